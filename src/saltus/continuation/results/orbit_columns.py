"""Columns of a curve of periodic orbits: parameters, states, extremes, observables; and the orbit of each point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.results.curve import SolutionCurve
from saltus.continuation.results.special_points import SpecialPoint
from saltus.errors import ConvergenceError, InputError
from saltus.flow.formulas import Observable, read_formula
from saltus.flow.observables import angles, estimate, observe
from saltus.orbits import PeriodicOrbit
from saltus.orbits.exactness import solved
from saltus.orbits.observables.observed import planned
from saltus.orbits.observables.outputs import curved
from saltus.orbits.observables.sampling import motion_of
from saltus.orbits.observables.sensitivities import sensitivities
from saltus.orbits.orbit import orbit_at
from saltus.orbits.problem import OrbitProblem, follow_from
from saltus.orbits.signature import Signature
from saltus.orbits.unfolding import Fixed
from saltus.result import frozen
from saltus.scales import FINEST

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["OrbitColumns"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OrbitColumns(SolutionCurve[PeriodicOrbit]):
    """Orbits in order along a curve, their properties, and special points, without files.

    Attributes
    ----------
    x0 : ndarray, shape (point, state)
        State at phase 0, or at the first segment's start.
    multipliers : ndarray of complex, shape (point, multiplier)
        Floquet multipliers; infinite at a grazing.
    admissible : ndarray of bool, shape (point,)
        Whether the orbit is a motion of the system.
    period : ndarray, shape (point,)
        Period.
    lows, highs : ndarray, shape (point, all states + outputs)
        Extremes over the period, in the order of `quantities`.
    means, harmonics : ndarray, shape (point, all states + outputs)
        Means over the period; first harmonics as a exp(i phi) of a sin(theta + phi), complex.
    forms : tuple of Signature
        The signatures that occur.
    form : ndarray of int, shape (point,)
        Index of each point's signature in `forms`.
    unknowns : tuple of ndarray
        States and durations of each point's segments, as `OrbitProblem` orders them.
    tolerance : float
        Relative tolerance of the flow.
    implicit : ndarray of bool, shape (point,)
        Whether the flow is stiff there, and was followed by implicit steps.
    """

    x0: NDArray[np.float64]
    multipliers: NDArray[np.complex128]
    admissible: NDArray[np.bool_]
    period: NDArray[np.float64]
    lows: NDArray[np.float64]
    highs: NDArray[np.float64]
    means: NDArray[np.float64]
    harmonics: NDArray[np.complex128]
    forms: tuple[Signature, ...]
    form: NDArray[np.int64]
    unknowns: tuple[NDArray[np.float64], ...]
    implicit: NDArray[np.bool_]
    tolerance: float = 1e-12

    counted = "orbits"
    fault = "not admissible"
    sound_called = "admissible"
    kinds = SolutionCurve.kinds | {
        **dict.fromkeys(("x0", "period", "lows", "highs", "means"), np.float64),
        **dict.fromkeys(("multipliers", "harmonics"), np.complex128),
        "form": np.int64,
        **dict.fromkeys(("admissible", "implicit"), np.bool_),
    }

    @property
    def sound(self) -> NDArray[np.bool_]:
        """See `SolutionCurve.sound`: `admissible`."""
        return self.admissible

    def _described(self, what: str) -> str:
        """See `SolutionCurve._described`: a word of orbits with implicit steps is added."""
        title, *lines = super()._described(what).split("\n")
        stiff = f"  stiff: {int(self.implicit.sum())} orbits by implicit steps"
        return "\n".join([title, *([stiff] if self.implicit.any() else []), *lines])

    @property
    def extremes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `SolutionCurve.extremes`."""
        n = len(self.system.states)
        return self.lows[:, :n], self.highs[:, :n]

    @property
    def equations(self) -> NDArray[np.int64]:
        """See `SolutionCurve.equations`: `form`."""
        return self.form

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of all states and outputs, in the order of `lows` and `highs`."""
        return (*self.system.all_states, *self.system.output_names)

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a quantity along the curve.

        Parameters
        ----------
        name : str
            A varied parameter, ``period``, ``arclength``, a state (its value at phase 0), or an observable as `observe`
            takes it. An extreme is ``min_`` or ``max_`` and a state or output. A locus has ``angle`` and
            ``coefficient`` too.

        Returns
        -------
        ndarray, shape (point,)
            In the units of the definition.

        Raises
        ------
        InputError
            A quantity of another name.
        """
        if isinstance(name, str) and not name.isidentifier():
            return self._observed(name)
        table = self.values.reshape(len(self), -1)
        declared: dict[str, Any] = {parameter: table[:, i] for i, parameter in enumerate(self.varied)}
        columns: dict[str, Any] = declared | {"period": self.period, "arclength": self.arclength}
        columns |= self._own_columns()
        declared |= {state: self.x0[:, i] for i, state in enumerate(self.system.states)}
        columns |= declared
        columns |= {f"min_{q}": self.lows[:, i] for i, q in enumerate(self.quantities)}
        columns |= {f"max_{q}": self.highs[:, i] for i, q in enumerate(self.quantities)}
        if self.system.phase is not None:
            for side in ("min", "max"):
                columns.pop(f"{side}_{self.system.phase[0]}")
        columns |= declared
        instead = f", or an observable, as in 'mean({self.quantities[0]})'"
        known = checks.chosen("quantity", name, columns, instead=instead)
        if known[:4] in ("min_", "max_") and known[4:] in curved(self.system):
            return self._extremes(known[:3], known[4:])
        found: NDArray[np.float64] = columns[known]
        return found

    def observe(self, *names: str, errors: bool = False) -> xr.Dataset:
        """Return observables of the orbits, against ``point``.

        A phase is continuous along the curve. Each observable is computed once.

        Parameters
        ----------
        *names : str
            As in ``"amplitude(z, 1)"`` or ``"fraction(contact)"``; `saltus.flow.observables` lists them.
        errors : bool, optional
            Whether estimates of the errors are returned as well, in variables ``"error of mean(z)"``.

        Returns
        -------
        xarray.Dataset
            A variable for each observable, and the varied parameters as coordinates.

        Raises
        ------
        InputError
            A name that is no observable.
        """
        from saltus.extras import xr

        self._observe(names)
        table = self.values.reshape(len(self), -1)
        coords = {parameter: ("point", table[:, i]) for i, parameter in enumerate(self.varied)}
        columns = {name: ("point", self._observed(name)) for name in names}
        if errors:
            rows = [estimate(motion_of(*self._solved(i)), names) for i in range(len(self))]
            for name in names:
                turn, values = read_formula(self.system, name).turn, self._observed(name)
                off = np.array([row[name].value for row in rows]) - values
                off = off - turn * np.round(off / turn) if turn else off
                found = np.array([row[name].error for row in rows])
                columns[f"error of {name}"] = ("point", np.maximum(found, np.abs(off)))
        return xr.Dataset(columns, coords)

    @cached_property
    def _observations(self) -> dict[str, NDArray[np.float64]]:
        return {}

    def _observed(self, name: str) -> NDArray[np.float64]:
        self._observe((name,))
        return self._observations[name]

    def _observe(self, names: Sequence[str]) -> None:
        """Compute the observables that are not known yet."""
        formulas = {name: read_formula(self.system, name) for name in names}
        parts = {part: known for formula in formulas.values() for part, known in formula.parts.items()}
        columns = {part: self._surveyed(known) for part, known in parts.items() if part not in self._observations}
        if missing := [part for part, column in columns.items() if column is None]:
            rows = [observe(motion_of(*self._solved(i)), missing) for i in range(len(self))]
            columns |= {part: np.array([row[part] for row in rows]) for part in missing}
        for part, column in columns.items():
            assert column is not None
            if turn := read_formula(self.system, part).turn:
                known = np.isfinite(column)
                column[known] = np.unwrap(column[known], period=turn)
            self._observations[part] = frozen(column)
        table = self.values.reshape(len(self), -1)
        parameters = {"period": self.period, **self.parameters, **dict(zip(self.varied, table.T, strict=True))}
        for name, formula in formulas.items():
            values = np.broadcast_to(formula.value(self._observations, parameters), (len(self),))
            self._observations[name] = frozen(values)

    def _surveyed(self, observable: Observable) -> NDArray[np.float64] | None:
        """Return an observable that each point was surveyed for; None of others."""
        kind, quantities = observable.kind, self.quantities
        if kind == "fraction":
            return self._fractions(self.system.mode_names.index(observable.of))
        if observable.of not in quantities or (observable.order or 1) != 1:
            return None
        i = quantities.index(observable.of)
        if kind in ("min", "max"):
            return self._extremes(kind, observable.of)
        if observable.of in curved(self.system):
            return None  # the survey's few places tell means of states and polynomials alone
        if kind == "mean":
            return np.array(self.means[:, i])
        harmonic = self.harmonics[:, i]
        return np.abs(harmonic) if kind == "amplitude" else angles(harmonic)

    def _extremes(self, kind: str, quantity: str) -> NDArray[np.float64]:
        """Return the least or greatest values, ``min`` or ``max``; those of outputs with peaks are sought."""
        if quantity not in curved(self.system):
            return np.array((self.lows if kind == "min" else self.highs)[:, self.quantities.index(quantity)])
        if f"{kind}({quantity})" not in self._observations:
            both = np.array([[orbit.min[quantity], orbit.max[quantity]] for orbit in self]).reshape(-1, 2)
            for side, column in zip(("min", "max"), both.T, strict=True):
                self._observations[f"{side}({quantity})"] = frozen(column)
        return self._observations[f"{kind}({quantity})"]

    def _fractions(self, mode: int) -> NDArray[np.float64]:
        """Return the share of the period that each orbit spends in a mode."""
        wide, shares = len(self.system.all_states) + 1, np.empty(len(self))
        for i, (form, u) in enumerate(zip(self.form.tolist(), self.unknowns, strict=True)):
            durations = u[wide - 1 :: wide]
            shares[i] = durations[np.array(self.forms[form].modes) == mode].sum() / durations.sum()
        return shares

    def value_at(self, point: SpecialPoint, name: str) -> float:
        """Return the quantity that `column` names at a special point.

        Parameters
        ----------
        point : SpecialPoint
            One of the curve's.
        name : str
            As `column` takes it.

        Returns
        -------
        float
            In the units of the definition.

        Raises
        ------
        InputError
            A quantity of another name, or no special point.
        """
        orbit = checks.instance("point", point, SpecialPoint).orbit
        checks.text("quantity", name, "the name of a quantity")
        if name.startswith(("min_", "max_")) and name[4:] in self.quantities:
            if self.system.phase is not None and name[4:] == self.system.phase[0]:
                return float((orbit.lows if name[:3] == "min" else orbit.highs)[self.quantities.index(name[4:])])
            return (orbit.min if name[:3] == "min" else orbit.max)[name[4:]]
        if name in self.varied or name in orbit.parameters:
            return point.value(name)
        if name == "period":
            return orbit.period
        if name in self.system.states:
            return float(orbit.x0[self.system.states.index(name)])
        if name == "arclength":
            return point.arclength
        nearby = float(np.interp(point.arclength, self.arclength, self.column(name)))
        if name.isidentifier():
            return nearby
        value, turn = orbit.observe(name)[name], read_formula(self.system, name).turn
        return value + turn * round((nearby - value) / turn) if turn and np.isfinite(nearby - value) else value

    def sensitivity(self, names: Sequence[str], parameters: Sequence[str] | None = None) -> xr.Dataset:
        """Return exact derivatives of observables by parameters at every point; see docs/theory/sensitivities.md.

        Parameters
        ----------
        names : sequence of str
            As `PeriodicOrbit.sensitivity` takes them, but for ``"multipliers"`` and ``"segments"``.
        parameters : sequence of str, optional
            All parameters of the system by default.

        Returns
        -------
        xarray.Dataset
            One variable for each observable along ``point`` and ``parameter``; the varied parameters and ``note`` along
            ``point``. Each derivative is that of the point's orbit, all other parameters fixed. Where none exists it is
            NaN, and ``note`` says why.

        Raises
        ------
        InputError
            A name is no observable, or no parameter.
        """
        from saltus.extras import xr

        names, known = checks.names("names", names, "observables"), self.system.parameter_names
        planned(self.system, names)
        wanted = known if parameters is None else checks.names("parameters", parameters, "names of parameters")
        active = [known.index(checks.chosen("parameters", name, known)) for name in wanted]
        slopes, notes = np.full((len(names), len(self), len(active)), np.nan), np.full(len(self), "", dtype=object)
        for i in range(len(self)):
            try:
                found = sensitivities(*self._solved(i, active), names).values
            except (InputError, ConvergenceError) as error:
                notes[i] = str(error)
                continue
            slopes[:, i] = [found[name].slopes for name in names]
            notes[i] = "; ".join(f"{name}: {one.note}" for name, one in found.items() if one.note)
        each = zip(self.varied, self.values.reshape(len(self), -1).T, strict=True)
        coordinates: dict[str, Any] = {name: ("point", values) for name, values in each}
        coordinates |= {"parameter": list(wanted), "note": ("point", notes)}
        return xr.Dataset({name: (("point", "parameter"), slopes[j]) for j, name in enumerate(names)}, coordinates)

    def signature(self, index: int) -> tuple[tuple[str, str], ...]:
        """Return the (mode, transition) names of a point's segments.

        Parameters
        ----------
        index : int
            The point; negative ones count from the end.

        Returns
        -------
        tuple of (str, str)
            One for each segment, in order.

        Raises
        ------
        InputError
            There is no such point.
        """
        form: Signature = self.forms[self.form[self._place(index)]]
        return form.names(self.system)

    def _solution(self, index: int) -> PeriodicOrbit:
        problem, u = self._solved(index)
        values = self._known(index, problem)
        return orbit_at(problem, u, problem.resolve(u)[1], values=values, fixed=self._fixed(index))

    def _known(self, index: int, problem: OrbitProblem) -> NDArray[np.complex128] | None:
        """Return the multipliers of a point's orbit where the curve knows more of them than the orbit tells.

        Of a cycle that is cut they come with the flow's directions, which the field does not give at an equilibrium.
        """
        return self.multipliers[index] if problem.signature.is_cut else None

    def _fixed(self, index: int) -> Fixed | None:
        """Return what is fixed of one point's orbit, and what is freed; None along parameters."""
        return None

    def _solved(self, index: int, active: Sequence[int] = ()) -> tuple[OrbitProblem, NDArray[np.float64]]:
        """Return the equations of one point's orbit, some parameters active, meshes made, and their solution."""
        p, form = self.system.parameter_vector(self._parameters_at(index)), self.forms[self.form[index]]
        u = np.append(self.unknowns[index], p[list(active)])
        sizes = np.maximum(np.abs(self.lows), np.abs(self.highs))[:, : len(self.system.states)].max(axis=0)
        # where the curve's tolerance could not tell, its points were computed at the finest one
        for tol in sorted({min(self.tolerance, FINEST), self.tolerance}):
            problem = OrbitProblem(self.system, form, p, active, np.ones(len(active)), tol)
            follow_from(problem, u, sizes)
            if tol == self.tolerance or solved(problem, u):
                break
        return problem, u
