"""Search of a step of orbits for multipliers that become critical and come back, which the step's ends do not show.

docs/theory/continuation.md, "Special points", explains when a step is searched.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.locating import CROWDED
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.within_step import ASIDE, Spectrum, circle_tests, several_critical, steady
from saltus.continuation.core.zero_problem import hermite
from saltus.orbits.floquet import multipliers, nontrivial

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.continuation.problems.orbit import OrbitData, OrbitZeroProblem

__all__ = ["searched"]

_PARTS = 8  # parts of a step that are looked at before it is taken back
_LARGE = 1e10  # size from which on a multiplier counts as this
_DOUBT = "events: multipliers may become critical and come back within the step"


def searched(
    problem: OrbitZeroProblem, a: Point, b: Point, data: OrbitData
) -> tuple[str | None, frozenset[Monitor], OrbitData]:
    """Return why the step from `a` to `b` may not be taken, test functions with one zero at most, and data of `b`.

    Parameters
    ----------
    problem : OrbitZeroProblem
        The equations.
    a, b : Point
        Ends of the step; `a` is examined.
    data : OrbitData
        What is known of `b`; with multipliers beside it in what is returned, if the step was searched.
    """
    length, old = b.arc - a.arc, a.examined.data
    data = replace(data, behind=(length, old.followed))
    count, equations = len(data.followed), problem.problem
    if length <= CROWDED or count < 2 or len(old.followed) != count:
        return None, frozenset(), data
    known = old.behind is not None and len(old.behind[1]) == count
    if known and steady((old.behind[1], old.followed, data.followed), (old.behind[0], length), circle_tests):
        return None, frozenset(), data

    def spectra(shares: NDArray[np.float64]) -> NDArray[np.complex128]:
        found = []
        for share in shares.tolist():
            u = hermite(a, b, length, share)
            J = problem.own(problem.evaluate(u)[1])
            found.append(_bounded(nontrivial(multipliers(equations, u, J), autonomous=equations.system.phase is None)))
        return np.array(found)

    if old.beside is None:
        away, beside = ASIDE * length, spectra(np.array([ASIDE]))[0]
    else:
        away, beside = old.beside
    data = replace(data, beside=(-ASIDE * length, spectra(np.array([1.0 - ASIDE]))[0]))
    assert data.beside is not None
    first = Spectrum(_bounded(np.array(old.followed)), beside, away / length)
    last = Spectrum(_bounded(np.array(data.followed)), data.beside[1], -ASIDE)
    several = several_critical(spectra, first, last, circle_tests, _PARTS)
    equations.set_parameters(b.u)
    if several is not False:
        return _DOUBT, frozenset(), data
    names = (name for name in a.examined.monitors if name.kind in ("PD", "BP", "TR"))
    return None, frozenset(names), data


def _bounded(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return multipliers without the size of those that are infinite, or nearly."""
    found = values.copy()
    large = ~(np.abs(values) < _LARGE)
    found[large] = np.where(values.real[large] < 0.0, -_LARGE, _LARGE)
    return found
