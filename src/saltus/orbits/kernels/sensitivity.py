"""Compiled derivatives of an orbit's integrals and extremes by many parameters at once: docs/theory/sensitivities.md."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import int64

from saltus.flow.kernels.segment import EVENT_P, EVENT_X, FIELD
from saltus.orbits.kernels.equation import TURN, pointed
from saltus.orbits.kernels.variation import Path, View, curve_of, differentiate, look, rate_of, value_of
from saltus.orbits.records import Mesh, Observed, Orbit, Seen
from saltus.scales import EXTREME_SAMPLED, EXTREMES_TIED, JUMPED, ON_CORNER, QUANTITY_ERROR, SLOPES_ALIKE, TURNS_THERE
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, keep, outlined, pointer

SMOOTH = 0  # an extreme with derivatives
AT_TWO_PLACES = 1  # one that is attained at two places
AT_A_JUMP = 2  # one at a place where its quantity jumps


class Angle(NamedTuple):
    """Derivatives by all parameters of what the angle of harmonics depends on: pointers, (columns,) each.

    Attributes
    ----------
    period, begun, turn : pointer
        Of the period, of the time at a segment's start, of the angle at time 0.
    """

    period: object
    begun: object
    turn: object


class Wanted(NamedTuple):
    """What is looked at, on pointers, with counts; see `saltus.orbits.records.Observed`."""

    n_quantities: int
    quantities: object
    n_integrals: int
    integrals: object
    orders: object
    n_extremes: int
    extremes: object
    signs: object
    n_places: int
    places: object
    scale: object
    first: bool


class Kept(NamedTuple):
    """What is found, on pointers, and the number of samples; see `saltus.orbits.records.Seen`."""

    samples: int
    sums: object
    values: object
    rates: object
    sizes: object
    noise: object
    extremes: object
    kinds: object
    segments: object


class Peak(NamedTuple):
    """What is known of an extreme: of a quantity, times a sign.

    Attributes
    ----------
    what : int
        A state (below n), or the expression behind these.
    sign : float
        1 for a maximum, -1 for a minimum.
    tie, jump : float
        Differences up to which two values are equal, and from which on the quantity jumps.
    best : pointer
        The greatest value so far, and its slopes, (1 + columns,).
    sizes : pointer
        Largest slope by each parameter along the orbit, (columns,).
    low, high : pointer
        Scratch: value, rate and slopes, (2 + columns,) each.
    first : bool
        Whether of equal values the first one is taken.
    """

    what: int
    sign: float
    tie: float
    jump: float
    best: object
    sizes: object
    low: object
    high: object
    first: bool


@njit(cache=True, error_model="numpy")
def observe(orbit, mesh, dense, u, du, observed, seen):
    """Integrate and sample quantities along an orbit that `vary` has followed, and find extremes.

    orbit, mesh, observed, seen: the fields of those records; the last one is written. dense: nodes and coefficients.
    """
    orbit, mesh, observed, seen = Orbit(*orbit), Mesh(*mesh), Observed(*observed), Seen(*seen)
    system, n, columns, expressions = pointed(orbit), orbit.n, orbit.active.size, observed.expressions
    length, start, change = n * (1 + columns), pointer(u, 0), pointer(du, 0)
    wanted, kept = _wanted(observed), _kept(seen)
    tracks, extremes = wanted.n_quantities, wanted.n_extremes
    path = Path(
        system.segments, system.modes, pointer(mesh.places, 0), pointer(mesh.starts, 0), pointer(dense[0], 0),
        pointer(dense[1], 0),
    )  # fmt: skip
    stride = n + observed.parameters
    tail = length + n + expressions * (2 + stride)
    block = np.zeros(tail + (tracks + 6) * columns + tracks + 6 + 2 * expressions)
    out, heights = pointer(block, length + n), pointer(block, tail + (tracks + 6) * columns + tracks + 6)
    view = View(
        system.functions[FIELD], observed.readings, system.p, pointer(observed.constants, 0), system.active, n, columns,
        expressions,
        length, stride, pointer(block, 0), pointer(block, length), out,
    )  # fmt: skip
    angle = Angle(pointer(block, tail), pointer(block, tail + columns), pointer(block, tail + 2 * columns))
    work = pointer(block, tail + 3 * columns)
    period = 0.0
    for i in range(system.segments):
        period += start[i * (n + 1) + n]
        for k in range(columns):
            angle.period[k] += change[(i * (n + 1) + n) * columns + k]
    faster = TURN / orbit.turn  # the angle of harmonics, over the phase
    if observed.phase:
        for k in range(columns):
            angle.turn[k] = faster * change[(n - 1) * columns + k]
    begun, at = 0.0, int64(0)
    for i in range(system.segments):
        row, curve = i * (n + 1), curve_of(path, i, length)
        clock = start[row + n], begun, period, max(orbit.turns, 1), faster * start[n - 1] if observed.phase else 0.0
        longer = pointer(change, (row + n) * columns)
        for step in range(curve.count):
            s = curve.mesh[step]
            h = curve.mesh[step + 1] - s
            for g in range(-1 if extremes > 0 else 0, wanted.n_places):
                look(view, curve, step, wanted.places[g] if g >= 0 else 0.0)
                if observed.cornered:
                    _watch(view, heights)
                if extremes > 0 and (g < 0 or g % 2 == 1):
                    _sample(view, wanted, curve.mode, kept, at, int64(g))
                    at += 1
                if g >= 0 and tracks > 0:
                    place, weight = s + h * wanted.places[g], observed.weights[g] * h
                    _add(view, wanted, clock, place, weight, longer, angle, kept.sums, work)
        if extremes > 0:
            look(view, curve, curve.count - 1, 1.0)
            _sample(view, wanted, curve.mode, kept, at, int64(-1))
            at += 1
        for q in range(expressions):
            level = ON_CORNER * max(heights[q], heights[expressions + q])
            if min(heights[q], heights[expressions + q]) > level:
                seen.bent[q] = 1
            heights[q] = heights[expressions + q] = 0.0
        begun += start[row + n]
        for k in range(columns):
            angle.begun[k] += longer[k]
    for j in range(extremes):
        _extreme(view, wanted, path, j, work, kept)
    keep(block)


@njit(**INNER)
def _wanted(observed):
    """Return what is looked at on pointers."""
    return Wanted(
        observed.quantities.size, pointer(observed.quantities, 0), observed.integrals.size,
        pointer(observed.integrals, 0), pointer(observed.orders, 0), observed.extremes.size,
        pointer(observed.extremes, 0), pointer(observed.signs, 0), observed.places.size, pointer(observed.places, 0),
        pointer(observed.scale, 0), observed.first,
    )  # fmt: skip


@njit(**INNER)
def _kept(seen):
    """Return what is written on pointers."""
    return Kept(
        seen.values.shape[1], pointer(seen.sums, 0), pointer(seen.values, 0), pointer(seen.rates, 0),
        pointer(seen.sizes, 0), pointer(seen.noise, 0), pointer(seen.extremes, 0), pointer(seen.kinds, 0),
        pointer(seen.segments, 0),
    )  # fmt: skip


@njit(**INNER)
def _add(view, wanted, clock, place, weight, longer, angle, sums, work):
    """Add a place's part to the integrals of quantities times exp(-i order angle), and to their derivatives.

    clock: duration of the segment, time at its start, period, turns, angle at time 0. longer: derivatives of that
    duration. work: (1 + quantities, 1 + columns).
    """
    outlined()
    duration, begun, period, turns, zero = clock
    columns, order, cosine, sine = view.columns, 0.0, 1.0, 0.0
    turning, values = pointer(work, 0), pointer(work, columns)
    slopes = pointer(values, wanted.n_quantities)
    share = place * place * (3.0 - 2.0 * place)
    weight *= 6.0 * place * (1.0 - place)
    time, speed = (begun + duration * share) / period, 2.0 * math.pi * turns / period
    for k in range(columns):
        turning[k] = angle.turn[k] + speed * (angle.begun[k] + longer[k] * share - time * angle.period[k])
    for q in range(wanted.n_quantities):
        values[q] = value_of(view, wanted.quantities[q])
        differentiate(view, wanted.quantities[q], pointer(slopes, q * columns))
    for a in range(wanted.n_integrals):
        q = wanted.integrals[a]
        value, slope = values[q], pointer(slopes, q * columns)
        if wanted.orders[a] != order:
            order = wanted.orders[a]
            cosine, sine = (
                math.cos(order * (zero + speed * period * time)),
                math.sin(order * (zero + speed * period * time)),
            )
        row, imaginary, size = pointer(sums, 3 * a * (1 + columns)), 1 + columns, weight * duration * value
        row[0] += size * cosine
        row[imaginary] -= size * sine
        row[2 * imaginary] += abs(size)
        for k in range(columns):
            change = weight * (duration * slope[k] + longer[k] * value)
            turn = order * size * turning[k]
            row[1 + k] += change * cosine - turn * sine
            row[imaginary + 1 + k] -= change * sine + turn * cosine
            row[2 * imaginary + 1 + k] += abs(change)


@njit(cache=True, error_model="numpy")
def rate_at(orbit, transition, end, out):
    """Write the rate of an event function at a segment's end, a state with its variations, and its derivatives."""
    orbit = Orbit(*orbit)
    system, n, columns, y = pointed(orbit), orbit.n, orbit.active.size, pointer(end, 0)
    block = np.empty(2 + 2 * n)
    event, out = pointer(block, 0), pointer(out, 0)
    call(system.functions[EVENT_X], transition, 0, y, 0, system.p, event, 0)
    out[0] = event[1]
    for k in range(columns):
        total = 0.0
        for e in range(n):
            total += event[2 + n + e] * y[n + e * columns + k]
        out[1 + k] = total
    for k in range(columns):
        call(system.functions[EVENT_P], transition, system.active[k], y, 0, system.p, event, 0)
        out[1 + k] += event[1]
    keep(block)


@njit(**INNER)
def _watch(view, heights):
    """Keep how far on either side of a corner each expression has been: heights, (2, expressions)."""
    for q in range(view.expressions):
        height = view.out[view.expressions * (1 + view.stride) + q]
        heights[q], heights[view.expressions + q] = max(heights[q], height), max(heights[view.expressions + q], -height)


@njit(**INNER)
def _sample(view, wanted, mode, kept, at, g):
    """Keep values and rates of the quantities whose extremes are sought, and before the first place `g` the sizes of their slopes."""
    outlined()
    call(view.field, mode, 0, view.y, 0, view.p, view.f, 0)
    for j in range(wanted.n_extremes):
        what = wanted.extremes[j]
        kept.values[j * kept.samples + at] = wanted.signs[j] * value_of(view, what)
        kept.rates[j * kept.samples + at] = wanted.signs[j] * rate_of(view, what)
        if g < 0:
            kept.noise[j] = _larger(kept.noise[j], QUANTITY_ERROR * _size(view, wanted.scale, what))
            largest, slopes = pointer(kept.sizes, j * view.columns), pointer(kept.extremes, j * (1 + view.columns))
            differentiate(view, what, slopes)
            for k in range(view.columns):
                largest[k] = _larger(largest[k], abs(slopes[k]))


@njit(**INNER)
def _larger(most, size):
    """Return the larger one; a size that is infinite or none, as at the surface of a root, is left out."""
    return size if most < size < np.inf else most


@njit(**INNER)
def _size(view, scale, what):
    """Return how much a quantity varies with the states' sizes, where `look` has looked."""
    if what < view.n:
        return scale[what]
    gradient = pointer(view.out, view.expressions + (what - view.n) * view.stride)
    total = 0.0
    for e in range(view.n):
        total += abs(gradient[e]) * scale[e]
    return total


@njit(**INNER)
def _extreme(view, wanted, path, j, work, kept):
    """Find an extreme and its slopes: at a zero of the rate, or at the start or end of a segment."""
    outlined()
    samples = kept.samples
    values, rates = pointer(kept.values, j * samples), pointer(kept.rates, j * samples)
    top, bottom, columns, each = -np.inf, np.inf, view.columns, wanted.n_places // 2 + 1
    for a in range(samples):
        top, bottom = max(top, values[a]), min(bottom, values[a])
    width = top - bottom
    size = max(abs(top), abs(bottom))
    best = pointer(kept.extremes, j * (1 + columns))
    peak = Peak(
        wanted.extremes[j], wanted.signs[j], EXTREMES_TIED * width + 4e-16 * size + kept.noise[j], JUMPED * width + 1e-14 * size, best,
        pointer(kept.sizes, j * columns), work, pointer(work, 2 + columns),
        wanted.first,
    )  # fmt: skip
    best[0] = -np.inf
    at, kind = int64(0), int64(SMOOTH)
    for i in range(path.segments):
        curve, before = curve_of(path, i, view.length), best[0]
        for a in range(curve.count * each):
            near = max(values[at + a], values[at + a + 1]) >= top - EXTREME_SAMPLED * width
            if near and rates[at + a] > 0.0 and rates[at + a + 1] <= 0.0:
                step, place = a // each, a % each
                low = 0.0 if place == 0 else wanted.places[2 * place - 1]
                high = wanted.places[2 * place + 1] if place < each - 1 else 1.0
                kind = _offer(peak, columns, _turn(view, curve, peak, step, low, high), kind)
        for end in range(2):
            if values[at + end * curve.count * each] >= best[0] - peak.tie:
                look(view, curve, end * (curve.count - 1), float(end))
                _note(view, curve.mode, peak, peak.low)
                kind = _offer(peak, columns, int64(SMOOTH), kind)
        if best[0] > before:
            kept.segments[j] = i
        at += curve.count * each + 1
    kept.kinds[j] = kind if peak.first else _levels(view, path, peak, values, each, kind)
    for k in range(1 + columns):
        best[k] *= peak.sign


@njit(**INNER)
def _levels(view, path, peak, values, each, kind):
    """Offer all steps of segments that are level at the extreme, as at rest: slopes may differ along them."""
    outlined()
    at = int64(0)
    for i in range(path.segments):
        curve, least = curve_of(path, i, view.length), np.inf
        for a in range(curve.count * each + 1):
            least = min(least, values[at + a])
        if least >= peak.best[0] - peak.tie:
            for step in range(curve.count):
                look(view, curve, step, 0.0)
                _note(view, curve.mode, peak, peak.low)
                kind = _offer(peak, view.columns, int64(SMOOTH), kind)
        at += curve.count * each + 1
    return kind


@njit(**INNER)
def _note(view, mode, peak, out):
    """Write value, rate and slopes of the quantity where `look` has looked."""
    outlined()
    call(view.field, mode, 0, view.y, 0, view.p, view.f, 0)
    out[0], out[1] = peak.sign * value_of(view, peak.what), peak.sign * rate_of(view, peak.what)
    slopes = pointer(out, 2)
    differentiate(view, peak.what, slopes)
    for k in range(view.columns):
        slopes[k] *= peak.sign


@njit(**INNER)
def _turn(view, curve, peak, step, low, high):
    """Leave value and slopes where the rate changes its sign in `peak.low`; return what the extreme is like.

    At a corner the slope is that of the place at which both sides meet.
    """
    outlined()
    look(view, curve, step, low)
    _note(view, curve.mode, peak, peak.low)
    look(view, curve, step, high)
    _note(view, curve.mode, peak, peak.high)
    rise, fall = peak.low[1], peak.high[1]
    still = TURNS_THERE * (rise - fall)
    for ask in range(100):
        if high - low < 1e-15:
            break
        place = low + (high - low) * rise / (rise - fall)
        if ask % 3 == 2 or not low < place < high:
            place = 0.5 * (low + high)
        if not low < place < high:
            break
        look(view, curve, step, place)
        call(view.field, curve.mode, 0, view.y, 0, view.p, view.f, 0)
        rate = peak.sign * rate_of(view, peak.what)
        if abs(rate) <= still:
            _note(view, curve.mode, peak, peak.low)
            return int64(SMOOTH)
        if rate > 0.0:
            low, rise = place, rate
            _note(view, curve.mode, peak, peak.low)
        else:
            high, fall = place, rate
            _note(view, curve.mode, peak, peak.high)
    gap = abs(peak.low[0] - peak.high[0])
    share = peak.low[1] / (peak.low[1] - peak.high[1]) if peak.low[1] > 0.0 else 0.0
    peak.low[0] = max(peak.low[0], peak.high[0])
    for k in range(view.columns):
        peak.low[2 + k] += share * (peak.high[2 + k] - peak.low[2 + k])
    return int64(AT_A_JUMP if gap > peak.jump else SMOOTH)


@njit(**INNER)
def _offer(peak, columns, like, kind):
    """Take what `peak.low` holds where it is the greatest; slopes that differ between equal ones are NaN.

    Or of equal ones the first is kept.
    """
    outlined()
    best, found = peak.best, peak.low
    if not found[0] >= best[0] - peak.tie:
        return kind
    if found[0] > best[0] + peak.tie:
        best[0] = found[0]
        for k in range(columns):
            best[1 + k] = found[2 + k] if like == SMOOTH else np.nan
        return like
    if peak.first:
        return kind
    best[0] = max(best[0], found[0])
    for k in range(columns):
        if like != SMOOTH or not abs(best[1 + k] - found[2 + k]) <= SLOPES_ALIKE * peak.sizes[k]:
            best[1 + k] = np.nan
            kind = AT_TWO_PLACES if kind == SMOOTH and like == SMOOTH else max(kind, like)
    return kind
