"""Data against a model: which sheet each datum lies on, residuals, and their derivatives.

A datum belongs to the nearest stable sheet, by its residuals. Beyond the end of a sheet the datum is compared with the
sheet's last orbits, which move as the end does: by the chain rule, y'(p) + y'(x) x_end'(p).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.results.sheets import WITHIN, Sheet, sheets_of
from saltus.errors import ConvergenceError, InputError
from saltus.fitting.jumps import point_near

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation import Branch, SpecialPoint
    from saltus.fitting.measured import Measured

__all__ = ["Evaluation"]

_INSETS = (WITHIN, 1e-4, 1e-3)  # distances from an end, over the sheet's length, tried one after the other


@dataclass
class Evaluation:
    """Residuals of data at one set of parameters."""

    measured: Measured  # the data
    branches: tuple[Branch, ...]  # the model's branches at these parameters
    names: tuple[str, ...]  # parameters that are varied
    # residuals and derivatives of what is known of the parameters beforehand, shapes (prior,) and (prior, parameter)
    beforehand: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def __post_init__(self) -> None:
        self.sheets: list[Sheet] = sheets_of(self.branches)
        if not self.sheets:
            raise ConvergenceError("stable sheet of the model", math.inf, 0, "all orbits of its branches are unstable")
        self._known: dict[tuple[int, float], tuple[NDArray[np.float64], NDArray[np.float64], float]] = {}

    @cached_property
    def _nearest(self) -> tuple[tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]], NDArray[np.float64]]:
        """Sheet, place and side of each datum, and the formulas interpolated there, shape (formula, datum)."""
        x = self.measured.x
        away, places, sides, interpolated = [], [], [], []
        for sheet in self.sheets:
            low, high = sheet.place(False), sheet.place(True)
            place = np.clip(x, low, high)
            columns = np.array([sheet.column(formula, place) for formula in self.measured.formulas])
            total = np.zeros(len(x))
            for channel in self.measured.channels:
                seen = columns[self._of(channel.formulas)]
                total += (channel.residual(seen, np.arange(len(x))) ** 2).sum(axis=0)
            beyond = np.where(x < low, -1, np.where(x > high, 1, 0))
            open_end = ((beyond < 0) & (sheet.ends[0] is None)) | ((beyond > 0) & (sheet.ends[1] is None))
            away.append(np.where(open_end | ~np.isfinite(total), np.inf, total))
            places.append(place)
            sides.append(beyond)
            interpolated.append(columns)
        table = np.array(away)
        lost = ~np.isfinite(table.min(axis=0))
        if lost.any():
            what = f"stable sheet at {self.measured.along} = {x[lost][0]:.6g}"
            raise ConvergenceError(what, math.inf, 0, f"{lost.sum()} of {len(x)} data lie where no sheet is")
        nearest, every = np.argmin(table, axis=0), np.arange(len(x))
        chosen = nearest, np.array(places)[nearest, every], np.array(sides)[nearest, every]
        return chosen, np.array(interpolated)[nearest, :, every].T

    @property
    def assigned(self) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
        """Of each datum the sheet, the value at which the sheet is compared, and at which end: -1, 1, or 0 within."""
        return self._nearest[0]

    @cached_property
    def rough(self) -> NDArray[np.float64]:
        """Residuals from observables interpolated between the branches' points: no orbit is solved for them."""
        return self._residuals(self._nearest[1])

    def _observed(self, sheet: int, place: float, side: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Return the formulas at a place, shape (formulas,), and their derivatives by the varied parameters.

        The last column of the derivatives is that by the branch's parameter. Next to an end, where orbits are nearly
        singular, the place may move inwards: the last that is returned is its distance, over the sheet's length.
        """
        key = sheet, place
        if key not in self._known:
            for inset in _INSETS[: len(_INSETS) if side else 1]:
                there = self.sheets[sheet].place(side > 0, inset) if side else place
                try:
                    self._known[key] = *self._solved(sheet, there), inset
                    break
                except ConvergenceError:
                    if not side or inset == _INSETS[-1]:
                        raise
        return self._known[key]

    def _solved(self, sheet: int, place: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        formulas, along = list(self.measured.formulas), self.branches[0].parameter
        orbit = self.sheets[sheet].orbit(place)
        try:
            found = orbit.sensitivity(formulas, self._sorted)
        except InputError as error:
            raise ConvergenceError(f"derivative at {along} = {place:.9g}", math.inf, 0, str(error)) from error
        values = np.array([found.variables[formula].attrs["value"] for formula in formulas])
        order = [self._sorted.index(name) for name in (*self.names, along)]
        slopes = np.array([found.variables[formula].values[order] for formula in formulas])
        if not np.all(np.isfinite(slopes)):
            notes = [note for formula in formulas if (note := found[formula].attrs.get("note"))]
            raise ConvergenceError(f"derivative at {along} = {place:.9g}", math.inf, 0, "; ".join(notes))
        return values, slopes

    @cached_property
    def _sorted(self) -> list[str]:
        """The varied parameters and the branch's, in the order of the system's, in which derivatives cost least."""
        wanted = {*self.names, self.branches[0].parameter}
        return [name for name in self.branches[0].system.parameter_names if name in wanted]

    @property
    def _keys(self) -> list[tuple[int, float, int]]:
        sheets, places, sides = self.assigned
        return list(zip(sheets.tolist(), places.tolist(), sides.tolist(), strict=True))

    @cached_property
    def seen(self) -> NDArray[np.float64]:
        """Values of the formulas at each datum, shape (formula, datum)."""
        return np.array([self._observed(*key)[0] for key in self._keys]).T

    def _of(self, formulas: Sequence[str]) -> list[int]:
        return [self.measured.formulas.index(formula) for formula in formulas]

    @cached_property
    def special(self) -> list[SpecialPoint | None]:
        """The model's special point of each measured one; None where it has none."""
        return [point_near(point, self.sheets, self.branches) for point in self.measured.points]

    @cached_property
    def residuals(self) -> NDArray[np.float64]:
        """Model less data over standard errors: datum after datum of each channel, special points, then priors.

        A special point that the model lacks counts with the range of the data.
        """
        return self._residuals(self.seen)

    def _residuals(self, seen: NDArray[np.float64]) -> NDArray[np.float64]:
        every = np.arange(len(self.measured))
        parts = [
            channel.residual(seen[self._of(channel.formulas)], every).ravel() for channel in self.measured.channels
        ]
        span = float(np.ptp(self.measured.x)) or 1.0
        ends = [
            (span if one is None else one.value(one.varied[0]) - point.value) / point.sigma
            for point, one in zip(self.measured.points, self.special, strict=True)
        ]
        known = [] if self.beforehand is None else [self.beforehand[0]]
        return np.concatenate([*parts, np.array(ends), *known])

    @cached_property
    def jacobian(self) -> NDArray[np.float64]:
        """Derivatives of the residuals by the varied parameters, shape (residuals, parameters), exact.

        Raises
        ------
        ConvergenceError
            An observable has no derivative at a datum.
        """
        formulas, count = self.measured.formulas, len(self.measured)
        slopes = np.empty((len(formulas), count, len(self.names)))
        ends: dict[tuple[int, bool], NDArray[np.float64]] = {}
        for i, (sheet, place, side) in enumerate(self._keys):
            _, by_all, inset = self._observed(sheet, place, side)
            slopes[:, i] = by_all[:, :-1]
            if side:
                end = sheet, side > 0
                if end not in ends:
                    ends[end] = self.sheets[sheet].place_slopes(side > 0, self.names, inset)
                slopes[:, i] += by_all[:, -1:] * ends[end]
        parts = []
        for channel in self.measured.channels:
            of = self._of(channel.formulas)
            rows = np.array([channel.slopes(self.seen[of, i], slopes[of, i], i) for i in range(count)])
            parts.append(rows.swapaxes(0, 1).reshape(-1, len(self.names)))
        for point, one in zip(self.measured.points, self.special, strict=True):
            moved = np.zeros(len(self.names)) if one is None else _moved(one, self.names)
            parts.append(moved[None, :] / point.sigma)
        if self.beforehand is not None:
            parts.append(self.beforehand[1])
        return np.concatenate(parts)


def _moved(point: SpecialPoint, names: Sequence[str]) -> NDArray[np.float64]:
    return np.asarray(point.sensitivity(names)[point.varied[0]].to_numpy())
