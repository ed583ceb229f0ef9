"""Smooth formulas for a table of a force over the gap: a rational function, or two pieces that meet where it bends.

Far away, the force is ``s**2`` times a polynomial of ``s = L/(D - D_min + L)``. Beyond the table it is fitted to a
force that falls from the last row with the distance squared. Nearer than a bend, it is a polynomial of the gap.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from scipy.interpolate import Akima1DInterpolator
from scipy.optimize import minimize_scalar

from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["TableFit", "fitted_table"]

_DEGREES = (4, 6, 8, 10, 12)  # of the polynomials, the least that will do
_LENGTHS = np.geomspace(0.03, 3.0, 9)  # L, over the range of the table
_GOOD = 1e-3  # misfit over the greatest force with which a formula will do, where the table has no errors
_SEEN = 2.0  # standard errors of the table with which it will do
_WORST = 0.05  # misfit over the greatest force that is allowed
_JOINT = 1e4  # weight of the condition that two pieces meet
_PLACES = 40  # gaps at which a bend is sought first
_LEAST = 8  # rows of a table
_LEAST_SPAN = 1e-3  # nm; gaps of a table
_BETWEEN = 200  # gaps of even distance at which the table is interpolated
_LOOSE = 0.1  # weight of what is interpolated, over that of a row
_TAIL = 0.5  # the same of what is beyond the table
_REACH = np.geomspace(1e-2, 1e3, 60)  # places beyond the table, over its greatest gap


class TableFit(NamedTuple):
    """Formulas in ``D_nm``."""

    far: str
    near: str  # below the bend; empty where there is none
    bend_nm: float | None
    misfit: float  # greatest difference, over the greatest force; half of it counts beyond the table


class _Far(NamedTuple):
    """The variable of the far formula."""

    least: float
    length: float
    last: float

    def basis(self, D: NDArray[np.float64], degree: int) -> NDArray[np.float64]:
        s = self.length / (D - self.least + self.length)
        found = chebyshev.chebvander((2.0 * s - 1.0 - self.last) / (1.0 - self.last), degree)
        return np.asarray(found * (s**2)[:, None], dtype=np.float64)

    def text(self, coefficients: NDArray[np.float64]) -> str:
        s = f"({self.length!r}/(D_nm - {self.least - self.length!r}))".replace("- -", "+ ")
        slope, shift = 2.0 / (1.0 - self.last), (1.0 + self.last) / (1.0 - self.last)
        return f"{s}**2*({_polynomial(f'({slope!r}*{s} - {shift!r})', coefficients)})"


def fitted_table(D: NDArray[np.float64], F: NDArray[np.float64], sigma: NDArray[np.float64] | None) -> TableFit:
    """Return formulas for a table with ascending gaps.

    Raises
    ------
    InputError
        The table is too short, its gaps are not in nm, or no formula comes near enough.
    """
    if len(D) < _LEAST:
        raise InputError("D_nm", len(D), f"{_LEAST} gaps or more")
    if (span := float(D[-1] - D[0])) < _LEAST_SPAN:
        raise InputError("D_nm", span, f"gaps that span {_LEAST_SPAN:g} nm or more", f"in m? then {span * 1e9:g} nm")
    greatest = float(np.abs(F).max())
    if greatest == 0.0:
        raise InputError("F_nN", 0.0, "a force that is not 0 everywhere")
    table = _Table.of(D, F)
    good = max(_GOOD, 0.0 if sigma is None else _SEEN * float(sigma.max()) / greatest)
    best = min((_whole(table, n) for n in _DEGREES), key=lambda one: max(one.misfit, good))
    if best.misfit > good:
        best = min((best, *(_bent(table, n) for n in _DEGREES[1:])), key=lambda one: max(one.misfit, good))
    if best.misfit > _WORST:
        hint = "more gaps where the force bends, or a reconstruction with less noise"
        raise InputError(
            "F_nN", float(f"{best.misfit:.3g}"), f"a table that formulas fit to {_WORST:g} of its peak", hint
        )
    return best


class _Table(NamedTuple):
    """Rows of a table, and gaps between and beyond them with less weight, in ascending order."""

    D: NDArray[np.float64]
    F: NDArray[np.float64]
    weights: NDArray[np.float64]
    rows: int
    last: float  # greatest gap of the rows

    @classmethod
    def of(cls, D: NDArray[np.float64], F: NDArray[np.float64]) -> _Table:
        between = np.setdiff1d(np.linspace(D[0], D[-1], _BETWEEN), D)
        size = D[-1] if D[-1] > 0.0 else D[-1] - D[0]  # gaps of an unknown origin: the range stands for the gap
        gaps = np.concatenate([D, between, D[-1] + size * _REACH])
        order = np.argsort(gaps)
        tail = F[-1] * (1.0 + _REACH) ** -2.0
        forces = np.concatenate([F, Akima1DInterpolator(D, F, method="makima")(between), tail])
        weights = np.repeat([1.0, _LOOSE, _TAIL], [len(D), len(between), len(_REACH)])
        return cls(gaps[order], forces[order], weights[order], len(D), float(D[-1]))

    def misfit(self, fitted: NDArray[np.float64]) -> float:
        """Greatest weighted difference, over the greatest force."""
        return float(np.abs((fitted - self.F) * self.weights).max() / np.abs(self.F).max())


def _whole(table: _Table, degree: int) -> TableFit:
    """Return the best single formula of a degree."""
    D, F, weights, rows, last = table
    found = []
    for length in _LENGTHS * (last - D[0]):
        far = _Far(float(D[0]), float(length), float(length / (D[-1] - D[0] + length)))
        basis = far.basis(D, min(degree, rows - 2))
        c = np.asarray(np.linalg.lstsq(basis * weights[:, None], F * weights, rcond=None)[0], dtype=np.float64)
        found.append((table.misfit(basis @ c), far, c))
    misfit, far, c = min(found, key=lambda one: one[0])
    return TableFit(far.text(c), "", None, misfit)


def _bent(table: _Table, degree: int) -> TableFit:
    """Return the best pair of formulas of a degree, which meet at a bend."""
    D = table.D[table.weights == 1.0]
    margin = min(degree // 2 + 1, len(D) // 4)
    low, high = float(D[margin]), float(D[-margin - 1])
    places = np.linspace(low, high, _PLACES)
    misfits = [_pieces(table, degree, float(place))[0] for place in places]
    i = int(np.argmin(misfits))
    around = float(places[max(i - 1, 0)]), float(places[min(i + 1, _PLACES - 1)])
    bend = float(minimize_scalar(lambda b: _pieces(table, degree, float(b))[0], bounds=around, method="bounded").x)
    misfit, far, c, near = _pieces(table, degree, bend)
    half, middle = 0.5 * (bend - float(D[0])), 0.5 * (bend + float(D[0]))
    text = _polynomial(f"(({1.0 / half!r})*D_nm - ({middle / half!r}))", near)
    return TableFit(far.text(c), text, bend, misfit)


def _pieces(table: _Table, degree: int, bend: float) -> tuple[float, _Far, NDArray[np.float64], NDArray[np.float64]]:
    """Return the misfit of two formulas that meet at a bend, and their coefficients."""
    D, F, weights, _, last = table
    beyond, rows = bend <= D, weights == 1.0
    n, m = min(degree, int((beyond & rows).sum()) - 1), min(degree, int((~beyond & rows).sum()) - 1)
    length = max(0.3 * (last - bend), 1e-9)
    far = _Far(bend, float(length), float(length / (D[-1] - bend + length)))

    def near(gaps: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(chebyshev.chebvander((2.0 * gaps - bend - D[0]) / (bend - D[0]), m))

    place = np.array([bend])
    matrix = np.zeros((len(D) + 1, n + m + 2))
    matrix[:-1][beyond, : n + 1] = far.basis(D[beyond], n)
    matrix[:-1][~beyond, n + 1 :] = near(D[~beyond])
    weight = np.append(weights, 1.0)
    matrix[-1] = _JOINT * np.concatenate([far.basis(place, n)[0], -near(place)[0]])
    c = np.linalg.lstsq(matrix * weight[:, None], np.append(F, 0.0) * weight, rcond=None)[0]
    one, two = c[: n + 1], c[n + 1 :].copy()
    two[0] += float(far.basis(place, n)[0] @ one - near(place)[0] @ two)
    fitted = np.where(beyond, matrix[:-1, : n + 1] @ one, matrix[:-1, n + 1 :] @ two)
    return table.misfit(fitted), far, one, two


def _polynomial(x: str, coefficients: NDArray[np.float64]) -> str:
    """Return a Chebyshev series as a text of powers."""
    powers = chebyshev.cheb2poly(coefficients)
    terms = [
        f"({float(c)!r})" + ("" if i == 0 else f"*{x}" + (f"**{i}" if i > 1 else "")) for i, c in enumerate(powers)
    ]
    return " + ".join(terms)
