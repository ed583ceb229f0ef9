"""Data against a model: which sheet each datum lies on, residuals, and their derivatives.

A datum belongs to the nearest stable sheet, by its residuals. Interpolated ones choose where they are sure. A sheet
that exists at the datum's own place comes first. Where none does, the datum is compared with the last orbits of a
sheet, which move as its end does: by the chain rule, y'(p) + y'(x) x_end'(p). It also costs its distance from the end.

A search may compare data with sheets that end before them. How far these may end before costs one standard error is its
allowance: infinite where a search begins, 0 where it ends.

A drift gives each datum parameters of its own. Its orbit is solved there, from one that lies alike between the ends of
its sheet. Where the sheet ends, observables are linear in the drift, as the ends are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

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
    from saltus.fitting.measured import Channel, Measured, MeasuredPoint
    from saltus.orbits import PeriodicOrbit

__all__ = ["Evaluation"]

_UNSURE = 1.0  # distance of a datum from the nearest sheet, and one more standard error: others are as near
_INSETS = (SHEET_END, 1e-4, 1e-3)  # distances from an end, over the sheet's length, tried one after the other


class Compared(NamedTuple):
    """Each datum against each sheet, arrays of shape (sheet, datum)."""

    squares: NDArray[np.float64]  # squared residuals, the distance from the end included
    places: NDArray[np.float64]  # values at which sheets are compared
    sides: NDArray[np.int64]  # at which end: -1, 1, or 0 within
    past: NDArray[np.float64]  # how far the datum lies beyond the last orbits that are compared; 0 within
    apart: NDArray[np.float64]  # the same in standard errors, of a datum that the sheet does not reach
    inside: NDArray[np.bool_]  # whether the sheet exists at the datum's own place
    seen: NDArray[np.float64]  # formulas interpolated, shape (sheet, formula, datum)


@dataclass
class Evaluation:
    """Residuals of data at one set of parameters."""

    measured: Measured  # the data
    branches: tuple[Branch, ...]  # the model's branches at these parameters
    names: tuple[str, ...]  # parameters that are varied
    # residuals and derivatives of what is known of the parameters beforehand, shapes (prior,) and (prior, parameter)
    beforehand: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    instrument: Instrument = field(default_factory=Instrument)  # what the measurement does to the model's curve
    # how far beyond the end of a sheet a datum is by one standard error, where another sheet exists; 0 for never
    allowance: float = math.inf

    def __post_init__(self) -> None:
        self.sheets: list[Sheet] = sheets_of(self.branches)
        if not self.sheets:
            raise ConvergenceError("stable sheet of the model", math.inf, 0, "all orbits of its branches are unstable")
        self._known: dict[tuple[int, float, float], tuple[NDArray[np.float64], NDArray[np.float64], float]] = {}
        self._end_moves: dict[tuple[int, bool], float] = {}

    @cached_property
    def compared(self) -> Compared:
        """Each datum against each sheet."""
        x, drifts = self.measured.x + self.instrument.moved_by, self._drifts
        rows = []
        for sheet in self.sheets:
            low, high = sheet.place(False), sheet.place(True)
            alike = self._without_drift(sheet, x, drifts)
            place = np.clip(alike, low, high)
            columns = np.array([sheet.column(formula, place) for formula in self.measured.formulas])
            total = self._squares(columns, np.arange(len(x)))
            side = np.where(alike < low, -1, np.where(alike > high, 1, 0))
            open_end = ((side < 0) & (sheet.ends[0] is None)) | ((side > 0) & (sheet.ends[1] is None))
            away = np.where(open_end | ~np.isfinite(total), np.inf, total)
            inside = (alike >= sheet.bounds[0]) & (alike <= sheet.bounds[1]) & np.isfinite(away)
            rows.append((away, place, side, np.abs(alike - place), inside, columns))
        table, places, sides, past, within, interpolated = map(np.array, zip(*rows, strict=True))
        lost = ~np.isfinite(table.min(axis=0))
        if lost.any():
            what = f"stable sheet at {self.measured.along} = {x[lost][0]:.6g}"
            raise ConvergenceError(what, math.inf, 0, f"{lost.sum()} of {len(x)} data lie where no sheet is")
        apart = self._apart(past, sides, within)
        return Compared(table + apart**2, places, sides, past, apart, within, interpolated)

    def _apart(
        self, past: NDArray[np.float64], sides: NDArray[np.int64], inside: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Return distances of data from the ends of sheets, in standard errors.

        Where no sheet is, the data tell the place of an end to within the distance of the next datum: as of a jump, one
        standard error is that of an equal distribution over it.
        """
        if math.isinf(self.allowance):
            return np.zeros(past.shape)
        lengths = np.array([np.ptp(sheet.bounds) for sheet in self.sheets])[:, None]
        below, above = self.measured.spacing
        next_one = np.where(sides > 0, below, above)
        other = np.where(sides > 0, above, below)
        spread = np.where(np.isfinite(next_one), next_one, np.where(np.isfinite(other), other, lengths))
        units = np.where(inside.any(axis=0), self.allowance, spread / math.sqrt(12.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            apart = np.where(past > 0.0, past / units, 0.0)
        return np.where(inside, 0.0, apart) if self.allowance == 0.0 else apart

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether the sheet of each datum exists at the datum's own place, shape (datum,)."""
        sheets, _, _ = self.assigned
        return np.asarray(self.compared.inside[sheets, np.arange(len(sheets))])

    @property
    def beyond(self) -> NDArray[np.float64]:
        """How far each datum lies beyond the end of its sheet, where no sheet exists; 0 of all others."""
        sheets, _, _ = self.assigned
        nowhere = ~self.compared.inside.any(axis=0)
        return np.where(nowhere, self.compared.past[sheets, np.arange(len(sheets))], 0.0)

    @property
    def overhang(self) -> float:
        """How far, at most, a datum lies beyond the end of its sheet while another sheet exists at its place."""
        sheets, _, _ = self.assigned
        past = self.compared.past[sheets, np.arange(len(sheets))]
        return float(np.max(past[~self.reached & self.compared.inside.any(axis=0)], initial=0.0))

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
        table, places, sides, _, apart, *_ = self.compared
        every, nearest = np.arange(table.shape[1]), np.argmin(table, axis=0)
        unsure = np.sqrt(table) <= np.sqrt(table.min(axis=0)) + _UNSURE
        x = self.measured.x + self.instrument.moved_by
        for i in np.flatnonzero(unsure.sum(axis=0) > 1).tolist():
            exact = {}
            for k in np.flatnonzero(unsure[:, i]).tolist():
                with suppress(ConvergenceError):  # next to an end there may be no orbit
                    key = k, float(places[k, i]), int(sides[k, i]), float(x[i]), float(self._drifts[i])
                    squares = self._squares(self._observed(*key)[0][:, None], np.array([i]))
                    exact[k] = float(squares[0] + apart[k, i] ** 2)
            nearest[i] = min(exact, key=exact.__getitem__, default=nearest[i])
        return nearest, places[nearest, every], sides[nearest, every]

    @cached_property
    def rough(self) -> NDArray[np.float64]:
        """Residuals from observables interpolated between the branches' points: no orbit is solved for them."""
        found = self.compared
        nearest, every = np.argmin(found.squares, axis=0), np.arange(found.squares.shape[1])
        return self._residuals(found.seen[nearest, :, every].T, found.apart[nearest, every])

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
        return self._residuals(self.seen, self._apart_of_data)

    @property
    def _apart_of_data(self) -> NDArray[np.float64]:
        """Distance of each datum from the end of its sheet, in standard errors."""
        sheets, _, _ = self.assigned
        return np.asarray(self.compared.apart[sheets, np.arange(len(sheets))])

    def _residuals(self, seen: NDArray[np.float64], apart: NDArray[np.float64]) -> NDArray[np.float64]:
        every, share = np.arange(len(self.measured)), apart / math.sqrt(self.measured.rows)
        parts = []
        for channel in self.measured.channels:
            away = channel.residual(seen[self._of(channel.formulas)], every, self.instrument.factor(channel.name))
            parts.append(np.where(share > 0.0, np.copysign(np.hypot(away, share), away), away).ravel())
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
        moves = np.zeros((count, len(self.names)))  # of the distances from the ends of sheets
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
                moves[i, own] = -side * ends[end]
                if self.instrument.offset in self.names:
                    moves[i, self.names.index(self.instrument.offset)] = side
                if self.instrument.drift in self.names:
                    end_move = self._end_move(self.sheets[sheet], side > 0)
                    moves[i, self.names.index(self.instrument.drift)] = -side * passed[i] * end_move
        parts = []
        for channel in self.measured.channels:
            of, gain = self._of(channel.formulas), self.instrument.factor(channel.name)
            rows = gain * np.array([channel.slopes(self.seen[of, i], slopes[of, i], i) for i in range(count)])
            table = rows.swapaxes(0, 1)
            if self.instrument.gain in self.names and channel.name in self.instrument.scaled:
                table[:, :, self.names.index(self.instrument.gain)] = channel.by_gain(self.seen[of])
            parts.append(self._with_distances(channel, table, moves).reshape(-1, len(self.names)))
        for point, one in zip(self.measured.points, self.special, strict=True):
            parts.append(self._point_slopes(point, one)[None, :] / point.sigma)
        if self.beforehand is not None:
            parts.append(self.beforehand[1])
        return np.concatenate(parts)

    def _with_distances(
        self, channel: Channel, table: NDArray[np.float64], moves: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return derivatives of residuals that contain distances from ends, from those without, (row, datum, vary)."""
        apart, (sheets, _, _) = self._apart_of_data, self.assigned
        for i in np.flatnonzero(apart > 0.0).tolist():
            gain = self.instrument.factor(channel.name)
            away = channel.residual(self.seen[self._of(channel.formulas), i], i, gain)
            share = apart[i] / self.measured.rows
            grown = share * apart[i] / self.compared.past[sheets[i], i] * moves[i]
            whole = np.copysign(np.hypot(away, math.sqrt(share * apart[i])), away)
            table[:, i] = (away[:, None] * table[:, i] + grown) / whole[:, None]
        return table

    def _point_slopes(self, point: MeasuredPoint, one: SpecialPoint | None) -> NDArray[np.float64]:
        """Return the derivatives of the distance between a special point of the model and a measured one."""
        if one is None:
            return np.zeros(len(self.names))
        return self.point_moves(point, one)[1] * beyond(point, self._place_of(point, one))[1]

    def point_moves(self, point: MeasuredPoint, one: SpecialPoint) -> tuple[float, NDArray[np.float64]]:
        """Return by how much a special point of the model lies off a measured one, and its derivatives."""
        found = np.zeros(len(self.names))
        names = self.instrument.of_model(self.names)
        found[[self.names.index(name) for name in names]] = _moved(one, names) if names else 0.0
        if self.instrument.offset in self.names:
            found[self.names.index(self.instrument.offset)] = -1.0
        if self.instrument.drift in self.names:
            found[self.names.index(self.instrument.drift)] = self.measured.passed_at(point) * self._drift_of(one)
        return self._place_of(point, one) - point.value, found


def _moved(point: SpecialPoint, names: Sequence[str]) -> NDArray[np.float64]:
    return np.asarray(point.sensitivity(names)[point.varied[0]].to_numpy())
