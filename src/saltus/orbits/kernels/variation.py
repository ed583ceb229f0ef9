"""Compiled variations of an orbit by many parameters at once, and looks at them: docs/theory/sensitivities.md.

The variation of an orbit by a parameter is taken at fixed clustered time, the change of the durations included. All
orbits nearby then begin and end their segments in the same places, and integrals have fixed limits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from saltus.flow.kernels.segment import FIELD_P, VARY
from saltus.flow.kernels.stages import dense_coefficients, dense_value, stage
from saltus.flow.tableaux import NODES as C
from saltus.orbits.kernels.equation import pointed
from saltus.orbits.records import Mesh, Orbit
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, call, invoke, keep, outlined, pointer


class View(NamedTuple):
    """What quantities are seen with, on pointers.

    Attributes
    ----------
    field, readings : int
        Addresses of the field and of the generated expressions with their gradients.
    p, constants : pointer
        Parameters with the constants of either behind them.
    active : pointer to int64
        Of each variation the parameter by which it is taken, -1 for none: it changes the unknowns alone.
    n, columns, expressions, length : int
        Components of the full state, variations, expressions; components of a state with its variations.
    stride : int
        Components of an expression's gradient, in state and all parameters.
    y, f, out : pointer
        Scratch: a state with its variations, (length,); the field there, (n,); expressions, their gradients, corners.
    """

    field: int
    readings: int
    p: object
    constants: object
    active: object
    n: int
    columns: int
    expressions: int
    length: int
    stride: int
    y: object
    f: object
    out: object


class Curve(NamedTuple):
    """A segment's dense output with variations, on pointers: `count` steps from `first` on."""

    mode: int
    mesh: object
    count: int
    nodes: object
    coefficients: object


@njit(cache=True, error_model="numpy")
def vary(orbit, mesh, u, du, nodes, coefficients):
    """Follow all segments with their variations and keep dense output, flat.

    orbit, mesh: the fields of those records, the parameters those at `u`; `active` has of each variation the parameter,
    -1 for none, by which generated functions have no derivative. du: (m, active), changes of the unknowns. nodes: (node, n (1 + active)); coefficients: (node, 7 n (1 + active)).
    """
    orbit, mesh = Orbit(*orbit), Mesh(*mesh)
    system, n, columns = pointed(orbit), orbit.n, orbit.active.size
    length, start, change = n * (1 + columns), pointer(u, 0), pointer(du, 0)
    block = np.empty(17 * length + n)
    slopes, trial, forcing = pointer(block, 0), pointer(block, 16 * length), pointer(block, 17 * length)
    nodes, coefficients = pointer(nodes, 0), pointer(coefficients, 0)
    for i in range(system.segments):
        row, first = i * (n + 1), mesh.starts[i]
        y = pointer(nodes, first * length)
        for e in range(n):
            y[e] = start[row + e]
        for e in range(n * columns):
            y[n + e] = change[row * columns + e]
        for e in range(length):
            slopes[e] = 0.0  # time stands still at the segment's start
        longer = pointer(change, (row + n) * columns)
        if system.implicit[2] != 0:
            count, bends = mesh.starts[i + 1] - 1 - first, pointer(coefficients, first * 7 * length)
            path = longer, pointer(mesh.places, first), count, y, bends
            invoke(
                system.implicit[2],
                (system.functions, system.modes[i], n, system.p, start[row + n], system.active, columns, *path),
            )
            continue
        for step in range(first, mesh.starts[i + 1] - 1):
            s = mesh.places[step]
            h = mesh.places[step + 1] - s
            y, end = pointer(nodes, step * length), pointer(nodes, (step + 1) * length)
            for k in range(1, 16):
                stage(k, slopes, length, h, y, trial)
                _slopes(
                    system, system.modes[i], start[row + n], longer, s + C[k] * h, trial, forcing, slopes, k * length
                )
                if k == 12:
                    for e in range(length):
                        end[e] = trial[e]
            dense_coefficients(slopes, length, h, y, end, pointer(coefficients, step * 7 * length))
            for e in range(length):
                slopes[e] = slopes[12 * length + e]
    keep(block)


@njit(**INNER)
def _slopes(system, mode, duration, longer, s, y, forcing, slopes, at):
    """Write the derivatives of state and variations by clustered time at `at` in `slopes`."""
    outlined()
    n, columns, weight = system.n, system.n_active, 6.0 * s * (1.0 - s)
    out, rate = pointer(slopes, at), duration * weight
    call(system.functions[VARY], mode, columns, y, 0, system.p, out, 0)
    for k in range(columns):
        call(system.functions[FIELD_P], mode, system.active[k], y, 0, system.p, forcing, 0)
        for e in range(n):
            c = n + e * columns + k
            out[c] = rate * (out[c] + forcing[e]) + weight * longer[k] * out[e]
    for e in range(n):
        out[e] *= rate


class Path(NamedTuple):
    """All segments' dense output with variations, on pointers; see `saltus.orbits.records.Mesh` and `Dense`."""

    segments: int
    modes: object
    places: object
    starts: object
    nodes: object
    coefficients: object


@njit(**INNER)
def curve_of(path, i, length):
    """Return a segment's dense output."""
    outlined()
    first = path.starts[i]
    return Curve(
        path.modes[i], pointer(path.places, first), path.starts[i + 1] - first - 1,
        pointer(path.nodes, first * length), pointer(path.coefficients, first * 7 * length),
    )  # fmt: skip


@njit(**INNER)
def look(view, curve, step, fraction):
    """Leave the state at a fraction of a step, with its variations, in `view.y`, expressions with gradients in `view.out`."""
    outlined()
    length = view.length
    dense_value(curve.coefficients, step * 7 * length, length, curve.nodes, step * length, fraction, view.y)
    if view.expressions > 0:
        call(view.readings, curve.mode, 0, view.y, 0, view.constants, view.out, 0)


@njit(**INNER)
def value_of(view, what):
    """Return a quantity where `look` has looked."""
    return view.y[what] if what < view.n else view.out[what - view.n]


@njit(**INNER)
def differentiate(view, what, out):
    """Write the derivatives of a quantity along all variations at fixed clustered time, where `look` has looked."""
    outlined()
    n, columns = view.n, view.columns
    if what < n:
        varied = pointer(view.y, n + what * columns)
        for k in range(columns):
            out[k] = varied[k]
        return
    gradient = pointer(view.out, view.expressions + (what - n) * view.stride)
    for k in range(columns):
        out[k] = gradient[n + view.active[k]] if view.active[k] >= 0 else 0.0
    for e in range(n):
        by = gradient[e]
        if by != 0.0:
            varied = pointer(view.y, n + e * columns)
            for k in range(columns):
                out[k] += by * varied[k]


@njit(**INNER)
def rate_of(view, what):
    """Return the derivative of a quantity by time, where `look` has looked and `view.f` holds the field."""
    n = view.n
    if what < n:
        return view.f[what]
    gradient = pointer(view.out, view.expressions + (what - n) * view.stride)
    total = 0.0
    for e in range(n):
        if gradient[e] != 0.0:
            total += gradient[e] * view.f[e]
    return total
