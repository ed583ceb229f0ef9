"""Objective and constraints of an orbit: values and exact derivatives of observables, formulas and parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError, InputError
from saltus.flow.formulas import read_formula
from saltus.orbits.observables.observed import planned
from saltus.orbits.observables.sensitivities import MULTIPLIERS, sensitivities

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from saltus.optimisation.carrying import Carried
    from saltus.orbits.observables.observed import Differentiated
    from saltus.system import HybridSystem

__all__ = ["Expressions", "Found", "is_parameter", "read_expression"]


@dataclass(frozen=True)
class Found:
    """What an orbit gives."""

    carried: Carried  # the orbit
    # shape (expressions,): values of the expressions; a phase is continuous from orbit to orbit
    values: NDArray[np.float64]
    slopes: NDArray[np.float64]  # shape (expressions, parameters): their derivatives
    phases: NDArray[np.float64]  # shape (phases,): phases within formulas
    # shape (multipliers,): Floquet multipliers without the trivial one; empty where stability is not asked for
    multipliers: NDArray[np.complex128]
    multiplier_slopes: NDArray[np.complex128]  # shape (multipliers, parameters): their derivatives


def read_expression(system: HybridSystem, name: object) -> str:
    """Return a parameter, observable or formula, checked.

    Raises
    ------
    InputError
        It is none.
    """
    if isinstance(name, str) and name in (*system.all_states, *system.output_names):
        raise InputError("observable", name, "one number of an orbit", f"as 'mean({name})' or 'max({name})'")
    try:
        planned(system, (name,))
    except InputError as error:
        if isinstance(name, str) and name in system.parameter_names:
            return name
        what, value, allowed, hint = error.args
        if value != name:
            raise
        raise InputError(what, value, f"a parameter, or {allowed}", hint) from None
    return str(name)


@dataclass(frozen=True)
class Expressions:
    """Expressions that are evaluated together, and whether multipliers are wanted."""

    system: HybridSystem
    names: tuple[str, ...]  # the expressions
    stable: bool  # whether orbits must be stable, and their multipliers are wanted

    @cached_property
    def _observed(self) -> tuple[str, ...]:
        """The expressions that are no parameters."""
        return tuple(name for name in self.names if not is_parameter(self.system, name))

    @cached_property
    def _turns(self) -> NDArray[np.float64]:
        """Turn of each expression, shape (expressions,); 0 of all but phases."""
        formulas = planned(self.system, self._observed).formulas
        return np.array([formulas[name].turn if name in formulas else 0.0 for name in self.names])

    @cached_property
    def _phases(self) -> dict[str, float]:
        """Turns of the phases within formulas."""
        formulas = planned(self.system, self._observed).formulas.values()
        parts = [part for formula in formulas if formula.expression is not None for part in formula.parts]
        turns = {part: read_formula(self.system, part).turn for part in parts}
        return {part: turn for part, turn in turns.items() if turn > 0.0}

    def at(self, carried: Carried, near: Found | None = None) -> Found | str:
        """Return values and derivatives of an orbit, or why there are none; near: those of an orbit nearby."""
        if self.stable and not carried.orbit.stable:
            return "the orbit loses its stability"
        wanted = tuple(dict.fromkeys((*self._observed, *self._phases)))
        try:
            seen = sensitivities(carried.problem, carried.u, (*wanted, *([MULTIPLIERS] if self.stable else ())))
        except (InputError, ConvergenceError) as error:
            return str(error)
        for name, one in seen.values.items():
            if not np.isfinite(one.value) or not np.all(np.isfinite(one.slopes)):
                return f"{name} has no derivative: {one.note}"
        values, slopes = self._table(carried, seen.values)
        phases = np.array([seen.values[name].value for name in self._phases])
        if near is not None:
            values = values + self._turns * _rounds(near.values - values, self._turns)
            jumps = _rounds(near.phases - phases, np.array([*self._phases.values()]))
            if np.any(jumps):
                return f"{[*self._phases][int(np.flatnonzero(jumps)[0])]} within a formula jumps by a turn"
        inner, by = np.zeros(0, dtype=complex), np.zeros((0, len(carried.names)), dtype=complex)
        if seen.multipliers is not None:
            count = len(seen.multipliers.values) - (self.system.phase is None)
            inner, by = seen.multipliers.values[:count], seen.multipliers.slopes[:count]
        return Found(carried, values, slopes, phases, inner, by)

    def _table(
        self, carried: Carried, seen: Mapping[str, Differentiated]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return values and derivatives of all expressions, those of parameters among them."""
        values, slopes = np.zeros(len(self.names)), np.zeros((len(self.names), len(carried.names)))
        for i, name in enumerate(self.names):
            if name in seen:
                values[i], slopes[i] = seen[name].value, seen[name].slopes
            else:
                values[i] = carried.orbit.parameters[name]
                slopes[i] = [float(name == other) for other in carried.names]
        return values, slopes


def is_parameter(system: HybridSystem, name: str) -> bool:
    """Return whether an expression is a parameter; one that is called as an observable is none."""
    try:
        planned(system, (name,))
    except InputError:
        return True
    return False


def _rounds(away: NDArray[np.float64], turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how many turns lie in differences; 0 of what has no turn."""
    return np.asarray(np.round(np.divide(away, turns, out=np.zeros(len(turns)), where=turns > 0.0)))
