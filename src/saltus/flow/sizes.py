"""Sizes of the states along a motion, and the absolute tolerance of steps that fits them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import SaltusError, StiffnessError
from saltus.flow.motion import EventDrivenMotion, start_state
from saltus.flow.shares import shares_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = [
    "ATOL", "EPSILON", "MOST_KEPT", "RTOL", "SMALL", "STEPS_KEPT", "Sizes", "fitting_atol", "followed_in_size",
    "share_of", "sizes_along", "sizes_from", "sizes_on_the_way", "units_along", "units_of",
]  # fmt: skip

RTOL = 1e-10  # relative tolerance of a motion's steps
ATOL = 1e-12  # absolute tolerance of a motion's steps, for states of size 1 or more
SMALL = 1e-2  # size of a state, over the one an absolute tolerance is for, below which it needs a finer tolerance
STEPS_KEPT = 1024  # steps of dense output between two clearances of the buffer
MOST_KEPT = 200_000  # steps of dense output in all, some 60 bytes for each step and state
_LEAST = 1e-120  # size of a state up to which it is nothing: squares of rates over its tolerance would overflow
_TRIED = 3  # finer tolerances that are tried
_DEARER = 20  # steps that a finer tolerance may take, over those of the coarser one
_FEW = 10_000  # further steps that a finer tolerance may take
_LOOKED_AT = 2000  # steps along which states are looked at before a tolerance is chosen
EPSILON = 2.220446049250313e-16  # spacing of floats at 1
_PARTS = 8  # of a motion: that moduli of a state fall from each to the next by chance is one in 8!
_TOLD = 1e4  # least size of a state, over its rounding, at which differences of the state can be told


@dataclass(frozen=True)
class Sizes:
    """How large states are along a motion, each shape (all states,)."""

    of_states: NDArray[np.float64]  # largest sizes, where they are more than rounding
    # sizes against which differences of states are measured; none is so small that rounding matters
    of_gaps: NDArray[np.float64]
    shares: NDArray[np.float64]  # in an absolute tolerance: states without any are followed by their own sizes

    def at_least(self, floor: NDArray[np.float64]) -> Sizes:
        """Return the sizes, none below `floor`, shape (all states,)."""
        return Sizes(np.maximum(self.of_states, floor), np.maximum(self.of_gaps, floor), self.shares)

    @property
    def atol(self) -> float:
        """Absolute tolerance of the motion's steps."""
        return ATOL * share_of(self.of_states[self.shares >= 1.0])


def sizes_along(
    system: HybridSystem,
    p: NDArray[np.float64],
    x: NDArray[np.float64],
    mode: int,
    time: float,
    atol: float,
) -> Sizes:
    """Return how large states are along a motion for some time, or 200 000 steps if these end before."""
    run = EventDrivenMotion(system, p, start_state(system, x), mode, RTOL, atol, steps_kept=STEPS_KEPT)
    return sizes_on_the_way(run, time)


def sizes_on_the_way(run: EventDrivenMotion, time: float) -> Sizes:
    """Follow a motion that begins, for some time as `sizes_along` does, and return how large states are."""
    run.follow_for(MOST_KEPT, MOST_KEPT, t_end=time)
    return sizes_from(run.system, run.p[: len(run.system.parameters)], run.x, run.mode, run.steps()[2], run.time)


def sizes_from(
    system: HybridSystem,
    p: NDArray[np.float64],
    x: NDArray[np.float64],
    mode: int,
    states: NDArray[np.float64],
    time: float,
    mean: NDArray[np.float64] | None = None,
) -> Sizes:
    """Return how large states are, shape (m, all states), which a motion has passed in a time; it is at x now.

    mean: (all states,), their mean moduli over time where these are known. A state keeps the rounding of its rate no
    longer than it takes to decay by itself.
    """
    size = np.max(np.abs(states), axis=0)
    size[system.angle_places] = np.minimum(size[system.angle_places], math.pi)  # however often it turned
    top = max(float(size.max()), 1e-300)
    compiled = system.compiled
    J = compiled.linearised(mode, x, compiled.extended(p))[1]
    rates = np.where(np.isfinite(J), J, 0.0)
    kept = np.minimum(time, 1.0 / np.maximum(-np.diag(rates), 1e-300))
    usual = size if mean is None else np.minimum(size, 2.0 * mean)
    rounding = EPSILON * kept * (np.abs(rates) @ usual)
    size = np.maximum(size, rounding / ATOL)
    size[size == 0.0] = top
    return Sizes(size, np.maximum(size, _TOLD * rounding), shares_of(compiled, p))


def followed_in_size(
    begun: Callable[[float], EventDrivenMotion], follow: Callable[[EventDrivenMotion], None], *, whole: bool = False
) -> EventDrivenMotion:
    """Return a motion followed with an absolute tolerance that fits its states: again where one of them is far below 1.

    Parameters
    ----------
    begun : callable
        Returns a motion at its start, for an absolute tolerance, that keeps its steps.
    follow : callable
        Follows it.
    whole : bool, optional
        Whether states count that have no share of the absolute tolerance, as on an invariant face.

    Raises
    ------
    SaltusError
        What the motion raises with a tolerance that fits it.
    """
    run, error = _followed(begun(ATOL), follow)
    for _ in range(_TRIED):
        needed = _share_needed(run, whole=whole)
        if needed * ATOL >= SMALL * run.atol:
            break
        again = begun(needed * ATOL)
        again.most_steps = _DEARER * run.tries + _FEW
        finer, its_error = _followed(again, follow)
        if isinstance(its_error, StiffnessError):  # such a small state is rounding
            break
        run, error = finer, its_error
    if error is not None:
        raise error
    return run


def _followed(
    run: EventDrivenMotion, follow: Callable[[EventDrivenMotion], None]
) -> tuple[EventDrivenMotion, SaltusError | None]:
    try:
        follow(run)
    except SaltusError as error:
        return run, error
    return run, None


def _share_needed(run: EventDrivenMotion, *, whole: bool) -> float:
    """Size of the least state along a motion, or 1 where all are larger or none is known; see `followed_in_size`."""
    states = run.steps()[2] if run.kept_steps else np.empty((0, run.x.size))
    sizes, count = np.abs(states).max(axis=0, initial=0.0), len(run.system.states)
    counted = (run.shares[:count] >= 1.0) | whole
    if (sizes[:count][counted] >= SMALL).all() or not sizes[:count].max() > _LEAST:
        return 1.0
    p = run.p[: len(run.system.parameters)]
    return share_of(sizes_from(run.system, p, run.x, run.mode, states, run.time).of_states[:count][counted])


def share_of(sizes: NDArray[np.float64]) -> float:
    """Return the size of the least state that is more than nothing, 1 at most."""
    return float(np.min(sizes, initial=1.0, where=sizes > _LEAST))


def units_along(
    points: NDArray[np.float64], sizes: NDArray[np.float64], rounding: NDArray[np.float64], angles: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return `units_of` of a motion, (points, n): states that fade count by the size of those that go on.

    Beside angles alone, which have none, what fades counts as nothing: its unit is infinite.
    """
    fades = _fading(points)
    units = units_of(sizes, np.where(fades, np.inf, rounding), angles)
    straight = np.delete(np.arange(sizes.size), angles)
    if angles.size and fades[straight].all():
        units[straight] = np.inf
    return units


def _fading(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which states become smaller from each eighth of a motion to the next, shape (n,), from its (points, n).

    Such a state has no size of its own beside others, where these go on.
    """
    if len(points) < _PARTS:
        return np.zeros(points.shape[1], dtype=np.bool_)
    tops = np.array([np.abs(part).max(axis=0) for part in np.array_split(points, _PARTS)])
    return np.asarray(np.all((tops[1:] < tops[:-1]) | (tops[1:] == 0.0), axis=0))


def units_of(
    sizes: NDArray[np.float64], rounding: NDArray[np.float64], angles: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return units in which states are of the size 1, powers of 2; 1 for the states that are angles.

    Parameters
    ----------
    sizes, rounding : ndarray, shape (n,)
        How large states are, and differences of them that are none: a state below that has the largest unit.
    angles : ndarray
        Places of the angles.
    """
    straight = np.delete(np.arange(sizes.size), angles)
    own = np.where(sizes > rounding, sizes, np.max(sizes[straight], initial=0.0))
    units = np.ones(sizes.size)
    known = straight[own[straight] > _LEAST]
    units[known] = np.exp2(np.round(np.log2(own[known])))
    return units


def fitting_atol(
    system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, usual: float
) -> float:
    """Return the absolute tolerance that fits a motion: the usual one, unless a state is far below 1.

    It fits every state: whoever takes it for the error of them all, or steps that know no shares, may rely on it.

    Parameters
    ----------
    x : ndarray, shape (states,) or (all states,)
        Start, from which the motion is looked at for 2000 steps.
    usual : float
        Tolerance for states of size 1 or more.
    """

    def begun(atol: float) -> EventDrivenMotion:
        return EventDrivenMotion(system, p, start_state(system, x), mode, RTOL, atol, steps_kept=STEPS_KEPT)

    try:
        run = followed_in_size(begun, lambda run: run.follow_for(_LOOKED_AT, _LOOKED_AT), whole=True)
    except SaltusError:  # the motion itself will raise it
        return usual
    return usual * run.atol / ATOL
