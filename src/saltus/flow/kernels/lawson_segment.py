"""Compiled flow of one segment by Lawson's method, in clustered time, as `saltus.flow.kernels.segment` does it by Runge-Kutta.

Behind the addresses of the generated functions is that of the modes' linear parts (`saltus.flow.linear_parts`). A mode
that has none, or whose rest depends on the state through more than one function, is followed by Runge-Kutta steps.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import float64, int64, types

from saltus.flow import exponential, lawson
from saltus.flow.kernels import segment as explicit
from saltus.flow.kernels.exponential_step import (
    ENOUGH,
    STAGES as STATIONS,
    driven_in,
    followed_states,
    level_at,
    off,
    one_function,
    room_for_driven,
    size_of,
    solved,
)
from saltus.flow.kernels.exponential_varied import room_for_slopes, slopes_in, varied as varied_by_force
from saltus.flow.kernels.lawson_step import (
    EACH,
    HEAD,
    STAGES,
    clustered,
    error_of,
    laid_out,
    plain,
    room_for,
    set_frame,
    span,
    taken,
)
from saltus.flow.kernels.lawson_varied import linearised, propagated
from saltus.flow.kernels.segment import LINEAR, MISSED, PROBES, Segment, Sensitive, state_slope
from saltus.flow.kernels.stages import dense_slope, dense_value
from saltus.system.numba_tools.machine_code import cfunc, njit
from saltus.system.numba_tools.pointers import INNER, keep, numbers_at, outlined, pointer, stack

NUMBERS = types.CPointer(float64)
DENSE = lawson.DENSE.ravel()
BESIDE = 2  # steps of the mesh at either end that are taken in the frame, where these turn no further
SMOOTH = 2.0  # longest step in the frame, times this rate, in place of those of a length that has tables
NEAREST = 1.2  # step of a length that has tables, over the mesh's step that it stands for, at most
LARGEST = 0.7  # error up to which a step of a length that has tables is taken
TOLD = 4.0  # error that is told of steps that were not taken, at most
FITS = 4e-3  # error that is told of a step of the mesh, at most, where shorter ones were taken in its place
EXPLICIT = 0.25  # longest explicit step in place of steps with a linear part, times this rate
MOST_PARTS = 1000  # of a step of the mesh; one that needs more has no end, as the errors tell
SLOW = 12  # sweeps from which a step counts as too long
LEVELS = exponential.LEVELS
SHORTEST = exponential.SHORTEST  # shortest and longest exponential step, times this rate
FARTHEST = exponential.SHORTEST * 2.0 ** (0.5 * (exponential.LEVELS - 1))
INTEGERS = types.CPointer(int64)
SYSTEM = INTEGERS, int64, int64, NUMBERS  # addresses of generated functions, mode, components, parameters

_explicit_flow = explicit.flow
_explicit_dense = explicit.dense


class Parts(NamedTuple):
    """What the steps of a segment are made with, on pointers.

    Attributes
    ----------
    linear, tables : pointer
        The mode's linear part, and what steps of each length make of it.
    frame, stages, varied : `Frame`, `Stages`, `Varied`
        Scratch of steps in the frame.
    driven, slopes : `Driven`, `Slopes`
        Scratch of exponential steps.
    """

    linear: object
    tables: object
    frame: object
    stages: object
    varied: object
    driven: object
    slopes: object


@njit(**INNER)
def _linear(functions, mode, n):
    """Return the linear part of a mode."""
    return pointer(numbers_at(functions[LINEAR]), mode * (HEAD + EACH * n))


@njit(**INNER)
def _paired(linear, n, partners):
    """Return the components' partners, written in `partners`."""
    for e in range(n):
        partners[e] = int(linear[HEAD + EACH * e])
    return partners


@njit(**INNER)
def _in_frame(segment, sensitive, parts, y, end, tolerances):
    """Take a step in the frame, whose times are set, from `y` to `end`; return its error, -1 where it cannot be taken."""
    outlined()
    n, linear, frame, stages, varied = segment.n, parts.linear, parts.frame, parts.stages, parts.varied
    set_frame(n, linear, frame, stages.frame)
    sweeps = taken(segment, linear, y, frame, stages, end, 0.0)
    if sweeps == 0 or not linearised(segment, linear, frame, stages, varied):
        return -1.0
    rough = error_of(n, stages, y, end, tolerances[0], tolerances[1])
    given = frame, stages, varied
    rough = max(rough, propagated(segment, linear, sensitive, pointer(y, n), pointer(end, n), tolerances[0], given))
    # errors of order 16 as if they were of order 8, by which meshes are moved
    return max(math.sqrt(rough), 1.0 if sweeps > SLOW else 0.0)


@njit(**INNER)
def _by_force(segment, sensitive, parts, level, y, end, tolerances):
    """Take a step of a length that has tables from `y` to `end`, as `_in_frame` does; inf where it is not solved."""
    outlined()
    n, linear, driven, partners = segment.n, parts.linear, parts.driven, parts.frame.partners
    made = level_at(pointer(parts.tables, level * size_of(n)), n)
    sweeps = solved(segment, linear, made, partners, y, driven, end)
    if sweeps == 0:
        return math.inf
    followed_states(n, made, partners, y, driven)
    start = y[n - 1], driven.rest[(n - 1) * STATIONS]
    given = made, driven, parts.slopes, partners, start
    rough = varied_by_force(segment, linear, sensitive, pointer(y, n), pointer(end, n), tolerances[0], given)
    rough = max(rough, off(segment, linear, made, driven, y, end, parts.slopes.steepest[0], tolerances))
    if not one_function(segment, linear, partners, end, driven):
        return -1.0
    return max(math.sqrt(rough), 1.0 if sweeps > SLOW else 0.0)


@njit(**INNER)
def _level(tables, size, most):
    """Return the number of the longest length that is at most `most`; -1 where none is."""
    level = -1
    for i in range(LEVELS):
        if tables[i * size] <= most:
            level = i
    return level


@njit(**INNER)
def _fitting(tables, size, lengths, count, k, used, room, way):
    """Return the number of the length that fits the mesh's steps from the k-th on, forwards or backwards; -1 without one.

    lengths: (count,), in time, of which `used` of the k-th lies behind.
    """
    outlined()
    level, covered = _level(tables, size, min(room, NEAREST * lengths[k])), -used
    if level < 0 and room >= tables[0]:
        level = 0
    while level > 0:
        covered += lengths[k]
        k += way
        if covered >= tables[level * size] or k < 0 or k >= count:
            break
        if NEAREST * lengths[k] < tables[level * size]:
            level = max(_level(tables, size, NEAREST * lengths[k]), 0)
    return level


@njit(**INNER)
def _planned(tables, size, lengths, count, total, fill, plan, most):
    """Write numbers of lengths for a run of the mesh's steps from both ends; return how many from either, and the gap.

    The numbers from the end are written backwards from the end of `plan`, (most,). fill: the longest gap that may stay.
    """
    outlined()
    k, used, last, spent = 0, 0.0, count - 1, 0.0
    front, back, begun, ended = 0, 0, 0.0, 0.0
    while front + back < most:
        room = total - begun - ended
        if room <= min(fill, 0.5 * min(lengths[k], lengths[last])):
            break
        forwards = begun <= ended
        if forwards:
            level = _fitting(tables, size, lengths, count, k, used, room, 1)
        else:
            level = _fitting(tables, size, lengths, count, last, spent, room, -1)
        if level < 0:
            break
        length = tables[level * size]
        if forwards:
            plan[front] = level
            front += 1
            begun += length
            used += length
            while k < count - 1 and used >= lengths[k]:
                used -= lengths[k]
                k += 1
        else:
            back += 1
            plan[most - back] = level
            ended += length
            spent += length
            while last > 0 and spent >= lengths[last]:
                spent -= lengths[last]
                last -= 1
    return front, back, total - begun - ended


@njit(**INNER)
def _clustered_step(segment, parts, sensitive, mesh, step, tolerances, y, end, errors):
    """Take a step of the mesh in the frame; whether it could be taken."""
    clustered(segment.duration, mesh[step], mesh[step + 1] - mesh[step], parts.frame)
    errors[step] = _in_frame(segment, sensitive, parts, y, end, tolerances)
    for e in range(segment.n * (1 + sensitive.columns)):
        y[e] = end[e]
    return errors[step] >= 0.0


@njit(**INNER)
def _run(segment, parts, sensitive, lengths, count, total, tolerances, y, end, errors):
    """Take steps that are put together, and cut to lengths that have tables; whether they could be taken.

    One step in the frame takes what is left, in the middle. A step whose error is too large is taken in two halves.
    """
    outlined()
    size, wide, most = segment.n * (1 + sensitive.columns), size_of(segment.n), 8 * count + 200
    levels = np.empty(most + 2 * LEVELS, np.int64)
    plan, waiting = pointer(levels, 0), pointer(levels, most)
    front, back, gap = _planned(parts.tables, wide, lengths, count, total, SMOOTH / parts.linear[3], plan, most)
    for k in range(count):
        errors[k] = (parts.linear[3] * lengths[k] / FARTHEST) ** 8
    k, begun, going = 0, 0.0, True
    for i in range(front + 1 + back):
        depth = 1
        waiting[0] = -1 if i == front else plan[i if i < front else most - back + i - front - 1]
        told = 0.0
        while depth > 0 and going:
            depth -= 1
            level = waiting[depth]
            if level >= 0:
                length = parts.tables[level * wide]
                error = _by_force(segment, sensitive, parts, level, y, end, tolerances)
                if level < 2 and not error < math.inf:
                    error = -1.0
                if error > LARGEST and level >= 2:
                    told = max(told, min(error, TOLD))
                    waiting[depth] = waiting[depth + 1] = level - 2
                    depth += 2
                    continue
            elif gap > 0.0:
                length = gap
                plain(gap, parts.frame)
                error = _in_frame(segment, sensitive, parts, y, end, tolerances)
            else:
                continue
            going = error >= 0.0
            for e in range(size):
                y[e] = end[e]
            begun += length
            while True:
                shorter = min(max(lengths[k] / length, 1.0) ** 8 * error, FITS)
                errors[k] = max(errors[k], max(error, max(shorter, told)))
                if k == count - 1 or begun < lengths[k]:
                    break
                begun -= lengths[k]
                k += 1
    keep(levels)
    return going


@njit(**INNER)
def _followed(segment, parts, sensitive, mesh, count, tolerances, y, errors):
    """Run a segment on its mesh from `y`; whether its steps could be taken."""
    outlined()
    duration, fastest, step, going = segment.duration, parts.linear[3], 0, True
    block = np.empty(segment.n * (1 + sensitive.columns) + count)
    lengths = pointer(block, 0)
    end = pointer(block, count)
    while step < count and going:
        last = step
        while last < count:
            length = span(duration, mesh[last], mesh[last + 1] - mesh[last])
            beside = last < BESIDE or last >= count - BESIDE  # a surface, where the field may bend
            if not fastest * length >= (SMOOTH if beside else SHORTEST):
                break
            lengths[last - step] = length
            last += 1
        if last == step:
            going = _clustered_step(segment, parts, sensitive, mesh, step, tolerances, y, end, errors)
            step += 1
        else:
            total, told = span(duration, mesh[step], mesh[last] - mesh[step]), pointer(errors, step)
            going = _run(segment, parts, sensitive, lengths, last - step, total, tolerances, y, end, told)
            step = last
    keep(block)
    return going


@njit(**INNER)
def _parts_of(segment, linear, mesh, step):
    """Return in how many explicit steps one of the mesh is taken, which resolve what turns or decays."""
    if not linear[0] > 0.0:
        return 1
    turned = linear[3] * abs(span(segment.duration, mesh[step], mesh[step + 1] - mesh[step])) / EXPLICIT
    return int(turned) + 1 if turned < MOST_PARTS else 1


@njit(**INNER)
def _by_runge_kutta(segment, sensitive, linear, x0, grid, tolerances, y, errors):
    """Run a segment by explicit steps as `flow` does; where the mode has a linear part, steps of the mesh are too long."""
    outlined()
    mesh, count = grid
    total = 0
    for step in range(count):
        total += _parts_of(segment, linear, mesh, step)
    block = np.empty(2 * total + 1)
    finer, told, at = pointer(block, 0), pointer(block, total + 1), 0
    for step in range(count):
        parts = _parts_of(segment, linear, mesh, step)
        for k in range(parts):
            finer[at + k] = mesh[step] + (mesh[step + 1] - mesh[step]) * k / parts
        at += parts
    finer[total] = mesh[count]
    _explicit_flow(segment, sensitive, x0, finer, total, tolerances[0], tolerances[1], y, told)
    at = 0
    for step in range(count):
        errors[step] = told[at]
        for k in range(_parts_of(segment, linear, mesh, step)):
            errors[step] = told[at + k] if not told[at + k] <= errors[step] else errors[step]
        at += _parts_of(segment, linear, mesh, step)
    keep(block)


@cfunc(
    float64(INTEGERS, NUMBERS, INTEGERS, INTEGERS, NUMBERS, float64, NUMBERS, float64, float64, NUMBERS, NUMBERS),
    error_model="numpy",
)
def flow(functions, p, sizes, active, x0, duration, mesh, rtol, atol, y, errors):
    """Run a segment on its mesh and leave state and sensitivities in `y`, as the explicit `flow` does.

    sizes: (7,), mode, components, transition, whether the event's mean rate is integrated, active parameters, columns,
    steps.
    """
    mode, n, mean, count = sizes[0], sizes[1], sizes[3], sizes[6]
    segment = Segment(functions, mode, duration, p, n)
    sensitive = Sensitive(sizes[2], mean != 0, False, active, sizes[4], sizes[5])
    linear = _linear(functions, mode, n)
    if linear[0] > 0.0 and mean == 0:
        columns = sizes[5]
        for e in range(n * (1 + columns)):
            y[e] = 0.0
        for e in range(n):
            y[e] = x0[e]
            y[n + e * columns + e] = 1.0
        block = np.empty(room_for(n) + room_for_driven(n) + room_for_slopes(n, columns))
        partners = np.empty(n, np.int64)
        at = pointer(block, 0)
        frame, stages, varied = laid_out(at, _paired(linear, n, pointer(partners, 0)), n)
        more = pointer(block, room_for(n) + room_for_driven(n))
        tables = pointer(numbers_at(functions[LINEAR + 1]), mode * LEVELS * size_of(n))
        scratch = driven_in(pointer(block, room_for(n)), n), slopes_in(more, n, columns)
        parts = Parts(linear, tables, frame, stages, varied, scratch[0], scratch[1])
        plain_steps = _followed(segment, parts, sensitive, mesh, count, (rtol, atol), y, errors)
        keep(block)
        keep(partners)
        if plain_steps:
            return 0.0
    _by_runge_kutta(segment, sensitive, linear, x0, (mesh, count), (rtol, atol), y, errors)
    return 0.0


@cfunc(float64(*SYSTEM, float64, NUMBERS, NUMBERS, int64, NUMBERS, NUMBERS), error_model="numpy")
def dense(functions, mode, n, p, duration, x0, mesh, count, nodes, coefficients):
    """Run a segment's state on its mesh and keep dense output, NaN behind a step whose equations are not solved."""
    segment, linear = Segment(functions, mode, duration, p, n), _linear(functions, mode, n)
    if not linear[0] > 0.0:
        _explicit_dense(segment, x0, mesh, count, nodes, coefficients)
        return 0.0
    block, partners = np.empty(room_for(n)), np.empty(n, np.int64)
    frame, stages, _ = laid_out(pointer(block, 0), _paired(linear, n, pointer(partners, 0)), n)
    for e in range(n):
        nodes[e] = x0[e]
    for step in range(count):
        x, end, bends = pointer(nodes, step * n), pointer(nodes, (step + 1) * n), pointer(coefficients, step * 7 * n)
        clustered(duration, mesh[step], mesh[step + 1] - mesh[step], frame)
        set_frame(n, linear, frame, stages.frame)
        if taken(segment, linear, x, frame, stages, end, ENOUGH) == 0:
            for e in range((count - step) * n):
                end[e] = np.nan
            for e in range((count - step) * 7 * n):
                bends[e] = np.nan
            break
        for k in range(7):
            last = DENSE[k * (STAGES + 1) + STAGES]
            for e in range(n):
                total = last * (end[e] - x[e])
                for i in range(STAGES):
                    total += DENSE[k * (STAGES + 1) + i] * (stages.points[i * n + e] - x[e])
                bends[k * n + e] = total
    keep(block)
    keep(partners)
    return 0.0


@cfunc(float64(*SYSTEM, float64, float64, float64, NUMBERS, NUMBERS, float64, float64), error_model="numpy")
def check(functions, mode, n, p, duration, begin, h, node, curve, rtol, atol):
    """Return the defect of a step's dense output between its stages, over what is allowed; curve: (7 n,), from `node`.

    The size of a state that turns with its partner is that of their circle.
    """
    segment, linear, worst = Segment(functions, mode, duration, p, n), _linear(functions, mode, n), 0.0
    x = stack(float64, 3 * n)
    slope, field = pointer(x, n), pointer(x, 2 * n)
    for k in range(len(PROBES)):
        fraction = PROBES[k]
        dense_value(curve, int64(0), n, node, int64(0), fraction, x)
        dense_slope(curve, int64(0), n, fraction, slope)
        state_slope(segment, begin + fraction * h, x, field, int64(0))
        for e in range(n):
            size, partner = abs(x[e]), int(linear[HEAD + EACH * e])
            turning = linear[HEAD + EACH * e + 2] * linear[HEAD + EACH * partner + 2]
            if linear[0] > 0.0 and partner != e and turning < 0.0:
                size = math.sqrt(size * size - x[partner] * x[partner] * linear[HEAD + EACH * e + 2] ** 2 / turning)
            defect = abs(slope[e] - h * field[e]) / (MISSED * (atol + rtol * size))
            if not defect < math.inf:
                return math.inf
            worst = max(worst, defect)
    return worst
