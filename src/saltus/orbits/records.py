"""Records of arrays that the compiled functions of an orbit take.

Python hands them over as plain tuples in the order of these fields, which Numba converts several times faster than
named tuples; the compiled functions name the fields again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.orbits.signature import BOUNDARY, SECTION, STOP

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem, Transition

__all__ = ["Dense", "Events", "Found", "Mesh", "Observed", "Orbit", "Phase", "Seen", "events_of"]


class Orbit(NamedTuple):
    """The equations of an orbit of one signature.

    Attributes
    ----------
    functions : ndarray of int64
        Addresses of the generated functions.
    n : int
        Components of the full state.
    p : ndarray
        Parameters, with the constants of `functions` behind them.
    modes, transitions, kinds : ndarray of int64, shape (segments,)
        The signature; transition -1 for none.
    turns : int
        Forcing periods in one period.
    rooted : ndarray of int64, shape (modes,)
        1 where a mode's field has roots that vanish on a surface, else 0.
    active : ndarray of int64
        Parameters among the unknowns.
    scales : ndarray, shape (active,)
        Their units.
    angles : ndarray of int64
        States on a circle, in which equations hold modulo 2 pi.
    """

    functions: NDArray[np.int64]
    n: int
    p: NDArray[np.float64]
    modes: NDArray[np.int64]
    transitions: NDArray[np.int64]
    kinds: NDArray[np.int64]
    turns: int
    rooted: NDArray[np.int64]
    active: NDArray[np.int64]
    scales: NDArray[np.float64]
    angles: NDArray[np.int64]


class Mesh(NamedTuple):
    """The segments' meshes, one after the other.

    Attributes
    ----------
    places : ndarray, shape (node,)
        Clustered times, from 0 to 1 in each segment.
    starts : ndarray of int64, shape (segments + 1,)
        Where each segment's begin; the number of all at the end.
    """

    places: NDArray[np.float64]
    starts: NDArray[np.int64]


class Phase(NamedTuple):
    """The phase conditions: where on an orbit its segments start.

    Attributes
    ----------
    anchor : ndarray, shape (2 n,)
        Point and normal of the plane on which a closed curve starts.
    shares : ndarray, shape (segments,)
        Each segment's part of the period, kept at cuts.
    """

    anchor: NDArray[np.float64]
    shares: NDArray[np.float64]


class Dense(NamedTuple):
    """Dense output on the meshes, flat.

    Attributes
    ----------
    nodes : ndarray, shape (node * n,)
        States.
    coefficients : ndarray, shape (node * 7 n,)
        Coefficients of the interpolants.
    """

    nodes: NDArray[np.float64]
    coefficients: NDArray[np.float64]


class Events(NamedTuple):
    """The events of the system, as a survey needs them.

    Attributes
    ----------
    sources, directions, surfaces : ndarray of int64, shape (transitions,)
        Mode, direction and kind (BOUNDARY, STOP or SECTION) of each transition.
    modes, outputs : int
        Counts of modes and of outputs.
    phase : bool
        Whether the system has a phase.
    """

    sources: NDArray[np.int64]
    directions: NDArray[np.int64]
    surfaces: NDArray[np.int64]
    modes: int
    outputs: int
    phase: bool


class Found(NamedTuple):
    """The results of a survey.

    Attributes
    ----------
    lows, highs : ndarray, shape (n + outputs,)
        Extremes of every state and output.
    margins, places : ndarray, shape (segments, transitions)
        The least interior local minimum of each event function in its firing direction (inf where there is none), and
        where in clustered time; its value at the segment's start and WHOLE where it is level.
    rates : ndarray, shape (segments, 3)
        Lie derivative of each segment's event at its end and at its start; how far the segment's end is from the next
        one's start, or from its event.
    x0 : ndarray, shape (n,)
        State at phase 0.
    moments : ndarray, shape (n + outputs, 3)
        Means of every state and output, and of their products with cosine and sine of the angle.
    """

    lows: NDArray[np.float64]
    highs: NDArray[np.float64]
    margins: NDArray[np.float64]
    places: NDArray[np.float64]
    rates: NDArray[np.float64]
    x0: NDArray[np.float64]
    moments: NDArray[np.float64]


class Observed(NamedTuple):
    """Quantities of an orbit, for their derivatives: a state is its index, an expression the one behind all states.

    Attributes
    ----------
    readings, expressions, parameters : int
        Address of the generated expressions with their gradients, 0 for none; how many these are; all parameters.
    constants : ndarray
        Parameters with the constants of `readings` behind them.
    cornered, phase : bool
        Whether expressions may have corners; whether the last state is the phase, which is the angle of harmonics.
    quantities : ndarray of int64
        What is integrated over the period.
    integrals : ndarray of int64, shape (integrals,)
        Of each integral an index in `quantities`.
    orders : ndarray, shape (integrals,)
        Orders of harmonics, 0 for a mean.
    extremes : ndarray of int64, shape (extremes,)
        What has its extreme sought.
    signs : ndarray, shape (extremes,)
        1 for a maximum, -1 for a minimum.
    places, weights : ndarray, shape (nodes,)
        Quadrature in a step, over [0, 1].
    scale : ndarray, shape (n,)
        Typical sizes of the states.
    """

    readings: int
    expressions: int
    parameters: int
    constants: NDArray[np.float64]
    cornered: bool
    phase: bool
    quantities: NDArray[np.int64]
    integrals: NDArray[np.int64]
    orders: NDArray[np.float64]
    extremes: NDArray[np.int64]
    signs: NDArray[np.float64]
    places: NDArray[np.float64]
    weights: NDArray[np.float64]
    scale: NDArray[np.float64]


class Seen(NamedTuple):
    """What is found of these quantities.

    Attributes
    ----------
    sums : ndarray, shape (integrals, 3, 1 + parameters)
        Integrals of a quantity q times cos and -sin of order times angle, with their derivatives; the integral of
        ``abs(q)``.
    values, rates : ndarray, shape (extremes, samples)
        Quantities times their signs, and their rates, at the places of all steps.
    sizes : ndarray, shape (extremes, parameters)
        Largest derivative along the orbit.
    noise : ndarray, shape (extremes,)
        Errors of these quantities.
    extremes : ndarray, shape (extremes, 1 + parameters)
        Extremes with their derivatives.
    kinds : ndarray of int64, shape (extremes,)
        0, or why derivatives are missing: the extreme is attained at two places, or at a jump.
    bent : ndarray of int64, shape (expressions,)
        1 where an expression has a corner or jumps within a segment.
    """

    sums: NDArray[np.float64]
    values: NDArray[np.float64]
    rates: NDArray[np.float64]
    sizes: NDArray[np.float64]
    noise: NDArray[np.float64]
    extremes: NDArray[np.float64]
    kinds: NDArray[np.int64]
    bent: NDArray[np.int64]


def events_of(system: HybridSystem) -> Events:
    """Return the events of a system, as a survey needs them."""
    return Events(
        sources=np.array([system.mode_index(t.source) for t in system.transitions], dtype=np.int64),
        directions=np.array([t.direction for t in system.transitions], dtype=np.int64),
        surfaces=np.array([_surface(t) for t in system.transitions], dtype=np.int64),
        modes=len(system.modes),
        outputs=system.compiled.n_outputs,
        phase=system.phase is not None,
    )


def _surface(transition: Transition) -> int:
    """Return what the event of a transition does to motions that meet its surface."""
    if transition.target != transition.source:
        return BOUNDARY
    return STOP if any(value != state for state, value in transition.reset.items()) else SECTION
