"""A curve of equilibria, of orbits of a map or of other zeros, as a result: what all have in common, also in files."""

from __future__ import annotations

import json
import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np

from saltus import checks
from saltus.algebraic.solution import AlgebraicSolution, Packed
from saltus.contents import Contents, as_json
from saltus.continuation.results.curve import SolutionCurve
from saltus.continuation.results.curve_files import complex_table, ragged_rows, texts_array
from saltus.continuation.results.special_points import SpecialPoint, SpecialPoints
from saltus.described import described
from saltus.errors import InputError
from saltus.result import frozen
from saltus.system.plain import all_parameters, held_parameters

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["AlgebraicCurve"]

Solved = TypeVar("Solved", bound=AlgebraicSolution)

_TYPES = {float: np.float64, complex: np.complex128, int: np.int64}  # of arrays, by the kind of `Packed`
_TEXTS = ("type", "label", "of", "locus", "kind")  # attributes of a special point that are texts
_NUMBERS = ("test", "position", "arclength")  # those that are numbers


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class AlgebraicCurve(SolutionCurve[Solved]):
    """Solutions in order along a curve, and special points: the base of curves of all zeros of algebraic equations.

    A curve of a new kind says by `solved` and `written` what it is made of, and makes the solution of a point.

    Attributes
    ----------
    regular : ndarray of bool, shape (point,)
        Whether the solution lies where its mode, or its pieces, hold.
    solved : type
        The kind of its solutions.
    written : mapping of str to Packed
        The columns by their names, and how they stand in files. The first are the unknowns.
    """

    regular: NDArray[np.bool_]

    solved: ClassVar[type[AlgebraicSolution]]
    written: ClassVar[Mapping[str, Packed]]
    kinds = SolutionCurve.kinds | {"regular": np.bool_}

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, column in self.written.items():
            object.__setattr__(self, name, frozen(getattr(self, name), _TYPES[column.kind]))

    @property
    def sound(self) -> NDArray[np.bool_]:
        """See `SolutionCurve.sound`: `regular`."""
        return self.regular

    @property
    def unknowns(self) -> NDArray[np.float64]:
        """The unknowns of each point, shape (point, unknown): the states, or those of all points of a map orbit."""
        return np.asarray(getattr(self, next(iter(self.written))).reshape(len(self), -1))

    @property
    def x0(self) -> NDArray[np.float64]:
        """The state of each solution, or its first one, shape (point, state)."""
        return self.unknowns[:, : len(self.system.states)]

    @property
    def extremes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `SolutionCurve.extremes`."""
        states = self.unknowns.reshape(len(self), -1, len(self.system.states))
        if states.shape[1] == 1:
            return states[:, 0], states[:, 0]
        return states.min(axis=1), states.max(axis=1)

    def _scale(self) -> NDArray[np.float64]:
        x = self.unknowns
        return np.asarray(np.maximum(np.ptp(x, axis=0), 1e-3 * np.abs(x).max()))

    def _extent(self, solution: Solved) -> NDArray[np.float64]:
        return np.asarray(solution.pack()[0]).ravel()

    def _known_as(self, name: str) -> str:
        """Return the name under which a column is held."""
        return name

    def _columns(self) -> dict[str, NDArray[np.float64]]:
        table, states = self.values.reshape(len(self), -1), self.x0
        declared = {parameter: table[:, i] for i, parameter in enumerate(self.varied)}
        declared |= {state: states[:, i] for i, state in enumerate(self.system.states)}
        return self._own_columns() | {"arclength": self.arclength} | declared

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a quantity along the curve.

        Parameters
        ----------
        name : str
            A varied parameter, a state, an output or ``arclength``; of a map orbit that at its first point. Of
            equilibria also an extreme, as ``max_x``, so that they and cycles are drawn on the same axes.

        Returns
        -------
        ndarray, shape (point,)
            In the units of the definition.

        Raises
        ------
        InputError
            A quantity of another name.
        """
        columns, name = self._columns(), self._known_as(name)
        outputs = [q for q in self.system.output_names if q not in columns]
        checks.chosen("quantity", name, [*columns, *outputs])
        if name in columns:
            return columns[name]
        return np.array([_output(self._solution(i), name) for i in range(len(self))])

    def value_at(self, point: SpecialPoint[Solved], name: str) -> float:
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
        found, name = checks.instance("point", point, SpecialPoint).solution, self._known_as(name)
        checks.chosen("quantity", name, dict.fromkeys([*self._columns(), *self.system.output_names]))
        if name in self.varied:
            return float(found.parameters[name])
        if name in self.system.states:
            return float(found.x0[self.system.states.index(name)])
        return float(point.arclength) if name == "arclength" else _output(found, name)

    def _spectrum(self) -> list[tuple[str, NDArray[np.complex128]]]:
        parts = [(column, getattr(self, name)) for name, column in self.written.items() if column.kind is complex]
        return [(column.name, values) for column, values in parts if values.ndim == 2]

    def _parameter_vector(self, index: int) -> NDArray[np.float64]:
        """Return all parameters of a point in the system's order."""
        return np.asarray(self.system.parameter_vector(self._parameters_at(index)))

    @abstractmethod
    def _solution(self, index: int) -> Solved:
        """Return the solution of one point, its residual and its reasons computed anew."""

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the curve as a Dataset: points against ``point``, special points against ``special``."""
        from saltus.extras import xr

        data: dict[str, Any] = {
            "value": (("point", "parameter"), self.values.reshape(len(self), -1)),
            "stable": ("point", self.stable.astype(np.int8)),
            "regular": ("point", self.regular.astype(np.int8)),
            "residual": ("point", self.residual),
            "arclength": ("point", self.arclength),
        }
        sizes: dict[str, int] = {}
        for name, column in self.written.items():
            values = getattr(self, name)
            sizes |= dict(zip(column.dims, values.shape[1:], strict=True))
            data |= _variables(column.name, ("point", *column.dims), values)
        data |= self._special_variables(sizes)
        data |= {name: ("point", values) for name, values in self._own_columns().items()}
        coords = {"state": list(self.system.states), "parameter": list(self.varied)}
        return xr.Dataset(data, coords=coords, attrs=self._kept_attributes())

    def _special_variables(self, sizes: Mapping[str, int]) -> dict[str, Any]:
        """Return special points as variables of a Dataset; sizes: those of the dimensions of a solution's parts."""
        points, n = self.special_points, self.unknowns.shape[1]
        tangents = [np.empty(0) if point.tangent is None else point.tangent for point in points]
        data: dict[str, Any] = {
            f"special_{name}": ("special", texts_array([getattr(point, name) for point in points])) for name in _TEXTS
        }
        data |= {
            f"special_{name}": ("special", np.array([getattr(point, name) for point in points], dtype=float))
            for name in _NUMBERS
        }
        values = [[point.parameters[name] for name in self.varied] for point in points]
        data |= {
            "special_value": (("special", "parameter"), _table(values, (len(self.varied),))),
            "special_scale": (("special", "unknown"), _table([point.scale for point in points], (n,))),
            "special_residual": ("special", np.array([point.solution.residual for point in points], dtype=float)),
            "special_reasons": ("special", texts_array([json.dumps([*point.solution.reasons]) for point in points])),
            "special_tangent": ("tangent_ragged", np.concatenate([*tangents, np.empty(0)])),
            "special_tangent_count": ("special", np.array([row.size for row in tangents], dtype=np.int64)),
        }
        packed = [point.solution.pack() for point in points]
        for i, part in enumerate(self.solved.packed):
            shape = tuple(sizes[dim] for dim in part.dims)
            table = _table([row[i] for row in packed], shape, _TYPES[part.kind])
            data |= _variables(f"special_{part.name}", ("special", *part.dims), table)
        return data

    @classmethod
    def _sizes(cls, held: Contents, system: Any) -> dict[str, int]:
        """Return what sizes dimensions of a file must have, that of ``unknown`` among them."""
        return {"unknown": len(system.states)}

    @classmethod
    def _held_columns(cls, held: Contents, system: Any) -> dict[str, Any]:
        """Return the columns that `written` names, and what belongs to them."""
        return {name: _held(held, column.name, "point", column, system) for name, column in cls.written.items()}

    @classmethod
    def _read(cls, held: Contents) -> Self:
        system = cls.solved._held_system(held)
        parameters, varied = held_parameters(held, system), _held_varied(held, system)
        held.names("state", system.states)
        sizes = cls._sizes(held, system)
        held.expect(**sizes)
        held.size("point")
        point = ("point",)
        return cls(
            system=system,
            parameters=parameters,
            special_points=cls._held_special_points(held, system, parameters, varied),
            stable=held.array("stable", point, bool),
            regular=held.array("regular", point, bool),
            residual=held.array("residual", point, least=0.0),
            arclength=held.array("arclength", point),
            **cls._held_columns(held, system),
            **cls._kept_fields(held),
            **cls._own_fields(held, varied, held.array("value", ("point", "parameter"))),
        )

    @classmethod
    def _held_special_points(
        cls, held: Contents, system: Any, parameters: Mapping[str, float], varied: tuple[str, ...]
    ) -> SpecialPoints[Any]:
        """Return the special points that `_special_variables` wrote."""
        special = ("special",)
        values = held.array("special_value", ("special", "parameter"))
        parts = [_held(held, f"special_{part.name}", "special", part, system) for part in cls.solved.packed]
        residuals, reasons = held.array("special_residual", special), held.array("special_reasons", special, str)
        text = {name: held.array(f"special_{name}", special, str) for name in _TEXTS}
        real = {name: held.array(f"special_{name}", special) for name in _NUMBERS}
        scales = held.array("special_scale", ("special", "unknown"), least=0.0)
        there = held.array("special_tangent_count", special, int, least=0) > 0
        widths = [(scales.shape[1] + 1) * int(is_there) for is_there in there.tolist()]
        tangents = ragged_rows(held, "special_tangent", "tangent_ragged", "special", widths)
        points: list[SpecialPoint[Any]] = []
        for i, row in enumerate(values.tolist()):
            own = all_parameters({**parameters, **dict(zip(varied, row, strict=True))}, system)
            found = cls.solved._unpack(
                system, own, [part[i] for part in parts], float(residuals[i]),
                [str(line) for line in as_json(str(reasons[i]), "special_reasons", list)],
            )  # fmt: skip
            kind, label, of, locus, side = (str(text[name][i]) for name in _TEXTS)
            test, place, arc = (float(real[name][i]) for name in _NUMBERS)
            tangent, scale = tangents[i] if tangents[i].size else None, np.array(scales[i])
            points.append(SpecialPoint(kind, label, found, test, place, arc, varied, of, locus, tangent, side, scale))
        return SpecialPoints(points, varied)


def _output(solution: AlgebraicSolution, name: str) -> float:
    """Return an output at a solution, or at its first point."""
    system = solution.system
    compiled, out = system.compiled, np.empty(len(system.output_names))
    p = compiled.extended(system.parameter_vector(solution.parameters))
    compiled.call("outputs", system.mode_index(solution.begins_in), 0, np.array(solution.x0), p, out)
    return float(out[system.output_names.index(name)])


def _variables(name: str, dims: tuple[str, ...], values: NDArray[Any]) -> dict[str, Any]:
    """Return an array as variables of a Dataset: two for complex numbers."""
    if np.iscomplexobj(values):
        return {f"{name}_re": (dims, values.real), f"{name}_im": (dims, values.imag)}
    return {name: (dims, values)}


def _held(held: Contents, name: str, along: str, part: Packed, system: Any) -> NDArray[Any]:
    """Return an array that `_variables` wrote."""
    dims = (along, *part.dims)
    if part.kind is complex:
        return complex_table(held, name, dims)
    if part.kind is int:
        return held.array(name, dims, int, least=0, most=math.inf if part.most is None else part.most(system))
    return held.array(name, dims)


def _table(rows: list[Any], shape: tuple[int, ...], kind: Any = np.float64) -> NDArray[Any]:
    """Return a row for each special point, also where there is none."""
    return np.array(rows, dtype=kind).reshape(len(rows), *shape)


def _held_varied(held: Contents, system: Any) -> tuple[str, ...]:
    """Return the names of the parameters that vary along a curve in a file."""
    varied = tuple(held.texts("varied"))
    if not varied or len(set(varied)) < len(varied) or not set(varied) <= set(system.parameter_names):
        raise InputError("attribute 'varied'", varied, f"parameters, of {', '.join(system.parameter_names)}")
    held.names("parameter", varied)
    return varied
