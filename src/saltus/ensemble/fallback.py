"""One motion by the event-driven flow until its fate is certain: for motions that lanes cannot follow."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.ensemble.labels import DIVERGED, UNDECIDED
from saltus.errors import DivergenceError, SaltusError, StickingError
from saltus.flow.motion import EventDrivenMotion, start_state
from saltus.flow.poincare import iterate
from saltus.flow.starting import starting_mode
from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.ensemble.traps import Traps
    from saltus.system.hybrid import HybridSystem

__all__ = ["Effort", "follow_alone"]

_TOLERANCE = 1e-11  # of a step, relative and absolute
_MOST_EVENTS = 100_000  # events in a period after which a motion is looked at as it is


@dataclass
class Effort:
    """Steps that motions of systems without a phase have taken, all of them together, and how many they may take."""

    steps: int = 0
    most: float = math.inf


def follow_alone(
    system: HybridSystem,
    parameters: Mapping[str, float],
    x: NDArray[np.float64],
    mode: int,
    traps: Traps,
    longest: int,
    period: float,
    effort: Effort,
) -> tuple[int, int, NDArray[np.float64], int]:
    """Return the label of a motion, the periods after which it was known, and its state and mode then.

    A motion that may not start, whose events accumulate, or that takes too many steps, stays undecided, at a state of
    NaN.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters that differ from the system's defaults.
    x : ndarray, shape (n,)
        Start at phase 0.
    mode : int
        Index of the mode there; negative for the first that the state allows.
    longest : int
        Periods after which a motion is undecided.
    period : float
        Time between two looks.
    effort : Effort
        Steps of a motion without a phase are added to it.

    Raises
    ------
    StiffnessError
        More steps than all motions may take.
    StickingError
        The motion is held where the field jumps; its fate is not defined.
    """
    strobe, seen = 0, 0
    p = system.parameter_vector(parameters)
    limit = traps.limit if traps.limit < math.inf else None
    try:
        x = wrapped(x, system.angle_places)
        if mode < 0:
            mode = starting_mode(system, system.full_state(x), p)
        label = traps.of(x, mode)
        while label == UNDECIDED and strobe < longest:
            x, mode = _after_period(system, parameters, x, mode, period, limit, effort)
            x, strobe = wrapped(x, system.angle_places), strobe + 1
            label = traps.of(x, mode)
            if label == UNDECIDED and traps.cells is not None:
                from saltus.ensemble.kernels.lanes import after_visit  # with Numba, which takes its time

                seen, label = after_visit(seen, traps.box_of(x), traps.cells.visits)
    except StickingError:
        raise
    except DivergenceError:
        return DIVERGED, strobe, np.full(x.size, np.inf), max(mode, 0)
    except SaltusError:
        if effort.steps >= effort.most:
            raise
        return UNDECIDED, strobe, np.full(x.size, np.nan), max(mode, 0)
    return label, strobe, x, mode


def _after_period(
    system: HybridSystem,
    parameters: Mapping[str, float],
    x: NDArray[np.float64],
    mode: int,
    period: float,
    limit: float | None,
    effort: Effort,
) -> tuple[NDArray[np.float64], int]:
    if system.phase is not None:
        p, full = system.parameter_vector(parameters), system.full_state(x)
        found = iterate(system, p, full, mode, discard=0, keep=1, tolerance=(_TOLERANCE, _TOLERANCE), limit=limit)
        return found.states[0, : x.size], int(found.modes[0])
    p = system.parameter_vector(parameters)
    left = None if effort.most == math.inf else int(effort.most - effort.steps)
    run = EventDrivenMotion(
        system, p, start_state(system, x), mode, _TOLERANCE, _TOLERANCE, limit=limit, most_steps=left
    )
    try:
        run.follow(period, None, _MOST_EVENTS, keep=False)
    finally:
        effort.steps += run.tries
    if effort.steps >= effort.most:
        raise run.too_stiff()
    return np.array(run.x), run.mode
