"""Objective and constraints of an orbit: values and exact derivatives of observables, formulas and parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError, InputError
from saltus.orbits.observed import planned
from saltus.orbits.sensitivities import MULTIPLIERS, sensitivities

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.optimisation.carrying import Carried
    from saltus.system import HybridSystem

__all__ = ["Expressions", "Found", "read_expression"]


@dataclass(frozen=True)
class Found:
    """What an orbit gives.

    Attributes
    ----------
    carried : Carried
        The orbit.
    values : ndarray, shape (expressions,)
        Values of the expressions; a phase is continuous from orbit to orbit.
    slopes : ndarray, shape (expressions, parameters)
        Their derivatives.
    phases : ndarray, shape (phases,)
        Phases within formulas.
    multipliers : ndarray of complex, shape (multipliers,)
        Floquet multipliers without the trivial one; empty where stability is not asked for.
    multiplier_slopes : ndarray of complex, shape (multipliers, parameters)
        Their derivatives.
    """

    carried: Carried
    values: NDArray[np.float64]
    slopes: NDArray[np.float64]
    phases: NDArray[np.float64]
    multipliers: NDArray[np.complex128]
    multiplier_slopes: NDArray[np.complex128]


def read_expression(system: HybridSystem, name: object) -> str:
    """Return a parameter, observable or formula, checked.

    Raises
    ------
    InputError
        It is none.
    """
    try:
        planned(system, (name,))  # type: ignore[arg-type]
    except InputError as error:
        if name in system.parameter_names:
            return str(name)
        what, value, allowed, hint = error.args
        raise InputError(what, value, f"a parameter, or {allowed}", hint) from None
    return str(name)


@dataclass(frozen=True)
class Expressions:
    """Expressions that are evaluated together, and whether multipliers are wanted.

    Attributes
    ----------
    system : HybridSystem
        The system.
    names : tuple of str
        The expressions.
    stable : bool
        Whether orbits must be stable, and their multipliers are wanted.
    """

    system: HybridSystem
    names: tuple[str, ...]
    stable: bool

    def _parts(self) -> tuple[list[str], list[str], list[float]]:
        """Return observables, phases within formulas, and the turn of each expression; 0 of all but phases."""
        observed = [name for name in self.names if not self._is_parameter(name)]
        formulas = planned(self.system, tuple(observed)).formulas
        phases = [
            part
            for formula in formulas.values()
            if formula.expression is not None
            for part, one in formula.parts.items()
            if one.kind == "phase"
        ]
        turns = [formulas[name].turn if name in formulas else 0.0 for name in self.names]
        return observed, list(dict.fromkeys(phases)), turns

    def _is_parameter(self, name: str) -> bool:
        if name not in self.system.parameter_names:
            return False
        try:
            planned(self.system, (name,))
        except InputError:
            return True
        return False

    def at(self, carried: Carried, near: Found | None = None) -> Found | str:
        """Return values and derivatives of an orbit, or why there are none; near: those of an orbit nearby."""
        observed, phases, turns = self._parts()
        wanted = tuple(dict.fromkeys([*observed, *phases]))
        if self.stable and not carried.orbit.stable:
            return "the orbit loses its stability"
        try:
            seen = sensitivities(carried.problem, carried.u, (*wanted, *([MULTIPLIERS] if self.stable else ())))
        except (InputError, ConvergenceError) as error:
            return str(error)
        found = Found(carried, *self._table(carried, seen.values), np.array([seen.values[name].value for name in phases]),
                      np.zeros(0, dtype=complex), np.zeros((0, len(carried.names)), dtype=complex))  # fmt: skip
        if near is not None:
            found = _continued(found, near, np.array(turns))
            widths = np.array([planned(self.system, (name,)).formulas[name].turn for name in phases])
            if np.any(np.abs(found.phases - near.phases) > 0.5 * widths):
                return f"{phases[int(np.argmax(np.abs(found.phases - near.phases)))]} within a formula jumps by a turn"
        for name in wanted:
            if not np.all(np.isfinite(seen.values[name].slopes)) or not np.isfinite(seen.values[name].value):
                return f"{name} has no derivative: {seen.values[name].note}"
        if seen.multipliers is None:
            return found
        inner = len(seen.multipliers.values) - (self.system.phase is None)
        return replace(found, multipliers=seen.multipliers.values[:inner],
                       multiplier_slopes=seen.multipliers.slopes[:inner])  # fmt: skip

    def _table(self, carried: Carried, seen: dict[str, object]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return values and derivatives of all expressions, those of parameters among them."""
        values, slopes = np.zeros(len(self.names)), np.zeros((len(self.names), len(carried.names)))
        for i, name in enumerate(self.names):
            if name in seen:
                values[i], slopes[i] = seen[name].value, seen[name].slopes  # type: ignore[attr-defined]
            else:
                values[i] = carried.orbit.parameters[name]
                slopes[i] = [float(name == other) for other in carried.names]
        return values, slopes


def _continued(found: Found, near: Found, turns: NDArray[np.float64]) -> Found:
    """Return values in which phases are those next to the phases of an orbit nearby."""
    rounds = np.round(np.divide(near.values - found.values, turns, out=np.zeros(len(turns)), where=turns > 0.0))
    return replace(found, values=found.values + turns * rounds)
