"""Flags of a lane after a step, labels of motions that reach no attractor, and records of many motions."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "ADDRESSED",
    "AT_STROBE",
    "CHANGES",
    "DIVERGED",
    "DONE",
    "EVENT",
    "FALLING",
    "FIELDS",
    "GOES_ON",
    "GONE",
    "HARD",
    "HUGE",
    "LEFT_OVER",
    "MOST_STEPS",
    "NL",
    "NOT_DONE",
    "REFUSED",
    "STUCK",
    "UNDECIDED",
    "Boxes",
    "Found",
    "Lanes",
    "Motions",
    "Regions",
    "Returning",
    "Returns",
    "Scratch",
    "Section",
    "Settings",
]

# Flags of a lane after a step.
GOES_ON = 0.0  # nothing to do
AT_STROBE = 1.0  # at phase 0
STUCK = 2.0  # no step could be taken
CHANGES = 3.0  # goes on with another kind of step
EVENT = 4.0  # EVENT + j: event j of the lane's mode

# Instead of a pool.
HARD = -1  # steps without branches cannot follow the motion
GONE = -2  # the motion is beyond all bounds
DONE = -3  # the motion has its label

# Labels besides those of attractors.
LEFT_OVER = 252  # a hard motion that no other engine has followed yet
DIVERGED = 253  # grown beyond all bounds
REFUSED = 251  # a motion that lanes cannot begin
UNDECIDED = 254  # not settled in time
NOT_DONE = 255  # not followed yet

MOST_STEPS = 3000.0  # steps between two looks, beyond which a motion is hard
FALLING = 48  # looks up to which a motion's tolerance may grow: one that is slow after them no longer falls into a trap
HUGE = "1e300"  # text of a step's largest length where nothing limits it


NL = 320  # lanes for which a pool has room

# What a lane keeps behind its state, and at which place.
FIELDS = {
    "w": 0,  # square root of the event function, where the mode is regularised
    "t": 1,  # time since phase 0
    "cap": 2,  # longest next step
    "itol": 3,  # inverse tolerance
    "count": 4,  # steps since phase 0
    "flag": 5,  # flag of the last step
    "wait": 6,  # steps for which a step by the exact flow is not tried
}


ADDRESSED = (
    "begin",
    "move",
    "read",
    "turned",
)  # functions called by address, in this order; the step of each pool comes behind them


class Lanes(NamedTuple):
    """What the loop over lanes has of a system: its functions, modes of its pools, parameters, and other numbers.

    functions: addresses in the order of `ADDRESSED`, then of each pool's step. mode_of: (pools,). p: parameters and the
    constants behind them. q: numbers as `CompiledLanes.quantities` names them.
    """

    functions: NDArray[np.int64]
    mode_of: NDArray[np.int64]
    p: NDArray[np.float64]
    q: NDArray[np.float64]


class Motions(NamedTuple):
    """Where motions start: states at phase 0, shape (m, n), and modes, negative for the first that a state allows."""

    points: NDArray[np.float64]
    modes: NDArray[np.int64]


class Regions(NamedTuple):
    """Trapping regions as `saltus.ensemble.kernels.lanes.fate` reads them, and the places of the states on a circle."""

    cages: NDArray[np.float64]
    ellipsoids: NDArray[np.float64]
    labels: NDArray[np.int64]
    circles: NDArray[np.int64]


class Boxes(NamedTuple):
    """Boxes that attractors visit, as `saltus.ensemble.kernels.lanes.box_of` reads them."""

    origin: NDArray[np.float64]
    size: NDArray[np.float64]
    indices: NDArray[np.int64]
    labels: NDArray[np.int64]


class Settings(NamedTuple):
    """How motions are followed: tolerances as `loosened` reads them, what has diverged, periods, visits to boxes."""

    itol: float
    growth: float
    least_itol: float
    limit: float
    longest: int
    visits: int


class Found(NamedTuple):
    """What has become of motions: labels, periods until then, and the states and modes where they ended."""

    labels: NDArray[np.uint8]
    strobes: NDArray[np.int32]
    ends: NDArray[np.float64]
    end_modes: NDArray[np.int64]


class Scratch(NamedTuple):
    """What a loop over lanes works in: pools of lanes, their motions and counts, visits of motions, a state."""

    pools: NDArray[np.float64]
    who: NDArray[np.int64]
    counts: NDArray[np.int64]
    seen: NDArray[np.int64]
    x: NDArray[np.float64]


class Returning(NamedTuple):
    """Motions that return to a section, each with parameters of its own.

    points, modes: where they start. times: (m,), since phase 0. numbers: (m, own), what a lane has of its own.
    weights: (m, states), inverse units of what perturbs the states.
    """

    points: NDArray[np.float64]
    modes: NDArray[np.int64]
    times: NDArray[np.float64]
    numbers: NDArray[np.float64]
    weights: NDArray[np.float64]


class Section(NamedTuple):
    """Where motions return, and how often.

    transitions: (transitions,), 1 for those that are returns; at_look: whether each look is one. first: field of a
    lane with the first of its own numbers. period: place of the time between two looks among these. taken: field with
    the last transition, from 1. itol: inverse tolerance. skip, keep: returns that are dropped, then kept. patience:
    looks without a return after which a motion is left to others.
    """

    transitions: NDArray[np.int64]
    at_look: bool
    first: int
    period: int
    taken: int
    itol: float
    skip: int
    keep: int
    patience: int


class Returns(NamedTuple):
    """What has become of motions that return to a section.

    labels: (m,), NOT_DONE until all returns are kept, then 0; LEFT_OVER or REFUSED. seen: (m,), returns so far. gaps:
    (m,), the longest time between two. states: (m, keep, n), with phases (m, keep) as times since phase 0, times since
    the start, and modes. ends: (m, n), end_times since phase 0, and end_modes. logs: (m, keep, columns), logarithms of
    the growth of perturbations, which lie behind the state, before each return.
    """

    labels: NDArray[np.uint8]
    seen: NDArray[np.int64]
    gaps: NDArray[np.float64]
    states: NDArray[np.float64]
    phases: NDArray[np.float64]
    times: NDArray[np.float64]
    modes: NDArray[np.int64]
    ends: NDArray[np.float64]
    end_times: NDArray[np.float64]
    end_modes: NDArray[np.int64]
    logs: NDArray[np.float64]
