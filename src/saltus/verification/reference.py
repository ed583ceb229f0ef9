"""A definition as plain functions of NumPy: fields, events and resets without the package's generated code.

The texts are read by the package's grammar. SymPy differentiates them, and its `lambdify` makes functions of them.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.system.expressions import parse

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem, Map

__all__ = ["MapReference", "Reference", "differences", "stencil"]

_REACH = 1e-6  # distance of the inner neighbours by which differences are taken, over the states' sizes


class _Texts:
    """Functions of the states, at parameters that are given once.

    Parameters
    ----------
    system : HybridSystem or Map
        The definition.
    parameters : mapping of str to float
        All parameters.
    """

    def __init__(self, system: HybridSystem | Map, parameters: Mapping[str, float]) -> None:
        self.names = (*system.all_states, *system.parameter_names)
        self.p = tuple(float(parameters[name]) for name in system.parameter_names)
        self.n = len(system.all_states)

    def both(self, texts: Sequence[str], x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the values of texts at one state, and their derivatives by the states, shape (texts, states)."""
        count = len(texts)
        try:
            found = np.array(_with_derivatives(tuple(texts), self.names, self.n)(*x.tolist(), *self.p), dtype=float)
        except (ArithmeticError, ValueError, TypeError):  # outside a function's domain; roots there are complex
            found = np.full(count * (1 + self.n), np.nan)
        return found[:count], found[count:].reshape(count, self.n)

    def slope(self, texts: Sequence[str], x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of texts by the states at one state, shape (texts, states)."""
        return self.both(texts, x)[1]

    def call(self, texts: Sequence[str], x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values of texts, shape (texts, ...), at states of shape (states, ...)."""
        with np.errstate(all="ignore"):
            values = _function(tuple(texts), self.names)(*x, *self.p)
        return np.array([np.broadcast_to(value, x.shape[1:]) for value in values], dtype=float)


class Reference(_Texts):
    """Fields, events, resets, conditions and outputs of a hybrid system."""

    def __init__(self, system: HybridSystem, parameters: Mapping[str, float]) -> None:
        super().__init__(system, parameters)
        self.system = system
        phase = () if system.phase is None else (system.phase[1],)
        self._fields = [
            (*(mode.field[name] for name in system.states), *phase) for mode in system.modes.values()
        ]  # fmt: skip
        self._resets = [
            tuple(transition.reset.get(name, name) for name in system.all_states) for transition in system.transitions
        ]

    def field(self, mode: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rates of all states, shape (states, ...), the phase last."""
        return self.call(self._fields[mode], x)

    def field_with_slope(self, mode: int, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the rates of all states at one state, and their derivative by all states."""
        return self.both(self._fields[mode], x)

    def field_slope(self, mode: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the field by all states."""
        return self.slope(self._fields[mode], x)

    def event_slope(self, transition: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the gradient of an event function."""
        return np.asarray(self.slope((self.system.transitions[transition].event,), x)[0])

    def reset_slope(self, transition: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of a reset."""
        return self.slope(self._resets[transition], x)

    def is_rooted(self, mode: int) -> bool:
        """Whether the field of a mode has fractional powers, so that it may end at a surface."""
        return _has_roots(self._fields[mode], self.names)

    def event(self, transition: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the event function of a transition."""
        return np.asarray(self.call((self.system.transitions[transition].event,), x)[0])

    def allows(self, transition: int, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return where the condition of a transition holds."""
        when = self.system.transitions[transition].when
        return np.ones(x.shape[1:], dtype=bool) if when is None else self.call((when,), x)[0] > 0.0

    def reset(self, transition: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states behind a transition."""
        return self.call(self._resets[transition], x)

    def domain(self, mode: int, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return where the domain of a mode holds."""
        text = self.system.modes[self.system.mode_names[mode]].domain
        return np.ones(x.shape[1:], dtype=bool) if text is None else self.call((text,), x)[0] > 0.0

    def quantities(self, mode: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return all states and then the outputs, shape (states + outputs, ...)."""
        name, outputs = self.system.mode_names[mode], self.system.outputs
        if not outputs:
            return x
        return np.concatenate([x, self.call([outputs[key][name] for key in outputs], x)])

    def ways_out(self, mode: int) -> list[int]:
        """Return the indices of the transitions that leave a mode."""
        name = self.system.mode_names[mode]
        return [k for k, transition in enumerate(self.system.transitions) if transition.source == name]


class MapReference(_Texts):
    """Images and conditions of the pieces of a map."""

    def __init__(self, system: Map, parameters: Mapping[str, float]) -> None:
        super().__init__(system, parameters)
        self._images = {
            key: tuple(piece.image[name] for name in system.states) for key, piece in system.pieces.items()
        }  # fmt: skip
        self._conditions = system.conditions

    def image(self, piece: str, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the image of a state by a piece."""
        return self.call(self._images[piece], x)

    def image_slope(self, piece: str, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the image of a state by a piece."""
        return self.slope(self._images[piece], x)

    def holds(self, piece: str, x: NDArray[np.float64]) -> bool:
        """Whether a piece holds at a state."""
        conditions = self._conditions.get(piece, ())
        return not conditions or bool(np.all(self.call(conditions, x) > 0.0))


def stencil(x: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a state and its neighbours along each state, shape (states, 1 + 4*states), for `differences`."""
    steps = np.diag(_REACH * sizes)
    return np.concatenate([x[:, None], *(x[:, None] + factor * steps for factor in (-2, -1, 1, 2))], axis=1)


def differences(Y: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative at a state of values at the points of its `stencil`, to fourth order.

    Parameters
    ----------
    Y : ndarray, shape (values, 1 + 4*states)
        Values at the stencil's points.
    sizes : ndarray, shape (states,)
        As `stencil` had them.
    """
    n = sizes.size
    far_down, down, up, far_up = (Y[:, 1 + k * n : 1 + (k + 1) * n] for k in range(4))
    return np.asarray((8.0 * (up - down) - (far_up - far_down)) / (12.0 * _REACH * sizes))


@functools.lru_cache(maxsize=256)
def _function(texts: tuple[str, ...], names: tuple[str, ...]) -> Any:
    import sympy

    expressions = [_continued(parse(text, names, "expression")) for text in texts]
    own: dict[str, Any] = {"amax": _largest, "amin": _least, "continued_power": _power}
    return sympy.lambdify(_symbols(names), expressions, modules=[own, "numpy", "scipy"], cse=True)


@functools.lru_cache(maxsize=256)
def _with_derivatives(texts: tuple[str, ...], names: tuple[str, ...], states: int) -> Any:
    import sympy

    by = _symbols(names)[:states]
    values = [parse(text, names, "expression") for text in texts]
    slopes = [sympy.diff(value, x).replace(sympy.DiracDelta, lambda *_: sympy.S.Zero) for value in values for x in by]
    own: dict[str, Any] = {
        "continued_power": lambda base, exponent: max(base, 0.0) ** exponent,
        "sign": lambda value: float((value > 0.0) - (value < 0.0)),
        "Heaviside": lambda value, at_zero=0.5: at_zero if value == 0.0 else float(value > 0.0),
    }
    return sympy.lambdify(_symbols(names), [_continued(e) for e in (*values, *slopes)], modules=[own, "math"], cse=True)


@functools.lru_cache(maxsize=256)
def _has_roots(texts: tuple[str, ...], names: tuple[str, ...]) -> bool:
    import sympy

    return any(
        not power.exp.is_integer and power.exp.is_number and not power.base.is_number
        for text in texts
        for power in parse(text, names, "expression").atoms(sympy.Pow)
    )


def _symbols(names: tuple[str, ...]) -> list[Any]:
    import sympy

    return [sympy.Symbol(name, real=True) for name in names]


def _continued(expression: Any) -> Any:
    """Return an expression whose fractional powers are 0 where their base is negative."""
    import sympy

    power = sympy.Function("continued_power")
    return expression.replace(
        lambda e: e.is_Pow and e.exp.is_number and e.exp.is_positive and not e.exp.is_integer and not e.base.is_number,
        lambda e: power(e.base, e.exp),
    )


def _power(base: Any, exponent: Any) -> Any:
    return np.maximum(base, 0.0) ** float(exponent)


def _largest(parts: Sequence[Any], axis: int = 0) -> Any:
    return functools.reduce(np.maximum, parts)


def _least(parts: Sequence[Any], axis: int = 0) -> Any:
    return functools.reduce(np.minimum, parts)
