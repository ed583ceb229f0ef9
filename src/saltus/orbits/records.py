"""Records of arrays that the compiled functions of an orbit take.

Python hands them over as plain tuples in the order of these fields, which Numba converts several times faster than
named tuples; the compiled functions name the fields again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.orbits.signature import BOUNDARY, SECTION, STOP
from saltus.system.once import once
from saltus.system.own_states import absent_states
from saltus.system.parts import at_phases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem, Transition

__all__ = [
    "Dense",
    "Events",
    "Found",
    "Mesh",
    "Observed",
    "Orbit",
    "Phase",
    "Seen",
    "changes_nothing",
    "events_of",
    "room_for",
]

# What Newton's method tells: converged, or meshes are to be moved before it goes on, or why there is no point.
CONVERGED = 0
MOVE = 1
SINGULAR = 2  # the equations have no one solution
ENDLESS = 3  # the step is far too long: the flow cannot be followed
APART = 4  # steps do not shrink
LATE = 5  # too many iterations


class Orbit(NamedTuple):
    """The equations of an orbit of one signature."""

    functions: NDArray[np.int64]  # addresses of the generated functions
    n: int  # components of the full state
    p: NDArray[np.float64]  # parameters, with the constants of `functions` behind them
    # modes, transitions, kinds: shape (segments,): the signature; transition -1 for none
    modes: NDArray[np.int64]
    transitions: NDArray[np.int64]
    kinds: NDArray[np.int64]
    turns: int  # forcing periods in one period
    turn: float  # angle of the phase in one of them
    rooted: NDArray[np.int64]  # shape (modes,): 1 where a mode's field has roots that vanish on a surface, else 0
    active: NDArray[np.int64]  # parameters among the unknowns
    scales: NDArray[np.float64]  # shape (active,): their units
    angles: NDArray[np.int64]  # states on a circle, in which equations hold modulo 2 pi
    laws: NDArray[np.float64]  # shape (term, 3 + parameters): see `saltus.system.integrals.kept.KeptTotals.terms`
    totals: NDArray[np.float64]  # shape (law, 2): see `saltus.system.integrals.kept.KeptTotals.wanted`
    # shape (4,): addresses of `flow`, `dense`, `vary` and `check` of `saltus.flow.kernels.implicit_segment`, 0 for
    # explicit steps
    implicit: NDArray[np.int64]


class Mesh(NamedTuple):
    """The segments' meshes, one after the other."""

    places: NDArray[np.float64]  # shape (node,): clustered times, from 0 to 1 in each segment
    starts: NDArray[np.int64]  # shape (segments + 1,): where each segment's begin; the number of all at the end


class Phase(NamedTuple):
    """The phase conditions: where on an orbit its segments start."""

    # shape (2 n,): point and normal of the plane on which a closed curve starts; (2 n segments,) where further pieces
    # start on planes of their own
    anchor: NDArray[np.float64]
    shares: NDArray[np.float64]  # shape (segments,): each segment's part of the period, kept at cuts without a plane


class Dense(NamedTuple):
    """Dense output on the meshes, flat."""

    nodes: NDArray[np.float64]  # shape (node * n,): states
    coefficients: NDArray[np.float64]  # shape (node * 7 n,): coefficients of the interpolants


class Events(NamedTuple):
    """The events of the system, as a survey needs them."""

    # sources, directions, surfaces: shape (transitions,): mode, direction and kind (BOUNDARY, STOP or SECTION) of each
    # transition
    sources: NDArray[np.int64]
    directions: NDArray[np.int64]
    surfaces: NDArray[np.int64]
    alike: NDArray[np.int64]  # shape (transitions,): the first transition with the same event function
    idle: NDArray[np.int64]  # shape (transitions,): 1 where motions are the same with a transition and without it
    absent: NDArray[np.int64]  # shape (modes * n,): 1 where a mode lacks a state
    # modes, outputs: counts of modes and of outputs
    modes: int
    outputs: int
    phase: bool  # whether the system has a phase


class Found(NamedTuple):
    """The results of a survey."""

    # lows, highs: shape (n + outputs,): extremes of every state and output
    lows: NDArray[np.float64]
    highs: NDArray[np.float64]
    # margins, places: shape (segments, transitions): the least interior local minimum of each event function in its
    # firing direction (inf where there is none), and where in clustered time; its value at the segment's start and
    # WHOLE where it is level
    margins: NDArray[np.float64]
    places: NDArray[np.float64]
    # shape (segments, 4): Lie derivative of each segment's event at its end and at its start; how far the segment's end
    # is from the next one's start, or from its event
    rates: NDArray[np.float64]
    # shape (segments, transitions): how far each segment's end is from the surface of each event that comes nearer
    # there, if its condition holds; NaN for others, and for those in either direction
    distances: NDArray[np.float64]
    # shape (segments, transitions): how far beyond the surface of each event each segment starts from which it goes on
    # there, if its condition holds; NaN for others
    behind: NDArray[np.float64]
    # shape (segments, transitions): how far from holding the condition of each transition is where the segment meets
    # its surface all the same, and not as its end; NaN where it does not meet it. How often it does so
    unmet: NDArray[np.float64]
    counts: NDArray[np.int64]
    x0: NDArray[np.float64]  # shape (n,): state at phase 0
    # shape (n + outputs, 3): means of every state and output, and of their products with cosine and sine of the angle
    moments: NDArray[np.float64]


class Observed(NamedTuple):
    """Quantities of an orbit, for their derivatives: a state is its index, an expression the one behind all states."""

    # readings, expressions, parameters: address of the generated expressions with their gradients, 0 for none; how many
    # these are; all parameters
    readings: int
    expressions: int
    parameters: int
    constants: NDArray[np.float64]  # parameters with the constants of `readings` behind them
    # cornered, phase: whether expressions may have corners; whether the last state is the phase, which is the angle of
    # harmonics
    cornered: bool
    phase: bool
    first: bool  # whether of places that are equally high the first one is the extreme, whatever its derivatives
    quantities: NDArray[np.int64]  # what is integrated over the period
    integrals: NDArray[np.int64]  # shape (integrals,): of each integral an index in `quantities`
    orders: NDArray[np.float64]  # shape (integrals,): orders of harmonics, 0 for a mean
    extremes: NDArray[np.int64]  # shape (extremes,): what has its extreme sought
    signs: NDArray[np.float64]  # shape (extremes,): 1 for a maximum, -1 for a minimum
    # places, weights: shape (nodes,): quadrature in a step, over [0, 1]
    places: NDArray[np.float64]
    weights: NDArray[np.float64]
    scale: NDArray[np.float64]  # shape (n,): typical sizes of the states


class Seen(NamedTuple):
    """What is found of these quantities."""

    # shape (integrals, 3, 1 + parameters): integrals of a quantity q times cos and -sin of order times angle, with
    # their derivatives; the integral of ``abs(q)`` and of the moduli of its derivatives
    sums: NDArray[np.float64]
    # values, rates: shape (extremes, samples): quantities times their signs, and their rates, at the places of all
    # steps
    values: NDArray[np.float64]
    rates: NDArray[np.float64]
    sizes: NDArray[np.float64]  # shape (extremes, parameters): largest derivative along the orbit
    noise: NDArray[np.float64]  # shape (extremes,): errors of these quantities
    extremes: NDArray[np.float64]  # shape (extremes, 1 + parameters): extremes with their derivatives
    # shape (extremes,): 0, or why derivatives are missing: the extreme is attained at two places, or at a jump
    kinds: NDArray[np.int64]
    segments: NDArray[np.int64]  # shape (extremes,): the segment in which each extreme is
    bent: NDArray[np.int64]  # shape (expressions,): 1 where an expression has a corner or jumps within a segment


@once
def events_of(system: HybridSystem) -> Events:
    """Return the events of a system, as a survey needs them."""
    return Events(
        sources=np.array([system.mode_index(t.source) for t in system.transitions], dtype=np.int64),
        directions=np.array([t.direction for t in system.transitions], dtype=np.int64),
        surfaces=np.array([_surface(system, t) for t in system.transitions], dtype=np.int64),
        alike=_alike([transition.event for transition in system.transitions]),
        idle=np.array([_is_idle(transition) for transition in system.transitions], dtype=np.int64),
        absent=_absent(system),
        modes=len(system.modes),
        outputs=system.compiled.n_outputs,
        phase=system.phase is not None,
    )


def _absent(system: HybridSystem) -> NDArray[np.int64]:
    """Return 1 where a mode lacks a component of the full state, shape (modes * n,)."""
    found = np.zeros((len(system.modes), system.compiled.n), dtype=np.int64)
    for mode, row in enumerate(found):
        row[absent_states(system, mode)] = 1
    return found.ravel()


def _alike(texts: list[str]) -> NDArray[np.int64]:
    """Return the index of the first text that each text is equal to."""
    return np.array([texts.index(text) for text in texts], dtype=np.int64)


def _surface(system: HybridSystem, transition: Transition) -> int:
    """Return what the event of a transition does to motions that meet its surface."""
    if at_phases(system, transition):
        return SECTION
    if transition.target != transition.source:
        return BOUNDARY
    return STOP if _moves(transition) else SECTION


def _is_idle(transition: Transition) -> bool:
    """Return whether a transition changes nothing, or sums up what happens without it as well."""
    return transition.sums or changes_nothing(transition)


def changes_nothing(transition: Transition) -> bool:
    """Return whether a transition leads back to its mode without a reset: motions pass freely."""
    return transition.target == transition.source and not _moves(transition)


def _moves(transition: Transition) -> bool:
    """Return whether the reset of a transition changes a state."""
    return any(value != state for state, value in transition.reset.items())


def room_for(n: int, quantities: int, segments: int, transitions: int) -> tuple[Any, ...]:
    """Return the fields of `Found`, for a survey of that many states, quantities, segments and transitions."""
    shape = segments, transitions
    margins, places, distances, behind, unmet = (np.empty(shape) for _ in range(5))
    counts = np.empty(shape, dtype=np.int64)
    lows, highs = np.empty(quantities), np.empty(quantities)
    rates, moments = np.zeros((segments, 4)), np.empty((quantities, 3))
    return lows, highs, margins, places, rates, distances, behind, unmet, counts, np.empty(n), moments
