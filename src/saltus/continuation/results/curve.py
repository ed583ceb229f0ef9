"""A curve of solutions of any kind, as a result: along one parameter or two, with its special points."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar

import numpy as np

from saltus import checks
from saltus.continuation.results.audit import Audit
from saltus.continuation.results.special_points import SpecialPoint, SpecialPoints
from saltus.errors import InputError
from saltus.result import Result, frozen
from saltus.scales import ILL_CONDITIONED, same
from saltus.solution import Solution

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["SolutionCurve"]

Solved = TypeVar("Solved", bound=Solution)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SolutionCurve(Result, Generic[Solved]):
    """Solutions in order along a curve, and special points: the base of all branches and loci.

    Attributes
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float
        All parameters at the start.
    values : ndarray
        The varied parameters: shape (point,) for one, (point, parameter) for two.
    stable : ndarray of bool, shape (point,)
        Whether the solution is stable.
    residual, arclength : ndarray, shape (point,)
        Residual over the sizes of its terms, and arclength from the first point.
    special_points : SpecialPoints
        In order along the curve; ``curve["SN1"]`` is one of them.
    stopped : tuple of str
        Why the curve ended, at its first and at its last point.
    rejected : tuple of str
        Rejected steps, with their reasons.
    options : mapping
        Arguments of the continuation.
    audit : Audit
        Whether the curve keeps what always holds: docs/theory/continuation.md, "The audit".
    """

    system: Any
    parameters: Mapping[str, float]
    values: NDArray[np.float64]
    stable: NDArray[np.bool_]
    residual: NDArray[np.float64]
    arclength: NDArray[np.float64]
    special_points: SpecialPoints[Solved]
    stopped: tuple[str, str]
    rejected: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    audit: Audit = field(default_factory=Audit)

    counted: ClassVar[str]  # what a `repr` counts
    fault: ClassVar[str] = "virtual"  # what a picture calls a solution that is not sound
    sound_called: ClassVar[str] = "regular"  # what a table calls `sound`
    kinds: ClassVar[dict[str, Any]] = {  # types of the arrays
        **dict.fromkeys(("values", "residual", "arclength"), np.float64),
        "stable": np.bool_,
    }

    def __post_init__(self) -> None:
        for name, kind in self.kinds.items():
            object.__setattr__(self, name, frozen(getattr(self, name), kind))

    def _with_audit(self, audit: Audit) -> Self:
        """Return the curve with an audit; the rest is checked already."""
        found = object.__new__(type(self))
        vars(found).update(vars(self), audit=audit)
        return found

    @property
    def conserved(self) -> dict[str, float]:
        """Totals that the system conserves, by name, which all solutions have."""
        if not len(self) or not getattr(self.system, "laws", ()):
            return {}
        laws, x0 = self.system.laws, np.asarray(self.x0)
        first, last = (laws.totals(x0[i], p := self._vector_at(i)) for i in (0, -1))
        errors = ILL_CONDITIONED * np.abs(laws.matrix(p)) @ np.abs(x0).max(axis=0)
        named = zip(laws.names, first.tolist(), last.tolist(), errors.tolist(), strict=True)
        return {name: value for name, value, other, error in named if same(value, other, error)}

    def _vector_at(self, index: int) -> NDArray[np.float64]:
        parameters = self._parameters_at(index)
        return np.asarray(self.system.parameter_vector({k: parameters[k] for k in self.system.parameter_names}))

    @property
    def at_rest(self) -> bool:
        """Whether the states of the solutions do not move."""
        return False

    @property
    def called(self) -> str:
        """What the solutions are called in a list of branches."""
        return self.counted

    @property
    @abstractmethod
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters that vary."""

    @property
    @abstractmethod
    def sound(self) -> NDArray[np.bool_]:
        """Whether each solution is one of the system, and not of equations that hold elsewhere, shape (point,)."""

    @property
    @abstractmethod
    def extremes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Least and greatest value of each state of each solution, shape (point, state) each."""

    @property
    def equations(self) -> NDArray[np.int64]:
        """Number of the equations that each point solves, shape (point,): of its signature, mode or itinerary."""
        return np.zeros(len(self), dtype=np.int64)

    @abstractmethod
    def column(self, name: str) -> NDArray[np.float64]:
        """Return a quantity along the curve."""

    @abstractmethod
    def value_at(self, point: SpecialPoint[Solved], name: str) -> float:
        """Return the quantity that `column` names at a special point."""

    def solution(self, index: int) -> Solved:
        """Return the solution of one point, from which another continuation can start.

        Parameters
        ----------
        index : int
            The point; negative ones count from the end.

        Returns
        -------
        PeriodicOrbit, Equilibrium or MapOrbit
            With the parameters of the point.

        Raises
        ------
        InputError
            There is no such point.
        """
        return self._solution(self._place(index))

    @abstractmethod
    def _solution(self, index: int) -> Solved:
        """Return the solution of one point, counted from the start."""

    def _own_columns(self) -> dict[str, NDArray[np.float64]]:
        """Return the columns, shape (point,) each, that only this kind of curve has."""
        return {}

    def _scale(self) -> NDArray[np.float64] | None:
        """Return sizes of the unknowns, for a locus that starts from one of the points; None if unknown."""
        return None

    def _extent(self, solution: Solved) -> NDArray[np.float64]:
        """Return numbers by which solutions nearby are told apart."""
        return np.concatenate(solution.extremes)

    if TYPE_CHECKING:  # a field of some kinds, computed by others

        @property
        def x0(self) -> NDArray[np.float64]:
            """Where each solution starts, shape (point, state)."""

    else:

        def __getattr__(self, name: str) -> Any:
            """Say where an accessor is now that stood here up to version 0.1."""
            now = ": it is now solution" if name in ("orbit", "equilibrium") else ""
            words = f"{type(self).__name__!r} object has no attribute {name!r}{now}"
            raise AttributeError(words, name=name, obj=self)  # with both, Python tells the nearest name

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table with a row for each point: what varies, the state at the start, stability, multipliers.

        Of orbits also the period, extremes and the signature. `to_xarray` has all else, with dimensions of its own.

        Returns
        -------
        pandas.DataFrame
            Its index is the point. Multipliers or eigenvalues are complex numbers in columns ``multiplier_1``, ...

        Raises
        ------
        SaltusError
            pandas is not installed.

        Examples
        --------
        >>> from saltus import HybridSystem, continue_equilibrium, find_equilibrium
        >>> fold = HybridSystem.smooth({"x": "r - x**2"}, {"r": 1.0})
        >>> table = continue_equilibrium(find_equilibrium(fold, {}, [1.0]), "r", (-1.0, 4.0)).to_dataframe()
        >>> list(table.columns)
        ['r', 'x', 'stable', 'regular', 'eigenvalue_1', 'residual', 'arclength']
        """
        from saltus.extras import pd

        return pd.DataFrame(self._of_each(), index=pd.RangeIndex(len(self), name="point"))

    def _of_each(self) -> dict[str, Any]:
        """Return the columns of `to_dataframe`, shape (point,) each."""
        declared = dict(zip(self.varied, self.values.reshape(len(self), -1).T, strict=True))
        declared |= dict(zip(self.system.states, np.asarray(self.x0).T, strict=True))
        found = declared | {"stable": self.stable, self.sound_called: self.sound} | self._own_columns()
        found |= {f"{name}_{k + 1}": column for name, table in self._spectrum() for k, column in enumerate(table.T)}
        return found | {"residual": self.residual, "arclength": self.arclength} | declared

    def _spectrum(self) -> list[tuple[str, NDArray[np.complex128]]]:
        """Return multipliers or eigenvalues, shape (point, value), with the name of one."""
        return []

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, label: str) -> SpecialPoint[Solved]:
        """Return the special point of that label."""
        known = {point.label: point for point in self.special_points}
        if not known:
            ends = f"from {', '.join(self.varied)} = {self.values[0]} to {self.values[-1]}"
            raise InputError("label", label, f"left out: the {len(self)} points {ends} have no special point")
        return known[checks.chosen("label", label, known)]

    def __iter__(self) -> Iterator[Solved]:
        """Go through the solutions of all points."""
        return (self._solution(i) for i in range(len(self)))

    def _place(self, index: int) -> int:
        """Return the place of a point; negative ones are counted from the end."""
        return range(len(self))[checks.count("index", index, -len(self), len(self) - 1)]

    def _parameters_at(self, index: int) -> dict[str, float]:
        """Return all parameters of one point."""
        return {**self.parameters, **dict(zip(self.varied, np.atleast_1d(self.values[index]).tolist(), strict=True))}

    def _kept_attributes(self) -> dict[str, str]:
        """Return attributes of a Dataset that all curves have."""
        return {
            "varied": json.dumps(list(self.varied)),
            "parameters": json.dumps(dict(self.parameters)),
            "definition": json.dumps(self.system.definition()),
            "stopped_first": self.stopped[0],
            "stopped_last": self.stopped[1],
            "rejected": json.dumps(list(self.rejected)),
            "options": json.dumps(dict(self.options)),
            "audit": json.dumps(self.audit.as_list()),
        }

    @staticmethod
    def _kept_fields(held: Contents) -> dict[str, Any]:
        """Return the fields in the attributes of a file that are read in one way for all curves."""
        return {
            "stopped": (held.text("stopped_first"), held.text("stopped_last")),
            "rejected": tuple(held.texts("rejected")),
            "options": held.json("options", dict),
            # absent from earlier files
            "audit": Audit.from_list(held.json("audit", list)) if "audit" in held.dataset.attrs else Audit(),
        }

    @classmethod
    @abstractmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...], values: NDArray[np.float64]) -> dict[str, Any]:
        """Return `values` and the fields that only this kind of curve has, as `to_xarray` described them."""

    def _described(self, what: str) -> str:
        """Return the text of a `repr`: kind, range, ends and special points."""
        of = self.system.name or self.system.unnamed
        lines = [f"{what} of {of}: {len(self)} {self.counted}, {int(self.stable.sum())} stable"]
        for name, column in zip(self.varied, self.values.reshape(len(self), -1).T, strict=True):
            ends = (column.min(), column.max()) if len(self) else (np.nan, np.nan)
            lines[0] += ", {} from {:.9g} to {:.9g}".format(name, *ends)
        lines += [f"  began: {self.stopped[0]}", f"  ended: {self.stopped[1]}"]
        lines += [f"  conserved {name} = {value:.9g}" for name, value in self.conserved.items()]
        lines += [f"  {line}" for line in repr(self.special_points).splitlines()]
        lines += [f"  audit: {line}" for line in self.audit.lines()]
        return "\n".join(lines)
