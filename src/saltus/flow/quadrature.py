"""Integrals and extremes of expressions along a motion, by steps that are divided where the expression asks for it.

A step is divided where bounds of the expression over the box of its states say that places between may be missed: at
kinks, jumps and poles, and where an argument varies by more than its function's own scale. It is divided as well where
the Legendre coefficients of what is integrated do not fall. docs/theory/observables.md has the estimates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from saltus.scales import DIVERGED, EPS, FINER
from saltus.system.enclosure import Range, enclose, is_polynomial
from saltus.system.evaluate import evaluate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.flow.stretch import Motion

__all__ = ["BLOCK", "Panels", "Total", "greatest", "integrate", "partition", "rule"]

BLOCK = 1 << 16  # states computed at once, each from all coefficients of its step
_PARTS = 8, 32  # parts into which a step, or a part of one, is divided: of many, and of few
_FEW = 8  # steps that are few: all their parts cost little more than one
_MOST = 1 << 19  # states at which an expression is evaluated, at most: a second, and some 200 MB
_MARGIN = 0.125  # share of a state's sampled range by which its extremes may lie beyond it
_FINEST = 64.0 * EPS  # length of a part, in steps, below which its places cannot be told apart
_NODES = 16  # places in a part
_TAIL = 3  # Legendre coefficients, the last ones, that tell how far they have fallen
_ORDER = 1.5  # power of their fall in the error of Gauss and Legendre's rule, which lies between 1 and 2
_NEAR = 0.05  # share of the range by which a sampled extreme that is refined may miss the true one
_ZOOMS = 7  # divisions of an extreme's neighbourhood, which lead to 1e-7 of a step
_PLACES = 17  # places in each division


class Total(NamedTuple):
    """An integral or an extreme, an estimate of its error, and why it has no value, if so."""

    value: complex
    error: float
    note: str = ""


@dataclass(frozen=True)
class Panels:
    """Parts of a motion's steps, with the states at both ends of each and at the places of the rule between."""

    motion: Motion
    steps: NDArray[np.intp]  # shape (part,)
    spans: NDArray[np.float64]  # shape (part, 2): fractions of the step
    fractions: NDArray[np.float64]  # shape (part, places + 2)
    weights: NDArray[np.float64]  # shape (part, places): of the integral over time
    times: NDArray[np.float64]  # shape (part, places + 2)
    states: NDArray[np.float64]  # shape (part * (places + 2), all states)

    @classmethod
    def of(cls, motion: Motion, steps: NDArray[np.intp], spans: NDArray[np.float64], nodes: int = _NODES) -> Panels:
        """Return the panels of parts of steps."""
        places, weights = rule(nodes)
        width = spans[:, 1:] - spans[:, :1]
        fractions = spans[:, :1] + width * places
        clocks = motion.clocks[steps]
        rates = clocks[:, 1:2] + fractions * (2.0 * clocks[:, 2:3] + fractions * 3.0 * clocks[:, 3:4])
        rows = max(1, BLOCK // places.size)
        blocks = [slice(first, first + rows) for first in range(0, len(steps), rows)]
        found = [motion.states(steps[block], fractions[block]) for block in blocks]
        states = (found[0] if len(found) == 1 else np.concatenate(found)).reshape(fractions.size, -1)
        return cls(
            motion, steps, spans, fractions, (weights * width * rates)[:, 1:-1], motion.clock(steps, fractions), states
        )

    @property
    def modes(self) -> NDArray[np.int64]:
        """Mode of each part, shape (part,)."""
        return self.motion.modes[self.steps]

    @property
    def durations(self) -> NDArray[np.float64]:
        """Length of each part in time, shape (part,)."""
        return np.asarray(self.weights.sum(axis=1))

    def values(self, expression: str, errors: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return values at both ends and the places between, shape (part, places + 2); errors: added to the states."""
        motion, modes = self.motion, np.repeat(self.modes, self.fractions.shape[1])
        states = self.states if errors is None else self.states + errors
        flat = evaluate(motion.system, expression, states, modes, motion.parameters)
        return flat.reshape(self.fractions.shape)

    @cached_property
    def boxes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Least and greatest states of each part, shape (part, all states) each."""
        count = self.fractions.shape[1]
        # along the first axis NumPy compares whole rows at once, an order of magnitude faster
        table = np.ascontiguousarray(self.states.reshape(len(self.steps), count, -1).transpose(1, 0, 2))
        low, high = table.min(axis=0), table.max(axis=0)
        margin = _MARGIN * (high - low)
        return low - margin, high + margin

    def bounds(self, expression: str) -> Range:
        """Return bounds of an expression in each part; those of a polynomial, which places show, are left out."""
        motion = self.motion
        if is_polynomial(motion.system, expression):
            return Range(0.0, 0.0, np.ones(len(self.steps), dtype=bool))
        return enclose(motion.system, expression, self.boxes, self.modes, motion.parameters)

    def chosen(self, rows: NDArray[np.bool_]) -> Panels:
        """Return some of the panels."""
        states = self.states.reshape(*self.fractions.shape, -1)[rows].reshape(-1, self.states.shape[1])
        own = self.steps[rows], self.spans[rows], self.fractions[rows], self.weights[rows], self.times[rows]
        return Panels(self.motion, *own, states)

    def divided(self, rows: NDArray[np.bool_]) -> Panels:
        """Return the panels of parts of each of some parts."""
        count = _PARTS[1 if np.count_nonzero(rows) <= _FEW else 0]
        share = np.linspace(0.0, 1.0, count + 1)
        ends = self.spans[rows, :1] + (self.spans[rows, 1:] - self.spans[rows, :1]) * share
        ends[:, -1] = self.spans[rows, 1]
        spans = np.stack([ends[:, :-1], ends[:, 1:]], axis=2).reshape(-1, 2)
        return Panels.of(self.motion, np.repeat(self.steps[rows], count), spans)


def integrate(
    panels: Panels,
    expression: str,
    values: NDArray[np.float64],
    wave: Callable[[NDArray[np.float64]], NDArray[np.complex128]] | None = None,
    spread: bool = False,
) -> Total:
    """Return the integral over time of an expression, times a wave, with its error.

    Parameters
    ----------
    panels : Panels
        The steps.
    expression : str
        What is integrated.
    values : ndarray, shape (step, places + 2)
        Its values there.
    wave : callable, optional
        Of times, what it is multiplied by; smooth on the scale of the steps.
    spread : bool, optional
        Whether the error holds what the errors of the states make; that costs an evaluation for each state.
    """
    within = values[:, 1:-1] if wave is None else values[:, 1:-1] * wave(panels.times[:, 1:-1])
    parts = panels.weights * within
    if not spread and wave is None and is_polynomial(panels.motion.system, expression):
        return Total(complex(np.sum(parts)), np.nan)  # exact but for rounding
    errors, size = _tails(within, panels.durations), float(np.sum(np.abs(parts)))
    goal = FINER * panels.motion.tolerance * size
    bounds = panels.bounds(expression)
    if np.all(bounds.plain) and errors.sum() <= goal:
        error = float(errors.sum()) + EPS * size
        return Total(complex(np.sum(parts)), error + (_spread(panels, expression, values) if spread else 0.0))
    return _divided(panels, expression, values, bounds, wave, spread)


def _tails(values: NDArray[np.float64] | NDArray[np.complex128], durations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the error of the rule in each part, shape (part,), from the fall of the values' Legendre coefficients."""
    last = np.abs(values @ _legendre(values.shape[1])).max(axis=1)
    size = np.abs(values).max(axis=1)
    with np.errstate(all="ignore"):
        fall = np.where(size > 0.0, np.minimum(last / size, 1.0), 0.0)
    return np.asarray(np.abs(durations) * size * fall**_ORDER)


def partition(panels: Panels, expression: str) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the parts of steps by which the integral of an expression is found: of each the step and its span."""
    values, bounds = panels.values(expression), panels.bounds(expression)
    parts: list[tuple[NDArray[np.intp], NDArray[np.float64]]] = []
    _divided(panels, expression, values, bounds, None, False, parts)
    if not parts:  # it has no value on a part of the motion
        return panels.steps, panels.spans
    return np.concatenate([steps for steps, _ in parts]), np.concatenate([spans for _, spans in parts])


def _divided(
    panels: Panels,
    expression: str,
    values: NDArray[np.float64],
    bounds: Range,
    wave: Callable[[NDArray[np.float64]], NDArray[np.complex128]] | None,
    spread: bool,
    parts_seen: list[tuple[NDArray[np.intp], NDArray[np.float64]]] | None = None,
) -> Total:
    """Return an integral by parts of steps, as many as it takes; parts_seen: receives them."""
    total, error, size, left, spent = 0.0 + 0.0j, 0.0, 0.0, 0.0, 0
    while True:
        within = values[:, 1:-1] if wave is None else values[:, 1:-1] * wave(panels.times[:, 1:-1])
        lengths = np.abs(panels.durations)
        known, tails = np.isfinite(within), _tails(np.where(np.isfinite(within), within, 0.0), lengths)
        if np.any(bounds.plain & ~known.all(axis=1)):
            if parts_seen is not None:
                parts_seen.clear()
            return Total(complex(np.nan), np.nan, "the expression has no value on a part of the motion")
        parts = np.where(known, panels.weights * np.where(known, within, 0.0), 0.0)
        here, sizes = parts.sum(axis=1), np.abs(parts).sum(axis=1)
        largest = size + float(sizes.sum())
        goal = FINER * panels.motion.tolerance * largest / max(len(lengths), len(panels.motion.modes))
        missed = np.where(bounds.plain, tails, np.broadcast_to(bounds.width, lengths.shape) * lengths)
        open_ = ~(np.where(np.isnan(missed), np.inf, missed) <= goal)
        spent += values.size
        short = panels.spans[:, 1] - panels.spans[:, 0] <= _FINEST
        ended = open_ & (short | (spent > _MOST))
        done = ~open_ | ended
        if parts_seen is not None:
            parts_seen.append((panels.steps[done], panels.spans[done]))
        total, size = total + complex(here[done].sum()), size + float(sizes[done].sum())
        error += float(missed[~open_].sum())
        left += float(np.where(np.isfinite(missed), np.maximum(missed, 0.0), sizes)[ended].sum())
        if spread and np.any(done):
            error += _spread(panels, expression, values, done)
        if np.all(done):
            break
        panels = panels.divided(~done)
        values, bounds = panels.values(expression), panels.bounds(expression)
    if left > DIVERGED * size:
        why = "it is finer than the parts into which steps are divided" if spent > _MOST else "it grows without bound"
        return Total(complex(np.nan), np.inf, f"the integral does not converge: {why}")
    return Total(total, error + left + EPS * size)


def _spread(
    panels: Panels, expression: str, values: NDArray[np.float64], rows: NDArray[np.bool_] | None = None
) -> float:
    """Return how far the errors of the states move the integral of an expression over some parts."""
    errors = panels.motion.state_errors
    if errors is None:
        return 0.0
    inside, weights, total = values[:, 1:-1], np.abs(panels.weights), 0.0
    for e in np.flatnonzero(errors > 0.0).tolist():
        moved = panels.values(expression, np.where(np.arange(errors.size) == e, errors, 0.0))[:, 1:-1]
        known = np.isfinite(moved) & np.isfinite(inside)
        change = np.abs(np.subtract(moved, inside, where=known, out=np.zeros_like(inside)))
        total += float(np.sum((weights * change) if rows is None else (weights * change)[rows]))
    return total


def greatest(panels: Panels, expression: str, values: NDArray[np.float64], sign: float, spread: bool = False) -> Total:
    """Return the greatest value of an expression times a sign: of samples, then of the neighbourhoods of those near it.

    Parts in which bounds leave room for a greater one are divided first.
    """
    values = sign * values
    top = float(values.max())
    bounds = panels.bounds(expression)
    plain = bool(np.all(bounds.plain))
    if plain and not np.all(np.isfinite(values)):
        return Total(complex(top), np.nan)
    top, at = _zoomed(panels, expression, values, sign) if np.all(np.isfinite(values)) else (_finite_top(values), None)
    unsure = 0.0
    if not plain:
        top, at, unsure = _searched(panels, expression, values, bounds, sign, (top, at))
    error = unsure + EPS * abs(top)
    if spread and at is not None and np.isfinite(top):
        error += _moved(panels.motion, expression, at)
    return Total(complex(top), error)


def exceeded(panels: Panels, expression: str, bounds: Range, sign: float, known: float) -> float:
    """Return the greatest value of an expression times a sign, where one is known that a few places showed.

    bounds: those in the panels. Places in a panel that is not plain may have missed a greater one.
    """
    high = np.asarray(bounds.high if sign > 0.0 else -bounds.low)
    open_ = ~bounds.plain & (high > known + panels.motion.tolerance * abs(known))
    if not np.any(open_):
        return known
    parts = panels.chosen(open_)
    values = sign * parts.values(expression)
    top, _, _ = _searched(
        parts, expression, values, parts.bounds(expression), sign, (max(known, _finite_top(values)), None)
    )
    return known if np.isnan(top) else top


_At: TypeAlias = "tuple[int, float]"  # a step and a fraction of it


def _finite_top(values: NDArray[np.float64]) -> float:
    return float(np.max(np.where(np.isnan(values), -np.inf, values)))


def _searched(
    panels: Panels,
    expression: str,
    values: NDArray[np.float64],
    bounds: Range,
    sign: float,
    best: tuple[float, _At | None],
) -> tuple[float, _At | None, float]:
    """Return the greatest value, where it is, and by how much it may be exceeded, by division of parts.

    What grows up to the finest parts, where no bound holds, has no greatest value: infinity is returned.
    """
    (top, at), spent, kept = best, 0, []
    finite = values[np.isfinite(values)]
    goal = panels.motion.tolerance * max(abs(top), float(np.ptp(finite)) if finite.size else 0.0)
    while True:
        if np.any(bounds.plain & np.isnan(values).any(axis=1)):
            return np.nan, None, np.nan
        high, before = np.asarray(bounds.high if sign > 0.0 else -bounds.low), top
        top, at = max((top, at), _sampled(panels, values), key=lambda one: one[0])
        if spent:  # whole steps are looked at already
            kept.append((panels, high, bounds.plain))
        spent += values.size
        open_ = ~bounds.plain & (high > top + goal)
        short = panels.spans[:, 1] - panels.spans[:, 0] <= _FINEST
        if spent > _MOST or not np.any(open_ & ~short):
            break
        panels = panels.divided(open_ & ~short)
        values, bounds = sign * panels.values(expression), panels.bounds(expression)
    grown, left = top > before + goal, float(np.max(high[open_] - top, initial=0.0))
    if np.isinf(left) and spent <= _MOST:
        if grown:
            return np.inf, at, 0.0
        left = abs(top - before)
    for some, bound, plain in kept:
        if np.any(rows := plain & (bound > top + goal)):
            part = some.chosen(rows)
            top, at = max(
                (top, at), _zoomed(part, expression, sign * part.values(expression), sign), key=lambda one: one[0]
            )
    return top, at, left


def _sampled(panels: Panels, values: NDArray[np.float64]) -> tuple[float, _At]:
    """Return the greatest sample, and its place."""
    here = np.where(np.isnan(values), -np.inf, values)
    row, column = np.unravel_index(int(np.argmax(here)), here.shape)
    return float(here[row, column]), (int(panels.steps[row]), float(panels.fractions[row, column]))


def _zoomed(panels: Panels, expression: str, values: NDArray[np.float64], sign: float) -> tuple[float, _At | None]:
    """Return the greatest value near the greatest samples, whose neighbourhoods are divided, and where it is."""
    motion, top = panels.motion, float(values.max())
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
    high = (values >= padded[:, :-2]) & (values >= padded[:, 2:]) & (values >= top - _NEAR * np.ptp(values))
    rows, at = np.nonzero(high)
    steps, last = panels.steps[rows], values.shape[1] - 1
    low, far = panels.fractions[rows, np.maximum(at - 1, 0)], panels.fractions[rows, np.minimum(at + 1, last)]
    row, column = np.unravel_index(int(np.argmax(values)), values.shape)
    place = int(panels.steps[row]), float(panels.fractions[row, column])
    share, each = np.linspace(0.0, 1.0, _PLACES), np.repeat(steps, _PLACES)
    rows = np.arange(len(steps))
    for _ in range(_ZOOMS):
        places = low[:, None] + (far - low)[:, None] * share
        states = motion.states(each, places.ravel())
        found = sign * evaluate(motion.system, expression, states, motion.modes[each], motion.parameters)
        table = found.reshape(places.shape)
        best = table.argmax(axis=1)
        if float(table.max()) > top:
            peak = int(np.argmax(table.max(axis=1)))
            top, place = float(table.max()), (int(steps[peak]), float(places[peak, best[peak]]))
        low, far = places[rows, np.maximum(best - 1, 0)], places[rows, np.minimum(best + 1, _PLACES - 1)]
    return top, place


def _moved(motion: Motion, expression: str, at: _At) -> float:
    """Return how far the errors of the states move an expression at a place."""
    errors = motion.state_errors
    if errors is None:
        return 0.0
    x = motion.states(np.array([at[0]]), np.array([at[1]]))
    table = np.vstack([x, x + np.diag(errors), x - np.diag(errors)])
    modes = np.repeat(motion.modes[at[0]], len(table))
    found = evaluate(motion.system, expression, table, modes, motion.parameters)
    if not np.all(np.isfinite(found)):
        return float(np.inf)
    return float(np.abs(found[1:] - found[0]).reshape(2, -1).max(axis=0).sum())


@cache
def rule(nodes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return places s^2 (3 - 2 s) in [0, 1], both ends among them, and weights, of Gauss and Legendre in s."""
    roots, weights = np.polynomial.legendre.leggauss(nodes)
    s = np.concatenate([[0.0], 0.5 * (roots + 1.0), [1.0]])
    rates = 6.0 * s * (1.0 - s)
    return s**2 * (3.0 - 2.0 * s), rates * np.concatenate([[0.0], 0.5 * weights, [0.0]])


@cache
def _legendre(nodes: int) -> NDArray[np.float64]:
    """Return what gives the last Legendre coefficients of values at the nodes, shape (nodes, `_TAIL`)."""
    roots, weights = np.polynomial.legendre.leggauss(nodes)
    orders = np.arange(nodes)[-_TAIL:]
    return weights[:, None] * np.polynomial.legendre.legvander(roots, nodes - 1)[:, -_TAIL:] * (orders + 0.5)
