"""A motion that is shown where no orbit was found: one that is chaotic, say."""

from __future__ import annotations

from typing import TYPE_CHECKING

from saltus.explorer.steps import FindOrbit, Move

if TYPE_CHECKING:
    from saltus.explorer.steps import Step
    from saltus.system import HybridSystem

__all__ = ["motion_instead"]

_WORDS = "periodic attractor"  # what was not found, in the words of the error
_PERIODS = 200  # forcing periods that are shown
_SPAN = 200.0  # units of time that are shown, of a system without a phase


def motion_instead(step: Step | None, error: str, system: HybridSystem) -> Move | None:
    """Return a step that shows the motion from the start of a search that found no periodic attractor.

    Parameters
    ----------
    step : Step or None
        The step that failed.
    error : str
        What it said.
    system : HybridSystem
        The system.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> still = HybridSystem.smooth({"x": "v", "v": "-x"})
    >>> motion_instead(FindOrbit(x0=(1.0, 0.0)), "no periodic attractor", still).text()
    'saltus.simulate(system, {}, [1.0, 0.0], t_end=200.0)'
    """
    if not isinstance(step, FindOrbit) or _WORDS not in error:
        return None
    periods, t_end = (None, _SPAN) if system.phase is None else (_PERIODS, None)
    return Move(parameters=step.parameters, x0=step.x0, mode=step.mode, periods=periods, t_end=t_end)
