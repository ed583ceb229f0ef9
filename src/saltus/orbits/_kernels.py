"""Compiled equations of a periodic orbit: residual, Jacobian, dense survey, small linear algebra."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from saltus.flow._kernels import call, dense_value
from saltus.flow._linear_kernels import solve
from saltus.flow._segment_kernels import FIELD, dense, flow, missed, redistribute

DERIVE, EVENT, EVENT_X, EVENT_P, RESET, RESET_X, RESET_P, OUTPUTS, GUARD = 0, 4, 5, 6, 7, 8, 9, 10, 11
EVENT_END, MEAN_END, PHASE_END, CLOSED_END = 0, 1, 2, 3
SHORT = 0.01  # share of the period below which a mean rate is integrated rather than taken from its ends


@njit(cache=True, error_model="numpy")
def set_parameters(functions, u, m, active, scales, p):
    """Take the active parameters from the unknowns behind the m of the orbit, and recompute the constants behind them."""
    for k in range(active.size):
        p[active[k]] = u[m + k] * scales[k]
    if active.size > 0:
        call(functions[DERIVE], 0, 0, p, 0, p, p, 0)


@njit(cache=True, error_model="numpy")
def equations(
    functions,
    modes,
    transitions,
    kinds,
    turns,
    n,
    u,
    p,
    active,
    scales,
    rtol,
    atol,
    mesh,
    mesh_at,
    anchor,
    F,
    J,
    errors,
):
    """Write the residual F, (m,), and the Jacobian J, (m, m + active), of all segment equations.

    u: each segment's state (n,) and duration, m = segments * (n + 1) in all. p: extended parameters. mesh_at: offsets of
    the segments' meshes, one more than segments. anchor: point and direction of the phase condition, (2 n,). Returns the
    largest error of a step, in tolerances.
    """
    segments, wide = modes.size, n + 1
    m, n_active = segments * wide, active.size
    set_parameters(functions, u, m, active, scales, p)
    worst = 0.0
    for i in range(m):
        for j in range(m + n_active):
            J[i, j] = 0.0
    total_time = 0.0
    for i in range(segments):
        total_time += abs(u[i * wide + n])
    y = np.empty((n + 1) * (n + n_active + 2))
    ends = np.empty(n)
    gx, gp, ev, f = np.empty(n * n), np.empty(n + 2), np.empty(2 + 2 * n), np.empty(n)
    for i in range(segments):
        row = i * wide
        following = row + wide if i + 1 < segments else 0
        kind, mode, transition, duration = kinds[i], modes[i], transitions[i], u[row + n]
        mean = kind == MEAN_END and abs(duration) < SHORT * total_time
        columns = n + n_active + (1 if mean else 0)
        count = mesh_at[i + 1] - mesh_at[i] - 1
        flow(
            functions, mode, transition, mean, u, row, duration, p, active, rtol, atol,
            mesh, mesh_at[i], count, n, y, errors,
        )  # fmt: skip
        for step in range(mesh_at[i], mesh_at[i] + count):
            worst = max(worst, errors[step])
        call(functions[FIELD], mode, 0, y, 0, p, f, 0)
        if transition >= 0:
            call(functions[RESET], transition, 0, y, 0, p, ends, 0)
            call(functions[RESET_X], transition, 0, y, 0, p, gx, 0)
        else:
            for a in range(n):
                ends[a] = y[a]
                for b in range(n):
                    gx[a * n + b] = 1.0 if a == b else 0.0
        for a in range(n):
            F[row + a] = ends[a] - u[following + a]
            for c in range(n + n_active):
                total = 0.0
                for b in range(n):
                    total += gx[a * n + b] * y[n + b * columns + c]
                J[row + a, row + c if c < n else m + c - n] += total
            total = 0.0
            for b in range(n):
                total += gx[a * n + b] * (y[n + b * columns + columns - 1] if mean else f[b])
            J[row + a, row + n] += total
            J[row + a, following + a] -= 1.0
        if transition >= 0:
            for k in range(n_active):
                call(functions[RESET_P], transition, active[k], y, 0, p, gp, 0)
                for a in range(n):
                    J[row + a, m + k] += gp[a]
        if following == 0 and turns > 0:
            F[row + n - 1] -= 2.0 * math.pi * turns
        last = row + n
        if kind == EVENT_END:
            call(functions[EVENT_X], transition, 0, y, 0, p, ev, 0)
            F[last] = ev[0]
            for c in range(n + n_active):
                total = 0.0
                for b in range(n):
                    total += ev[2 + b] * y[n + b * columns + c]
                J[last, row + c if c < n else m + c - n] += total
            J[last, row + n] += ev[1]
            for k in range(n_active):
                call(functions[EVENT_P], transition, active[k], y, 0, p, gp, 0)
                J[last, m + k] += gp[0]
        elif kind == MEAN_END and not mean:
            # the same mean, (h(end) - h(start)) / duration, where nothing cancels
            call(functions[EVENT_X], transition, 0, y, 0, p, ev, 0)
            height = ev[0]
            for c in range(n + n_active):
                total = 0.0
                for b in range(n):
                    total += ev[2 + b] * y[n + b * columns + c]
                J[last, row + c if c < n else m + c - n] += total / duration
            J[last, row + n] += ev[1] / duration
            for k in range(n_active):
                call(functions[EVENT_P], transition, active[k], y, 0, p, gp, 0)
                J[last, m + k] += gp[0] / duration
            call(functions[EVENT_X], transition, 0, u, row, p, ev, 0)
            F[last] = (height - ev[0]) / duration
            J[last, row + n] -= F[last] / duration
            for b in range(n):
                J[last, row + b] -= ev[2 + b] / duration
            for k in range(n_active):
                call(functions[EVENT_P], transition, active[k], u, row, p, gp, 0)
                J[last, m + k] -= gp[0] / duration
        elif mean:
            at = n * (1 + columns)
            F[last] = y[at]
            for c in range(n + n_active):
                J[last, row + c if c < n else m + c - n] += y[at + 1 + c]
            J[last, row + n] += y[at + columns]
        elif kind == PHASE_END:
            F[last] = u[row + n - 1]
            J[last, row + n - 1] += 1.0
        else:
            F[last] = 0.0
            for a in range(n):
                F[last] += anchor[n + a] * (u[row + a] - anchor[a])
                J[last, row + a] += anchor[n + a]
    for k in range(n_active):
        for i in range(m):
            J[i, m + k] *= scales[k]
    return worst


@njit(cache=True, error_model="numpy")
def pencil(J, kinds, n, vector, P, R):
    """Write the (n, n) pencil P v = mu R v of the linearised return map at the first segment's start.

    Durations are eliminated by reflections and segments joined by orthogonal null spaces, so nothing is divided by the
    normal velocity: where it vanishes (grazing) R is singular and a multiplier infinite. Unless the segment closes without
    an event, the flow `vector` is an eigenvector (of multiplier 0, since the event waits for it), and the quotient by it
    is left in P[1:, 1:] and R[1:, 1:]; it is first improved to the eigenvector of the discrete equations.
    """
    segments, wide = kinds.size, n + 1
    for a in range(n):
        for b in range(n):
            P[a, b] = 0.0
            R[a, b] = 0.0
    for i in range(segments):
        row = i * wide
        left, right = np.zeros((wide, n)), np.zeros((wide, n))
        tau = np.empty(wide)
        for a in range(wide):
            tau[a] = J[row + a, row + n]
            for b in range(n):
                left[a, b] = J[row + a, row + b]
                if segments == 1 and a == b:
                    left[a, b] += 1.0
        for a in range(n):
            right[a, a] = 1.0
        if kinds[i] == PHASE_END or kinds[i] == CLOSED_END:
            for a in range(n):
                for b in range(n):
                    P[a, b] = left[a, b]
                    R[a, b] = right[a, b]
            return
        _reflect(tau, left, right)
        here_left, here_right = left[1:], right[1:]
        if i == 0:
            for a in range(n):
                for b in range(n):
                    P[a, b] = here_left[a, b]
                    R[a, b] = here_right[a, b]
        else:
            _join(P, R, here_left, here_right)
    matrix, v = P.copy(), np.empty((n, 1))
    for a in range(n):
        v[a, 0] = 0.0
        for b in range(n):
            v[a, 0] += R[a, b] * vector[b]
    sign, _ = solve(matrix, v)
    size = 0.0
    for a in range(n):
        size = max(size, abs(v[a, 0]))
    better = vector.copy()
    if sign != 0.0 and 0.0 < size < 1e300:
        for a in range(n):
            better[a] = v[a, 0] / size
    _quotient(P, R, better)


@njit(cache=True, error_model="numpy")
def _quotient(P, R, vector):
    """Turn a pencil so that its rows and columns behind the first are the quotient by an eigenvector."""
    n = vector.size
    left, right = np.empty((n, n)), np.empty((n, n))
    for a in range(n):
        for b in range(n):
            left[a, b] = P[b, a]
            right[a, b] = R[b, a]
    _reflect(vector, left, right)
    image = np.empty(n)
    size = 0.0
    for a in range(n):
        for b in range(n):
            P[a, b] = left[b, a]
            R[a, b] = right[b, a]
        image[a] = R[a, 0]
        size = max(size, abs(image[a]))
    if size == 0.0:
        for a in range(n):
            image[a] = P[a, 0]
    _reflect(image, P, R)


@njit(cache=True, error_model="numpy")
def pair(P, R, at, values):
    """Write the two generalised eigenvalues of the 2 x 2 pencil that begins at (at, at); infinite ones as inf."""
    p00, p01, p10, p11 = P[at, at], P[at, at + 1], P[at + 1, at], P[at + 1, at + 1]
    r00, r01, r10, r11 = R[at, at], R[at, at + 1], R[at + 1, at], R[at + 1, at + 1]
    a, c = r00 * r11 - r01 * r10, p00 * p11 - p01 * p10
    b = -(p00 * r11 + p11 * r00 - p01 * r10 - p10 * r01)
    half = 0.5 * b
    discriminant = half * half - a * c
    if discriminant < 0.0:
        values[0] = complex(-half / a, math.sqrt(-discriminant) / a)
        values[1] = values[0].conjugate()
        return
    q = -(half + math.copysign(math.sqrt(discriminant), half))
    values[0] = complex(q / a, 0.0) if a != 0.0 else complex(np.inf, 0.0)
    values[1] = complex(c / q, 0.0) if q != 0.0 else complex(0.0, 0.0)
    if abs(values[1]) > abs(values[0]):
        values[0], values[1] = values[1], values[0]


@njit(cache=True, error_model="numpy")
def doubling(J, n):
    """Return sign and log of |det(A + B)|, A - B = J with B the closing equations' derivative in the next period's start."""
    m = J.shape[0]
    matrix = J[:, :m].copy()
    last = m - n - 1
    for a in range(n):
        matrix[last + a, a] += 2.0
    return solve(matrix, np.zeros((m, 1)))


@njit(cache=True, error_model="numpy")
def metric(u, segments, n, block, out):
    """Write the weights of the arclength: the trapezoidal rule over the period for each segment's start, 1 for parameters."""
    wide = n + 1
    total = 0.0
    for i in range(segments):
        total += abs(u[i * wide + n])
    for i in range(out.size):
        out[i] = 1.0
    for i in range(segments):
        share = 0.5 * (abs(u[i * wide + n]) + abs(u[(i * wide if i else segments * wide) - 1])) / total
        for a in range(wide):
            out[i * wide + a] = share * block[a]


@njit(cache=True, error_model="numpy")
def _reflect(tau, left, right):
    """Apply to both matrices the reflection that turns `tau` onto its first component."""
    size = tau.size
    norm = 0.0
    for a in range(size):
        norm += tau[a] * tau[a]
    norm = math.sqrt(norm)
    if norm == 0.0:
        return
    v = tau.copy()
    v[0] += norm if tau[0] >= 0.0 else -norm
    square = 0.0
    for a in range(size):
        square += v[a] * v[a]
    for b in range(left.shape[1]):
        one = two = 0.0
        for a in range(size):
            one += v[a] * left[a, b]
            two += v[a] * right[a, b]
        one *= 2.0 / square
        two *= 2.0 / square
        for a in range(size):
            left[a, b] -= one * v[a]
            right[a, b] -= two * v[a]


@njit(cache=True, error_model="numpy")
def _join(P, R, left, right):
    """Eliminate the middle state from P x0 = R x1 and left x1 = right x2, leaving P x0 = R x2 in place.

    The rows (R; left) are turned by reflections until only n of them are non-zero; the other n give the new pencil.
    """
    n = P.shape[0]
    stack = np.zeros((2 * n, 3 * n))
    for a in range(n):
        for b in range(n):
            stack[a, b] = -R[a, b]
            stack[n + a, b] = left[a, b]
            stack[a, n + b] = P[a, b]
            stack[n + a, 2 * n + b] = right[a, b]
    for c in range(n):
        norm = 0.0
        for a in range(c, 2 * n):
            norm += stack[a, c] * stack[a, c]
        norm = math.sqrt(norm)
        if norm == 0.0:
            continue
        v = np.zeros(2 * n)
        for a in range(c, 2 * n):
            v[a] = stack[a, c]
        v[c] += norm if v[c] >= 0.0 else -norm
        square = 0.0
        for a in range(c, 2 * n):
            square += v[a] * v[a]
        for b in range(c, 3 * n):
            total = 0.0
            for a in range(c, 2 * n):
                total += v[a] * stack[a, b]
            total *= 2.0 / square
            for a in range(c, 2 * n):
                stack[a, b] -= total * v[a]
    for a in range(n):
        for b in range(n):
            P[a, b] = stack[n + a, n + b]
            R[a, b] = stack[n + a, 2 * n + b]


@njit(cache=True, error_model="numpy")
def sample(
    functions, mode, what, sign, dense_at, mesh, first, count, n, n_outputs, nodes, nodes_at, coefficients, s, p, x, out
):
    """Return a quantity at clustered time `s` of a segment, its state left in `x`.

    what: a state (below n), an output (below n + n_outputs) or, behind these, the event function of a transition; times `sign`.
    """
    low, high = 0, count - 1
    while low < high:
        middle = (low + high + 1) // 2
        if mesh[first + middle] <= s:
            low = middle
        else:
            high = middle - 1
    a, b = mesh[first + low], mesh[first + low + 1]
    dense_value(coefficients, dense_at + low * 7 * n, n, nodes, nodes_at + low * n, (s - a) / (b - a), x)
    if what < n:
        return sign * x[what]
    if what < n + n_outputs:
        call(functions[OUTPUTS], mode, 0, x, 0, p, out, 0)
        return sign * out[what - n]
    call(functions[EVENT], what - n - n_outputs, 0, x, 0, p, out, 0)
    return sign * out[0]


@njit(cache=True, error_model="numpy")
def lowest(
    functions,
    mode,
    what,
    sign,
    dense_at,
    mesh,
    first,
    count,
    n,
    n_outputs,
    nodes,
    nodes_at,
    coefficients,
    a,
    m,
    b,
    fa,
    fm,
    fb,
    p,
    x,
    out,
):
    """Return the place and value of the least value of a quantity in (a, b), bracketed at m, by parabolas and sections."""  # fmt: skip
    for step in range(60):
        if b - a < 1e-7 or not fm <= min(fa, fb):
            break
        r, q = (m - a) * (fm - fb), (m - b) * (fm - fa)
        bottom = 2.0 * (r - q)
        t = m - ((m - a) * r - (m - b) * q) / bottom if bottom != 0.0 else m
        margin = 0.02 * min(m - a, b - m)
        if step % 3 == 2 or not (a + margin < t < b - margin) or abs(t - m) < 1e-10:
            t = m + 0.3 * (b - m) if b - m > m - a else m - 0.3 * (m - a)
        ft = sample(
            functions,
            mode,
            what,
            sign,
            dense_at,
            mesh,
            first,
            count,
            n,
            n_outputs,
            nodes,
            nodes_at,
            coefficients,
            t,
            p,
            x,
            out,
        )
        if ft < fm:
            if t < m:
                b, fb = m, fm
            else:
                a, fa = m, fm
            m, fm = t, ft
        elif t < m:
            a, fa = t, ft
        else:
            b, fb = t, ft
    if fa < fm:
        return a, fa
    if fb < fm:
        return b, fb
    return m, fm


@njit(cache=True, error_model="numpy")
def _at_phase(
    functions,
    mode,
    dense_at,
    mesh,
    first,
    count,
    n,
    n_outputs,
    nodes,
    nodes_at,
    coefficients,
    p,
    low,
    high,
    target,
    at_zero,
    out,
):
    """Write the state of a segment at which its phase, between two clustered times, is `target`; its phase is set to 0."""  # fmt: skip
    start = low
    f_low = sample(
        functions, mode, n - 1, 1.0, dense_at, mesh, first, count, n, n_outputs, nodes, nodes_at, coefficients, low, p, at_zero, out,
    ) - target  # fmt: skip
    f_high = sample(
        functions, mode, n - 1, 1.0, dense_at, mesh, first, count, n, n_outputs, nodes, nodes_at, coefficients, high, p, at_zero, out,
    ) - target  # fmt: skip
    for _ in range(60):
        if abs(f_high) < 1e-14 or high - low < 1e-16:
            break
        middle = high - f_high * (high - start) / (f_high - f_low) if f_high != f_low else 0.5 * (low + high)
        if not low < middle < high:
            middle = 0.5 * (low + high)
        f = sample(
            functions, mode, n - 1, 1.0, dense_at, mesh, first, count, n, n_outputs, nodes, nodes_at, coefficients, middle, p, at_zero, out,
        ) - target  # fmt: skip
        if f >= 0.0:
            start, f_low = high, f_high
            high, f_high = middle, f
        else:
            low = middle
            start, f_low = middle, f
    sample(
        functions, mode, n - 1, 1.0, dense_at, mesh, first, count, n, n_outputs, nodes, nodes_at, coefficients, high, p, at_zero, out,
    )  # fmt: skip
    at_zero[n - 1] = 0.0


FINE = 3
DURATION, DIRECTION, EARLY, WHEN, DOMAIN, VALUE, COARSE = 1, 2, 4, 8, 16, 32, 64


@njit(cache=True, error_model="numpy")
def survey(
    functions,
    modes,
    transitions,
    kinds,
    turns,
    sources,
    directions,
    n,
    n_modes,
    n_outputs,
    has_phase,
    u,
    p,
    rtol,
    atol,
    mesh,
    mesh_at,
    nodes,
    coefficients,
    lows,
    highs,
    margins,
    places,
    rates,
    at_zero,
):
    """Follow an orbit densely: extremes of every state and output, margins to other events, normal velocities, state at phase 0.

    lows, highs: (n + n_outputs,). margins, places: (segments, transitions): the least interior local minimum of each event
    function in its firing direction (inf where there is none), and where in clustered time. rates: (segments, 3): Lie
    derivative of each segment's event at its end and at its start; in rates[:, 2] how far the segment's end is from the next
    one's start, or from its event. Returns the bits of what makes the orbit inadmissible, and
    COARSE where a step passed over something.
    """  # fmt: skip
    segments, wide, n_transitions = modes.size, n + 1, sources.size
    bad = 0
    x, out, one = np.empty(n), np.empty(max(n_outputs, 2)), np.empty(2)
    probe, field, slope = np.empty(n), np.empty(n), np.empty(2 + 2 * n)
    for q in range(n + n_outputs):
        lows[q] = np.inf
        highs[q] = -np.inf
    best = np.zeros((2, n + n_outputs, 2))
    found_zero = False
    target = 0.0
    if has_phase:
        target = 2.0 * math.pi * math.ceil(u[n - 1] / (2.0 * math.pi) - 1e-13)
    for i in range(segments):
        mode, transition, row = modes[i], transitions[i], i * wide
        duration = u[row + n]
        count = mesh_at[i + 1] - mesh_at[i] - 1
        first = mesh_at[i]
        nodes_at, dense_at = first * n, first * 7 * n
        dense(functions, mode, u, row, duration, p, mesh, first, count, n, nodes, nodes_at, coefficients, dense_at)
        if (not duration > 0.0 and kinds[i] != MEAN_END) or duration < 0.0:
            bad |= DURATION
        for step in range(count):
            a = mesh[first + step]
            if missed(
                functions, mode, duration, a, mesh[first + step + 1] - a, p, coefficients, dense_at + step * 7 * n,
                nodes, nodes_at + step * n, n, x, probe, field, rtol, atol,
            ):  # fmt: skip
                bad |= COARSE
                break
        end = nodes_at + count * n
        following = row + wide if i + 1 < segments else 0
        for e in range(n):
            x[e] = nodes[end + e]
        if transition >= 0:
            call(functions[RESET], transition, 0, nodes, end, p, x, 0)
        gap = 0.0
        for e in range(n):
            turn = 2.0 * math.pi * turns if following == 0 and e == n - 1 else 0.0
            gap = max(gap, abs(x[e] - u[following + e] - turn))
        rates[i, 2] = gap
        if transition >= 0:
            call(functions[EVENT], transition, 0, nodes, end, p, one, 0)
            rates[i, 0] = one[1]
            rates[i, 2] = max(gap, abs(one[0]))
            call(functions[EVENT_X], transition, 0, nodes, end, p, slope, 0)
            call(functions[FIELD], mode, 0, nodes, end, p, field, 0)
            speed = 0.0
            for e in range(n):
                speed += abs(slope[2 + e] * field[e])
            if directions[transition] * one[1] < -1e-9 * speed:
                bad |= DIRECTION
            call(functions[GUARD], n_modes + transition, 0, nodes, end, p, one, 0)
            if not one[0] > 0.0:
                bad |= WHEN
            call(functions[EVENT], transition, 0, nodes, nodes_at, p, one, 0)
            rates[i, 1] = one[1]
        total = count * FINE
        heights = np.empty((n_transitions, total + 1))
        for j in range(total + 1):
            step = min(j // FINE, count - 1)
            if j % FINE == 0:
                for e in range(n):
                    x[e] = nodes[nodes_at + (j // FINE) * n + e]
            else:
                part = (j - step * FINE) / FINE
                dense_value(coefficients, dense_at + step * 7 * n, n, nodes, nodes_at + step * n, part, x)
            for e in range(n):
                if not abs(x[e]) < 1e300:
                    bad |= VALUE
            call(functions[GUARD], mode, 0, x, 0, p, one, 0)
            if not one[0] > 0.0:
                bad |= DOMAIN
            if n_outputs > 0:
                call(functions[OUTPUTS], mode, 0, x, 0, p, out, 0)
            for q in range(n + n_outputs):
                value = x[q] if q < n else out[q - n]
                if value < lows[q]:
                    lows[q] = value
                    best[0, q, 0], best[0, q, 1] = i, j
                if value > highs[q]:
                    highs[q] = value
                    best[1, q, 0], best[1, q, 1] = i, j
            for k in range(n_transitions):
                if sources[k] == mode:
                    call(functions[EVENT], k, 0, x, 0, p, one, 0)
                    heights[k, j] = -one[0] if directions[k] > 0 else one[0]
            if has_phase and not found_zero and x[n - 1] >= target - 1e-13:
                found_zero = True
                _at_phase(
                    functions, mode, dense_at, mesh, first, count, n, n_outputs, nodes, nodes_at, coefficients, p,
                    _fine(mesh, first, count, max(j - 1, 0)), _fine(mesh, first, count, j), target, at_zero, out,
                )  # fmt: skip
        for k in range(n_transitions):
            margins[i, k] = np.inf
            places[i, k] = 0.5
            if sources[k] != mode:
                continue
            height = heights[k]
            sign = -1.0 if directions[k] > 0 else 1.0
            if directions[k] == 0 and height[1] < 0.0:
                sign = -1.0
                for j in range(total + 1):
                    height[j] = -height[j]
            size = 0.0
            for j in range(total + 1):
                size = max(size, abs(height[j]))
            small = 1e-9 * (1e-3 + size)
            armed = False
            for j in range(total + 1):
                if (
                    2 <= j
                    and height[j - 1] < height[j - 2]
                    and height[j - 1] <= height[j]
                    and (armed or height[j - 2] > small)
                ):
                    place, least = lowest(
                        functions, mode, n + n_outputs + k, sign, dense_at, mesh, first, count, n, n_outputs, nodes,
                        nodes_at, coefficients, _fine(mesh, first, count, j - 2), _fine(mesh, first, count, j - 1),
                        _fine(mesh, first, count, j), height[j - 2], height[j - 1], height[j], p, x, out,
                    )  # fmt: skip
                    call(functions[GUARD], n_modes + k, 0, x, 0, p, one, 0)
                    if one[0] > 0.0 and least < margins[i, k]:
                        margins[i, k] = least
                        places[i, k] = place
                        if least < -small:
                            bad |= EARLY
                starts = j == 1 and abs(height[0]) <= small and duration > 0.0
                if 0 < j < total and height[j] < -small and (armed or starts):
                    sample(
                        functions, mode, 0, 1.0, dense_at, mesh, first, count, n, n_outputs, nodes, nodes_at,
                        coefficients, _fine(mesh, first, count, j), p, x, out,
                    )  # fmt: skip
                    call(functions[GUARD], n_modes + k, 0, x, 0, p, one, 0)
                    if one[0] > 0.0:
                        bad |= EARLY
                    armed = False
                if j == total and k != transition and armed and height[j] < -small:
                    bad |= EARLY
                if height[j] > small:
                    armed = True
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        for q in range(n + n_outputs):
            i, j = int(best[side, q, 0]), int(best[side, q, 1])
            count = mesh_at[i + 1] - mesh_at[i] - 1
            first, total = mesh_at[i], count * FINE
            if j == 0 or j == total:
                continue
            a, m, b = _fine(mesh, first, count, j - 1), _fine(mesh, first, count, j), _fine(mesh, first, count, j + 1)
            fa = sample(
                functions, modes[i], q, sign, first * 7 * n, mesh, first, count, n, n_outputs, nodes, first * n,
                coefficients, a, p, x, out,
            )  # fmt: skip
            fb = sample(
                functions, modes[i], q, sign, first * 7 * n, mesh, first, count, n, n_outputs, nodes, first * n,
                coefficients, b, p, x, out,
            )  # fmt: skip
            place, least = lowest(
                functions, modes[i], q, sign, first * 7 * n, mesh, first, count, n, n_outputs, nodes, first * n,
                coefficients, a, m, b, fa, sign * (lows[q] if side == 0 else highs[q]), fb, p, x, out,
            )  # fmt: skip
            if side == 0:
                lows[q] = min(lows[q], least)
            else:
                highs[q] = max(highs[q], -least)
    if not has_phase or not found_zero:
        for e in range(n):
            at_zero[e] = u[e]
    return bad


@njit(cache=True, error_model="numpy")
def _fine(mesh, first, count, j):
    """Clustered time of the j-th fine sample of a segment."""
    step = min(j // FINE, count - 1)
    a, b = mesh[first + step], mesh[first + step + 1]
    return a + (b - a) * (j - step * FINE) / FINE


FINEST, COARSEST, AIM = 5.0, 5e-3, 0.2


@njit(cache=True, error_model="numpy")
def remesh(mesh, mesh_at, errors, limit):
    """Return whether the mesh is fine enough, a new flat mesh and the segments' counts; no counts where it may stay.

    It may where the largest error is below `limit` and no segment is much finer than need be.
    """
    segments = mesh_at.size - 1
    worst = 0.0
    stay = True
    for i in range(segments):
        top = 0.0
        for j in range(mesh_at[i], mesh_at[i + 1] - 1):
            top = max(top, errors[j])
        worst = max(worst, top)
        if top > limit or (top < COARSEST and mesh_at[i + 1] - mesh_at[i] > 6):
            stay = False
    counts = np.zeros(0 if stay else segments, np.int64)
    fresh = np.empty(0 if stay else 3 * mesh.size + 8 * segments)
    if stay:
        return True, fresh, counts
    at = 0
    for i in range(segments):
        count = mesh_at[i + 1] - mesh_at[i] - 1
        room = np.empty(3 * count + 8)
        counts[i] = redistribute(
            mesh[mesh_at[i] : mesh_at[i + 1]], count, errors[mesh_at[i] : mesh_at[i + 1]], AIM, room
        )  # fmt: skip
        for j in range(counts[i] + 1):
            fresh[at + j] = room[j]
        at += counts[i] + 1
    return worst <= FINEST, fresh, counts
