"""A kind of solution that saltus does not know: zeros of a polynomial with parameters. This module alone adds it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, final

import numpy as np
import xarray as xr

from saltus.algebraic.solution import AlgebraicSolution, Packed
from saltus.continuation.results.algebraic_curve import AlgebraicCurve
from saltus.continuation.results.parameters import OneParameter, TwoParameters
from saltus.continuation.runs.algebraic import AlgebraicRun, algebraic_columns
from saltus.continuation.runs.algebraic_locus import AlgebraicLocusRun
from saltus.continuation.runs.one_parameter import branch_run
from saltus.continuation.runs.two_parameters import locus_run


@dataclass(frozen=True)
class Polynomial:
    """The sum of p x^k over all parameters p, k the power of each."""

    powers: Mapping[str, int]
    parameters: Mapping[str, float]
    name: str = ""

    unnamed = "a polynomial"
    states, output_names, angle_places = ("x",), (), np.empty(0, dtype=np.int64)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return tuple(self.powers)

    def allowed(self, name: str) -> tuple[float, float]:
        return -math.inf, math.inf

    def parameter_vector(self, parameters: Mapping[str, float]) -> np.ndarray:
        return np.array([parameters[name] for name in self.powers])

    def resolve(self, given: Mapping[str, float]) -> dict[str, float]:
        return dict(given)

    def definition(self) -> dict[str, Any]:
        return {"powers": dict(self.powers), "parameters": dict(self.parameters), "name": self.name}

    def zero(self, x: float, **parameters: float) -> Zero:
        p = {**self.parameters, **parameters}
        return Zero.from_unknowns(Equations(self, self.parameter_vector(p)), np.array([x]), np.ones(1))


@dataclass
class Equations:
    """The equation F = 0 as an `AlgebraicProblem`."""

    system: Polynomial
    p: np.ndarray
    active: Sequence[int] = ()

    n, period, circles = 1, 1, np.empty(0, dtype=np.int64)

    def __post_init__(self) -> None:
        self.scales, self._powers = np.ones(len(self.active)), np.array([*self.system.powers.values()])

    def parameters_at(self, u: np.ndarray) -> np.ndarray:
        p = self.p.copy()
        p[list(self.active)] = u[1:] * self.scales
        return p

    def _terms(self, x: float, derivative: int) -> np.ndarray:
        factors = [math.perm(power, derivative) if power >= derivative else 0 for power in self._powers.tolist()]
        return np.array(factors) * x ** np.maximum(self._powers - derivative, 0)

    def evaluate(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        p, terms = self.parameters_at(u), self._terms(u[0], 0)
        own = terms[list(self.active)] * self.scales
        return np.array([p @ terms]), np.append(p @ self._terms(u[0], 1), own)[None]

    def second(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        own = self._terms(u[0], 1)[list(self.active)] * self.scales
        return np.append(self.parameters_at(u) @ self._terms(u[0], 2) * v[0] + own @ v[1:], own * v[0])[None]

    def third(self, u: np.ndarray, *directions: np.ndarray) -> np.ndarray:
        return np.array([self.parameters_at(u) @ self._terms(u[0], 3) * math.prod(v[0] for v in directions)])

    def rounding(self, u: np.ndarray, J: np.ndarray, sizes: np.ndarray) -> float:
        terms = float(np.abs(self.parameters_at(u)) @ sizes[0] ** self._powers)
        return float(abs(self.evaluate(u)[0][0]) / terms)


@final
@dataclass(frozen=True, eq=False)
class Zero(AlgebraicSolution):
    """A zero, and the slope of the polynomial there: that of the flow x' = F."""

    system: Polynomial
    parameters: Mapping[str, float]
    x: float
    slope: float
    residual: float
    reasons: tuple[str, ...] = ()

    noun, at_rest = "a zero", True
    packed = Packed("x", ()), Packed("slope", ())

    @property
    def x0(self) -> np.ndarray:
        return np.array([self.x])

    unknowns = x0

    @property
    def extremes(self) -> tuple[np.ndarray, np.ndarray]:
        return self.x0, self.x0

    @property
    def stable(self) -> bool:
        return self.slope < 0.0

    @property
    def unstable(self) -> int:
        return int(self.slope > 0.0)

    def _states_along(self, points: int) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(1), self.x0[None]

    def row(self) -> dict[str, Any]:
        return {"x": self.x, "stable": self.stable}

    def pack(self) -> tuple[Any, ...]:
        return self.x, self.slope

    @classmethod
    def _unpack(cls, system: Any, parameters: Any, parts: Any, residual: float, reasons: Any) -> Zero:
        return cls(system, parameters, float(parts[0]), float(parts[1]), residual)

    @staticmethod
    def _held_system(held: Any) -> Polynomial:
        return Polynomial(**held.json("definition", dict))

    def problem(self, *active: str) -> Equations:
        names = self.system.parameter_names
        return Equations(self.system, self.system.parameter_vector(self.parameters), [names.index(a) for a in active])

    @classmethod
    def from_unknowns(cls, problem: Equations, u: np.ndarray, sizes: np.ndarray) -> Zero:
        p, J = problem.parameters_at(u), problem.evaluate(u)[1]
        named = dict(zip(problem.system.parameter_names, p.tolist(), strict=True))
        return cls(problem.system, named, float(u[0]), float(J[0, 0]), problem.rounding(u, J, np.ones(1)))

    def to_xarray(self) -> xr.Dataset:
        numbers = {"x": self.x, "slope": self.slope, "residual": self.residual}
        texts = {"parameters": json.dumps(dict(self.parameters)), "definition": json.dumps(self.system.definition())}
        return xr.Dataset(attrs=numbers | texts)

    @classmethod
    def _read(cls, held: Any) -> Zero:
        numbers = [held.number(name) for name in ("x", "slope", "residual")]
        return cls(cls._held_system(held), held.json("parameters", dict), *numbers)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Zeros(AlgebraicCurve[Any]):
    """Zeros along a curve."""

    x: np.ndarray
    slope: np.ndarray

    counted = "zeros"
    solved = Zero
    written: ClassVar = {"x": Packed("x", ()), "slope": Packed("slope", ())}

    def _solution(self, index: int) -> Zero:
        numbers = (float(column[index]) for column in (self.x, self.slope, self.residual))
        return Zero(self.system, self._parameters_at(index), *numbers)


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ZeroBranch(OneParameter[Any], Zeros):
    """Zeros along one parameter."""

    def _attempts(self, a: Zero, b: Zero, share: float, value: float) -> Iterator[Callable[[], Zero]]:
        parameters = {**a.parameters, self.parameter: value}
        powers, p = list(self.system.powers.values()), self.system.parameter_vector(parameters)
        roots = np.roots([p[[power == k for power in powers]].sum() for k in range(max(powers), -1, -1)])
        nearest = roots[np.argmin(np.abs(roots - (a.x + share * (b.x - a.x))))]
        yield lambda: self.system.zero(float(nearest.real), **parameters)


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ZeroLocus(TwoParameters[Any], Zeros):
    """Double zeros along two parameters."""


def columns(joined: Any) -> dict[str, Any]:
    """Return the fields of `Zeros` that tell of zeros."""
    points = [point for _, point in joined.rows]
    slopes = [point.examined.data.values[0].real for point in points]
    return algebraic_columns(joined) | {"x": np.array([point.u[0] for point in points]), "slope": np.array(slopes)}


class ZeroRun(AlgebraicRun):
    """A branch of zeros under way."""

    result, columns = ZeroBranch, staticmethod(columns)


class ZeroLocusRun(AlgebraicLocusRun):
    """A locus of double zeros under way."""

    result, columns = ZeroLocus, staticmethod(columns)


@branch_run.register
def _(start: Zero, parameter: str) -> type[ZeroRun]:
    return ZeroRun


@locus_run.register
def _(solution: Zero) -> type[ZeroLocusRun]:
    return ZeroLocusRun
