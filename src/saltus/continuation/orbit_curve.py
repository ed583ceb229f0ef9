"""A curve of periodic orbits as a result, along one parameter or two, with its special points."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.continuation.curve_files import (
    column_name,
    complex_table,
    described,
    ragged_rows,
    special_points_of,
    special_variables,
)
from saltus.continuation.special_points import SpecialPoint, SpecialPoints
from saltus.errors import InputError
from saltus.flow.observables import check_observables, observe, read_observable
from saltus.orbits import PeriodicOrbit
from saltus.orbits.orbit import TOLERANCES, follow_from, orbit_at, signature_from
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.sampling import motion_of
from saltus.orbits.signature import Signature
from saltus.orbits.unfolding import Fixed, read_fixed
from saltus.results import Result, frozen
from saltus.system import HybridSystem
from saltus.system.plain import held_parameters, held_system

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["OrbitCurve"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OrbitCurve(Result):
    """Orbits in order along a curve, their properties, and special points: the base of `Branch` and `Locus`.

    Attributes
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float
        All parameters at the start.
    values : ndarray
        The varied parameters: shape (point,) for one, (point, parameter) for more.
    x0 : ndarray, shape (point, state)
        State at phase 0, or at the first segment's start.
    multipliers : ndarray of complex, shape (point, multiplier)
        Floquet multipliers; infinite at a grazing.
    stable, admissible : ndarray of bool, shape (point,)
        Whether the orbit is stable, and whether it is a motion of the system.
    period, residual, arclength : ndarray, shape (point,)
        Period, residual of the equations, and arclength from the first point.
    lows, highs : ndarray, shape (point, all states + outputs)
        Extremes over the period, in the order of `quantities`.
    forms : tuple of Signature
        The signatures that occur.
    form : ndarray of int, shape (point,)
        Index of each point's signature in `forms`.
    unknowns : tuple of ndarray
        States and durations of each point's segments, as `OrbitProblem` orders them.
    special_points : SpecialPoints
        In order along the curve; ``curve["SN1"]`` is one of them.
    stopped : tuple of str
        Why the curve ended, at its first and at its last point.
    rejected : tuple of str
        Rejected steps, with their reasons.
    options : mapping
        Arguments of the continuation.
    tolerance : float
        Relative tolerance of the flow.
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    values: NDArray[np.float64]
    x0: NDArray[np.float64]
    multipliers: NDArray[np.complex128]
    stable: NDArray[np.bool_]
    admissible: NDArray[np.bool_]
    period: NDArray[np.float64]
    residual: NDArray[np.float64]
    arclength: NDArray[np.float64]
    lows: NDArray[np.float64]
    highs: NDArray[np.float64]
    forms: tuple[Signature, ...]
    form: NDArray[np.int64]
    unknowns: tuple[NDArray[np.float64], ...]
    special_points: SpecialPoints
    stopped: tuple[str, str]
    rejected: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    tolerance: float = 1e-12

    def __post_init__(self) -> None:
        reals = ("values", "x0", "period", "residual", "arclength", "lows", "highs")
        kinds: dict[str, Any] = dict.fromkeys(reals, np.float64)
        kinds |= {"multipliers": np.complex128, "form": np.int64, "stable": np.bool_, "admissible": np.bool_}
        for name, kind in kinds.items():
            object.__setattr__(self, name, frozen(getattr(self, name), kind))

    @property
    @abstractmethod
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that vary."""

    @abstractmethod
    def _own_columns(self) -> dict[str, NDArray[np.float64]]:
        """Return the columns, shape (point,) each, that only this kind of curve has."""

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, label: str) -> SpecialPoint:
        """Return the special point of that label."""
        known = {point.label: point for point in self.special_points}
        return known[checks.chosen("label", label, known)]

    def __iter__(self) -> Iterator[PeriodicOrbit]:
        """Go through the orbits of all points."""
        return (self.orbit(i) for i in range(len(self)))

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
        if isinstance(name, str) and "(" in name:
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
        found: NDArray[np.float64] = columns[checks.chosen("quantity", name, columns, instead=instead)]
        return found

    def observe(self, *names: str) -> xr.Dataset:
        """Return observables of the orbits, against ``point``.

        A phase is continuous along the curve. Each observable is computed once.

        Parameters
        ----------
        *names : str
            As in ``"amplitude(z, 1)"`` or ``"fraction(contact)"``; `saltus.flow.observables` lists them.

        Returns
        -------
        xarray.Dataset
            A variable for each observable, and the varied parameters as coordinates.

        Raises
        ------
        InputError
            A name that is no observable.
        """
        import xarray as xr

        self._observe(names)
        table = self.values.reshape(len(self), -1)
        coords = {parameter: ("point", table[:, i]) for i, parameter in enumerate(self.varied)}
        return xr.Dataset({name: ("point", self._observed(name)) for name in names}, coords)

    @cached_property
    def _observations(self) -> dict[str, NDArray[np.float64]]:
        return {}

    def _observed(self, name: str) -> NDArray[np.float64]:
        self._observe((name,))
        return self._observations[name]

    def _observe(self, names: Sequence[str]) -> None:
        """Compute the observables that are not known yet."""
        check_observables(self.system, names)
        wanted = [name for name in dict.fromkeys(names) if name not in self._observations]
        if not wanted:
            return
        rows = [observe(motion_of(*self._solved(i)), wanted) for i in range(len(self))]
        for name in wanted:
            column = np.array([row[name] for row in rows])
            if turn := self._turn(name):
                known = np.isfinite(column)
                column[known] = np.unwrap(column[known], period=turn)
            self._observations[name] = frozen(column)

    def _turn(self, name: str) -> float:
        """Return the angle up to which a phase is defined, in radians; 0.0 where the observable is no phase."""
        observable = read_observable(self.system, name)
        return 2.0 * np.pi / observable.order.denominator if observable.kind == "phase" and observable.order else 0.0

    def at(self, point: SpecialPoint, name: str) -> float:
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
            source = orbit.lows if name.startswith("min_") else orbit.highs
            return float(source[self.quantities.index(name[4:])])
        if name in self.varied or name in orbit.parameters:
            return point.value(name)
        if name == "period":
            return orbit.period
        if name in self.system.states:
            return float(orbit.x0[self.system.states.index(name)])
        if name == "arclength":
            return point.arclength
        nearby = float(np.interp(point.arclength, self.arclength, self.column(name)))
        if "(" not in name:
            return nearby
        value, turn = orbit.observe(name)[name], self._turn(name)
        return value + turn * round((nearby - value) / turn) if turn and np.isfinite(nearby - value) else value

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
        form: Signature = self.forms[self.form[checks.count("index", index, -len(self), len(self) - 1)]]
        return form.names(self.system)

    def orbit(self, index: int) -> PeriodicOrbit:
        """Return the orbit of one point, from which another continuation can start.

        Parameters
        ----------
        index : int
            The point; negative ones count from the end.

        Returns
        -------
        PeriodicOrbit
            With meshes of its own, made from the point's unknowns.

        Raises
        ------
        InputError
            There is no such point.
        """
        index = checks.count("index", index, -len(self), len(self) - 1)
        problem, u = self._solved(index)
        return orbit_at(problem, u, problem.resolve(u)[1], fixed=self._fixed(index))

    def _parameters(self, index: int) -> dict[str, float]:
        """Return all parameters of one point's orbit."""
        return {**self.parameters, **dict(zip(self.varied, np.atleast_1d(self.values[index]).tolist(), strict=True))}

    def _fixed(self, index: int) -> Fixed | None:
        """Return what is fixed of one point's orbit, and what is freed; None along parameters."""
        return None

    def _solved(self, index: int) -> tuple[OrbitProblem, NDArray[np.float64]]:
        """Return the equations of one point's orbit, meshes made, and their solution."""
        p = self.system.parameter_vector(self._parameters(index))
        problem = OrbitProblem(self.system, self.forms[self.form[index]], p, tol=self.tolerance)
        u = np.array(self.unknowns[index])
        states = len(self.system.states)
        follow_from(problem, u, np.maximum(np.abs(self.lows), np.abs(self.highs))[:, :states].max(axis=0))
        return problem, u

    def to_xarray(self) -> xr.Dataset:
        """Return the curve as a Dataset: points against ``point``, special points against ``special``."""
        import xarray as xr

        signatures = [form.names(self.system) for form in self.forms]
        written = [" -> ".join(f"{mode}:{transition}" for mode, transition in names) for names in signatures]
        n = len(self.system.all_states)
        table = self.values.reshape(len(self), -1)
        data: dict[str, Any] = {name: ("point", values) for name, values in self._own_columns().items()}
        data |= {
            "x0": (("point", "state"), self.x0),
            "multiplier_re": (("point", "multiplier"), self.multipliers.real),
            "multiplier_im": (("point", "multiplier"), self.multipliers.imag),
            "stable": ("point", self.stable.astype(np.int8)),
            "admissible": ("point", self.admissible.astype(np.int8)),
            "period": ("point", self.period),
            "residual": ("point", self.residual),
            "arclength": ("point", self.arclength),
            "form": ("point", self.form),
            "signature": ("point", np.array([written[form] for form in self.form.tolist()], dtype=object)),
            "unknown": ("ragged", np.concatenate([*self.unknowns, np.empty(0)])),
            "unknown_count": ("point", np.array([len(u) for u in self.unknowns], dtype=np.int64)),
        }
        skip = None if self.system.phase is None else self.system.phase[0]
        for i, q in enumerate(self.quantities):
            if q != skip:
                data[f"min_{q}"] = ("point", self.lows[:, i])
                data[f"max_{q}"] = ("point", self.highs[:, i])
        data |= {"lows": (("point", "quantity"), self.lows), "highs": (("point", "quantity"), self.highs)}
        forms = list(dict.fromkeys([*self.forms, *(point.orbit.form for point in self.special_points)]))
        data |= special_variables(self.special_points, self.varied, self.multipliers.shape[1], forms, self.system)
        coords = {
            "state": list(self.system.states),
            "quantity": list(self.quantities),
            "parameter": list(self.varied),
        }
        taken = {*data, *coords, *(dim for dims, *_ in data.values() for dim in np.atleast_1d(dims))}
        columns = [column_name(name, taken) for name in self.varied]
        data = {column: ("point", table[:, i]) for i, column in enumerate(columns)} | data
        attrs = {
            "varied": json.dumps(list(self.varied)),
            "columns": json.dumps(columns),
            "parameters": json.dumps(dict(self.parameters)),
            "definition": json.dumps(self.system.definition()),
            "forms": json.dumps([[f.modes, f.transitions, f.kinds, f.turns] for f in forms]),
            "signatures": json.dumps(signatures),
            "n_forms": len(self.forms),
            "stopped_first": self.stopped[0],
            "stopped_last": self.stopped[1],
            "rejected": json.dumps(list(self.rejected)),
            "options": json.dumps(dict(self.options)),
            "tolerance": self.tolerance,
            "ragged": f"unknown: unknown_count numbers for each point: state ({n}) and duration of each segment",
        }
        return xr.Dataset(data, coords=coords, attrs=attrs)

    @classmethod
    def _varied_columns(cls, held: Contents) -> list[NDArray[np.float64]]:
        """Return the values of the varied parameters, shape (point,) each, as `to_xarray` described them."""
        columns = held.texts("columns" if "columns" in held.dataset.attrs else "varied")  # absent from earlier files
        if len(columns) != len(held.texts("varied")):
            raise InputError("attribute 'columns'", columns, "one for each varied parameter")
        return [held.array(column, ("point",)) for column in columns]

    @classmethod
    @abstractmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...]) -> dict[str, Any]:
        """Return the fields that only this kind of curve has, and `values`, as `to_xarray` described them."""

    @classmethod
    def _read(cls, held: Contents) -> Self:
        point = ("point",)
        system = held_system(held)
        parameters, varied = held_parameters(held, system), tuple(held.texts("varied"))
        fixed = read_fixed(held, system)
        known = system.parameter_names if fixed is None else (fixed.quantity,)
        if not varied or len(set(varied)) < len(varied) or not set(varied) <= set(known):
            raise InputError("attribute 'varied'", varied, f"of {', '.join(known)}")
        quantities = (*system.all_states, *system.output_names)
        for name, wanted in (("state", system.states), ("quantity", quantities), ("parameter", varied)):
            held.names(name, wanted)
        held.expect(multiplier=len(system.states))
        held.size("point")
        forms = [signature_from(form) for form in held.json("forms", list)]
        for form in forms:
            form.check(system)
        n_forms = held.count("n_forms", most=len(forms))
        number = held.array("form", point, int, least=0, most=n_forms - 1)
        wide, tolerance = len(system.all_states) + 1, held.number("tolerance", *TOLERANCES)
        points = special_points_of(held, system, (parameters, varied, fixed), forms, tolerance)
        return cls(
            system=system,
            parameters=parameters,
            x0=held.array("x0", ("point", "state")),
            multipliers=complex_table(held, "multiplier", ("point", "multiplier")),
            stable=held.array("stable", point, bool),
            admissible=held.array("admissible", point, bool),
            period=held.array("period", point),
            residual=held.array("residual", point, finite=False),
            arclength=held.array("arclength", point, finite=False),
            lows=held.array("lows", ("point", "quantity"), finite=False),
            highs=held.array("highs", ("point", "quantity"), finite=False),
            forms=tuple(forms[:n_forms]),
            form=number,
            unknowns=ragged_rows(held, "unknown", "ragged", "point", [len(forms[i]) * wide for i in number.tolist()]),
            special_points=SpecialPoints(points, varied),
            stopped=(held.text("stopped_first"), held.text("stopped_last")),
            rejected=tuple(held.texts("rejected")),
            options=held.json("options", dict),
            tolerance=tolerance,
            **cls._own_fields(held, varied),
        )

    def _described(self, what: str) -> str:
        """Return the text of a `repr`: kind, range, ends and special points."""
        return described(self, what, "orbits")
