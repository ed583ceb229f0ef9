"""What can be done with the solution that is selected: only this is offered."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from saltus.continuation import Branch, EquilibriumBranch
from saltus.equilibria import Equilibrium
from saltus.explorer.steps import Place, taken
from saltus.orbits import PeriodicOrbit

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from saltus.system import HybridSystem

__all__ = ["Choices", "choices_at"]

_SWITCHED = {"orbits": ("PD", "BP", "GR", "HB"), "equilibria": ("HB", "BP")}
_FOLLOWED = {"orbits": ("SN", "PD", "TR", "BP", "GR"), "equilibria": ("SN", "HB", "BE")}


class Choices(NamedTuple):
    """What a selected solution allows.

    Attributes
    ----------
    what : str
        ``"orbit"`` or ``"equilibrium"``; empty where nothing is selected.
    resume : bool
        Whether a branch can be followed through it.
    switch : str
        What is followed after a change of branch, ``"orbit"`` or ``"equilibrium"``; empty where there is none.
    follow, cascade, film : bool
        Whether its locus, its cascade can be followed, whether it can be filmed.
    """

    what: str = ""
    resume: bool = False
    switch: str = ""
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
    if not isinstance(solution, PeriodicOrbit | Equilibrium):
        return Choices()
    of_orbits = isinstance(solution, PeriodicOrbit)
    what = "orbit" if of_orbits else "equilibrium"
    film = of_orbits and films(solution.system)
    if place.label is None or not isinstance(result, Branch | EquilibriumBranch):
        return Choices(what, resume=True, film=film)
    point, kind = result[place.label], "orbits" if of_orbits else "equilibria"
    switch = ""
    if point.type in _SWITCHED[kind]:
        switch = {"HB": "equilibrium" if of_orbits else "orbit"}.get(point.type, what)
    follow = point.type in _FOLLOWED[kind]
    return Choices(what, point.type != "GR", switch, follow, of_orbits and point.type == "PD", film)
