"""A definition with perturbations of its state beside it: their linear equations, and saltation at events."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import sympy

if TYPE_CHECKING:
    from saltus.system.derivatives import Symbolic

__all__ = ["with_tangents"]


def with_tangents(system: Symbolic, columns: int) -> Symbolic:
    """Return a definition whose state has perturbations behind it, before the phase, which is not perturbed.

    Between events a perturbation u obeys ``u' = (df/dx) u``. Where a transition happens it becomes
    ``Dg (u - a f1) + a f2`` with ``a = (dh u)/(dh f1)``; see docs/theory/lyapunov.md.

    Parameters
    ----------
    system : Symbolic
        The definition.
    columns : int
        How many perturbations.
    """
    found = copy.copy(system)
    n = len(system.system.states)
    phase = system.x[n:]
    names = [symbol.name for symbol in system.x[:n]]
    # no name of a user's has a space
    tangents = [[sympy.Symbol(f"{name} {c}", real=True) for name in names] for c in range(columns)]
    found.x = [*system.x[:n], *(u for column in tangents for u in column), *phase]
    found.field = []
    for field in system.field:
        jacobian = system.gradients(field[:n], system.x[:n])
        rates = [
            sum((entry * u for entry, u in zip(row, column, strict=True)), sympy.S.Zero)
            for column in tangents
            for row in jacobian
        ]
        found.field.append([*field[:n], *rates, *field[n:]])
    found.reset = [
        [*reset[:n], *(u for column in tangents for u in _passed(system, k, column)), *reset[n:]]
        for k, reset in enumerate(system.reset)
    ]
    found.rate = system.rate
    return found


def _passed(system: Symbolic, k: int, column: list[sympy.Symbol]) -> list[sympy.Expr]:
    """Return a perturbation behind transition k."""
    n, reset = len(system.system.states), system.reset[k]
    transition = system.system.transitions[k]
    source, target = system.source[k], system.system.mode_names.index(transition.target)
    if source == target and all(g == x for g, x in zip(reset, system.x, strict=True)):
        return list(column)
    moved = dict(zip(system.x, reset, strict=True))
    before = system.field[source]
    after = [rate.xreplace(moved) for rate in system.field[target]]
    gradient = system.gradients([system.event[k]], system.x)[0]
    late = sum((slope * u for slope, u in zip(gradient, column, strict=False)), sympy.S.Zero) / system.rate[k]
    jacobian = system.jacobian(reset[:n])
    ahead = [u - late * rate for u, rate in zip([*column, *([0] * len(system.x[n:]))], before, strict=True)]
    return [
        sum((entry * u for entry, u in zip(row, ahead, strict=True)), sympy.S.Zero) + late * after[i]
        for i, row in enumerate(jacobian)
    ]
