"""Fields that jump, as by ``sign(v)`` at v = 0: motions that are held at the jump, told from motions that pass it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.errors import DefinitionError
from saltus.system.filippov import lines_of
from saltus.system.once import once

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["check_continuous", "sticking_surface"]

_STEPS_AWAY = 8.0  # farthest from the jump, in steps of the motion
_CONTINUOUS = 1e-6  # difference of the fields on two sides of a surface, over their size, that is none
_ROUNDING = 64.0 * 2.220446049250313e-16  # of an expression, relative to its terms


class _Jump(NamedTuple):
    """An expression at whose zero a field may jump; `at` returns it with its gradient, (1 + all states,)."""

    text: str
    at: Callable[..., Any]


def sticking_surface(
    system: HybridSystem, mode: int, x: NDArray[np.float64], extended: NDArray[np.float64], step: float
) -> str | None:
    """Return the expression at whose zero the field jumps and both sides lead back, some steps from x; or None.

    Parameters
    ----------
    x : ndarray, shape (all states,)
        Full state.
    extended : ndarray
        Parameters with the constants behind them, `Compiled.extended`.
    step : float
        Length in time of the motion's steps there.

    References
    ----------
    A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, Kluwer 1988: a motion slides on a surface
    where the normal components of the fields on its two sides point to it.
    """
    for jump in _jumps(system)[mode]:
        sides = _sides(system, mode, jump, x, extended)
        if sides is None:
            continue
        value, slope, before, after = sides
        rates = float(slope @ before), float(slope @ after)
        if rates[1] < 0.0 < rates[0] and abs(value) <= _STEPS_AWAY * step * max(rates[0], -rates[1]):
            return jump.text
    return None


def check_continuous(
    system: HybridSystem, modes: NDArray[np.int64], states: NDArray[np.float64], extended: NDArray[np.float64]
) -> None:
    """Raise `DefinitionError` where a motion passes a jump of its mode's field, which no saltation matrix knows of.

    Parameters
    ----------
    modes : ndarray of int, shape (time,)
        Indices of the modes at some times of the motion.
    states : ndarray, shape (time, all states)
        Full states then.
    extended : ndarray
        Parameters with the constants behind them, `Compiled.extended`.
    """
    parameters, field = extended[: len(system.parameters)], np.empty(states.shape[1])
    for mode, jumps in enumerate(_jumps(system)):
        for jump in jumps:
            with np.errstate(all="ignore"):
                values = np.asarray(jump.at(*states.T, *parameters)[0] + np.zeros(len(states)))
            passed = (modes[:-1] == mode) & (modes[1:] == mode) & (values[:-1] * values[1:] < 0.0)
            for i in np.flatnonzero(passed):
                share = values[i] / (values[i] - values[i + 1])
                sides = _sides(system, mode, jump, states[i] + share * (states[i + 1] - states[i]), extended)
                if sides is None:
                    continue
                before, after = sides[2:]
                size = np.zeros(len(before))
                for x in states[i : i + 2]:
                    system.compiled.call("field", mode, 0, np.ascontiguousarray(x), extended, field)
                    size = np.maximum(size, np.abs(field))
                unlike = np.abs(after - before) > _CONTINUOUS * size
                if np.any(unlike):
                    name = system.mode_names[mode]
                    rate = system.modes[name].field[system.states[int(np.argmax(unlike))]]
                    lines = lines_of(system, mode, jump.text)
                    hint = f"it jumps at {jump.text} = 0: "
                    hint += f"define it as {lines}" if lines else "give each side a mode, and the surface one"
                    raise DefinitionError(
                        f"field of mode {name!r}", rate, "without a jump that the motion passes", hint
                    )


def _sides(
    system: HybridSystem, mode: int, jump: _Jump, x: NDArray[np.float64], extended: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
    """Value and gradient of an expression at x, and the fields just before and behind its zero there."""
    with np.errstate(all="ignore"):
        value, *gradient = jump.at(*x, *extended[: len(system.parameters)])
    slope = np.array(gradient, dtype=np.float64)
    square = float(slope @ slope)
    if not 0.0 < square < np.inf:
        return None
    beyond = 2.0 * abs(value) + _ROUNDING * float(np.abs(slope) @ np.abs(x)) + 1e-290
    fields = np.empty((2, x.size))
    for side, field in zip((-1.0, 1.0), fields, strict=True):
        system.compiled.call("field", mode, 0, x + (side * beyond - value) / square * slope, extended, field)
    return float(value), slope, fields[0], fields[1]


@once
def _jumps(system: HybridSystem) -> list[list[_Jump]]:
    """Expressions at whose zeros the field of each mode may jump."""
    if not any(system.compiled.jumps):
        return [[] for _ in system.modes]
    import sympy

    from saltus.system.derivatives import Symbolic

    symbolic = Symbolic(system)
    found = []
    for mode in range(len(system.modes)):
        jumps = []
        for argument in symbolic.jumps(mode):
            gradient = symbolic.gradients([argument], symbolic.x)[0]
            at = sympy.lambdify([*symbolic.x, *symbolic.p], [argument, *gradient], "numpy")
            jumps.append(_Jump(str(argument), at))
        found.append(jumps)
    return found
