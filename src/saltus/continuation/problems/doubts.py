"""Search of a step of orbits for multipliers that become critical and come back, which the step's ends do not show.

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
from saltus.scales import CROWDED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.continuation.problems.orbit_data import OrbitData

__all__ = ["DOUBT", "search_between"]

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
