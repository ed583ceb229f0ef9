"""A curve of periodic orbits, along one parameter or two, and its special points."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self, overload

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.errors import InputError
from saltus.flow.observables import check_observables, observe, read_observable
from saltus.orbits import PeriodicOrbit
from saltus.orbits.normal_form import NORMAL_FORMS, NormalForm, normal_form
from saltus.orbits.orbit import MOST_FAULTS, TOLERANCES, complex_of, follow_from, orbit_at, signature_from
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.sampling import motion_of
from saltus.orbits.signature import Signature
from saltus.results import Result, frozen
from saltus.system import HybridSystem
from saltus.system.plain import all_parameters, held_parameters, held_system

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["OrbitCurve", "SpecialPoint", "SpecialPoints"]

_MEANING = {
    "SN": "saddle-node (fold)",
    "PD": "period doubling (flip)",
    "TR": "torus (Neimark-Sacker)",
    "BP": "branch point",
    "GR": "grazing",
    "HB": "Hopf: the cycle shrinks to an equilibrium",
    "CP": "cusp",
    "GPD": "generalised period doubling",
    "CH": "Chenciner",
    "R1": "strong resonance 1:1",
    "R2": "strong resonance 1:2",
    "R3": "strong resonance 1:3",
    "R4": "strong resonance 1:4",
    "FF": "fold-flip",
    "TP": "turning point of a parameter",
}


@dataclass(frozen=True, eq=False, repr=False)
class SpecialPoint:
    """A special point of a branch or of a locus, located.

    Attributes
    ----------
    type : str
        On a branch ``SN``, ``PD``, ``TR``, ``BP``, ``GR``, ``HB`` or the name of a user's event; on a locus ``CP``,
        ``GPD``, ``CH``, ``R1`` to ``R4``, ``FF``, ``SN``, ``PD``, ``TR``, ``GR`` or ``BP`` (where another locus meets
        it) and ``TP`` (where a parameter turns); `Locus` tells more.
    label : str
        The type with its number along the curve, as in ``SN1``.
    orbit : PeriodicOrbit
        The orbit there; its parameters are those of the point.
    test : float
        Test function there: the parameter's component of the tangent (SN, TP), ``mu + 1`` (PD), ``|mu|^2 - 1`` (TR),
        the determinant over its size nearby (BP, FF), the normal velocity or the distance from the surface (GR), the
        coefficient of the normal form over its size nearby (CP, GPD, CH), the amplitude (HB), the cosine of the
        multipliers' angle less that of the resonance (R1 to R4), the distance from the wanted value (users' events).
    position : float
        Where among the curve's points: 3.5 lies between points 3 and 4.
    arclength : float
        Arclength there, as the curve's `arclength` counts it.
    varied : tuple of str
        The parameters along which it was found.
    of : str
        What the type leaves open: of a turning point the parameter that turns; where a GR locus meets another, on which
        side of the grazing (``smaller`` or ``larger`` signature).
    locus : str
        The type of the locus on which it was found; empty on a branch.
    tangent : ndarray, shape (unknowns + 1,), or None
        At a branch point the tangent of the branch on which it was found, the parameter last.
    """

    type: str
    label: str
    orbit: PeriodicOrbit
    test: float
    position: float
    arclength: float
    varied: tuple[str, ...]
    of: str = ""
    locus: str = ""
    tangent: NDArray[np.float64] | None = None

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters there."""
        return self.orbit.parameters

    @property
    def sizes(self) -> NDArray[np.float64] | None:
        """Sizes of the states along the branch, by its tangent where there is one: an orbit at rest has none itself."""
        if self.tangent is None:
            return None
        wide = len(self.orbit.system.all_states) + 1
        states = np.abs(self.tangent[:-1].reshape(-1, wide)).max(axis=0)
        return np.asarray(states[: len(self.orbit.system.states)])

    @cached_property
    def normal_form(self) -> NormalForm:
        """Normal form of the Poincare map at an SN, PD or TR: computed when first asked for.

        Raises
        ------
        InputError
            The point is of another type.
        """
        if self.type not in NORMAL_FORMS:
            raise InputError("type", self.type, f"one of {', '.join(NORMAL_FORMS)}", "no normal form belongs to it")
        return normal_form(self.orbit, self.type)

    def __repr__(self) -> str:
        meaning = f", {_MEANING[self.type]}" if self.type in _MEANING else ""
        of = f" of {self.of}" if self.of else ""
        return f"SpecialPoint {self.label}{meaning}{of}, test function {self.test:.2g}\n{self.orbit!r}"


class SpecialPoints(Sequence[SpecialPoint]):
    """Special points in their order along a curve."""

    def __init__(self, points: Sequence[SpecialPoint], parameters: tuple[str, ...]) -> None:
        self._points = tuple(points)
        self._parameters = parameters

    @overload
    def __getitem__(self, index: int) -> SpecialPoint: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[SpecialPoint]: ...
    def __getitem__(self, index: int | slice) -> SpecialPoint | Sequence[SpecialPoint]:
        return self._points[index]

    def __len__(self) -> int:
        return len(self._points)

    def __iter__(self) -> Iterator[SpecialPoint]:
        return iter(self._points)

    def of_type(self, *types: str) -> list[SpecialPoint]:
        """Return the points of the given types."""
        return [point for point in self._points if point.type in types]

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table: label, type, parameters, stability, signature, x0, extremes, test function."""
        import pandas as pd

        rows = []
        for p in self._points:
            row: dict[str, Any] = {"label": p.label, "type": p.type}
            row |= {"of": p.of} if len(self._parameters) > 1 else {}
            row |= {name: p.parameters[name] for name in self._parameters}
            row |= {f"x0_{name}": value for name, value in zip(p.orbit.system.states, p.orbit.x0, strict=True)}
            row |= {f"min_{name}": value for name, value in p.orbit.min.items()}
            row |= {f"max_{name}": value for name, value in p.orbit.max.items()}
            row |= {
                "period": p.orbit.period,
                "stable": p.orbit.stable,
                "signature": p.orbit.signature,
                "admissible": p.orbit.admissible,
            }
            rows.append(row | {"test": p.test})
        return pd.DataFrame(rows)

    def __repr__(self) -> str:
        lines = []
        for p in self._points:
            values = ", ".join(f"{name} = {p.parameters[name]:.12g}" for name in self._parameters)
            lines.append(f"{p.label:5s} {values}" + (f" ({p.of})" if p.of else ""))
        return "\n".join(lines) or "no special points"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OrbitCurve(Result):
    """What `Branch` and `Locus` share: orbits in their order, with what is known of each, and special points.

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
    period, residual, arclength : ndarray, shape (point,)
    lows, highs : ndarray, shape (point, all states + outputs)
        Extremes over the period.
    forms : tuple of Signature
        The signatures that occur.
    form : ndarray of int, shape (point,)
        Which of `forms` each point has.
    unknowns : tuple of ndarray
        States and durations of each point's segments, as `OrbitProblem` orders them.
    special_points : SpecialPoints
        In order along the curve; ``curve["SN1"]`` is one of them.
    stopped : tuple of str
        Why the curve ended, at its first and at its last point.
    rejected : tuple of str
        Steps that were not taken, with their reasons.
    options : mapping
        What was asked for.
    tol : float
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
    tol: float = 1e-12

    def __post_init__(self) -> None:
        for name in ("values", "x0", "period", "residual", "arclength", "lows", "highs"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "multipliers", frozen(self.multipliers, np.complex128))
        object.__setattr__(self, "form", frozen(self.form, np.int64))
        for name in ("stable", "admissible"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.bool_))

    @property
    @abstractmethod
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that vary."""

    @abstractmethod
    def _own_columns(self) -> dict[str, NDArray[np.float64]]:
        """Return what this kind of curve knows of each point beyond what all know."""

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
        """Return a quantity along the curve, shape (point,).

        Parameters
        ----------
        name : str
            A varied parameter, ``period``, ``arclength``, a state (its value at phase 0), ``min_`` or ``max_`` and a
            state or output, or an observable as `observe` takes it; of a locus also ``angle`` and ``coefficient``.

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

        A phase runs on along the curve, without jumps. An observable that is asked for again is not computed again.

        Parameters
        ----------
        *names : str
            As in ``"amplitude(z, 1)"`` or ``"fraction(contact)"``; `saltus.flow.observables` lists them.

        Returns
        -------
        xarray.Dataset
            A variable for each, and the varied parameters as coordinates.

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
        """Compute what is not known yet."""
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
        """Return the angle that a phase is known up to; 0.0 for what is no phase."""
        observable = read_observable(self.system, name)
        return 2.0 * np.pi / observable.order.denominator if observable.kind == "phase" and observable.order else 0.0

    def at(self, point: SpecialPoint, name: str) -> float:
        """Return the quantity that `column` names at a special point."""
        orbit = checks.instance("point", point, SpecialPoint).orbit
        checks.text("quantity", name, "the name of a quantity")
        if name.startswith(("min_", "max_")) and name[4:] in self.quantities:
            source = orbit.lows if name.startswith("min_") else orbit.highs
            return float(source[self.quantities.index(name[4:])])
        if name in self.varied:
            return orbit.parameters[name]
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
        """Return the (mode, transition) names of a point's segments."""
        form: Signature = self.forms[self.form[checks.count("index", index, -len(self), len(self) - 1)]]
        return form.names(self.system)

    def orbit(self, index: int) -> PeriodicOrbit:
        """Return the orbit of one point, from which another continuation can start."""
        index = checks.count("index", index, -len(self), len(self) - 1)
        problem, u = self._solved(index)
        return orbit_at(problem, u, problem.resolve(u)[1])

    def _solved(self, index: int) -> tuple[OrbitProblem, NDArray[np.float64]]:
        """Return the equations of one point's orbit, meshes made, and their solution."""
        row = np.atleast_1d(self.values[index]).tolist()
        values = dict(self.parameters) | dict(zip(self.varied, row, strict=True))
        p = self.system.parameter_vector(values)
        problem = OrbitProblem(self.system, self.forms[self.form[index]], p, tol=self.tol)
        u = np.array(self.unknowns[index])
        states = len(self.system.states)
        follow_from(problem, u, np.maximum(np.abs(self.lows), np.abs(self.highs))[:, :states].max(axis=0))
        return problem, u

    def to_xarray(self) -> xr.Dataset:
        """Return the curve as a Dataset: points against ``point``, special points against ``special``."""
        import xarray as xr

        names = [form.names(self.system) for form in self.forms]
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
            "signature": ("point", np.array([_written(names[form]) for form in self.form.tolist()], dtype=object)),
            "unknown": ("ragged", np.concatenate([*self.unknowns, np.empty(0)])),
            "unknown_count": ("point", np.array([len(u) for u in self.unknowns], dtype=np.int64)),
        }
        skip = None if self.system.phase is None else self.system.phase[0]
        for i, q in enumerate(self.quantities):
            if q != skip:
                data[f"min_{q}"] = ("point", self.lows[:, i])
                data[f"max_{q}"] = ("point", self.highs[:, i])
        data["lows"] = (("point", "quantity"), self.lows)
        data["highs"] = (("point", "quantity"), self.highs)
        forms = list(dict.fromkeys([*self.forms, *(point.orbit.form for point in self.special_points)]))
        data |= self._special_data(forms)
        coords = {
            "state": list(self.system.states),
            "quantity": list(self.quantities),
            "parameter": list(self.varied),
        }
        taken = {*data, *coords, *(dim for dims, *_ in data.values() for dim in np.atleast_1d(dims))}
        columns = [f"varied_{name}" if name in taken else name for name in self.varied]
        data = {column: ("point", table[:, i]) for i, column in enumerate(columns)} | data
        attrs = {
            "varied": json.dumps(list(self.varied)),
            "columns": json.dumps(columns),
            "parameters": json.dumps(dict(self.parameters)),
            "definition": json.dumps(self.system.definition()),
            "forms": json.dumps([[f.modes, f.transitions, f.kinds, f.turns] for f in forms]),
            "signatures": json.dumps(names),
            "n_forms": len(self.forms),
            "stopped_first": self.stopped[0],
            "stopped_last": self.stopped[1],
            "rejected": json.dumps(list(self.rejected)),
            "options": json.dumps(dict(self.options)),
            "tol": self.tol,
            "ragged": "unknown: the points' segments one after the other, unknown_count numbers each: "
            f"state ({n}) and duration of each segment",
        }
        return xr.Dataset(data, coords=coords, attrs=attrs)

    def _special_data(self, forms: list[Signature]) -> dict[str, Any]:
        specials = list(self.special_points)
        orbits = [point.orbit for point in specials]
        blocks = [orbit.unknowns for orbit in orbits]
        tangents = [np.empty(0) if point.tangent is None else point.tangent for point in specials]
        states, quantities = len(self.system.states), len(self.quantities)
        values = [[point.parameters[name] for name in self.varied] for point in specials]

        def stack(rows: list[Any], width: int) -> NDArray[np.float64]:
            return np.array(rows, dtype=np.float64).reshape(len(rows), width)

        width = self.multipliers.shape[1]
        return {
            "special_type": ("special", np.array([point.type for point in specials], dtype=object)),
            "special_label": ("special", np.array([point.label for point in specials], dtype=object)),
            "special_of": ("special", np.array([point.of for point in specials], dtype=object)),
            "special_locus": ("special", np.array([point.locus for point in specials], dtype=object)),
            "special_value": (("special", "parameter"), stack(values, len(self.varied))),
            "special_test": ("special", np.array([point.test for point in specials], dtype=float)),
            "special_arclength": ("special", np.array([point.arclength for point in specials], dtype=float)),
            "special_position": ("special", np.array([point.position for point in specials], dtype=float)),
            "special_x0": (("special", "state"), stack([o.x0 for o in orbits], states)),
            "special_multiplier_re": (("special", "multiplier"), stack([o.multipliers.real for o in orbits], width)),
            "special_multiplier_im": (("special", "multiplier"), stack([o.multipliers.imag for o in orbits], width)),
            "special_low": (("special", "quantity"), stack([o.lows for o in orbits], quantities)),
            "special_high": (("special", "quantity"), stack([o.highs for o in orbits], quantities)),
            "special_residual": ("special", np.array([o.residual for o in orbits], dtype=float)),
            "special_faults": ("special", np.array([o.faults for o in orbits], dtype=np.int64)),
            "special_form": ("special", np.array([forms.index(o.form) for o in orbits], dtype=np.int64)),
            "special_unknown": ("special_ragged", np.concatenate([*blocks, np.empty(0)])),
            "special_unknown_count": ("special", np.array([len(block) for block in blocks], dtype=np.int64)),
            "special_tangent": ("tangent_ragged", np.concatenate([*tangents, np.empty(0)])),
            "special_tangent_count": ("special", np.array([len(row) for row in tangents], dtype=np.int64)),
        }

    @classmethod
    def _varied_columns(cls, held: Contents) -> list[NDArray[np.float64]]:
        """Return the values of the varied parameters, shape (point,) each, as `to_xarray` described them."""
        columns = held.texts("columns" if "columns" in held.dataset.attrs else "varied")  # earlier files lack it
        if len(columns) != len(held.texts("varied")):
            raise InputError("attribute 'columns'", columns, "one for each varied parameter")
        return [held.array(column, ("point",)) for column in columns]

    @classmethod
    @abstractmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...]) -> dict[str, Any]:
        """Return the fields that only this kind of curve has, and `values`, as `to_xarray` described them."""

    @classmethod
    def from_xarray(cls, dataset: xr.Dataset) -> Self:
        """Return the curve that `to_xarray` described; raise `InputError` where it cannot be one."""
        held, point = Contents(dataset), ("point",)
        system = held_system(held)
        parameters, varied = held_parameters(held, system), tuple(held.texts("varied"))
        if not varied or len(set(varied)) < len(varied) or not set(varied) <= set(system.parameter_names):
            raise InputError("attribute 'varied'", varied, f"parameters, of {', '.join(system.parameter_names)}")
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
        wide, tol = len(system.all_states) + 1, held.number("tol", *TOLERANCES)
        options = held.json("options", dict)
        return cls(
            system=system,
            parameters=parameters,
            x0=held.array("x0", ("point", "state")),
            multipliers=_complex(held, "multiplier", ("point", "multiplier")),
            stable=held.array("stable", point, bool),
            admissible=held.array("admissible", point, bool),
            period=held.array("period", point),
            residual=held.array("residual", point, finite=False),
            arclength=held.array("arclength", point, finite=False),
            lows=held.array("lows", ("point", "quantity"), finite=False),
            highs=held.array("highs", ("point", "quantity"), finite=False),
            forms=tuple(forms[:n_forms]),
            form=number,
            unknowns=_split(held, "unknown", "ragged", "point", [len(forms[i]) * wide for i in number.tolist()]),
            special_points=SpecialPoints(_specials(held, system, parameters, varied, forms, tol), varied),
            stopped=(held.text("stopped_first"), held.text("stopped_last")),
            rejected=tuple(held.texts("rejected")),
            options=options,
            tol=tol,
            **cls._own_fields(held, varied),
        )

    def _described(self, what: str) -> str:
        """Return a few lines: what it is, how it began and ended, its special points."""
        lines = [
            f"{what} of {self.system.name or 'a hybrid system'}: {len(self)} orbits, {int(self.stable.sum())} stable"
        ]
        for name, column in zip(self.varied, self.values.reshape(len(self), -1).T, strict=True):
            low, high = (float(column.min()), float(column.max())) if len(self) else (np.nan, np.nan)
            lines[0] += f", {name} from {low:.9g} to {high:.9g}"
        lines += [f"  began: {self.stopped[0]}", f"  ended: {self.stopped[1]}"]
        lines += [f"  {line}" for line in repr(self.special_points).splitlines()]
        return "\n".join(lines)


def _written(signature: tuple[tuple[str, str], ...]) -> str:
    return " -> ".join(f"{mode}:{transition}" for mode, transition in signature)


def _specials(
    held: Contents,
    system: HybridSystem,
    parameters: Mapping[str, float],
    varied: tuple[str, ...],
    forms: list[Signature],
    tol: float,
) -> list[SpecialPoint]:
    """Return the special points in a curve's file."""
    special = ("special",)
    wide, number = len(system.all_states) + 1, held.array("special_form", special, int, least=0, most=len(forms) - 1)
    sizes = [len(forms[i]) * wide for i in number.tolist()]
    blocks = _split(held, "special_unknown", "special_ragged", "special", sizes)
    with_tangent = held.array("special_tangent_count", special, int, least=0) > 0
    lengths = [size + 1 if there else 0 for size, there in zip(sizes, with_tangent.tolist(), strict=True)]
    tangents = _split(held, "special_tangent", "tangent_ragged", "special", lengths)
    text = {name: held.array(f"special_{name}", special, str) for name in ("type", "label", "of", "locus")}
    real = {
        name: held.array(f"special_{name}", special, finite=False)
        for name in ("test", "position", "arclength", "residual")
    }
    values = held.array("special_value", ("special", "parameter"))
    multipliers = _complex(held, "special_multiplier", ("special", "multiplier"))
    x0 = held.array("special_x0", ("special", "state"), finite=False)
    lows, highs = (held.array(f"special_{end}", ("special", "quantity"), finite=False) for end in ("low", "high"))
    faults = held.array("special_faults", special, int, least=0, most=MOST_FAULTS)
    specials = []
    for i, block in enumerate(blocks):
        table = block.reshape(-1, wide)
        orbit = PeriodicOrbit(
            system,
            all_parameters({**parameters, **dict(zip(varied, values[i].tolist(), strict=True))}, system),
            forms[number[i]],
            table[:, :-1],
            table[:, -1],
            multipliers[i],
            float(real["residual"][i]),
            int(faults[i]),
            x0[i],
            lows[i],
            highs[i],
            tol,
        )
        specials.append(
            SpecialPoint(
                str(text["type"][i]),
                str(text["label"][i]),
                orbit,
                float(real["test"][i]),
                float(real["position"][i]),
                float(real["arclength"][i]),
                varied,
                str(text["of"][i]),
                str(text["locus"][i]),
                tangents[i] if tangents[i].size else None,
            )
        )
    return specials


def _complex(held: Contents, name: str, dims: tuple[str, ...]) -> NDArray[np.complex128]:
    return complex_of(*(held.array(f"{name}_{part}", dims, finite=False) for part in ("re", "im")))


def _split(held: Contents, name: str, ragged: str, dim: str, sizes: list[int]) -> tuple[NDArray[np.float64], ...]:
    """Return the parts of a ragged variable; raise `InputError` where they are not of the sizes that they must be."""
    counts, values = held.array(f"{name}_count", (dim,), int, least=0), held.array(name, (ragged,))
    if counts.tolist() != sizes or values.size != sum(sizes):
        told = f"those of the signatures: {sum(sizes)} numbers"
        raise InputError(f"counts of variable {name!r}", f"{counts.sum()} for {values.size} numbers", told)
    return tuple(np.split(values, np.cumsum(sizes, dtype=np.int64))[:-1])
