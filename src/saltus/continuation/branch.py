"""A branch of periodic orbits and its special points."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from saltus.errors import InputError, nearest
from saltus.orbits import PeriodicOrbit
from saltus.orbits.orbit import complex_of, orbit_at
from saltus.orbits.problem import OrbitProblem, Signature
from saltus.results import Result, frozen
from saltus.system import HybridSystem

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Branch", "SpecialPoint", "SpecialPoints"]

_MEANING = {
    "SN": "saddle-node (fold)",
    "PD": "period doubling (flip)",
    "TR": "torus (Neimark-Sacker)",
    "BP": "branch point",
    "GR": "grazing",
}


@dataclass(frozen=True, eq=False, repr=False)
class SpecialPoint:
    """A special point of a branch, located.

    Attributes
    ----------
    type : str
        ``SN``, ``PD``, ``TR``, ``BP``, ``GR`` or the name of a user's event.
    label : str
        The type with its number along the branch, as in ``SN1``.
    orbit : PeriodicOrbit
        The orbit there; its parameters are those of the point.
    test : float
        Test function there: the parameter's component of the tangent (SN), ``mu + 1`` (PD), ``|mu|^2 - 1`` (TR), the
        determinant over its size nearby (BP), the normal velocity or the distance from the surface (GR), the distance
        from the wanted value (users' events).
    position : float
        Where among the branch's points: 3.5 lies between points 3 and 4.
    arclength : float
        Arclength there, as `Branch.arclength` counts it.
    """

    type: str
    label: str
    orbit: PeriodicOrbit
    test: float
    position: float
    arclength: float

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters there."""
        return self.orbit.parameters

    def __repr__(self) -> str:
        meaning = f", {_MEANING[self.type]}" if self.type in _MEANING else ""
        return f"SpecialPoint {self.label}{meaning}, test function {self.test:.2g}\n{self.orbit!r}"


class SpecialPoints(Sequence[SpecialPoint]):
    """Special points in their order along the branch."""

    def __init__(self, points: Sequence[SpecialPoint], parameter: str) -> None:
        self._points = tuple(points)
        self._parameter = parameter

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

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table: label, type, parameter, stability, signature, x0, extremes, test function."""
        import pandas as pd

        rows = []
        for p in self._points:
            row: dict[str, Any] = {"label": p.label, "type": p.type, self._parameter: p.parameters[self._parameter]}
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
        lines = [f"{p.label:5s} {self._parameter} = {p.parameters[self._parameter]:.12g}" for p in self._points]
        return "\n".join(lines) or "no special points"


@dataclass(frozen=True, eq=False, repr=False)
class Branch(Result):
    """Periodic orbits along one parameter.

    Attributes
    ----------
    system : HybridSystem
        The system.
    parameter : str
        What varies.
    parameters : mapping of str to float
        The others (and the start's value of `parameter`).
    values : ndarray, shape (point,)
        The parameter.
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
        SN, PD, TR, BP, GR and users' events, in order along the branch; ``branch["SN1"]`` is one of them.
    stopped : tuple of str
        Why the branch ended, at its first and at its last point.
    rejected : tuple of str
        Steps that were not taken, with their reasons.
    options : mapping
        What `continue_orbit` was asked for: bounds, steps, directions, events, stop_at, at_grazing.
    tol : float
        Relative tolerance of the flow.
    """

    system: HybridSystem
    parameter: str
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

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, label: str) -> SpecialPoint:
        """Return the special point of that label."""
        for point in self.special_points:
            if point.label == label:
                return point
        known = [point.label for point in self.special_points]
        raise InputError(
            "label", label, f"one of {', '.join(known) or 'no special points'}", nearest(str(label), known)
        )

    def __iter__(self) -> Iterator[PeriodicOrbit]:
        """Go through the orbits of all points."""
        return (self.orbit(i) for i in range(len(self)))

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of all states and outputs, in the order of `lows` and `highs`."""
        return (*self.system.all_states, *self.system.output_names)

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a quantity along the branch, shape (point,).

        Parameters
        ----------
        name : str
            The parameter's name, ``period``, ``arclength``, a state (its value at phase 0), or ``min_`` or ``max_`` and
            a state or output.
        """
        columns: dict[str, Any] = {self.parameter: self.values, "period": self.period, "arclength": self.arclength}
        columns |= {state: self.x0[:, i] for i, state in enumerate(self.system.states)}
        columns |= {f"min_{q}": self.lows[:, i] for i, q in enumerate(self.quantities)}
        columns |= {f"max_{q}": self.highs[:, i] for i, q in enumerate(self.quantities)}
        if self.system.phase is not None:
            for side in ("min", "max"):
                columns.pop(f"{side}_{self.system.phase[0]}")
        if name not in columns:
            raise InputError("quantity", name, f"one of {', '.join(columns)}", nearest(str(name), columns))
        found: NDArray[np.float64] = columns[name]
        return found

    def at(self, point: SpecialPoint, name: str) -> float:
        """Return the quantity that `column` names at a special point."""
        orbit = point.orbit
        if name.startswith(("min_", "max_")) and name[4:] in self.quantities:
            source = orbit.lows if name.startswith("min_") else orbit.highs
            return float(source[self.quantities.index(name[4:])])
        if name == self.parameter:
            return orbit.parameters[name]
        if name == "period":
            return orbit.period
        if name in self.system.states:
            return float(orbit.x0[self.system.states.index(name)])
        if name == "arclength":
            return point.arclength
        self.column(name)  # says what is wrong with the name
        raise AssertionError(name)

    def signature(self, index: int) -> tuple[tuple[str, str], ...]:
        """Return the (mode, transition) names of a point's segments."""
        form: Signature = self.forms[self.form[index]]
        return form.names(self.system)

    def orbit(self, index: int) -> PeriodicOrbit:
        """Return the orbit of one point, from which another continuation can start."""
        if isinstance(index, bool) or not isinstance(index, int | np.integer):
            raise InputError("index", index, "an integer")
        if not -len(self) <= index < len(self):
            raise InputError("index", index, f"between {-len(self)} and {len(self) - 1}")
        values = dict(self.parameters) | {self.parameter: float(self.values[index])}
        p = self.system.parameter_vector(values)
        problem = OrbitProblem(self.system, self.forms[self.form[index]], p, tol=self.tol)
        u = np.array(self.unknowns[index])
        problem.start(u)
        return orbit_at(problem, u, problem.evaluate(u)[1])

    def to_xarray(self) -> xr.Dataset:
        """Return the branch as a Dataset: points against ``point``, special points against ``special``."""
        import xarray as xr

        names = [form.names(self.system) for form in self.forms]
        specials = list(self.special_points)
        n = len(self.system.all_states)
        data: dict[str, Any] = {
            self.parameter: ("point", self.values),
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
        orbits = [point.orbit for point in specials]
        forms = list(dict.fromkeys([*self.forms, *(orbit.form for orbit in orbits)]))
        blocks = [orbit.unknowns for orbit in orbits]
        data |= {
            "special_type": ("special", np.array([point.type for point in specials], dtype=object)),
            "special_label": ("special", np.array([point.label for point in specials], dtype=object)),
            "special_value": (
                "special",
                np.array([point.parameters[self.parameter] for point in specials], dtype=float),
            ),
            "special_test": ("special", np.array([point.test for point in specials], dtype=float)),
            "special_arclength": ("special", np.array([point.arclength for point in specials], dtype=float)),
            "special_position": ("special", np.array([point.position for point in specials], dtype=float)),
            "special_x0": (("special", "state"), np.array([o.x0 for o in orbits]).reshape(-1, len(self.system.states))),
            "special_multiplier_re": (("special", "multiplier"), self._stack([o.multipliers.real for o in orbits])),
            "special_multiplier_im": (("special", "multiplier"), self._stack([o.multipliers.imag for o in orbits])),
            "special_low": (
                ("special", "quantity"),
                np.array([o.lows for o in orbits]).reshape(-1, len(self.quantities)),
            ),
            "special_high": (
                ("special", "quantity"),
                np.array([o.highs for o in orbits]).reshape(-1, len(self.quantities)),
            ),
            "special_residual": ("special", np.array([o.residual for o in orbits], dtype=float)),
            "special_faults": ("special", np.array([o.faults for o in orbits], dtype=np.int64)),
            "special_form": ("special", np.array([forms.index(o.form) for o in orbits], dtype=np.int64)),
            "special_unknown": ("special_ragged", np.concatenate([*blocks, np.empty(0)])),
            "special_unknown_count": ("special", np.array([len(block) for block in blocks], dtype=np.int64)),
        }
        coords = {"state": list(self.system.states), "quantity": list(self.quantities)}
        attrs = {
            "parameter": self.parameter,
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

    def _stack(self, rows: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        return np.array(rows, dtype=np.float64).reshape(len(rows), self.multipliers.shape[1])

    @classmethod
    def from_xarray(cls, dataset: xr.Dataset) -> Branch:
        """Return the branch that `to_xarray` described."""
        attrs, ds = dataset.attrs, dataset
        system = HybridSystem.from_definition(json.loads(attrs["definition"]))
        parameter, tol = str(attrs["parameter"]), float(attrs["tol"])
        parameters = json.loads(attrs["parameters"])
        forms = [Signature(tuple(m), tuple(t), tuple(k), turns) for m, t, k, turns in json.loads(attrs["forms"])]
        n = len(system.all_states)
        specials = []
        blocks = np.split(ds["special_unknown"].values, np.cumsum(ds["special_unknown_count"].values))[:-1]
        for i, block in enumerate(blocks):
            table = block.reshape(-1, n + 1)
            orbit = PeriodicOrbit(
                system,
                parameters | {parameter: float(ds["special_value"].values[i])},
                forms[int(ds["special_form"].values[i])],
                table[:, :n],
                table[:, n],
                complex_of(ds["special_multiplier_re"].values[i], ds["special_multiplier_im"].values[i]),
                float(ds["special_residual"].values[i]),
                int(ds["special_faults"].values[i]),
                ds["special_x0"].values[i],
                ds["special_low"].values[i],
                ds["special_high"].values[i],
                tol,
            )
            specials.append(
                SpecialPoint(
                    str(ds["special_type"].values[i]),
                    str(ds["special_label"].values[i]),
                    orbit,
                    float(ds["special_test"].values[i]),
                    float(ds["special_position"].values[i]),
                    float(ds["special_arclength"].values[i]),
                )
            )
        return cls(
            system,
            parameter,
            parameters,
            ds[parameter].values,
            ds["x0"].values,
            complex_of(ds["multiplier_re"].values, ds["multiplier_im"].values),
            ds["stable"].values.astype(bool),
            ds["admissible"].values.astype(bool),
            ds["period"].values,
            ds["residual"].values,
            ds["arclength"].values,
            ds["lows"].values,
            ds["highs"].values,
            tuple(forms[: int(attrs["n_forms"])]),
            ds["form"].values,
            tuple(np.split(ds["unknown"].values, np.cumsum(ds["unknown_count"].values))[:-1]),
            SpecialPoints(specials, parameter),
            (str(attrs["stopped_first"]), str(attrs["stopped_last"])),
            tuple(json.loads(attrs["rejected"])),
            json.loads(attrs["options"]),
            tol,
        )

    def __repr__(self) -> str:
        low, high = (float(self.values.min()), float(self.values.max())) if len(self) else (np.nan, np.nan)
        lines = [
            f"Branch of {self.system.name or 'a hybrid system'}: {len(self)} orbits, {int(self.stable.sum())} stable, "
            f"{self.parameter} from {low:.9g} to {high:.9g}",
            f"  began: {self.stopped[0]}",
            f"  ended: {self.stopped[1]}",
        ]
        lines += [f"  {line}" for line in repr(self.special_points).splitlines()]
        return "\n".join(lines)


def _written(signature: tuple[tuple[str, str], ...]) -> str:
    return " -> ".join(f"{mode}:{transition}" for mode, transition in signature)
