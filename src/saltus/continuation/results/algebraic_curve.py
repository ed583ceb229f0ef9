"""A curve of equilibria, or of cycles of a map, as a result: what both have in common, in memory and in files."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.continuation.results.curve import SolutionCurve
from saltus.continuation.results.curve_files import ragged_rows, texts_array
from saltus.continuation.results.special_points import SpecialPoint, SpecialPoints
from saltus.equilibria.equilibrium import Equilibrium
from saltus.errors import InputError
from saltus.maps.orbit import MapOrbit
from saltus.system import HybridSystem, Map

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "AlgebraicCurve",
    "held_varied",
    "special_rows",
    "special_table",
    "special_variables_of",
]

Solved = TypeVar("Solved", bound=Equilibrium | MapOrbit)

_TEXTS = ("type", "label", "of", "locus", "kind")  # attributes of a special point that are texts
_NUMBERS = ("test", "position", "arclength")  # those that are numbers


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class AlgebraicCurve(SolutionCurve[Solved]):
    """Solutions in order along a curve, and special points: the base of curves of equilibria and of cycles of maps.

    Attributes
    ----------
    regular : ndarray of bool, shape (point,)
        Whether the solution lies where its mode, or its pieces, hold.
    """

    regular: NDArray[np.bool_]

    kinds = SolutionCurve.kinds | {"regular": np.bool_}

    @property
    def sound(self) -> NDArray[np.bool_]:
        """See `SolutionCurve.sound`: `regular`."""
        return self.regular

    @abstractmethod
    def _first_states(self) -> NDArray[np.float64]:
        """Return the states along the curve, shape (point, state)."""

    def _own_columns(self) -> dict[str, NDArray[np.float64]]:
        """Return what only this kind of curve has, by name."""
        return {}

    def _known_as(self, name: str) -> str:
        """Return the name under which a column is held."""
        return name

    def _columns(self) -> dict[str, NDArray[np.float64]]:
        table, states = self.values.reshape(len(self), -1), self._first_states()
        declared = {parameter: table[:, i] for i, parameter in enumerate(self.varied)}
        declared |= {state: states[:, i] for i, state in enumerate(self.system.states)}
        return self._own_columns() | {"arclength": self.arclength} | declared

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a quantity along the curve.

        Parameters
        ----------
        name : str
            A varied parameter, a state, an output or ``arclength``; of a cycle that at its first point. Of equilibria
            also an extreme, as ``max_x``, so that they and cycles are drawn on the same axes.

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

    def _at_point(self, index: int) -> tuple[int, NDArray[np.float64]]:
        """Return the place of a point, negative ones counted from the end, and all parameters there."""
        i = self._place(index)
        return i, self.system.parameter_vector(self._parameters_at(i))

    def _shared_variables(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Return variables and attributes of a Dataset that all curves have."""
        data: dict[str, Any] = {
            "value": (("point", "parameter"), self.values.reshape(len(self), -1)),
            "stable": ("point", self.stable.astype(np.int8)),
            "regular": ("point", self.regular.astype(np.int8)),
            "residual": ("point", self.residual),
            "arclength": ("point", self.arclength),
        }
        return data, self._kept_attributes()

    @classmethod
    def _shared_fields(cls, held: Contents) -> dict[str, Any]:
        """Return the fields that `_shared_variables` wrote, but those that each kind of curve reads by itself."""
        held.size("point")
        point = ("point",)
        return {
            "stable": held.array("stable", point, bool),
            "regular": held.array("regular", point, bool),
            "residual": held.array("residual", point),
            "arclength": held.array("arclength", point),
            **cls._kept_fields(held),
        }


def _output(solution: Any, name: str) -> float:
    """Return an output at an equilibrium, or at the first point of a cycle."""
    system = solution.system
    if isinstance(solution, MapOrbit):
        mode, state = system.mode_index(solution.itinerary[0]), solution.points[0]
    else:
        mode, state = system.mode_index(solution.mode), solution.state
    compiled, out = system.compiled, np.empty(len(system.output_names))
    p = compiled.extended(system.parameter_vector(solution.parameters))
    compiled.call("outputs", mode, 0, np.array(state), p, out)
    return float(out[system.output_names.index(name)])


def held_varied(held: Contents, system: HybridSystem | Map) -> tuple[str, ...]:
    """Return the names of the parameters that vary along a curve in a file."""
    varied = tuple(held.texts("varied"))
    if not varied or len(set(varied)) < len(varied) or not set(varied) <= set(system.parameter_names):
        raise InputError("attribute 'varied'", varied, f"parameters, of {', '.join(system.parameter_names)}")
    held.names("parameter", varied)
    return varied


def special_table(values: Sequence[Any], *shape: int) -> NDArray[np.float64]:
    """Return a row for each special point, also where there is none."""
    return np.array(values, dtype=np.float64).reshape(len(values), *shape)


def special_variables_of(points: SpecialPoints[Any], n: int, varied: tuple[str, ...]) -> dict[str, Any]:
    """Return what all special points have as variables of a Dataset; `n` is the number of a solution's unknowns."""
    tangents = [np.empty(0) if point.tangent is None else point.tangent for point in points]
    data: dict[str, Any] = {
        f"special_{name}": ("special", texts_array([getattr(point, name) for point in points])) for name in _TEXTS
    }
    data |= {
        f"special_{name}": ("special", np.array([getattr(point, name) for point in points], dtype=float))
        for name in _NUMBERS
    }
    reasons = [json.dumps(list(point.solution.reasons)) for point in points]
    values = [[point.parameters[name] for name in varied] for point in points]
    return data | {
        "special_value": (("special", "parameter"), special_table(values, len(varied))),
        "special_scale": (("special", "unknown"), special_table([point.scale for point in points], n)),
        "special_residual": ("special", np.array([point.solution.residual for point in points], dtype=float)),
        "special_reasons": ("special", texts_array(reasons)),
        "special_tangent": ("tangent_ragged", np.concatenate([*tangents, np.empty(0)])),
        "special_tangent_count": ("special", np.array([row.size for row in tangents], dtype=np.int64)),
    }


def special_rows(held: Contents, n: int, varied: tuple[str, ...], solved: Sequence[Solved]) -> SpecialPoints[Solved]:
    """Return the special points that `special_variables_of` wrote, with their solutions."""
    special = ("special",)
    text = {name: held.array(f"special_{name}", special, str) for name in _TEXTS}
    real = {name: held.array(f"special_{name}", special) for name in _NUMBERS}
    scales = held.array("special_scale", ("special", "unknown"), least=0.0)
    there = held.array("special_tangent_count", special, int, least=0) > 0
    widths = [(n + 1) * int(is_there) for is_there in there.tolist()]
    tangents = ragged_rows(held, "special_tangent", "tangent_ragged", "special", widths)
    points = []
    for i, found in enumerate(solved):
        kind, label, of, locus, side = (str(text[name][i]) for name in _TEXTS)
        test, position, arclength = (float(real[name][i]) for name in _NUMBERS)
        tangent = tangents[i] if tangents[i].size else None
        points.append(
            SpecialPoint(
                kind, label, found, test, position, arclength, varied, of, locus, tangent, side, np.array(scales[i])
            )
        )  # fmt: skip
    return SpecialPoints(points, varied)
