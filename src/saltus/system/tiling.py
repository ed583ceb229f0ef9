"""Whether the pieces of a map cover the space of its states once: where they are defined, and at each state."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from saltus.errors import DefinitionError
from saltus.system.evaluate import evaluate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.compiled import Compiled
    from saltus.system.definition import Definition

__all__ = ["NUDGE", "check_tiling", "piece_at", "pieces_error"]

NUDGE = 64.0 * 2.0**-52  # part of a state by which a border may be missed through rounding
_SCALES = tuple(10.0**power for power in range(-9, 10, 3))  # sizes of the states that are tried
_POINTS = 512  # states tried at each size
_MIXED = 2048  # states tried whose components have sizes of their own
_DECADES = 9.0  # decades of these sizes above and below 1
_SAME = 1e-12  # difference of two borders, over their size, that is rounding


class Pieces(Protocol):
    """What is asked of a map."""

    states: tuple[str, ...]
    parameters: dict[str, float]

    @property
    def conditions(self) -> dict[str, tuple[str, ...]]:
        """Conditions of each piece."""

    @property
    def guards(self) -> NDArray[np.int64]:
        """Indices of their compiled functions."""

    @property
    def compiled(self) -> Compiled:
        """The compiled functions."""


class _Stretch(NamedTuple):
    """Where a piece holds along one state."""

    low: float
    high: float
    piece: str


def check_tiling(system: Definition) -> None:
    """Raise `DefinitionError` where pieces leave a gap or overlap, at the default parameters.

    Where all conditions are affine in one and the same state, the stretches of that state are compared. Otherwise the
    conditions are evaluated at quasi-random states of several sizes, always the same ones.
    """
    stretches = _stretches(system)
    if stretches is None:
        _check_samples(system)
        return
    state, found = stretches
    end, before = -math.inf, ""
    for low, high, piece in sorted(found):
        if _apart(end, low):
            beside = (before, piece) if before else (piece,)
            raise _refused(_between(end, low), (state,), beside, gap=end < low)
        end, before = max(end, high), piece
    if end < math.inf or not found:
        raise _refused(_between(end, math.inf), (state,), (before,) if before else tuple(system.conditions), gap=True)


def piece_at(system: Pieces, x: NDArray[np.float64], p: NDArray[np.float64]) -> int:
    """Return the index of the piece that holds at a state, -1 where none or several do; `p` is extended.

    Strictly inside one piece it is that one, on a border the first listed of those that meet. A state that misses or
    passes a border by no more than rounding is on it.
    """
    inside, held = _holding(system, x, p)
    if len(inside) == 1:
        return inside[0]
    if not inside and held:
        return held[0]
    for neighbour in _neighbours(x):
        beside, on = _holding(system, neighbour, p)
        if len(beside) == 1:
            return inside[0] if inside else beside[0]
        if not beside and on:
            return on[0]
    return -1


def pieces_error(system: Pieces, x: NDArray[np.float64], p: NDArray[np.float64]) -> DefinitionError:
    """Return the error of a state at which not exactly one piece holds."""
    inside, _ = _holding(system, np.ascontiguousarray(x, dtype=np.float64), system.compiled.extended(p))
    names = list(system.conditions)
    beside = tuple(names[k] for k in inside) if inside else tuple(names)
    return _refused(np.asarray(x).tolist(), system.states, beside, gap=not inside)


def _holding(system: Pieces, x: NDArray[np.float64], p: NDArray[np.float64]) -> tuple[list[int], list[int]]:
    """Return the pieces whose conditions are all positive, and those where none is negative."""
    out, rows = np.empty(1), system.guards
    inside, held = [], []
    for k in range(len(rows) - 1):
        least = math.inf
        for guard in range(int(rows[k]), int(rows[k + 1])):
            system.compiled.call("guard", guard, 0, x, p, out)
            value = -math.inf if math.isnan(out[0]) else float(out[0])
            least = min(least, value)
        if least > 0.0:
            inside.append(k)
        if least >= 0.0:
            held.append(k)
    return inside, held


def _neighbours(x: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    for i in range(x.size):
        for side in (-1.0, 1.0):
            beside = x.copy()
            beside[i] += side * NUDGE * abs(beside[i])
            yield beside


def _stretches(system: Definition) -> tuple[str, list[_Stretch]] | None:
    """Return the one state that all conditions are affine in, and each piece's stretch of it; None without one."""
    import sympy

    from saltus.system.expressions import parse

    names = (*system.states, *system.parameters)
    values = {sympy.Symbol(name, real=True): value for name, value in system.parameters.items()}
    read = {
        piece: [parse(text, names, f"piece {piece!r}").subs(values) for text in texts]
        for piece, texts in system.conditions.items()
    }
    found = {symbol for conditions in read.values() for condition in conditions for symbol in condition.free_symbols}
    if len(found) > 1:
        return None
    state = found.pop() if found else sympy.Symbol(system.states[0], real=True)
    stretches = []
    for piece, conditions in read.items():
        low, high = -math.inf, math.inf
        for condition in conditions:
            slope = sympy.diff(condition, state)
            if slope.free_symbols:
                return None
            at_zero = float(condition.subs(state, 0))
            if float(slope) == 0.0:
                low, high = (low, high) if at_zero > 0.0 else (0.0, 0.0)
            elif float(slope) > 0.0:
                low = max(low, -at_zero / float(slope))
            else:
                high = min(high, -at_zero / float(slope))
        if low < high:
            stretches.append(_Stretch(low, high, piece))
    return state.name, stretches


def _apart(end: float, begin: float) -> bool:
    if math.isinf(end) or math.isinf(begin):
        return end != begin
    return abs(end - begin) > _SAME * max(abs(end), abs(begin))


def _between(low: float, high: float) -> list[float]:
    """A value between two ends, either of which may be infinite."""
    low, high = min(low, high), max(low, high)
    if math.isinf(low) and math.isinf(high):
        return [0.0]
    if math.isinf(low):
        return [high - max(abs(high), 1.0)]
    return [low + max(abs(low), 1.0)] if math.isinf(high) else [0.5 * (low + high)]


def _check_samples(system: Definition) -> None:
    points = _samples(len(system.states))
    modes = np.zeros(len(points), np.int64)
    inside: list[NDArray[np.bool_]] = []
    held: list[NDArray[np.bool_]] = []
    known = np.ones(len(points), dtype=bool)
    for texts in system.conditions.values():
        values = np.array([evaluate(system, text, points, modes) for text in texts]).reshape(-1, len(points))
        known &= ~np.isnan(values).any(axis=0)
        with np.errstate(invalid="ignore"):
            inside.append(np.asarray((values > 0.0).all(axis=0)))
            held.append(np.asarray((values >= 0.0).all(axis=0)))
    gap = np.asarray(known & ~np.any(held, axis=0))
    overlap = np.asarray(known & (np.sum(inside, axis=0) > 1))
    pieces = list(system.conditions)
    if gap.any():
        raise _refused(points[np.argmax(gap)].tolist(), system.states, tuple(pieces), gap=True)
    if overlap.any():
        at = int(np.argmax(overlap))
        beside = tuple(piece for piece, own in zip(pieces, inside, strict=True) if own[at])
        raise _refused(points[at].tolist(), system.states, beside, gap=False)


def _samples(n: int) -> NDArray[np.float64]:
    """Quasi-random states of several sizes: multiples of powers of the root of ``x^(n+1) = x + 1``, modulo 1.

    References
    ----------
    M. Roberts, The unreasonable effectiveness of quasirandom sequences, 2018: the sequence R_n.
    """
    root = 2.0
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (n + 1))
    steps = root ** -np.arange(1.0, n + 1)
    unit = 2.0 * ((0.5 + np.outer(np.arange(_POINTS), steps)) % 1.0) - 1.0
    mixed = 2.0 * ((0.5 + np.outer(np.arange(_MIXED), steps)) % 1.0) - 1.0
    signs = np.where((np.arange(_MIXED)[:, None] >> np.arange(n) % 60) % 2 == 0, 1.0, -1.0)
    return np.concatenate([*(scale * unit for scale in _SCALES), signs * 10.0 ** (_DECADES * mixed)])


def _refused(x: Any, states: tuple[str, ...], pieces: tuple[str, ...], *, gap: bool) -> DefinitionError:
    """Return the error of pieces that do not hold exactly once at a state."""
    where = ", ".join(f"{name} = {value:.9g}" for name, value in zip(states, x, strict=True))
    names = ", ".join(repr(piece) for piece in pieces)
    said = f"none of {names} does" if gap else f"{names} do at once"
    return DefinitionError("state", where, "one at which exactly one piece holds", said)
