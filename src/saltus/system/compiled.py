"""Generated functions of a system, compiled: called by address, so that drivers are compiled once for all systems."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from saltus.errors import DefinitionError, NotAnalyticError
from saltus.system.generated import Kind, module_of
from saltus.system.numba_tools.calling import call, callable_at, with_constants

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.system.definition import Definition
    from saltus.system.derivatives import Symbolic
    from saltus.system.writing.writer import Writer

__all__ = [
    "ANGLE",
    "FLOW",
    "FUNCTIONS",
    "SECOND",
    "SERIES_TEXT",
    "SHARES",
    "Compiled",
    "CompiledGradients",
    "CompiledLinear",
    "CompiledSecond",
    "CompiledSeries",
    "CompiledThird",
    "Formulas",
    "load",
    "load_gradients",
    "load_linear",
    "load_second",
    "load_series",
    "load_third",
]

Formulas: TypeAlias = tuple[tuple[str, tuple[str, ...]], ...]  # of each its text and its further names

# Names of the generated functions, in the order of `Compiled.addresses`.
FUNCTIONS = ("derive", "field", "vary", "field_p", "event", "event_x", "event_p", "reset", "reset_x", "reset_p",
             "outputs", "guard", "ways", "rounding")  # fmt: skip

# Those that a motion needs.
MOTION = ("derive", "field", "event", "event_x", "reset", "guard", "ways", "rounding")

# Place behind the functions' addresses of that of the states' shares of an absolute tolerance, shape (n,).
SHARES = len(FUNCTIONS)

# The share of an angle: all of the absolute tolerance, and of the relative one no more than that of half a turn.
ANGLE = 2.0

# Names of the functions of second derivatives, in the order of `CompiledSecond.addresses`.
SECOND = ("derive", "field_2", "event_2", "reset_2")


class Compiled:
    """The generated functions of one system, each compiled at first need.

    Attributes
    ----------
    motion : ndarray of int64, shape (functions + 1,)
        Where each of `FUNCTIONS` that is one of `MOTION` begins, 0 for others; valid in this process only. A system
        without exponents has 0 for ``ways``. The last is the address of the states' shares of an absolute tolerance,
        `whole`.
    whole : ndarray, shape (n,)
        A whole share of each state: 1, or `ANGLE`.
    kinds : ndarray of int64, shape (n,)
        The kind of each state, as `saltus.system.faces` tells them.
    numbers : ndarray, shape (2,)
        The largest and the least size of the numbers in fields and resets, 1 and 1 without any.
    groups : ndarray of int64, shape (n,)
        The least state of the group that stays at 0 together with each; -1 for none.
    plain, grouped : bool
        Whether all states are of the usual kind; whether some of them stay at 0 together.
    n, n_parameters, n_constants, n_outputs : int
        Sizes of the full state, of the parameters, of the constants made from them, of the outputs.
    rooted : ndarray of bool, shape (modes,)
        Whether a mode's field has broken powers at which its first derivatives are infinite.
    limits : ndarray of bool, shape (modes,)
        Whether their product with the rate of clustered time has a limit that is not 0.
    under_roots : bool
        Whether a field, event function, condition or reset has a root of what may be negative.
    jumps : tuple of bool
        Whether a mode's field may jump.
    too_steep : tuple of str
        The power of each mode with which no sensitivities are computed; empty where there is none.
    """

    def __init__(self, module: Any, system: Definition) -> None:
        self._module = module  # addresses are valid as long as the module is
        self.n = len(system.all_states)
        self.whole = np.ones(self.n)
        self.whole[system.angle_places] = ANGLE
        self.motion = self._addresses(MOTION)
        self.kinds = np.array(module.KINDS, dtype=np.int64)
        self.numbers = np.array(module.NUMBERS, dtype=np.float64)
        self.groups = np.array(module.GROUPS, dtype=np.int64)
        self.plain = not any(module.KINDS)  # `saltus.system.faces.PLAIN` is 0
        self.grouped = max(module.GROUPS, default=-1) >= 0
        self.n_parameters = len(system.parameters)
        self.n_constants = int(module.CONSTANTS)
        self.n_outputs = len(system.outputs)
        self.rooted = np.array(module.ROOTED, dtype=np.bool_)
        self.limits = np.array(module.LIMITS, dtype=np.bool_)
        self.under_roots = bool(module.UNDER_ROOTS)
        self.jumps = tuple(module.JUMPS)
        self.too_steep = tuple(module.TOO_STEEP)
        self._calls: dict[str, Any] = {}
        self._directions = np.eye(self.n).ravel()  # those of the states, one after the other
        # the parameters that were last extended, or asked for their spread, and what was found
        self._last = b"", np.empty(0)
        self._spread: tuple[list[float], float] = [math.nan], 1.0

    @cached_property
    def addresses(self) -> NDArray[np.int64]:
        """Where each of `FUNCTIONS` begins, then the shares; derivatives are compiled when this is first read."""
        return self._addresses(FUNCTIONS)

    def _addresses(self, wanted: Sequence[str]) -> NDArray[np.int64]:
        needed = set(wanted) if self._module.EXPONENTS else set(wanted) - {"ways"}
        found = [getattr(self._module, name).address if name in needed else 0 for name in FUNCTIONS]
        return np.array([*found, self.whole.ctypes.data], dtype=np.int64)

    def extended(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters with the constants behind them, shape (n_parameters + n_constants,)."""
        known, given = self._last, p.tobytes()
        if known[0] != given:
            known = self._last = given, with_constants(self._callable("derive"), p, self.n_constants)
        return known[1].copy()

    def spread(self, p: NDArray[np.float64]) -> float:
        """Return the largest of the sizes of formulas' numbers and parameters, and of 1, over the least above 0."""
        known, given = self._spread, p[: self.n_parameters].tolist()
        if known[0] != given:
            numbers = [number for number in (1.0, *self.numbers.tolist(), *map(abs, given)) if 0.0 < number < math.inf]
            known = self._spread = given, max(numbers) / min(numbers)
        return known[1]

    def check_powers(self, system: Definition, modes: Sequence[int]) -> None:
        """Raise `DefinitionError` where the field of one of the modes is too steep at a surface for sensitivities."""
        for mode in modes:
            if power := self.too_steep[mode]:
                allowed = "1/2 alone, or above 1/2, where it vanishes on a surface of the mode"
                hint = "this needs its derivatives; simulate, run_sweep and map_basins do not"
                raise DefinitionError(f"power in the field of mode {system.mode_names[mode]!r}", power, allowed, hint)

    def field(self, mode: int, x: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the vector field of a mode at a full state."""
        out = np.empty(self.n)
        self.call("field", mode, 0, x, self.extended(p), out)
        return out

    def linearised(
        self, mode: int, x: NDArray[np.float64], p: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the field of a mode at a full state, shape (n,), and its Jacobian, (n, n); `p` is extended."""
        frame, out = np.concatenate([x, self._directions]), np.empty(self.n * (self.n + 1))
        self.call("vary", mode, self.n, frame, p, out)
        return out[: self.n], out[self.n :].reshape(self.n, self.n)

    def call(
        self,
        name: str,
        k: int,
        m: int,
        x: NDArray[np.float64],
        p: NDArray[np.float64],
        out: NDArray[np.float64],
    ) -> None:
        """Call one generated function; `p` is extended, arrays are contiguous."""
        call(self._callable(name), k, m, x, p, out)

    def _callable(self, name: str) -> Any:
        if name not in self._calls:
            self._calls[name] = callable_at(getattr(self._module, name))
        return self._calls[name]


class CompiledSeries:
    """Taylor series of a system's motions, one order.

    ``series`` writes coefficients for mode `k` at ``x``, the full state with w behind it; shape (order + 1, stride).
    Columns are the states without the phase, two further ones, and the mode's event functions. For ``modes + k`` the
    coefficients are those in sigma, where the mode is regularised (see `saltus.system.writing.regularise`). The two
    further columns are then w and the time.

    Attributes
    ----------
    addresses : ndarray of int64, shape (2,)
        Where ``derive`` and ``series`` begin; valid in this process only.
    order, stride : int
        Last coefficient; columns.
    ways : int
        Column with the sizes of the coefficients of exponents, in ways that a step may go; -1 without exponents.
    forms : ndarray of int64, shape (modes, 2)
        For each mode the transition about which it is regularised (-1: none) and the sign of its event function.
    """

    def __init__(self, module: Any, system: Definition) -> None:
        self._module = module  # addresses are valid as long as the module is
        self.addresses = np.array([module.derive.address, module.series.address], dtype=np.int64)
        self.order, self.stride, self.ways = int(module.ORDER), int(module.STRIDE), int(module.WAYS)
        self.forms = np.array(module.FORMS, dtype=np.int64).reshape(len(system.modes), 2)
        self._n_constants = int(module.CONSTANTS)
        self._derive: Any = callable_at(module.derive)

    def constants(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters with the constants of these functions behind them."""
        return with_constants(self._derive, p, self._n_constants)


class CompiledLinear:
    """Linear parts of a system's modes.

    Attributes
    ----------
    splits : list of dict or None
        For each mode what `saltus.system.writing.linear_split.Split.layout` says of its linear part; None without one.
    """

    def __init__(self, module: Any) -> None:
        self._module = module  # addresses are valid as long as the module is
        self.splits: list[dict[str, Any] | None] = module.SPLITS
        self._n_constants = int(module.CONSTANTS)
        self._derive: Any = callable_at(module.derive)
        self._linear: Any = callable_at(module.linear)

    def at(self, mode: int, p: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the generator of a mode's linear part and its event functions, (size, size) and (events, size)."""
        layout = self.splits[mode]
        assert layout is not None
        size = layout["size"]
        out = np.empty((size + layout["events"], size))
        call(self._linear, mode, 0, out, with_constants(self._derive, p, self._n_constants), out)
        return out[:size], out[size:]


class CompiledSecond:
    """Second derivatives of one system, in its state and in some of its parameters.

    Let v be a direction of the state with these parameters behind it. ``field_2`` writes the second derivative of the
    field, once along v, shape (n, n + active). ``reset_2`` does so for a reset, ``event_2`` for an event function and
    its rate, shape (2, n + active). Their argument is [state (n,), v (n + active,)].

    Attributes
    ----------
    addresses : ndarray of int64, shape (functions,)
        Where each of `SECOND` begins; valid in this process only.
    active : tuple of int
        The parameters, as indices in growing order.
    extended : int
        Count of the parameters with the constants of these functions behind them.
    """

    def __init__(self, module: Any, system: Definition, active: tuple[int, ...]) -> None:
        self._module = module  # addresses are valid as long as the module is
        self.addresses = np.array([getattr(module, name).address for name in SECOND], dtype=np.int64)
        self.active = active
        self.n = len(system.all_states)
        self.extended = len(system.parameters) + int(module.CONSTANTS)
        self._derive: Any = callable_at(module.derive)
        self._field_2: Any = callable_at(module.field_2)

    def field(
        self, mode: int, x: NDArray[np.float64], v: NDArray[np.float64], p: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the second derivative of a mode's field along v, shape (n, n + active); `p` is not extended."""
        out = np.empty((self.n, self.n + len(self.active)))
        extended = with_constants(self._derive, p, self.extended - p.size)
        call(self._field_2, mode, 0, np.concatenate([x, v]), extended, out)
        return out


class CompiledGradients:
    """Values and gradients of expressions, and of formulas in what is made of them.

    ``readings`` writes for mode `k` the values of all expressions at a full state, then their gradients in state and
    parameters, shape (expressions, n + parameters). Behind these is one number for each expression. It changes its sign
    where the expression has a corner or jumps, and is 1 where there is no such place.

    Attributes
    ----------
    address : int
        Where ``readings`` begins; valid in this process only.
    cornered : bool
        Whether an expression may have corners or jumps.
    """

    def __init__(self, module: Any, system: Definition) -> None:
        self._module = module  # addresses are valid as long as the module is
        self.address = int(module.readings.address)
        self.cornered = bool(module.CORNERED)
        self._n_constants, self._n_parameters = int(module.CONSTANTS), len(system.parameters)
        self._derive: Any = callable_at(module.derive)
        self._formulas: Any = callable_at(module.formulas)

    def extended(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters with the constants of these functions behind them."""
        return with_constants(self._derive, p, self._n_constants)

    def formula(
        self, k: int, x: NDArray[np.float64], p: NDArray[np.float64]
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """Return a formula's value and its gradients in the names behind it, `x`, and in the parameters.

        `p` is extended.
        """
        out = np.empty(1 + x.size + self._n_parameters)
        call(self._formulas, k, 0, x, p, out)
        return float(out[0]), out[1 : 1 + x.size], out[1 + x.size :]


class CompiledThird:
    """Third derivatives of one system's fields in the state."""

    def __init__(self, module: Any, system: Definition) -> None:
        self._module = module  # addresses are valid as long as the module is
        self._n, self._n_constants = len(system.all_states), int(module.CONSTANTS)
        self._derive: Any = callable_at(module.derive)
        self._field_3: Any = callable_at(module.field_3)

    def field(self, mode: int, x: NDArray[np.float64], *directions: NDArray[np.float64],
              p: NDArray[np.float64]) -> NDArray[np.float64]:  # fmt: skip
        """Return the third derivative of a mode's field along three directions, shape (n,); `p` is not extended."""
        out, extended = np.empty(self._n), with_constants(self._derive, p, self._n_constants)
        call(self._field_3, mode, 0, np.concatenate([x, *directions]), extended, out)
        return out


# Modules from which the text of the flow comes, and that of Taylor series and linear parts, their writers apart.
_TEXT = (
    "choices",
    "derivatives",
    "expansion",
    "expressions",
    "grammar",
    "powers",
    "writing.exponents",
    "writing.printer",
    "writing.regularise",
    "writing.writer",
)
_FLOW_TEXT = tuple(
    f"system.{name}" for name in (*_TEXT, "faces", "writing.roots", "writing.rounding", "writing.codegen")
)
SERIES_TEXT = tuple(f"system.{name}" for name in (*_TEXT, "writing.linear_split", "writing.taylor"))


def _flow(symbolic: Symbolic) -> Writer:
    from saltus.system.writing.codegen import FlowWriter

    return FlowWriter(symbolic)


def _second(symbolic: Symbolic, active: tuple[int, ...]) -> Writer:
    from saltus.system.writing.codegen import SecondWriter

    return SecondWriter(symbolic, active)


def _third(symbolic: Symbolic) -> Writer:
    from saltus.system.writing.codegen import ThirdWriter

    return ThirdWriter(symbolic)


def _gradients(symbolic: Symbolic, expressions: tuple[str, ...], formulas: Formulas) -> Writer:
    from saltus.system.writing.gradient_writer import GradientWriter

    return GradientWriter(symbolic, expressions, formulas)


def _series(symbolic: Symbolic, order: int) -> Writer:
    from saltus.system.writing.series_writer import SeriesWriter

    return SeriesWriter(symbolic, order)


def _linear(symbolic: Symbolic) -> Writer:
    from saltus.system.writing.series_writer import LinearWriter

    return LinearWriter(symbolic)


FLOW = Kind("flow", _flow, _FLOW_TEXT)
SECOND_DERIVATIVES = Kind("second", _second, _FLOW_TEXT)
THIRD_DERIVATIVES = Kind("third", _third, _FLOW_TEXT)
_GRADIENT_TEXT = (
    "choices",
    "derivatives",
    "expressions",
    "grammar",
    "powers",
    "writing.gradient_writer",
    "writing.printer",
    "writing.writer",
)
GRADIENTS = Kind("gradients", _gradients, tuple(f"system.{name}" for name in _GRADIENT_TEXT))
SERIES = Kind("series", _series, (*SERIES_TEXT, "system.writing.series_writer"))
LINEAR = Kind("linear", _linear, (*SERIES_TEXT, "system.writing.series_writer"))


def load(system: Definition) -> Compiled:
    """Return the functions of a system, compiled or read from the cache on disk."""
    return Compiled(module_of(FLOW, system), system)


def load_second(system: Definition, active: tuple[int, ...]) -> CompiledSecond:
    """Return the second derivatives of a system in its state and in the parameters of growing indices `active`."""
    return CompiledSecond(module_of(SECOND_DERIVATIVES, system, active), system, active)


def load_third(system: Definition) -> CompiledThird:
    """Return the third derivatives of a system's fields in the state."""
    return CompiledThird(module_of(THIRD_DERIVATIVES, system), system)


def load_gradients(system: Definition, expressions: tuple[str, ...], formulas: Formulas) -> CompiledGradients:
    """Return expressions in a system's names, and formulas in parameters and further names, with their gradients."""
    return CompiledGradients(module_of(GRADIENTS, system, expressions, formulas), system)


def load_series(system: Definition, order: int) -> CompiledSeries | None:
    """Return the Taylor series of a system's motions; None where the definition has none."""
    try:
        return CompiledSeries(module_of(SERIES, system, order), system)
    except NotAnalyticError:
        return None


def load_linear(system: Definition) -> CompiledLinear:
    """Return the linear parts of a system's modes."""
    return CompiledLinear(module_of(LINEAR, system))
