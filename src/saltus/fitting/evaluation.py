"""Data against a model: which sheet each datum lies on, residuals, and their derivatives.

A datum belongs to the nearest stable sheet, by its residuals. Interpolated ones choose where they are sure. Beyond the
end of a sheet the datum is compared with the sheet's last orbits, which move as the end does: by the chain rule,
y'(p) + y'(x) x_end'(p).

A drift gives each datum parameters of its own. Its orbit is solved there, from one that lies alike between the ends of
its sheet. Where the sheet ends, observables are linear in the drift, as the ends are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.many.retracing import moved
from saltus.continuation.results.sheets import Sheet, sheets_of
from saltus.errors import ConvergenceError, InputError
from saltus.fitting.instrument import Instrument
from saltus.fitting.jumps import beyond, point_near
from saltus.scales import SHEET_END

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation import Branch, SpecialPoint
    from saltus.fitting.measured import Measured, MeasuredPoint
    from saltus.orbits import PeriodicOrbit

__all__ = ["Evaluation"]

_UNSURE = 1.0  # distance of a datum from the nearest sheet, and one more standard error: others are as near
_INSETS = (SHEET_END, 1e-4, 1e-3)  # distances from an end, over the sheet's length, tried one after the other


@dataclass
class Evaluation:
    """Residuals of data at one set of parameters."""

    measured: Measured  # the data
    branches: tuple[Branch, ...]  # the model's branches at these parameters
    names: tuple[str, ...]  # parameters that are varied
    # residuals and derivatives of what is known of the parameters beforehand, shapes (prior,) and (prior, parameter)
    beforehand: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    instrument: Instrument = field(default_factory=Instrument)  # what the measurement does to the model's curve

    def __post_init__(self) -> None:
        self.sheets: list[Sheet] = sheets_of(self.branches)
        if not self.sheets:
            raise ConvergenceError("stable sheet of the model", math.inf, 0, "all orbits of its branches are unstable")
        self._known: dict[tuple[int, float, float], tuple[NDArray[np.float64], NDArray[np.float64], float]] = {}
        self._end_moves: dict[tuple[int, bool], float] = {}

    @cached_property
    def _compared(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
        """Squared residuals, place and side of each datum on each sheet, (sheet, datum), and formulas interpolated."""
        x, drifts = self.measured.x + self.instrument.moved_by, self._drifts
        away, places, sides, interpolated = [], [], [], []
        for sheet in self.sheets:
            low, high = sheet.place(False), sheet.place(True)
            alike = self._without_drift(sheet, x, drifts)
            place = np.clip(alike, low, high)
            columns = np.array([sheet.column(formula, place) for formula in self.measured.formulas])
            total = self._squares(columns, np.arange(len(x)))
            side = np.where(alike < low, -1, np.where(alike > high, 1, 0))
            open_end = ((side < 0) & (sheet.ends[0] is None)) | ((side > 0) & (sheet.ends[1] is None))
            away.append(np.where(open_end | ~np.isfinite(total), np.inf, total))
            places.append(place)
            sides.append(side)
            interpolated.append(columns)
        table = np.array(away)
        lost = ~np.isfinite(table.min(axis=0))
        if lost.any():
            what = f"stable sheet at {self.measured.along} = {x[lost][0]:.6g}"
            raise ConvergenceError(what, math.inf, 0, f"{lost.sum()} of {len(x)} data lie where no sheet is")
        return table, np.array(places), np.array(sides), np.array(interpolated)

    def _squares(self, seen: NDArray[np.float64], data: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the sums of squared residuals of some data, for formulas of shape (formula, datum)."""
        total = np.zeros(len(data))
        for channel in self.measured.channels:
            gain = self.instrument.factor(channel.name)
            total += (channel.residual(seen[self._of(channel.formulas)], data, gain) ** 2).sum(axis=0)
        return total

    @cached_property
    def assigned(self) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
        """Of each datum the sheet, the value at which the sheet is compared, and at which end: -1, 1, or 0 within.

        Orbits decide between sheets of which interpolation does not tell the nearest.
        """
        table, places, sides, _ = self._compared
        every, nearest = np.arange(table.shape[1]), np.argmin(table, axis=0)
        unsure = np.sqrt(table) <= np.sqrt(table.min(axis=0)) + _UNSURE
        x = self.measured.x + self.instrument.moved_by
        for i in np.flatnonzero(unsure.sum(axis=0) > 1).tolist():
            exact = {}
            for k in np.flatnonzero(unsure[:, i]).tolist():
                with suppress(ConvergenceError):  # next to an end there may be no orbit
                    key = k, float(places[k, i]), int(sides[k, i]), float(x[i]), float(self._drifts[i])
                    exact[k] = float(self._squares(self._observed(*key)[0][:, None], np.array([i]))[0])
            nearest[i] = min(exact, key=exact.__getitem__, default=nearest[i])
        return nearest, places[nearest, every], sides[nearest, every]

    @cached_property
    def rough(self) -> NDArray[np.float64]:
        """Residuals from observables interpolated between the branches' points: no orbit is solved for them."""
        table, _, _, interpolated = self._compared
        return self._residuals(interpolated[np.argmin(table, axis=0), :, np.arange(table.shape[1])].T)

    @property
    def _drifts(self) -> NDArray[np.float64]:
        """Drift at each datum."""
        return self.instrument.drifted_by * self.measured.passed

    def _end_move(self, sheet: Sheet, upper: bool) -> float:
        """Return by how much an end of a sheet moves with the drift."""
        key = sheet.number, upper
        if key not in self._end_moves:
            weights = self.instrument.drifting
            slopes = sheet.place_slopes(upper, list(weights)) if self.instrument.drift else np.zeros(0)
            self._end_moves[key] = float(slopes @ np.array(list(weights.values()))) if slopes.size else 0.0
        return self._end_moves[key]

    def _without_drift(self, sheet: Sheet, x: NDArray[np.float64], drifts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the places that lie between the ends of a sheet as `x` does between those that have drifted."""
        if not np.any(drifts):
            return x
        low, high = sheet.place(False), sheet.place(True)
        first, last = self._end_move(sheet, False), self._end_move(sheet, True)
        growth = (last - first) / (high - low) if high > low else 0.0
        return np.asarray((x - drifts * (first - growth * low)) / (1.0 + growth * drifts))

    def _observed(
        self, sheet: int, place: float, side: int, x: float, drift: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Return the formulas of a datum, shape (formulas,), and their derivatives by the varied parameters.

        The last columns of the derivatives are those by the drift and by the branch's parameter. Next to an end, where
        orbits are nearly singular, the place may move inwards. The last that is returned is its distance, over the
        sheet's length.
        """
        key = sheet, place if side else x, drift
        if key not in self._known:
            self._known[key] = self._within(sheet, place, x, drift) if not side else self._at_end(sheet, side, drift)
        return self._known[key]

    def _at_end(self, sheet: int, side: int, drift: float) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        for inset in _INSETS:
            try:
                there = self.sheets[sheet].place(side > 0, inset)
                values, slopes = self._solved(self.sheets[sheet].orbit(there), there)
                break
            except ConvergenceError:
                if inset == _INSETS[-1]:
                    raise
        by_drift = slopes[:, -2] + slopes[:, -1] * self._end_move(self.sheets[sheet], side > 0)
        slopes[:, -2] = by_drift
        return values + drift * by_drift, slopes, inset

    def _within(
        self, sheet: int, place: float, x: float, drift: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Return formulas and derivatives of a datum within its sheet; next to an end they are linear in the drift."""
        orbit = self.sheets[sheet].orbit(place)
        if drift:
            own = {name: orbit.parameters[name] + drift * by for name, by in self.instrument.drifting.items()}
            try:
                there = moved(orbit, {self.branches[0].parameter: x, **own})
                if there.stable:
                    return *self._solved(there, x), _INSETS[0]
            except (ConvergenceError, InputError):
                pass  # next to an end: its fold is not linear in the drift
        values, slopes = self._solved(orbit, place)
        return values + slopes[:, -2] * drift + slopes[:, -1] * (x - place), slopes, _INSETS[0]

    def _solved(self, orbit: PeriodicOrbit, place: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        formulas, along = list(self.measured.formulas), self.branches[0].parameter
        try:
            found = orbit.sensitivity(formulas, self._sorted)
        except InputError as error:
            raise ConvergenceError(f"derivative at {along} = {place:.9g}", math.inf, 0, str(error)) from error
        values = np.array([found.variables[formula].attrs["value"] for formula in formulas])
        table = np.array([found.variables[formula].values for formula in formulas])
        if not np.all(np.isfinite(table)):
            notes = [note for formula in formulas if (note := found[formula].attrs.get("note"))]
            raise ConvergenceError(f"derivative at {along} = {place:.9g}", math.inf, 0, "; ".join(notes))
        by_drift = sum(
            (by * table[:, self._sorted.index(name)] for name, by in self._drifting.items()), np.zeros(len(formulas))
        )
        order = [self._sorted.index(name) for name in self.instrument.of_model(self.names)]
        by_place = table[:, self._sorted.index(along)]
        return values, np.column_stack([table[:, order], by_drift, by_place])

    @property
    def _drifting(self) -> Mapping[str, float]:
        return self.instrument.drifting if self.instrument.drift else {}

    @cached_property
    def _sorted(self) -> list[str]:
        """The varied parameters and the branch's, in the order of the system's, in which derivatives cost least."""
        wanted = {*self.instrument.of_model(self.names), *self._drifting, self.branches[0].parameter}
        return [name for name in self.branches[0].system.parameter_names if name in wanted]

    @property
    def _keys(self) -> list[tuple[int, float, int, float, float]]:
        sheets, places, sides = self.assigned
        x = self.measured.x + self.instrument.moved_by
        rows = (sheets, places, sides, x, self._drifts)
        return list(zip(*(row.tolist() for row in rows), strict=True))

    @cached_property
    def seen(self) -> NDArray[np.float64]:
        """Values of the formulas at each datum, shape (formula, datum)."""
        return np.array([self._observed(*key)[0] for key in self._keys]).T

    def _of(self, formulas: Sequence[str]) -> list[int]:
        return [self.measured.formulas.index(formula) for formula in formulas]

    @cached_property
    def special(self) -> list[SpecialPoint | None]:
        """The model's special point of each measured one; None where it has none."""
        return [
            point_near(point._replace(value=point.value + self.instrument.moved_by), self.sheets, self.branches)
            for point in self.measured.points
        ]

    @cached_property
    def residuals(self) -> NDArray[np.float64]:
        """Model less data over standard errors: datum after datum of each channel, special points, then priors.

        A special point that the model lacks counts with the range of the data.
        """
        return self._residuals(self.seen)

    def _residuals(self, seen: NDArray[np.float64]) -> NDArray[np.float64]:
        every = np.arange(len(self.measured))
        parts = [
            channel.residual(seen[self._of(channel.formulas)], every, self.instrument.factor(channel.name)).ravel()
            for channel in self.measured.channels
        ]
        span = float(np.ptp(self.measured.x)) or 1.0
        ends = [
            (span if one is None else beyond(point, self._place_of(point, one))[0]) / point.sigma
            for point, one in zip(self.measured.points, self.special, strict=True)
        ]
        known = [] if self.beforehand is None else [self.beforehand[0]]
        return np.concatenate([*parts, np.array(ends), *known])

    def _place_of(self, point: MeasuredPoint, one: SpecialPoint) -> float:
        """Return where the data should have a special point of the model."""
        place = one.value(one.varied[0]) - self.instrument.moved_by
        if self.instrument.drifted_by:
            place += self.instrument.drifted_by * self.measured.passed_at(point) * self._drift_of(one)
        return place

    def _drift_of(self, one: SpecialPoint) -> float:
        """Return by how much a special point moves with the drift."""
        return float(_moved(one, list(self._drifting)) @ np.array(list(self._drifting.values())))

    @cached_property
    def jacobian(self) -> NDArray[np.float64]:
        """Derivatives of the residuals by the varied parameters, shape (residuals, parameters), exact.

        Raises
        ------
        ConvergenceError
            An observable has no derivative at a datum.
        """
        formulas, count = self.measured.formulas, len(self.measured)
        names, passed = self.instrument.of_model(self.names), self.measured.passed
        slopes = np.zeros((len(formulas), count, len(self.names)))
        own = [self.names.index(name) for name in names]
        ends: dict[tuple[int, bool], NDArray[np.float64]] = {}
        for i, (sheet, place, side, x, drift) in enumerate(self._keys):
            _, by_all, inset = self._observed(sheet, place, side, x, drift)
            slopes[:, i, own] = by_all[:, :-2]
            if self.instrument.drift in self.names:
                slopes[:, i, self.names.index(self.instrument.drift)] = passed[i] * by_all[:, -2]
            if self.instrument.offset in self.names and not side:
                slopes[:, i, self.names.index(self.instrument.offset)] = by_all[:, -1]
            if side:
                end = sheet, side > 0
                if end not in ends:
                    ends[end] = self.sheets[sheet].place_slopes(side > 0, names, inset)
                slopes[:, i, own] += by_all[:, -1:] * ends[end]
        parts = []
        for channel in self.measured.channels:
            of, gain = self._of(channel.formulas), self.instrument.factor(channel.name)
            rows = gain * np.array([channel.slopes(self.seen[of, i], slopes[of, i], i) for i in range(count)])
            table = rows.swapaxes(0, 1)
            if self.instrument.gain in self.names and channel.name in self.instrument.scaled:
                table[:, :, self.names.index(self.instrument.gain)] = channel.by_gain(self.seen[of])
            parts.append(table.reshape(-1, len(self.names)))
        for point, one in zip(self.measured.points, self.special, strict=True):
            parts.append(self._point_slopes(point, one)[None, :] / point.sigma)
        if self.beforehand is not None:
            parts.append(self.beforehand[1])
        return np.concatenate(parts)

    def _point_slopes(self, point: MeasuredPoint, one: SpecialPoint | None) -> NDArray[np.float64]:
        """Return the derivatives of the distance between a special point of the model and a measured one."""
        found = np.zeros(len(self.names))
        if one is None:
            return found
        names = self.instrument.of_model(self.names)
        found[[self.names.index(name) for name in names]] = _moved(one, names) if names else 0.0
        if self.instrument.offset in self.names:
            found[self.names.index(self.instrument.offset)] = -1.0
        if self.instrument.drift in self.names:
            found[self.names.index(self.instrument.drift)] = self.measured.passed_at(point) * self._drift_of(one)
        return found * beyond(point, self._place_of(point, one))[1]


def _moved(point: SpecialPoint, names: Sequence[str]) -> NDArray[np.float64]:
    return np.asarray(point.sensitivity(names)[point.varied[0]].to_numpy())
