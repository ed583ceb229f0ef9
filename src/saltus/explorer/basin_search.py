"""Basins over a plane, in turn: attractors about it, few cells for a first picture, then as many as are asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from saltus.explorer.steps import Attract, Basin

if TYPE_CHECKING:
    from saltus.explorer.desk import Desk
    from saltus.explorer.session import Entry
    from saltus.explorer.steps import Step

__all__ = ["Search", "map_plane"]

_STARTS = 64  # motions in the search for attractors
_MOTIONS = 1000  # motions for which trapping regions are made: few, so that the first picture comes soon


@dataclass(frozen=True)
class Search:
    """Where attractors are looked for."""

    parameters: Mapping[str, float]  # values of parameters
    region: Mapping[str, tuple[float, float]]  # a box of all states
    interval: float | None = None  # time between two looks at a motion of a system without a phase


def map_plane(
    desk: Desk,
    search: Search,
    free: Mapping[str, tuple[float, float]],
    frozen: Mapping[str, float],
    counts: tuple[int, int],
) -> None:
    """Map a plane; attractors that were found in the same region are taken.

    Parameters
    ----------
    desk : Desk
        Who does it.
    search : Search
        Where attractors are looked for.
    free : mapping of str to (float, float)
        The two states of the plane with their ranges.
    frozen : mapping of str to float
        Values of the other states.
    counts : (int, int)
        Cells along a side of the first picture, and of the last.
    """
    own = desk.session.system.parameters
    parameters = {name: value for name, value in search.parameters.items() if value != own[name]}
    region = dict(search.region)

    def mapped(attractors: Entry, count: int, then: int | None, replaces: str = "") -> None:
        grid: dict[str, Any] = {name: (*ends, count) for name, ends in free.items()} | dict(frozen)
        step = Basin(parameters=parameters, grid=grid, attractors=attractors.name)

        def shown(entry: Entry) -> None:
            if then is not None:
                mapped(attractors, then, None, entry.name)

        desk.run(step, shown, replaces)

    def found(entry: Entry) -> None:
        mapped(entry, counts[0], counts[1])

    known = next((e for e in desk.session.entries if _same_search(e.step, parameters, region)), None)
    if known is not None:
        found(known)
        return
    step = Attract(parameters=parameters, region=region, starts=_STARTS, motions=_MOTIONS, interval=search.interval)
    desk.run(step, found)


def _same_search(step: Step, parameters: dict[str, float], region: dict[str, tuple[float, float]]) -> bool:
    return isinstance(step, Attract) and step.parameters == parameters and step.region == region
