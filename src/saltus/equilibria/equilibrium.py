"""An equilibrium as a result: mode, state, eigenvalues, stability, whether it is regular."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus import checks
from saltus.algebraic.solution import AlgebraicSolution, Packed
from saltus.contents import Contents
from saltus.described import described
from saltus.equilibria.problem import EquilibriumProblem
from saltus.equilibria.pseudo import beside_two_fold, residual_of
from saltus.equilibria.spectrum import NEUTRAL, eigenvalues, kind_of, multiplicity, sized_eigenvalues, terms_at
from saltus.result import frozen
from saltus.scales import SEPARATED
from saltus.system import HybridSystem
from saltus.system.plain import expect_values, held_parameters, held_system

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Equilibrium", "faults_of"]

# why the field of a sliding mode is 0/0 at an equilibrium, whose eigenvalues are those next to it
TWO_FOLD = "both fields beside it are tangent to the surface, where one eigenvalue passes infinity"
_ON_SURFACE = 1e-9  # event function, over its variation with the states' sizes, up to which a state lies on the surface
_ASIDE = 1e-3  # change of a parameter, over its value, beside a point at which all eigenvalues may vanish
_GROWS = 1e-6  # real part, over the value's size, above which a disturbance grows


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(AlgebraicSolution):
    """A state of one mode at which the field vanishes.

    Attributes
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float
        All parameters.
    mode : str
        The mode.
    state : ndarray, shape (states,)
        The state.
    eigenvalues : ndarray of complex, shape (states less conserved,)
        Eigenvalues of the field's Jacobian at fixed `conserved`, the largest real part first.
    residual : float
        Largest component of the field, over the sizes of its terms.
    reasons : tuple of str
        Why the equilibrium is virtual: it lies beyond an event of its mode, or outside the mode's domain. Empty for a
        regular one.

    Examples
    --------
    >>> import saltus
    >>> lorenz = saltus.HybridSystem.smooth(
    ...     {"x": "10*(y - x)", "y": "x*(r - z) - y", "z": "x*y - 8*z/3"}, {"r": 0.5}
    ... )
    >>> rest = saltus.find_equilibrium(lorenz)
    >>> rest.kind, rest.stable
    ('stable node', True)
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    mode: str
    state: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    residual: float
    reasons: tuple[str, ...] = ()

    noun = "an equilibrium"
    at_rest = True
    packed = (
        Packed("state", ("state",)),
        Packed("eigenvalue", ("eigenvalue",), complex),
        Packed("mode", (), int, lambda system: len(system.modes) - 1),
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "state", frozen(self.state))
        object.__setattr__(self, "eigenvalues", frozen(self.eigenvalues, np.complex128))

    @property
    def x0(self) -> NDArray[np.float64]:
        """The state, from which a motion starts."""
        return self.state

    @property
    def extremes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Least and greatest value of each state: twice the state."""
        return self.state, self.state

    def _states_along(self, points: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return np.zeros(1), self.state[None]

    def row(self) -> dict[str, Any]:
        """Return what a table says of the equilibrium: states, stability, mode, whether it is regular."""
        row: dict[str, Any] = dict(zip(self.system.states, self.state.tolist(), strict=True))
        return row | {"stable": self.stable, "mode": self.mode, "regular": self.regular}

    @property
    def stable(self) -> bool:
        """Whether all eigenvalues have negative real parts, beyond rounding."""
        return bool(np.all(self.eigenvalues.real < -NEUTRAL * self.value_sizes))

    @property
    def unstable(self) -> int:
        """Number of eigenvalues whose real part is positive, beyond rounding."""
        return int(np.sum(self.eigenvalues.real > _GROWS * self.value_sizes))

    @cached_property
    def value_sizes(self) -> NDArray[np.float64]:
        """Sizes of the eigenvalues, as many: the largest modulus, or that of the terms of far slower ones."""
        sizes = np.full(self.eigenvalues.size, float(np.abs(self.eigenvalues).max(initial=0.0)))
        if float(np.abs(self.eigenvalues).min(initial=np.inf)) >= SEPARATED * sizes.max(initial=0.0):
            return sizes
        problem = self.problem(*self.system.parameters)
        u = np.append(self.state, [self.parameters[name] for name in self.system.parameters])
        A = problem.within(u, problem.evaluate(u)[1][:, : self.state.size])
        if not np.isfinite(A).all():
            return sizes
        values, found = sized_eigenvalues(A, lambda: problem.within(u, terms_at(problem, u)))
        return found if values.size == self.eigenvalues.size else sizes

    @property
    def begins_in(self) -> str:
        """See `AlgebraicSolution.begins_in`: `mode`."""
        return self.mode

    @staticmethod
    def _held_system(held: Contents) -> HybridSystem:
        """See `AlgebraicSolution._held_system`."""
        return held_system(held)

    def pack(self) -> tuple[Any, ...]:
        """Return state, eigenvalues and index of the mode."""
        return self.state, self.eigenvalues, self.system.mode_index(self.mode)

    @classmethod
    def _unpack(
        cls, system: Any, parameters: Mapping[str, float], parts: Sequence[Any], residual: float, reasons: Sequence[str]
    ) -> Self:
        """See `AlgebraicSolution._unpack`."""
        state, values, mode = parts
        return cls(system, parameters, system.mode_names[mode], state, values, residual, tuple(reasons))

    def _multiplicity(self, type: str, varied: Sequence[str]) -> int:
        (along, *_), x = varied, self.state
        aside = self.parameters[along] + _ASIDE * max(abs(self.parameters[along]), 1.0)
        problem, u = self.problem(along), np.append(x, aside)
        J = problem.within(u, problem.evaluate(u)[1][:, :-1])
        unit = float(np.abs(np.linalg.eigvals(J)).max()) if np.isfinite(J).all() else 0.0
        return multiplicity(self.eigenvalues, type, unit, self.value_sizes)

    @property
    def kind(self) -> str:
        """The kind in words, as ``stable focus`` or ``saddle (1 unstable)``."""
        return kind_of(self.eigenvalues, self.value_sizes)

    @property
    def unknowns(self) -> NDArray[np.float64]:
        """Unknowns of the equations: the state."""
        return self.state

    @classmethod
    def from_unknowns(cls, problem: EquilibriumProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> Self:
        """Return the equilibrium with given unknowns.

        Parameters
        ----------
        problem : EquilibriumProblem
            The equations.
        u : ndarray, shape (n + active,)
            The unknowns.
        sizes : ndarray, shape (n,)
            Typical sizes of the states.

        Returns
        -------
        Equilibrium
            As the unknowns are, solved or not: `residual` says how well.

        Raises
        ------
        ValueError
            The unknowns are of another number.
        """
        beside = beside_two_fold(problem, u, sizes)
        at = u if beside is None else beside
        J = problem.evaluate(at)[1]
        p = problem.parameters_at(u)
        return cls(
            system=problem.system,
            parameters=dict(zip(problem.system.parameter_names, p.tolist(), strict=True)),
            mode=problem.system.mode_names[problem.mode],
            state=u[: problem.n],
            eigenvalues=eigenvalues(problem.within(at, J[:, : problem.n])),
            residual=residual_of(problem, u, J, sizes),
            reasons=tuple(faults_of(problem, u, sizes)),
        )

    def problem(self, *active: str) -> EquilibriumProblem:
        """Return the equations, with some parameters among the unknowns.

        Parameters
        ----------
        *active : str
            Names of parameters, in the order of the definition.

        Returns
        -------
        EquilibriumProblem
            Its parameters have unit 1.

        Raises
        ------
        InputError
            There is no such parameter.
        """
        known = self.system.parameter_names
        indices = [known.index(checks.chosen("active", name, known)) for name in active]
        p = self.system.parameter_vector(self.parameters)
        kept, units = self.system.laws.totals(self.state, p), np.ones(len(indices))
        return EquilibriumProblem(self.system, self.system.mode_index(self.mode), p, indices, units, kept)

    def __getitem__(self, state: str) -> float:
        """Return one state by its name."""
        return float(self.state[self.system.states.index(checks.chosen("state", state, self.system.states))])

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the equilibrium as a Dataset: the state against ``state``, eigenvalues against ``eigenvalue``."""
        from saltus.extras import xr

        data = {
            "equilibrium": ("state", self.state),
            "eigenvalue_re": ("eigenvalue", self.eigenvalues.real),
            "eigenvalue_im": ("eigenvalue", self.eigenvalues.imag),
        }
        attrs = {
            "parameters": json.dumps(dict(self.parameters)),
            "definition": json.dumps(self.system.definition()),
            "mode": self.mode,
            "residual": self.residual,
            "reasons": json.dumps(list(self.reasons)),
        }
        return xr.Dataset(data, coords={"state": list(self.system.states)}, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> Self:
        system = held_system(held)
        held.names("state", system.states)
        expect_values(held, system, "eigenvalue", 0.0)
        mode = held.text("mode")
        system.mode_index(mode)
        parts = (held.array(f"eigenvalue_{part}", ("eigenvalue",)) for part in ("re", "im"))
        return cls(
            system=system,
            parameters=held_parameters(held, system),
            mode=mode,
            state=held.array("equilibrium", ("state",)),
            eigenvalues=_complex(*parts),
            residual=held.number("residual", least=0.0),
            reasons=tuple(held.texts("reasons")),
        )

    def __repr__(self) -> str:
        of = self.system.name or self.system.unnamed
        regular = "regular" if self.regular else f"virtual: {'; '.join(self.reasons)}"
        place = ", ".join(f"{name} = {value:.9g}" for name, value in zip(self.system.states, self.state, strict=True))
        values = ", ".join(_short(value) for value in self.eigenvalues.tolist())
        kept = "".join(f"\n  conserved {name} = {value:.9g}" for name, value in self.conserved.items())
        return (
            f"Equilibrium of {of} in mode {self.mode}: {self.kind}, {regular}\n"
            f"  {place}{kept}\n  eigenvalues {values}\n  residual {self.residual:.2g}"
        )


def _complex(real: NDArray[np.float64], imaginary: NDArray[np.float64]) -> NDArray[np.complex128]:
    values = np.empty(real.shape, dtype=np.complex128)
    values.real, values.imag = real, imaginary
    return values


def _short(value: complex) -> str:
    return f"{value.real:.6g}" if value.imag == 0.0 else f"{value.real:.6g}{value.imag:+.6g}i"


def faults_of(problem: EquilibriumProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> list[str]:
    """Return why an equilibrium is virtual: events of its mode that are passed, a domain that is left."""
    system, reasons = problem.system, []
    mode = system.mode_names[problem.mode]
    if beside_two_fold(problem, u, sizes) is not None:
        return [TWO_FOLD]
    domain = system.modes[mode].domain
    if domain is not None and (value := problem.guard(problem.mode, u)) <= 0.0:
        reasons.append(f"{domain} is {value:.6g}, not positive as in the domain of {mode}")
    if told := problem.negative_root(u, sizes):
        reasons.append(told)
    for k in problem.ways_out:
        transition = system.transitions[k]
        height, gradient = problem.event(k, u)
        beyond = height * transition.direction
        unit = float(np.abs(gradient[: problem.n]) @ sizes)
        if beyond > _ON_SURFACE * unit and problem.guard(len(system.modes) + k, u) > 0.0:
            reasons.append(f"it lies beyond the event {transition.name}: {transition.event} is {height:.6g}")
    return reasons
