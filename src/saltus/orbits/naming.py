"""What a motion is on which no periodic orbit was found: its kind, judged by its returns and its leading exponent."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import DefinitionError, StiffnessError
from saltus.flow.motion import EventDrivenMotion, start_state
from saltus.flow.motion_kind import CHAOTIC, QUASI_PERIODIC, STRANGE, UNRESOLVED, Kind, classify
from saltus.flow.recurring.criteria import Criteria
from saltus.flow.sizes import RTOL, units_along
from saltus.flow.variational import Average, frame_tolerance, growth_along
from saltus.orbits.settling import follow
from saltus.system.angles import on_circles, wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.flow.variational import Growth
    from saltus.orbits.settling import Stretch
    from saltus.system import HybridSystem

__all__ = ["UNSETTLED", "Unsettled", "kind_in_words", "plane_returns"]

UNSETTLED = "the motion is quasi-periodic or chaotic, or its period is above {longest}, or it settles slowly"

_BATCH = 512  # returns between two clearances of what is kept
_LOOKS = 4  # looks, each `Criteria.patience` times as long as the one before
_ENOUGH = 16  # returns from which on they tell whether a motion recurs
_FEWEST = 2  # returns from which on growth has an error
_SLOWER = 4.0  # steps of a return over the mean of those before, up to which so many returns are followed
_APART = 0.25  # share of the returns of a look in which a perturbation turns into the direction that grows


@dataclass(frozen=True)
class Unsettled:
    """A motion on which no orbit was found, and what its search knows of it."""

    system: HybridSystem
    p: NDArray[np.float64]
    x: NDArray[np.float64]  # shape (all states,): where it is
    mode: int  # index of the mode there
    atol: float  # absolute tolerance of its steps
    sizes: NDArray[np.float64]  # shape (all states,): of the states
    time: float  # between returns, in the mean
    returns: float  # that may be followed to judge it
    longest: int  # returns of the longest orbit that was looked for
    steps: float  # of a return, in the mean
    limit: float  # size beyond which a state has diverged
    transition: int = -1  # index of the transition that is the return; -1 for the phase, or a plane across the motion

    @property
    def unit(self) -> str:
        """The return's name."""
        return "period" if self.system.phase is not None else "return"


def kind_in_words(motion: Unsettled, *, slow: bool = True) -> str:
    """Return what a motion is, with its leading Lyapunov exponent; empty where it cannot be told.

    It is judged as in a sweep, by `classify`, and looked at longer where the exponent's error leaves it open. One that
    settles slowly is told where `slow` asks for it.

    Raises
    ------
    ChatteringError, DivergenceError
        As the motion goes on.
    """
    criteria, left, words = Criteria(), motion.returns, ""
    cost = 2.0 + _APART  # returns of a look, and their growth, over the returns of its points
    count = max(criteria.fewest, int(left / (cost * (1 + criteria.patience))))
    if cost * count > left:
        count = int(left / cost)
    for _ in range(_LOOKS):
        if cost * count > left or count < _FEWEST:
            break
        left -= cost * count
        try:
            points, x, mode = _points(motion, count)
            growth = _growth(motion, x, mode, count) if len(points) >= _FEWEST else None
        except StiffnessError:  # steps have become shorter: so many returns are more work than allowed
            break
        except DefinitionError as refusal:  # at a jump of the field perturbations do not grow by a matrix
            return f"{UNSETTLED.format(longest=motion.longest)}; its exponents cannot tell: {refusal}"
        if growth is None:
            break
        exponent, error = _leading(motion, growth)
        kind = _kind(motion, points, exponent, error)
        if len(points) < criteria.fewest and kind.label != CHAOTIC:
            break
        words = _words(motion, kind, exponent, error, slow=slow)
        if kind.sure and words and not (kind.label == CHAOTIC and exponent - error < criteria.exponent):
            break
        motion = replace(motion, x=growth.x_end, mode=growth.mode_end)
        count *= criteria.patience
    return words


def plane_returns(
    system: HybridSystem, p: NDArray[np.float64], seen: Stretch, scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the times at which a motion without events comes back to the plane across it where it starts."""
    x = seen.states[0]
    slope = system.compiled.field(seen.mode, np.ascontiguousarray(x), p) / scale
    away = seen.states - x
    away[:, system.angle_places] = np.sin(away[:, system.angle_places])
    across = (away / scale) @ slope
    crossing = np.flatnonzero((across[:-1] < 0.0) & (across[1:] >= 0.0))
    share = -across[crossing] / (across[crossing + 1] - across[crossing])
    return np.asarray(seen.times[crossing] + share * (seen.times[crossing + 1] - seen.times[crossing]))


def _points(motion: Unsettled, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Return states at up to so many returns, shape (return, states), and state and mode at the end."""
    system = motion.system
    if system.phase is None and motion.transition < 0:
        tries = int(count * motion.steps)
        seen = follow(system, motion.p, motion.x, motion.mode, tries, 1, motion.atol, motion.limit, sampled=True)
        times = plane_returns(system, motion.p, seen, motion.sizes)
        return seen.at(times), wrapped(seen.log.x_end, system.angle_places), seen.log.mode_end
    run = EventDrivenMotion(
        system, motion.p, start_state(system, motion.x), motion.mode, RTOL, motion.atol,
        most_steps=int(_SLOWER * count * motion.steps), limit=motion.limit,
    )  # fmt: skip
    run.offset = 0.0  # periods are counted at the wraps
    found = [np.empty((0, len(system.states)))]
    seen_so_far = 0
    while seen_so_far < count:
        batch = min(_BATCH, count - seen_so_far)
        if system.phase is not None:
            run.follow(math.inf, run.wraps + batch, None)
        else:
            run.follow(math.inf, None, run.events_passed + batch)
        _, which, ends, _ = run.events()
        run.kept_events.clear()
        run.kept_steps.clear()
        found.append(ends[which[:, 0] == motion.transition, 0, : len(system.states)])
        seen_so_far += len(found[-1])
    return np.concatenate(found), wrapped(run.x, system.angle_places), run.mode


def _growth(motion: Unsettled, x: NDArray[np.float64], mode: int, count: int) -> Growth:
    """Return the growth of the perturbation that grows most, over so many returns."""
    average = Average(t_end=count * motion.time, discard=_APART * count * motion.time)
    return growth_along(
        motion.system, motion.p, x, mode,
        average=average, exponents=1, tolerance=(RTOL, motion.atol), limit=motion.limit,
    )  # fmt: skip


def _leading(motion: Unsettled, growth: Growth) -> tuple[float, float]:
    """Return the leading exponent per return, and its error."""
    exponent, error = float(growth.exponents[0]), float(growth.errors[0])
    return exponent * motion.time, error * motion.time + frame_tolerance(RTOL)


def _kind(motion: Unsettled, points: NDArray[np.float64], exponent: float, error: float) -> Kind:
    """Return the kind that `classify` finds of states in their sizes.

    Of fewer points than it takes, chaos where the exponent shows it.
    """
    criteria, count = Criteria(), len(points)
    if count < _ENOUGH:
        grows = exponent > max(error, math.log(count) / count)  # what grows like time has no exponent
        return Kind(CHAOTIC if grows else UNRESOLVED, 0, math.nan, 0)
    rounding = criteria.noise * (motion.atol + RTOL * motion.sizes[: points.shape[1]])
    units = units_along(points, motion.sizes[: points.shape[1]], rounding, motion.system.angle_places)
    states, rounding = on_circles(points / units, rounding / units, motion.system.angle_places)
    return classify(states, exponent, error, criteria, rounding, autonomous=motion.system.phase is None)


def _words(motion: Unsettled, kind: Kind, exponent: float, error: float, *, slow: bool) -> str:
    """Return a kind in words; empty where it is none."""
    grows = f"its leading Lyapunov exponent is {exponent:.3g} +- {error:.1g} a {motion.unit}"
    if kind.label in (CHAOTIC, STRANGE):
        return f"the motion is {kind.label}: {grows}"
    if kind.label == QUASI_PERIODIC:
        turns = "" if math.isnan(kind.rotation) else f", and it winds by {kind.rotation:.6g} turns"
        return f"the motion is quasi-periodic: {grows}{turns}"
    if not kind.period or (not slow and kind.period <= motion.longest):
        return ""
    if kind.period > motion.longest:
        return f"the motion recurs after {kind.period} {motion.unit}s, and orbits of up to {motion.longest} are sought"
    return f"the motion settles slowly, on an orbit of {kind.period} {motion.unit}(s): settle= allows more of them"
