"""Steps along a branch from one solution to the next, to the next special point, or to an end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from saltus.continuation.results.parameters import OneParameter
from saltus.explorer.steps import Place

__all__ = ["stepped"]


def stepped(place: Place | None, count: int, results: Mapping[str, Any], *, special: bool = False) -> Place | None:
    """Return the place to which steps along a branch lead; None where there is no branch.

    Parameters
    ----------
    place : Place or None
        Where the steps begin; from elsewhere than a branch they lead to the first point of the first one.
    count : int
        How many points, back where negative; beyond an end the end.
    results : mapping of str to Result
        The results that are drawn, by name.
    special : bool, optional
        Whether special points are counted instead of points.

    Examples
    --------
    >>> from saltus import HybridSystem, continue_equilibrium, find_equilibrium
    >>> found = find_equilibrium(HybridSystem.smooth({"x": "a - x"}, {"a": 1.0}), x0=[1.0])
    >>> branch = {"branch1": continue_equilibrium(found, "a", (0.0, 1.0))}
    >>> stepped(Place(of="branch1", index=0), 2, branch).index
    2
    """
    if place is None or not isinstance(results.get(place.of), OneParameter):
        first = next((name for name, result in results.items() if isinstance(result, OneParameter)), None)
        return None if first is None else Place(of=first, index=0)
    branch = results[place.of]
    at = _position(place, branch)
    if special:
        label = _nearest(at, count, branch.special_points)
        return place if label is None else Place(of=place.of, label=label)
    last = len(branch) - 1
    begun = math.floor(at) if count > 0 else math.ceil(at)
    return Place(of=place.of, index=min(max(begun + count, 0), last))


def _position(place: Place, branch: Any) -> float:
    """Return the place among the points of its branch, as `SpecialPoint.position`."""
    return float(place.index or 0) if place.label is None else float(branch[place.label].position)


def _nearest(at: float, count: int, points: Iterable[Any]) -> str | None:
    """Return the label of the special point `count` further on; None where there is none."""
    way = 1.0 if count > 0 else -1.0
    ahead = sorted((way * (point.position - at), point.label) for point in points)
    there = [label for distance, label in ahead if distance > 0.0]
    if not there:
        return None
    return str(there[min(abs(count), len(there)) - 1])
