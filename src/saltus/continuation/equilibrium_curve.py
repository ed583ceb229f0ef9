"""A curve of equilibria as a result, along one parameter or two, with its special points."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus import checks
from saltus.contents import Contents, as_json
from saltus.continuation.curve_files import complex_table, described, ragged_rows, texts_array
from saltus.continuation.special_points import SpecialPoint, SpecialPoints
from saltus.equilibria import Equilibrium
from saltus.equilibria.equilibrium import equilibrium_at
from saltus.equilibria.problem import EquilibriumProblem
from saltus.errors import InputError
from saltus.results import Result, frozen
from saltus.system import HybridSystem
from saltus.system.plain import all_parameters, held_parameters, held_system

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["EquilibriumCurve"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EquilibriumCurve(Result):
    """Equilibria in order along a curve, and special points: the base of `EquilibriumBranch` and `EquilibriumLocus`.

    Attributes
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float
        All parameters at the start.
    values : ndarray
        The varied parameters: shape (point,) for one, (point, parameter) for two.
    states : ndarray, shape (point, state)
        The equilibria.
    eigenvalues : ndarray of complex, shape (point, state)
        Eigenvalues, the largest real part first.
    stable, regular : ndarray of bool, shape (point,)
        Whether the equilibrium is stable, and whether it lies where its mode holds.
    mode : ndarray of int, shape (point,)
        Index of the mode whose field vanishes.
    residual, arclength : ndarray, shape (point,)
        Largest component of the field over the sizes of its terms, and arclength from the first point.
    special_points : SpecialPoints
        In order along the curve; ``curve["HB1"]`` is one of them.
    stopped : tuple of str
        Why the curve ended, at its first and at its last point.
    rejected : tuple of str
        Rejected steps, with their reasons.
    options : mapping
        Arguments of the continuation.
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    values: NDArray[np.float64]
    states: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    stable: NDArray[np.bool_]
    regular: NDArray[np.bool_]
    mode: NDArray[np.int64]
    residual: NDArray[np.float64]
    arclength: NDArray[np.float64]
    special_points: SpecialPoints[Equilibrium]
    stopped: tuple[str, str]
    rejected: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        kinds: dict[str, Any] = dict.fromkeys(("values", "states", "residual", "arclength"), np.float64)
        kinds |= {"eigenvalues": np.complex128, "mode": np.int64, "stable": np.bool_, "regular": np.bool_}
        for name, kind in kinds.items():
            object.__setattr__(self, name, frozen(getattr(self, name), kind))

    @property
    @abstractmethod
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that vary."""

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, label: str) -> SpecialPoint[Equilibrium]:
        """Return the special point of that label."""
        known = {point.label: point for point in self.special_points}
        return known[checks.chosen("label", label, known)]

    def __iter__(self) -> Iterator[Equilibrium]:
        """Go through the equilibria of all points."""
        return (self.equilibrium(i) for i in range(len(self)))

    def _columns(self) -> dict[str, NDArray[np.float64]]:
        table = self.values.reshape(len(self), -1)
        declared = {parameter: table[:, i] for i, parameter in enumerate(self.varied)}
        declared |= {state: self.states[:, i] for i, state in enumerate(self.system.states)}
        return {"arclength": self.arclength} | declared

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a quantity along the curve.

        Parameters
        ----------
        name : str
            A varied parameter, a state, an output or ``arclength``.

        Returns
        -------
        ndarray, shape (point,)
            In the units of the definition.

        Raises
        ------
        InputError
            A quantity of another name.
        """
        columns = self._columns()
        outputs = [q for q in self.system.output_names if q not in columns]
        checks.chosen("quantity", name, [*columns, *outputs])
        if name in columns:
            return columns[name]
        return np.array([_output(self.equilibrium(i), name) for i in range(len(self))])

    def at(self, point: SpecialPoint[Equilibrium], name: str) -> float:
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
        found = checks.instance("point", point, SpecialPoint).equilibrium
        checks.chosen("quantity", name, dict.fromkeys([*self._columns(), *self.system.output_names]))
        if name in self.varied:
            return found.parameters[name]
        if name in self.system.states:
            return found[name]
        return point.arclength if name == "arclength" else _output(found, name)

    def equilibrium(self, index: int) -> Equilibrium:
        """Return the equilibrium of one point, from which another continuation can start.

        Parameters
        ----------
        index : int
            The point; negative ones count from the end.

        Returns
        -------
        Equilibrium
            With the parameters of the point.

        Raises
        ------
        InputError
            There is no such point.
        """
        i = range(len(self))[checks.count("index", index, -len(self), len(self) - 1)]
        row = np.atleast_1d(self.values[i]).tolist()
        p = self.system.parameter_vector(dict(self.parameters) | dict(zip(self.varied, row, strict=True)))
        problem = EquilibriumProblem(self.system, int(self.mode[i]), p)
        return equilibrium_at(problem, np.array(self.states[i]), np.abs(self.states).max(axis=0))

    def to_xarray(self) -> xr.Dataset:
        """Return the curve as a Dataset: points against ``point``, special points against ``special``."""
        import xarray as xr

        data: dict[str, Any] = {
            "value": (("point", "parameter"), self.values.reshape(len(self), -1)),
            "equilibrium": (("point", "state"), self.states),
            "eigenvalue_re": (("point", "eigenvalue"), self.eigenvalues.real),
            "eigenvalue_im": (("point", "eigenvalue"), self.eigenvalues.imag),
            "stable": ("point", self.stable.astype(np.int8)),
            "regular": ("point", self.regular.astype(np.int8)),
            "mode": ("point", self.mode),
            "residual": ("point", self.residual),
            "arclength": ("point", self.arclength),
        }
        data |= _special_variables(self.special_points, len(self.system.states), self.varied, self.system)
        attrs = {
            "varied": json.dumps(list(self.varied)),
            "parameters": json.dumps(dict(self.parameters)),
            "definition": json.dumps(self.system.definition()),
            "stopped_first": self.stopped[0],
            "stopped_last": self.stopped[1],
            "rejected": json.dumps(list(self.rejected)),
            "options": json.dumps(dict(self.options)),
        }
        return xr.Dataset(data, coords={"state": list(self.system.states), "parameter": list(self.varied)}, attrs=attrs)

    @classmethod
    @abstractmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...], values: NDArray[np.float64]) -> dict[str, Any]:
        """Return `values` and the fields that only this kind of curve has, as `to_xarray` described them."""

    @classmethod
    def _read(cls, held: Contents) -> Self:
        system = held_system(held)
        parameters, varied = held_parameters(held, system), tuple(held.texts("varied"))
        if not varied or len(set(varied)) < len(varied) or not set(varied) <= set(system.parameter_names):
            raise InputError("attribute 'varied'", varied, f"parameters, of {', '.join(system.parameter_names)}")
        held.names("state", system.states)
        held.names("parameter", varied)
        held.expect(eigenvalue=len(system.states))
        held.size("point")
        point = ("point",)
        return cls(
            system=system,
            parameters=parameters,
            states=held.array("equilibrium", ("point", "state")),
            eigenvalues=complex_table(held, "eigenvalue", ("point", "eigenvalue")),
            stable=held.array("stable", point, bool),
            regular=held.array("regular", point, bool),
            mode=held.array("mode", point, int, least=0, most=len(system.modes) - 1),
            residual=held.array("residual", point),
            arclength=held.array("arclength", point),
            special_points=SpecialPoints(_special_points(held, system, parameters, varied), varied),
            stopped=(held.text("stopped_first"), held.text("stopped_last")),
            rejected=tuple(held.texts("rejected")),
            options=held.json("options", dict),
            **cls._own_fields(held, varied, held.array("value", ("point", "parameter"))),
        )

    def _described(self, what: str) -> str:
        """Return the text of a `repr`: kind, range, ends and special points."""
        return described(self, what, "equilibria")


def _output(equilibrium: Equilibrium, name: str) -> float:
    """Return an output at an equilibrium."""
    system = equilibrium.system
    compiled, out = system.compiled, np.empty(len(system.output_names))
    p = compiled.extended(system.parameter_vector(equilibrium.parameters))
    compiled.call("outputs", system.mode_index(equilibrium.mode), 0, np.array(equilibrium.state), p, out)
    return float(out[system.output_names.index(name)])


def _special_variables(
    points: SpecialPoints[Equilibrium], n: int, varied: tuple[str, ...], system: HybridSystem
) -> dict[str, Any]:
    """Return special points as variables of a Dataset."""
    rows = [point.equilibrium for point in points]
    tangents = [np.empty(0) if point.tangent is None else point.tangent for point in points]

    def table(values: list[Any], width: int) -> NDArray[np.float64]:
        return np.array(values, dtype=np.float64).reshape(len(values), width)

    data: dict[str, Any] = {
        f"special_{name}": ("special", texts_array([getattr(point, name) for point in points]))
        for name in ("type", "label", "of", "locus", "kind")
    }
    data |= {
        f"special_{name}": ("special", np.array([getattr(point, name) for point in points], dtype=float))
        for name in ("test", "arclength", "position")
    }
    return data | {
        "special_value": (("special", "parameter"),
                          table([[row.parameters[name] for name in varied] for row in rows], len(varied))),
        "special_state": (("special", "state"), table([row.state for row in rows], n)),
        "special_scale": (("special", "state"), table([point.scale for point in points], n)),
        "special_eigenvalue_re": (("special", "eigenvalue"), table([row.eigenvalues.real for row in rows], n)),
        "special_eigenvalue_im": (("special", "eigenvalue"), table([row.eigenvalues.imag for row in rows], n)),
        "special_residual": ("special", np.array([row.residual for row in rows], dtype=float)),
        "special_mode": ("special", np.array([system.mode_index(row.mode) for row in rows], dtype=np.int64)),
        "special_reasons": ("special", texts_array([json.dumps(list(row.reasons)) for row in rows])),
        "special_tangent": ("tangent_ragged", np.concatenate([*tangents, np.empty(0)])),
        "special_tangent_count": ("special", np.array([row.size for row in tangents], dtype=np.int64)),
    }  # fmt: skip


def _special_points(
    held: Contents, system: HybridSystem, parameters: Mapping[str, float], varied: tuple[str, ...]
) -> list[SpecialPoint[Equilibrium]]:
    """Return the special points that `_special_variables` wrote."""
    special, n = ("special",), len(system.states)
    text = {name: held.array(f"special_{name}", special, str) for name in ("type", "label", "of", "locus", "kind")}
    real = {name: held.array(f"special_{name}", special) for name in ("test", "position", "arclength", "residual")}
    values = held.array("special_value", ("special", "parameter"))
    states = held.array("special_state", ("special", "state"))
    scales = held.array("special_scale", ("special", "state"), least=0.0)
    eigenvalues = complex_table(held, "special_eigenvalue", ("special", "eigenvalue"))
    modes = held.array("special_mode", special, int, least=0, most=len(system.modes) - 1)
    reasons = held.array("special_reasons", special, str)
    there = held.array("special_tangent_count", special, int, least=0) > 0
    widths = [(n + 1) * int(is_there) for is_there in there.tolist()]
    tangents = ragged_rows(held, "special_tangent", "tangent_ragged", "special", widths)
    points = []
    for i in range(len(values)):
        found = Equilibrium(
            system,
            all_parameters({**parameters, **dict(zip(varied, values[i].tolist(), strict=True))}, system),
            system.mode_names[modes[i]],
            states[i],
            eigenvalues[i],
            float(real["residual"][i]),
            tuple(str(line) for line in as_json(str(reasons[i]), "special_reasons", list)),
        )
        numbers = [float(real[name][i]) for name in ("test", "position", "arclength")]
        names = [str(text[name][i]) for name in ("type", "label", "of", "locus", "kind")]
        points.append(
            SpecialPoint(
                names[0], names[1], found, numbers[0], numbers[1], numbers[2], varied, names[2], names[3],
                tangents[i] if tangents[i].size else None, names[4], scales[i],
            )
        )  # fmt: skip
    return points
