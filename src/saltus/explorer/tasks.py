"""What the companion process does for a page: it takes steps."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from saltus.continuation.results.point_normal_forms import NoNormalForm
from saltus.errors import SaltusError
from saltus.explorer.solutions import quantity_of
from saltus.explorer.steps import step_from
from saltus.explorer.subjects import system_of
from saltus.solution import Solution
from saltus.work import uncollected

if TYPE_CHECKING:
    from saltus.progress import Progress, Report
    from saltus.result import Result

__all__ = ["Outcome", "expect_results", "normal_forms", "prepare", "take", "warm"]


_SHARE = 0.2  # of a parameter, by which a branch is followed ahead of time
_POINTS = 20  # of it, at most
_PACE = 0.1  # seconds between two solutions whose place is told, at least


_FOUND: dict[str, Any] = {}  # in the process that works: the solution that was found last


class Outcome(NamedTuple):
    """What came of a step."""

    result: Result
    seconds: float  # how long it took
    notes: tuple[str, ...]  # warnings that came meanwhile


def prepare() -> None:
    """Import what a first orbit needs, before it is looked for."""
    import scipy.linalg  # noqa: F401

    import saltus.flow.radau
    import saltus.orbits.find
    import saltus.orbits.kernels.pencil
    import saltus.orbits.kernels.survey
    import saltus.orbits.kernels.together  # noqa: F401

    expect_results()


def expect_results() -> None:
    """Import what a result needs on its way from one process to another, and to be drawn there."""
    with uncollected():
        import xarray

        import saltus.orbits.kernels.curve  # noqa: F401

        xarray.Dataset({"none": ("none", [])})  # the first one imports other packages


def take(
    definition: str,
    plain: Mapping[str, Any],
    results: Mapping[str, Any],
    axes: tuple[str, ...],
    progress: Callable[[Progress], object],
) -> Outcome:
    """Return what comes of a step.

    Parameters
    ----------
    definition : str
        The system's definition as JSON.
    plain : mapping
        The step as plain data.
    results : mapping of str to Result
        The results that the step needs, by name.
    axes : tuple of str
        Quantities on the diagram's axes: progress tells the place of the last solution there.
    progress : callable
        Called with a `Progress`, whose `last` is a place on the axes or None.

    Raises
    ------
    SaltusError
        As the step's function does.
    """
    begun = time.perf_counter()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", RuntimeWarning)
        result = step_from(plain).run(system_of(definition), results, _Watch(axes, progress))
    if isinstance(result, Solution):
        _FOUND["solution"] = result
    notes = tuple(dict.fromkeys(str(warning.message) for warning in told if warning.category is RuntimeWarning))
    return Outcome(result, time.perf_counter() - begun, notes)


class _Watch:
    """Passes progress on, with the place of the last solution on the axes from time to time."""

    def __init__(self, axes: tuple[str, ...], progress: Callable[[Progress], object]) -> None:
        self._axes, self._progress, self._seen = axes, progress, 0.0

    def __call__(self, progress: Progress) -> None:
        place = None
        if callable(progress.last) and time.monotonic() - self._seen >= _PACE:
            self._seen = time.monotonic()
            with suppress(SaltusError):  # a quantity that this solution has not: the diagram says so when all is done
                solution = progress.last()
                place = tuple(quantity_of(solution, name) for name in self._axes)
        self._progress(replace(progress, last=place))


def warm(definition: str, x0: tuple[float, ...], progress: Report | bool) -> None:
    """Load the code of branches and basins for a system, so that the first ones come at once; nothing is kept.

    The last solution that was found in this process is followed a little.

    Parameters
    ----------
    definition : str
        The system's definition as JSON.
    x0 : tuple of float
        A state about which a few motions start.
    progress : callable or bool
        Not used.
    """
    system = system_of(definition)
    for load in (_load_branches, lambda: _load_basins(system, x0)):
        with warnings.catch_warnings(), suppress(SaltusError):  # whoever asks for branches or basins is told
            warnings.simplefilter("ignore")
            load()


def _load_branches() -> None:
    from saltus.continuation import StepControl, continue_branch

    if (first := _FOUND.get("solution")) is not None and first.parameters:
        name, value = next(iter(first.parameters.items()))
        wide = _SHARE * abs(value) or _SHARE
        continue_branch(first, name, (value - wide, value + wide), steps=StepControl(max_points=_POINTS))


def _load_basins(system: Any, x0: tuple[float, ...]) -> None:
    from saltus.basins import AttractorOptions, find_attractors, map_basins

    region = {name: (x - 0.1, x + 0.1) for name, x in zip(system.states, x0, strict=False)}
    first, *others = system.states
    grid: dict[str, Any] = {first: (*region[first], 8)} | {name: sum(region[name]) / 2.0 for name in others}
    map_basins(system, {}, grid, find_attractors(system, {}, region, options=AttractorOptions(starts=2, motions=8)))


def normal_forms(result: Any, progress: Report | bool) -> dict[str, str]:
    """Return the normal forms of the special points of a curve in words, by label; of types without one nothing.

    Parameters
    ----------
    result : Branch, Locus or another curve
        The curve.
    progress : callable or bool
        Not used.
    """
    found: dict[str, str] = {}
    for point in result.special_points:
        form = point.normal_form
        if not isinstance(form, NoNormalForm):
            found[point.label] = repr(form).partition(": ")[2]
        elif not form.expected:
            found[point.label] = f"none: {form.reason}"
    return found
