"""What a state allows: the mode in which a motion starts, rates of the phase, and roots that have no value there."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import sympy

from saltus.errors import InputError
from saltus.scales import EPS
from saltus.system.evaluate import evaluate
from saltus.system.expressions import parse
from saltus.system.own_states import absent_states
from saltus.system.parts import ENDS, at_phases
from saltus.system.writing.printer import is_broken

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.compiled_definition import CompiledDefinition
    from saltus.system.definition import Definition
    from saltus.system.hybrid import HybridSystem

__all__ = [
    "allowed_modes",
    "defined_modes",
    "domain_value",
    "negative_root",
    "passed_event",
    "phase_rate",
    "starting_mode",
    "told_root",
]

_APART = 1e-3  # change of a state, over its size, by which a surface's slope is looked at
_ON_SURFACE = 1e-8  # distance from a surface, over its variation with the states' sizes, up to which a state is on it


def domain_value(system: HybridSystem, mode: int, x: NDArray[np.float64], p: NDArray[np.float64]) -> float:
    """Return the domain function of a mode, positive where its field is defined."""
    out = np.empty(1)
    system.compiled.call("guard", mode, 0, x, system.compiled.extended(p), out)
    return float(out[0])


def starting_mode(system: HybridSystem, x: NDArray[np.float64], p: NDArray[np.float64], mode: str | None = None) -> int:
    """Return the index of the mode in which a motion starts at x.

    That is `mode`, in whose domain x must lie; by default the first whose domain holds there and none of whose events
    that lead to another mode is passed.
    """
    if mode is not None:
        index = system.mode_index(mode)
        if mode in ENDS:
            raise InputError("mode", mode, f"one of {', '.join(name for name in system.modes if name not in ENDS)}")
        _check_own(system, mode, x, p)
        if not (value := domain_value(system, index, x, p)) > 0.0:
            allowed = f"in the domain of mode {mode!r}, {system.modes[mode].domain} > 0"
            raise InputError("x0", x.tolist(), allowed, f"it is {value:.6g} there")
        return index
    possible = list(allowed_modes(system, x, p))
    if possible and not _leaves_to_either_side(system, x, p, possible):
        return possible[0]
    if possible:
        names = ", ".join(system.mode_names[index] for index in possible)
        raise InputError("x0", x.tolist(), "a start with one motion from it", f"pass mode=, one of {names}")
    reasons = []
    for index, name in enumerate(system.mode_names):
        if not (value := domain_value(system, index, x, p)) > 0.0:
            reasons.append(f"{name}: {system.modes[name].domain} is {value:.6g}, not positive")
        else:
            reasons.append(f"{name}: past its event {passed_event(system, index, x, p)!r}")
    allowed = "in the domain of a mode and before its events"
    raise InputError("x0", x.tolist(), allowed, "; ".join(reasons))


def _leaves_to_either_side(
    system: HybridSystem, x: NDArray[np.float64], p: NDArray[np.float64], allowed: list[int]
) -> bool:
    """Return whether a start lies on a surface along which motions may slide, but leave it here in several modes.

    Where a motion may slide as well, one way is left, unless it is a two-fold: the sliding field has no value there.
    """
    sliding = [index for index in allowed if system.modes[system.mode_names[index]].surface is not None]
    if sliding or len(allowed) < 2:
        return any(not np.all(np.isfinite(system.compiled.field(index, x, p))) for index in sliding)
    parameters = dict(zip(system.parameter_names, p.tolist(), strict=True))
    surfaces = {mode.surface for mode in system.modes.values() if mode.surface is not None}
    met = {text for text in surfaces if abs(evaluate(system, text, x[None], 0, parameters)[0]) == 0.0}
    beside = {t.source for t in system.transitions if t.event in met}
    return sum(system.mode_names[index] in beside for index in allowed) > 1


def _check_own(system: HybridSystem, mode: str, x: NDArray[np.float64], p: NDArray[np.float64]) -> None:
    """Raise `InputError` where a state has what its mode lacks, or is off the surface along which the mode slides."""
    if np.any(x[(absent := absent_states(system, system.mode_index(mode)))] != 0.0):
        names = ", ".join(system.states[i] for i in absent)
        raise InputError("x0", x.tolist(), f"of the states of mode {mode!r}", f"it lacks {names}")
    surface = system.modes[mode].surface
    if surface is None:
        return
    parameters = dict(zip(system.parameter_names, p.tolist(), strict=True))
    near = np.vstack([x, x + np.diag(_APART * np.abs(x))])
    heights = evaluate(system, surface, near, system.mode_index(mode), parameters)
    if not abs(heights[0]) <= _ON_SURFACE * float(np.abs(heights[1:] - heights[0]).sum()) / _APART:
        allowed = f"on the surface of mode {mode!r}, {surface} = 0"
        raise InputError("x0", x.tolist(), allowed, f"it is {heights[0]:.6g} there")


def allowed_modes(system: HybridSystem, x: NDArray[np.float64], p: NDArray[np.float64]) -> Iterator[int]:
    """Go through the indices of the modes in which a motion may start at x."""
    return (index for index in defined_modes(system, x, p) if not passed_event(system, index, x, p))


def defined_modes(system: HybridSystem, x: NDArray[np.float64], p: NDArray[np.float64]) -> Iterator[int]:
    """Go through the indices of the modes in which a motion may be at x: before their events, or beyond."""
    for index in range(len(system.modes)):
        absent = absent_states(system, index)
        if not (absent.size and (x[absent] != 0.0).any()) and domain_value(system, index, x, p) > 0.0:
            yield index


def passed_event(system: HybridSystem, mode: int, x: NDArray[np.float64], p: NDArray[np.float64]) -> str:
    """Return the name of a transition to another mode whose event is passed already; nothing where none is."""
    compiled, event, when = system.compiled, np.empty(2), np.empty(1)
    extended = compiled.extended(p)
    for k, transition in enumerate(system.transitions):
        if system.mode_names.index(transition.source) != mode or transition.target == transition.source:
            continue
        if at_phases(system, transition):  # it comes again
            continue
        compiled.call("event", k, 0, x, extended, event)
        side = event[0] if event[0] != 0.0 else event[1]
        compiled.call("guard", len(system.modes) + k, 0, x, extended, when)
        if side * transition.direction > 0.0 and when[0] > 0.0:
            return transition.name
    return ""


def phase_rate(system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int) -> float:
    """Return the rate of the phase.

    Raises
    ------
    InputError
        It is not positive and finite.
    """
    assert system.phase is not None
    rate = float(system.compiled.field(mode, x, p)[-1])
    if not 0.0 < rate < math.inf:
        raise InputError(f"rate of the phase {system.phase[0]}", rate, "> 0 and finite")
    return rate


def negative_root(
    system: CompiledDefinition, mode: int, x: NDArray[np.float64], p: NDArray[np.float64], errors: NDArray[np.float64]
) -> str:
    """Return in words which root in a mode has a negative argument beyond errors of the state; empty without one.

    Parameters
    ----------
    mode : int
        Index of the mode, or of a map's piece.
    x, errors : ndarray, shape (all states,)
        The state, and the errors of its components.
    p : ndarray
        Parameters, extended or not.
    """
    if not system.compiled.under_roots:
        return ""
    count = len(system.modes) + len(system.transitions)
    place = count + sum(map(len, system.conditions.values())) + mode
    x, p, out = np.ascontiguousarray(x), system.compiled.extended(p[: len(system.parameters)]), np.empty(1)
    for first, state in ((place, x), (place + count, np.concatenate([x, errors / EPS]))):
        system.compiled.call("guard", first, 0, state, p, out)
        if out[0] >= 0.0:
            return ""
    return told_root(system, mode, x, p)


def told_root(system: Definition, mode: int, x: NDArray[np.float64], p: NDArray[np.float64]) -> str:
    """Return in words which root has the least negative argument, in a mode or a transition from it.

    Parameters
    ----------
    mode : int
        Index of the mode, or of a map's piece.
    x : ndarray, shape (all states,)
        The state.
    p : ndarray
        Parameters, extended or not.
    """
    names = (*system.all_states, *system.parameters)
    at = zip(names, [*x.tolist(), *p[: len(system.parameters)].tolist()], strict=True)
    values = {sympy.Symbol(name, real=True): sympy.Float(value) for name, value in at}
    name = system.mode_names[mode]
    ways = [t for t in system.transitions if t.source == name]
    texts = [*system.modes[name].field.values(), *(t.event for t in ways), *(t.when for t in ways if t.when)]
    texts += [text for t in ways for text in t.reset.values()]
    found = []
    for power in {p for text in texts for p in parse(text, names, "formula").atoms(sympy.Pow)}:
        exponent, base = power.exp.xreplace(values), power.base.xreplace(values).evalf()
        if base.is_number and base.is_real and base < 0 and exponent.is_number and is_broken(exponent):
            found.append((float(base), _shown(power.base), _shown(power)))
    if not found:
        return "the argument of a root is negative"
    value, argument, power = min(found)
    other = "a piece" if system.part == "piece" else f"a mode, and a transition at {argument} = 0,"
    return (
        f"the argument of a root is negative: {argument} is {value:.6g} in {power}; define {other} where it is negative"
    )


def _shown(expression: sympy.Expr) -> str:
    short = expression.replace(lambda e: e.is_Float, lambda e: sympy.Float(f"{float(e):.12g}"))
    return str(sympy.sstr(short, full_prec=False))
