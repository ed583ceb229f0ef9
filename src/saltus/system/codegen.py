"""From a definition to compiled functions: one source file a system, in the user's cache folder.

Every generated function has the signature ``(k, m, x, p, out) -> None``: `k` a mode or transition, `m` a count of
columns or a parameter, `x` the state (with sensitivities behind it), `p` the parameters and behind them the constants
that `derive` makes of them, `out` what is returned. Drivers call them by address, so they are compiled once for all.
"""

from __future__ import annotations

import hashlib
import json
import math
import sys
import threading
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from saltus.errors import DefinitionError
from saltus.system.cache import cache_folder, let_numba_cache, read_checked, warn_once, write_checked
from saltus.system.grammar import clipped

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import sympy
    from numpy.typing import NDArray

    from saltus.system.derivatives import Symbolic
    from saltus.system.hybrid import HybridSystem
    from saltus.system.regularise import Regularised
    from saltus.system.split import Split

__all__ = ["FUNCTIONS", "SECOND", "Compiled", "CompiledLanes", "CompiledLinear", "CompiledSecond", "CompiledSeries",
           "Writer", "load", "load_lanes", "load_linear", "load_second", "load_series", "source_file"]  # fmt: skip

FUNCTIONS = ("derive", "field", "vary", "field_p", "event", "event_x", "event_p", "reset", "reset_x", "reset_p",
             "outputs", "guard")  # fmt: skip
"""Names of the generated functions, in the order of `Compiled.addresses`."""

SECOND = ("derive", "field_2", "event_2", "reset_2")
"""Names of the functions of second derivatives, in the order of `CompiledSecond.addresses`."""

_POLE = "pole"


class Compiled:
    """The compiled functions of one system.

    Attributes
    ----------
    addresses : ndarray of int64, shape (functions,)
        Where each of `FUNCTIONS` begins; valid in this process only.
    n, n_parameters, n_constants, n_outputs : int
        Sizes of the full state, of the parameters, of the constants made from them, of the outputs.
    rooted : ndarray of bool, shape (modes,)
        Whether a mode's field has broken powers at which its first derivatives are infinite.
    limits : ndarray of bool, shape (modes,)
        Whether their product with the rate of clustered time has a limit that is not 0.
    jumps : tuple of bool
        Whether a mode's field may jump.
    too_steep : tuple of str
        The power of each mode with which no sensitivities are computed; empty where there is none.
    """

    def __init__(self, module: Any, system: HybridSystem) -> None:
        self.addresses = np.array([getattr(module, name).address for name in FUNCTIONS], dtype=np.int64)
        self.n = len(system.all_states)
        self.n_parameters = len(system.parameters)
        self.n_constants = int(module.CONSTANTS)
        self.n_outputs = len(system.outputs)
        self.rooted = np.array(module.ROOTED, dtype=np.bool_)
        self.limits = np.array(module.LIMITS, dtype=np.bool_)
        self.jumps = tuple(module.JUMPS)
        self.too_steep = tuple(module.TOO_STEEP)
        # valid as long as the module is, which `sys.modules` keeps
        self._calls: dict[str, Any] = {name: _callable(getattr(module, name)) for name in FUNCTIONS}

    def extended(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters with the constants behind them, shape (n_parameters + n_constants,)."""
        return _with_constants(self._calls["derive"], p, self.n_constants)

    def check_powers(self, system: HybridSystem, modes: Sequence[int]) -> None:
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
        frame, out = np.concatenate([x, np.eye(self.n).ravel()]), np.empty(self.n * (self.n + 1))
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
        _call(self._calls[name], k, m, x, p, out)


class CompiledSeries:
    """Taylor series of a system's motions, one order.

    ``series`` writes, for mode `k` and at ``x`` (the full state and w behind it), the coefficients of the states
    without the phase, of two more and of the mode's event functions: shape (order + 1, stride). For ``modes + k`` they
    are those in sigma, where the mode is regularised (see `saltus.system.regularise`), and the two more are those of w
    and the time.

    Attributes
    ----------
    addresses : ndarray of int64, shape (3,)
        Where ``derive``, ``series`` and ``far`` begin; valid in this process only.
    order, stride : int
        Last coefficient; columns.
    forms : ndarray of int64, shape (modes, 2)
        For each mode the transition about which it is regularised (-1: none) and the sign of its event function.
    """

    def __init__(self, module: Any, system: HybridSystem) -> None:
        self.addresses = np.array(
            [getattr(module, name).address for name in ("derive", "series", "far")], dtype=np.int64
        )
        self.order, self.stride = int(module.ORDER), int(module.STRIDE)
        self.forms = np.array(module.FORMS, dtype=np.int64).reshape(len(system.modes), 2)
        self._n_constants = int(module.CONSTANTS)
        self._derive: Any = _callable(module.derive)

    def constants(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters with the constants of these functions behind them."""
        return _with_constants(self._derive, p, self._n_constants)


class CompiledLinear:
    """Linear parts of a system's modes.

    Attributes
    ----------
    splits : list of dict or None
        For each mode what `saltus.system.split.Split.layout` says of its linear part, None where it has none.
    """

    def __init__(self, module: Any) -> None:
        self.splits: list[dict[str, Any] | None] = module.SPLITS
        self._n_constants = int(module.CONSTANTS)
        self._derive: Any = _callable(module.derive)
        self._linear: Any = _callable(module.linear)

    def at(self, mode: int, p: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the generator of a mode's linear part and its event functions, (size, size) and (events, size)."""
        layout = self.splits[mode]
        assert layout is not None
        size = layout["size"]
        out = np.empty((size + layout["events"], size))
        _call(self._linear, mode, 0, out, _with_constants(self._derive, p, self._n_constants), out)
        return out[:size], out[size:]


class CompiledLanes:
    """Steps of many motions at once, compiled for one system.

    Attributes
    ----------
    module : module
        The generated module, from which a graphics card's kernels take the same functions.
    run : callable
        Follows motions until each has met its fate; see `saltus.system.lanes`.
    quantities : tuple of str
        Names of the numbers that `run` reads from its argument ``q``.
    """

    def __init__(self, module: Any) -> None:
        self.module = module
        self.run: Callable[..., None] = module.run
        self.quantities: tuple[str, ...] = module.QUANTITIES
        self._n_constants = int(module.CONSTANTS)
        self._derive: Any = _callable(module.derive)

    def constants(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters with the constants of these functions behind them."""
        return _with_constants(self._derive, p, self._n_constants)

    def scratch(self, motions: int) -> tuple[NDArray[Any], ...]:
        """Return the arrays that one call of `run` works in, for so many motions at most."""
        m = self.module
        pools = np.ones((m.POOLS + 1, m.NF * m.NL)), np.zeros((m.POOLS, m.NL), np.int64), np.zeros(m.POOLS, np.int64)
        return *pools, np.zeros(motions, np.int64), np.empty(m.N)


class CompiledSecond:
    """Second derivatives of one system, in its state and in some of its parameters.

    With y the state and those parameters behind it, and v a direction, ``field_2`` writes the matrix of the second
    derivative of the field, once along v, shape (n, n + active), ``reset_2`` that of a reset, and ``event_2`` that of
    an event function and of its rate, shape (2, n + active). Their argument is [state (n,), v (n + active,)].

    Attributes
    ----------
    addresses : ndarray of int64, shape (functions,)
        Where each of `SECOND` begins; valid in this process only.
    active : tuple of int
        The parameters, as indices in growing order.
    extended : int
        Count of the parameters with the constants of these functions behind them.
    """

    def __init__(self, module: Any, system: HybridSystem, active: tuple[int, ...]) -> None:
        self.addresses = np.array([getattr(module, name).address for name in SECOND], dtype=np.int64)
        self.active = active
        self.extended = len(system.parameters) + int(module.CONSTANTS)


def _call(
    function: Any, k: int, m: int, x: NDArray[np.float64], p: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    function(k, m, x.ctypes.data, p.ctypes.data, out.ctypes.data)


def _callable(function: Any) -> Any:
    """Return a generated function as one of integers and addresses, which are converted faster than pointers."""
    import ctypes

    integer, address = ctypes.c_int64, ctypes.c_void_p
    return ctypes.CFUNCTYPE(None, integer, integer, address, address, address)(function.address)


def _with_constants(derive: Any, p: NDArray[np.float64], n_constants: int) -> NDArray[np.float64]:
    out = np.empty(p.size + n_constants)
    out[: p.size] = p
    _call(derive, 0, 0, out, out, out)
    return out


def source_file(system: HybridSystem) -> Path:
    """Return the file of the system's generated source, written now unless an equal definition has one.

    Raises
    ------
    DefinitionError
        An expression of the definition cannot be read.
    """
    file = _file(system)
    _text(file, system, Writer)
    return file


def _file(system: HybridSystem, *variant: object) -> Path:
    """The place of the functions of a system, or of a variant of them."""
    from importlib.metadata import version

    mathematics = {key: value for key, value in system.definition().items() if key not in ("name", "groups", "regimes")}
    mathematics["parameters"] = list(system.parameters)
    for key in ("positive", "parameter_bounds"):
        mathematics.pop(key)
    versions = [_generator(), version("numba"), version("sympy"), sys.version_info[:2]]
    text = json.dumps([mathematics, *versions, *variant])
    digest = hashlib.sha256(text.encode()).hexdigest()[:20]
    return cache_folder() / f"system_{digest}.py"


_UNWRITTEN: dict[str, bytes] = {}
"""Texts that found no place on disk, by the name of their file."""


def _text(file: Path, system: HybridSystem, writer: Callable[[Symbolic], Writer]) -> bytes:
    """Return the text of a generated file; what is not there or not whole is written anew."""
    text = _UNWRITTEN.get(file.name) or read_checked(file)
    if text is None:
        from saltus.system.derivatives import Symbolic

        try:
            text = "".join(_module_text(writer(Symbolic(system)))).encode()
        except RecursionError:
            allowed = "nested less deeply"
            raise DefinitionError("the definition", system.name, allowed, "SymPy cannot differentiate it") from None
        try:
            write_checked(file, text)
        except OSError as error:
            _UNWRITTEN[file.name] = text
            warn_once(f"generated code is not kept: {error.strerror}: {error.filename or file}")
    return text


@cache
def _generator() -> str:
    """A digest of the modules that write the text, so that files of an older text are not used."""
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def load(system: HybridSystem) -> Compiled:
    """Return the functions of a system, compiled or read from the cache on disk."""
    return Compiled(_module(system, Writer), system)


def load_second(system: HybridSystem, active: tuple[int, ...]) -> CompiledSecond:
    """Return the second derivatives of a system in its state and in the parameters of growing indices `active`."""
    module = _module(system, lambda symbolic: _SecondWriter(symbolic, active), active)
    return CompiledSecond(module, system, active)


def load_series(system: HybridSystem, order: int) -> CompiledSeries | None:
    """Return the Taylor series of a system's motions; None where the definition has none."""
    from saltus.system.taylor import NotAnalyticError

    try:
        module = _module(system, lambda symbolic: _SeriesWriter(symbolic, order), "series", order)
    except NotAnalyticError:
        return None
    return CompiledSeries(module, system)


def load_linear(system: HybridSystem) -> CompiledLinear:
    """Return the linear parts of a system's modes."""
    return CompiledLinear(_module(system, _LinearWriter, "linear"))


def load_lanes(system: HybridSystem, order: int, exact: dict[int, int]) -> CompiledLanes | None:
    """Return the steps of many motions at once, see `saltus.system.lanes`; None where the definition has no series."""
    from saltus.system.taylor import NotAnalyticError

    def writer(symbolic: Symbolic) -> Writer:
        from saltus.system.lanes import LaneWriter

        return LaneWriter(symbolic, order, exact)

    try:
        return CompiledLanes(_module(system, writer, "lanes", order, sorted(exact.items())))
    except NotAnalyticError:
        return None


_LOADING = threading.RLock()
"""Held while a module is loaded: another thread must not see half of one."""


def _module(system: HybridSystem, writer: Callable[[Symbolic], Writer], *variant: object) -> ModuleType:
    """The module of generated functions; what runs is the text that was checked."""
    file = _file(system, *variant)
    name = f"saltus_{file.stem}"
    with _LOADING:
        module = sys.modules.get(name)
        if module is None:
            text = _text(file, system, writer)
            let_numba_cache()
            module = ModuleType(name)
            module.__file__ = str(file)
            sys.modules[name] = module  # Numba's cache looks the module up by name
            try:
                exec(compile(text, file, "exec"), module.__dict__)
            except BaseException:
                del sys.modules[name]
                raise
    return module


_HEAD = '''"""Generated by saltus from the definition of a hybrid system; safe to delete."""
import math

from numba import float64, int64, types, void

from saltus.system.machine_code import cfunc

P = types.CPointer(float64)
SIGNATURE = void(int64, int64, P, P, P)
OPTIONS = {"error_model": "numpy"}
FAST = {"contract", "nsz"}
'''


def _module_text(writer: Writer) -> Iterator[str]:
    body = list(writer.functions())
    yield _HEAD
    yield f"CONSTANTS = {len(writer.constants)}\n"
    yield from (f"{name} = {value!r}\n" for name, value in writer.numbers.items())
    yield writer.derive()
    yield from body


class Writer:
    """Texts of the generated functions; gathers the constants that depend on parameters alone."""

    def __init__(self, system: Symbolic) -> None:
        self.system = system
        self.n = len(system.x)
        self.constants: dict[sympy.Expr, int] = {}
        self.numbers: dict[str, object] = {}
        self._symbols: list[sympy.Dummy] = []
        self._parameters = set(system.p)
        self._printer = _printer(clamped=True)
        self._names = {symbol: f"x[{i}]" for i, symbol in enumerate(system.x)}
        self._names |= {symbol: f"p[{i}]" for i, symbol in enumerate(system.p)}

    def functions(self) -> Iterator[str]:
        """Texts of the module's functions."""
        s = self.system
        modes, transitions = range(len(s.field)), range(len(s.event))
        powers = [self._vanishing_powers(s.field[k]) for k in modes]
        self.numbers["ROOTED"] = tuple(bool(found) for found in powers)
        self.numbers["LIMITS"] = tuple(any(2 * power == 1 for power in found) for found in powers)
        self.numbers["JUMPS"] = tuple(bool(s.jumps(k)) for k in modes)
        self.numbers["TOO_STEEP"] = tuple(_too_steep(found) for found in powers)
        yield self._function("field", {k: self._assign(s.field[k]) for k in modes})
        yield self._function("vary", {k: self._vary(s.field[k]) for k in modes})
        yield self._by_parameter("field_p", {k: s.field[k] for k in modes})
        event = {k: [s.event[k], s.rate[k]] for k in transitions}
        yield self._function("event", {k: self._assign(event[k]) for k in transitions})
        gradient = {k: [*event[k], *(e for row in s.jacobian(event[k]) for e in row)] for k in transitions}
        yield self._function("event_x", {k: self._assign(gradient[k]) for k in transitions})
        yield self._by_parameter("event_p", event)
        yield self._function("reset", {k: self._assign(s.reset[k]) for k in transitions})
        jacobian = {k: [e for row in s.jacobian(s.reset[k]) for e in row] for k in transitions}
        yield self._function("reset_x", {k: self._assign(jacobian[k]) for k in transitions})
        yield self._by_parameter("reset_p", {k: s.reset[k] for k in transitions})
        yield self._function("outputs", {k: self._assign(s.outputs[k]) for k in modes})
        guards = [*s.domain, *s.when]
        yield self._function("guard", {k: self._assign([guard]) for k, guard in enumerate(guards)})

    def derive(self) -> str:
        """Text of the function that computes the constants."""
        usual, self._printer = self._printer, _printer(clamped=False)
        lines = self._lines(list(self.constants), len(self.constants), len(self.system.p), "", True)
        self._printer = usual
        return self._function("derive", {0: lines})

    def _function(self, name: str, branches: dict[int, list[str]]) -> str:
        lines = ["\n\n@cfunc(SIGNATURE, **OPTIONS)", f"def {name}(k, m, x, p, out):"]
        for index, (k, body) in enumerate(branches.items()):
            lines.append(f"    {'if' if index == 0 else 'elif'} k == {k}:")
            lines += [f"        {line}" for line in (body or ["pass"])]
        if not branches:
            lines.append("    pass")
        return "\n".join(lines) + "\n"

    def _by_parameter(self, name: str, expressions: dict[int, list[sympy.Expr]]) -> str:
        branches = {}
        for k, group in expressions.items():
            lines = [f"out[{i}] = 0.0" for i in range(len(group))]
            first, rooted = True, bool(self._vanishing_powers(group))
            for j in range(len(self.system.p)):
                derivatives = self.system.along(group, j)
                if rooted:
                    derivatives = [_without_poles(d) for d in derivatives]
                if all(d == 0 for d in derivatives):
                    continue
                lines.append(f"{'if' if first else 'elif'} m == {j}:")
                lines += [f"    {line}" for line in self._assign(derivatives, keep_zero=False)]
                first = False
            branches[k] = lines
        return self._function(name, branches)

    def _vanishing_powers(self, field: list[sympy.Expr]) -> list[sympy.Expr]:
        """Broken powers below 1 of what vanishes on a surface, where they make the first derivatives infinite."""
        import sympy

        from saltus.system.regularise import multiple_of

        powers = {
            (power.base, power.exp)
            for expression in field
            for power in expression.atoms(sympy.Pow)
            if _is_broken(power.exp) and power.exp < 1
        }
        return sorted(
            {
                exponent
                for base, exponent in powers
                if any(multiple_of(self.system, base, event) is not None for event in self.system.event)
            }
        )

    def _vary(self, field: list[sympy.Expr]) -> list[str]:
        n, jacobian = self.n, self.system.jacobian(field)
        if self._vanishing_powers(field):  # elsewhere an infinite derivative is told as one
            jacobian = [[_without_poles(entry) for entry in row] for row in jacobian]
        entries = [(i, j) for i in range(n) for j in range(n) if jacobian[i][j] != 0]
        lines = self._assign(field, [jacobian[i][j] for i, j in entries], name="j")
        lines.append("for c in range(m):")
        for i in range(n):
            terms = [f"j{e} * x[{n} + {j} * m + c]" for e, (row, j) in enumerate(entries) if row == i]
            lines.append(f"    out[{n} + {i} * m + c] = {' + '.join(terms) if terms else '0.0'}")
        return lines

    def _assign(
        self,
        expressions: list[sympy.Expr],
        locals_: list[sympy.Expr] | None = None,
        *,
        name: str = "",
        keep_zero: bool = True,
    ) -> list[str]:
        locals_ = locals_ or []
        hoisted = [self._hoist(e) for e in (*expressions, *locals_)]
        return self._lines(hoisted, len(expressions), 0, name, keep_zero)

    def _lines(self, expressions: list[sympy.Expr], n_out: int, offset: int, name: str, keep_zero: bool) -> list[str]:
        import sympy

        shared, results = sympy.cse(expressions, symbols=sympy.numbered_symbols("u"))
        lines = [f"{symbol} = {self._text(value)}" for symbol, value in shared]
        for i, result in enumerate(results[:n_out]):
            if keep_zero or result != 0:
                lines.append(f"out[{offset + i}] = {self._text(result)}")
        lines += [f"{name}{i} = {self._text(result)}" for i, result in enumerate(results[n_out:])]
        return lines

    def _text(self, expression: sympy.Expr) -> str:
        import sympy

        renamed = {s: sympy.Symbol(self._names[s]) for s in expression.free_symbols if s in self._names}
        text = str(self._printer.doprint(expression.xreplace(renamed)))
        return f"{text}.0" if text.lstrip("-").isdigit() else text

    def _hoist(self, expression: sympy.Expr) -> sympy.Expr:
        """Replace what depends on parameters alone by a constant that `derive` computes."""
        import sympy

        if not expression.args or expression.is_number:
            return expression
        if expression.free_symbols <= self._parameters:
            return self._constant(expression)
        if isinstance(expression, sympy.Add | sympy.Mul):
            fixed = [a for a in expression.args if a.free_symbols <= self._parameters]
            if len(fixed) > 1 and not all(a.is_number for a in fixed):
                rest = [self._hoist(a) for a in expression.args if not a.free_symbols <= self._parameters]
                return expression.func(self._constant(expression.func(*fixed)), *rest)
        return expression.func(*(self._hoist(a) for a in expression.args))

    def _constant(self, expression: sympy.Expr) -> sympy.Expr:
        import sympy

        index = self.constants.setdefault(expression, len(self.constants))
        while index >= len(self._symbols):
            self._symbols.append(sympy.Dummy())
        symbol = self._symbols[index]
        self._names[symbol] = f"p[{len(self.system.p) + index}]"
        return symbol


class _SeriesWriter(Writer):
    """Text of the Taylor series of every mode."""

    def __init__(self, system: Symbolic, order: int) -> None:
        super().__init__(system)
        self.order = order

    def functions(self) -> Iterator[str]:
        from saltus.system.regularise import regularised
        from saltus.system.taylor import series_of_mode

        modes = range(len(self.system.field))
        forms = [regularised(self.system, k) for k in modes]
        wanted: dict[int, Regularised | None] = dict.fromkeys(modes)
        wanted |= {len(modes) + k: form for k, form in enumerate(forms) if form is not None}
        first_event = len(self.system.system.states) + 2
        stride = first_event + max(self.system.source.count(k) for k in modes)
        self.numbers = {
            "ORDER": self.order,
            "STRIDE": stride,
            "FORMS": [(-1, 1) if form is None else (form.transition, form.sign) for form in forms],
        }
        branches = {}
        for k, form in wanted.items():
            series = series_of_mode(self.system, k % len(modes), self.order, lambda e: self._text(self._hoist(e)), form)
            places = [*range(first_event - (2 if form is None else 0)), *range(first_event, stride)]
            branches[k] = (
                series.constants
                + series.lines
                + [
                    f"out[{stride * i + place}] = {name}_{i}"
                    for i in range(self.order + 1)
                    for place, name in zip(places, series.columns, strict=False)
                ]
            )
        yield "\nfrom saltus.system._series_kernels import products\n"
        yield self._far(_splits(self.system))
        yield self._function("series", branches).replace("**OPTIONS", "**OPTIONS, fastmath=FAST")

    def _far(self, splits: list[Split | None]) -> str:
        """Text of ``far``, and where each mode's tables begin behind the constants."""
        far = {
            k: split.lines(f"TABLES_{k}", lambda e: self._text(self._hoist(e)))
            for k, split in enumerate(splits)
            if split is not None
        }
        text = self._function("far", far)
        place = len(self.system.p) + len(self.constants)
        for k, split in enumerate(splits):
            if split is not None:
                self.numbers[f"TABLES_{k}"] = place
                place += split.table_size
        return text


class _LinearWriter(Writer):
    """Text of the linear parts of the modes."""

    def functions(self) -> Iterator[str]:
        splits = _splits(self.system)
        self.numbers["SPLITS"] = [None if split is None else split.layout() for split in splits]
        entries = {
            k: [entry for row in (*split.matrix, *split.events) for entry in row]
            for k, split in enumerate(splits)
            if split is not None
        }
        yield self._function("linear", {k: self._assign(rows) for k, rows in entries.items()})


def _splits(system: Symbolic) -> list[Split | None]:
    """The linear part of each mode that is not regularised and has one."""
    from saltus.system.regularise import regularised
    from saltus.system.split import split_of_mode

    modes = range(len(system.field))
    return [split_of_mode(system, k) if regularised(system, k) is None else None for k in modes]


class _SecondWriter(Writer):
    """Texts of the second derivatives in the state and in some parameters, once along a direction."""

    def __init__(self, system: Symbolic, active: tuple[int, ...]) -> None:
        super().__init__(system)
        import sympy

        self._variables = [*system.x, *(system.p[j] for j in active)]
        self._direction = [sympy.Dummy() for _ in self._variables]
        self._names |= {symbol: f"x[{self.n + i}]" for i, symbol in enumerate(self._direction)}

    def functions(self) -> Iterator[str]:
        s = self.system
        modes, transitions = range(len(s.field)), range(len(s.event))
        yield self._function("field_2", {k: self._assign(self._curvature(s.field[k])) for k in modes})
        events = {k: self._assign(self._curvature([s.event[k], s.rate[k]])) for k in transitions}
        yield self._function("event_2", events)
        yield self._function("reset_2", {k: self._assign(self._curvature(s.reset[k])) for k in transitions})

    def _curvature(self, expressions: list[sympy.Expr]) -> list[sympy.Expr]:
        """Gradients, row by row, of the expressions' derivatives along the direction."""
        import sympy

        slopes = [
            sympy.Add(*(d * g for d, g in zip(self._direction, row, strict=True)))
            for row in self.system.gradients(expressions, self._variables)
        ]
        return [_without_poles(g) for row in self.system.gradients(slopes, self._variables) for g in row]


def _is_broken(exponent: sympy.Expr) -> bool:
    """Whether an exponent is a number, but no integer."""
    return bool(exponent.is_number) and float(exponent) != math.floor(float(exponent))


def _too_steep(powers: Sequence[sympy.Expr]) -> str:
    """The power of those that vanish on a surface with which no sensitivities of a segment are computed, if any is.

    With the power a of an event function, sensitivities grow like s^(2 a - 1) in clustered time: without bound for a
    below 1/2. At 1/2 they have a limit, which is found by extrapolation, unless there are powers besides.
    """
    others = [power for power in powers if 2 * power != 1]
    steep = [power for power in powers if 2 * power < 1]
    return str((steep or others)[0]) if steep or (others and len(others) < len(powers)) else ""


def _without_poles(expression: sympy.Expr) -> sympy.Expr:
    """Replace inverse broken powers by functions that are zero where their base is.

    A broken power of an event function gives its second derivatives a pole on the surface, where the direction is
    tangential, or the time of the segment stands still: there the product vanishes. A power below 1 gives its first
    derivatives one: for a root, their product with the clustered time's rate has a limit, which the flow of a segment
    adds; above 1/2 that limit is 0.
    """
    import sympy

    pole = sympy.Function(_POLE)
    return expression.replace(
        lambda e: e.is_Pow and _is_broken(e.exp) and e.exp < 0 and not e.base.is_number,
        lambda e: pole(e.base, e.exp),
    )


def _printer(*, clamped: bool) -> Any:
    """Return what writes Python text; `clamped` where broken powers of negative numbers are 0."""
    import sympy
    from sympy.printing.pycode import PythonCodePrinter

    def refused(_: object, expr: Any) -> NoReturn:
        shown = "a number that no float can hold" if expr.is_Number else clipped(str(expr), 40)
        raise DefinitionError("derivatives of the definition", shown, "of real numbers and functions of expressions")

    class Printer(PythonCodePrinter):  # type: ignore[misc]
        """Python text that Numba compiles: exact floats, powers as products."""

        _print_ImaginaryUnit = _print_Infinity = _print_NegativeInfinity = _print_ComplexInfinity = _print_NaN = refused
        _print_not_supported = emptyPrinter = refused

        def _print_Float(self, expr: Any) -> str:
            try:
                value = float(expr)
            except OverflowError:
                value = math.inf
            if not math.isfinite(value) or (value == 0.0 and not expr.is_zero):
                refused(self, expr)
            return repr(value)

        _print_Rational = _print_Float

        def _print_Integer(self, expr: Any) -> str:
            self._print_Float(expr)
            return f"{int(expr)}.0"

        def _print_Pi(self, expr: Any) -> str:
            return repr(float(sympy.pi))

        def _print_sign(self, expr: Any) -> str:
            return f"math.copysign(1.0, {self._print(expr.args[0])})"

        def _print_Abs(self, expr: Any) -> str:
            return f"abs({self._print(expr.args[0])})"

        def _print_Pow(self, expr: Any, rational: bool = False, sqrt: str = "math.sqrt") -> str:
            base, exponent = expr.as_base_exp()
            text = f"({self._print(base)})"
            if exponent.is_Rational and exponent.q in (1, 2) and abs(exponent.p) <= 24:
                power = self._power(text, abs(int(exponent.p)), int(exponent.q))
                return power if exponent.p > 0 else f"(1.0/{power})"
            power = f"({self._print(exponent)})"
            if not clamped or (exponent.is_number and not _is_broken(exponent)):
                return f"({text}**{power})"
            if exponent.is_number:
                return f"(max({text}, 0.0)**{power})"
            return f"({text}**{power} if {text} >= 0.0 or {power} == math.floor({power}) else 0.0)"

        def _print_Function(self, expr: Any) -> str:
            if expr.func.__name__ != _POLE:
                return str(super()._print_Function(expr))
            base, exponent = f"({self._print(expr.args[0])})", expr.args[1]
            power = f"{base}**({self._print(exponent)})"
            if exponent.is_Rational and exponent.q == 2:
                power = f"1.0/{self._power(base, -int(exponent.p), 2)}"
            return f"({power} if {base} > 0.0 else 0.0)"

        @staticmethod
        def _power(base: str, p: int, q: int) -> str:
            whole, half = divmod(p, q)
            factors = [base] * whole
            if half:
                # stages of a step overshoot the surface where a root begins
                factors.append(f"math.sqrt(max({base}, 0.0))" if clamped else f"math.sqrt({base})")
            return f"({'*'.join(factors)})"

    return Printer({"fully_qualified_modules": True, "allow_unknown_functions": False})
