"""What can be done with the solution that is selected: only this is offered."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from saltus.continuation.core.point_types import CHANGES
from saltus.explorer.solutions import traits_of
from saltus.explorer.steps import Place, taken

if TYPE_CHECKING:
    from saltus.system import HybridSystem

__all__ = ["Choices", "choices_at"]

# What is followed after a change of branch at a special point, by what the branch is of and by the point's type.
_SWITCHED: Mapping[str, Mapping[str, str]] = {
    "orbit": {"PD": "orbit", "BP": "orbit", **dict.fromkeys(CHANGES, "orbit"), "HB": "equilibrium"},
    "equilibrium": {"HB": "orbit", "BP": "equilibrium"},
    "map_orbit": {"PD": "map_orbit", "BP": "map_orbit"},
}
# Types of which a locus can be followed.
_FOLLOWED: Mapping[str, tuple[str, ...]] = {
    "orbit": ("SN", "PD", "TR", "BP", *CHANGES),
    "equilibrium": ("SN", "HB", "BE"),
    "map_orbit": ("SN", "PD", "TR", "BC"),
}


class Choices(NamedTuple):
    """What a selected solution allows."""

    what: str = ""  # ``"orbit"``, ``"equilibrium"`` or ``"map_orbit"``; empty where nothing is selected
    resume: bool = False  # whether a branch can be followed through it
    # what is followed after a change of branch, likewise; empty where there is none
    switch: str = ""
    # follow, cascade, film: whether its locus, its cascade can be followed, whether it can be filmed
    follow: bool = False
    cascade: bool = False
    film: bool = False


def choices_at(place: Place | None, results: Mapping[str, Any], films: Callable[[HybridSystem], bool]) -> Choices:
    """Return what the solution at a place allows.

    Parameters
    ----------
    place : Place or None
        The place.
    results : mapping of str to Result
        The results by name.
    films : callable
        Returns whether orbits of a system can be filmed.

    Examples
    --------
    >>> choices_at(None, {}, bool)
    Choices(what='', resume=False, switch='', follow=False, cascade=False, film=False)
    """
    if place is None or place.of not in results:
        return Choices()
    result, solution = results[place.of], taken(place, results)
    what = traits_of(solution).what
    if not what:
        return Choices()
    film = what == "orbit" and films(solution.system)
    if place.label is None or len(result.varied) > 1:
        return Choices(what, resume=True, film=film)
    kind = result[place.label].itself.type
    switch, follow = _SWITCHED[what].get(kind, ""), kind in _FOLLOWED[what]
    return Choices(what, kind not in CHANGES, switch, follow, traits_of(solution).circle and kind == "PD", film)
