"""Multipliers within a step of orbits: which become critical and come back, and in which order they pass 1 and -1.

docs/theory/continuation.md, "Special points", explains when a step is searched.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.value_tests import bounded, circle_tests
from saltus.continuation.core.within_step import ASIDE, Spectrum, several_critical, steady
from saltus.continuation.core.zero_problem import hermite
from saltus.continuation.problems.other_values import GOALS
from saltus.scales import CONFIRMED, CROWDED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Event, Point
    from saltus.continuation.problems.orbit_data import OrbitData
    from saltus.orbits.problem import OrbitProblem

__all__ = ["DOUBT", "in_order", "passing", "search_between"]

DOUBT = "events: multipliers may become critical and come back within the step"
_PARTS = 8  # parts of a step that are looked at before it is taken back


def search_between(
    spectrum: Callable[[NDArray[np.float64]], NDArray[np.complex128]],
    a: Point,
    b: Point,
    data: OrbitData,
    *,
    touches: bool,
) -> tuple[bool | None, OrbitData]:
    """Return whether a step may pass over special points, None if it was not searched, and more data of its end.

    Parameters
    ----------
    spectrum : callable
        Multipliers without the trivial one at unknowns near the branch, in any order.
    a, b : Point
        Ends of the step; `a` is examined.
    data : OrbitData
        What is known of `b`.
    touches : bool
        Whether a fold and a branch point lie in the step. A multiplier passes 1 at each, or touches it at both at once.
    """
    old: OrbitData = a.examined.data
    length, count = b.arc - a.arc, len(data.followed)
    data = replace(data, behind=(length, old.followed))
    if length <= CROWDED or count < 2 or len(old.followed) != count:
        return None, data
    start, end = bounded(np.array(old.followed)), bounded(np.array(data.followed))
    if old.behind is not None and len(old.behind[1]) == count:
        back, earlier = old.behind
        if steady((bounded(np.array(earlier)), start, end), (back, length), circle_tests):
            return None, data

    def spectra(shares: NDArray[np.float64]) -> NDArray[np.complex128]:
        return np.array([bounded(spectrum(hermite(a, b, length, share))) for share in shares.tolist()])

    away, before = old.beside or (ASIDE * length, spectra(np.array([ASIDE]))[0])
    beside = spectra(np.array([1.0 - ASIDE]))[0]
    ends = Spectrum(start, before, away / length), Spectrum(end, beside, -ASIDE)
    several = several_critical(spectra, *ends, circle_tests, _PARTS, touches=touches)
    return several is not False, replace(data, beside=(-ASIDE * length, beside))


def passing(problem: OrbitProblem, kind: str, before: Point, after: Point) -> int | None:
    """Return which real multiplier passes 1 (SN) or -1 (PD) in a step, by its index; None where not one does.

    Multipliers of smooth orbits have no poles: one whose distance differs in sign at both ends vanishes between them.
    Where orbits are in pieces, the trivial multiplier is left out exactly.
    """
    if problem.signature.flies or not problem.signature.is_cut:
        return None
    old, new = ([] if (data := end.examined.data) is None else data.followed for end in (before, after))
    if len(old) != len(new):
        return None
    at = GOALS[kind]
    real = [i for i, (a, b) in enumerate(zip(old, new, strict=True)) if a.imag == b.imag == 0.0]
    past = [i for i in real if (old[i].real - at) * (new[i].real - at) < 0.0]
    return past[0] if len(past) == 1 else None


def in_order(problem: OrbitProblem, events: list[Event], before: Point, after: Point) -> list[Event]:
    """Return the events of a step, its fold and its doubling in the order in which one multiplier passes 1 and -1.

    Next to a homoclinic orbit they are nearer to each other than rounding tells, and multipliers there are rounding.
    Their points are then exchanged, and the multiplier that passes is told to be at its critical place.
    """
    simple = {event.name.kind: event for event in events if event.name.kind in ("SN", "PD")}
    index = {kind: i for kind in simple if (i := passing(problem, kind, before, after)) is not None}
    passes = {kind: simple[kind] for kind in index}
    if len(passes) == 2 and index["SN"] == index["PD"]:
        i, (fold, doubling) = index["SN"], (passes["SN"], passes["PD"])
        falls = after.examined.data.followed[i].real < before.examined.data.followed[i].real
        if fold.point.arc != doubling.point.arc and (fold.point.arc < doubling.point.arc) != falls:
            passes = {"SN": replace(fold, point=doubling.point), "PD": replace(doubling, point=fold.point)}
    for kind, event in passes.items():
        _settle(event.point, index[kind], GOALS[kind])
    kept = [passes.get(event.name.kind, event) for event in events]
    return sorted(kept, key=lambda event: event.point.arc)


def _settle(point: Point, i: int, place: float) -> None:
    """Tell a point's multiplier that passes its critical place to be there; the next one keeps the product of all."""
    data: OrbitData | None = point.examined.data
    if data is None or len(data.followed) <= i or abs(data.followed[i] - place) <= CONFIRMED:
        return
    told = data.multipliers.copy()
    k = int(np.argmin(np.abs(told - data.followed[i])))
    if k + 1 < len(data.followed) and told[k + 1].imag == 0.0:
        told[k + 1] *= told[k].real / place
    told[k] = place
    point.examined = replace(point.examined, data=replace(data, known=told))
