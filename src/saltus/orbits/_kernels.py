"""Compiled equations of a periodic orbit: residual, Jacobian, dense survey, small linear algebra."""

from __future__ import annotations

import math

import numpy as np
from numba import int64

from saltus.flow._event_kernels import AT_WRAP
from saltus.flow._kernels import INNER, call, dense_value, keep, outlined, pointer
from saltus.flow._linear_kernels import solve_flat
from saltus.flow._segment_kernels import FIELD, dense, flow, missed, redistribute
from saltus.orbits.signature import (
    BEYOND,
    BOUNDARY,
    CLOSED_END,
    COARSE,
    CUT_END,
    DIRECTION,
    DOMAIN,
    DURATION,
    EARLY,
    EVENT_END,
    MEAN_END,
    PHASE_END,
    SECTION,
    TOUCH_END,
    VALUE,
    WHEN,
    WHOLE,
)
from saltus.system.compiled import FUNCTIONS
from saltus.system.machine_code import njit

DERIVE, VARY, EVENT, EVENT_X, EVENT_P, RESET, RESET_X, RESET_P, OUTPUTS, GUARD = (
    FUNCTIONS.index(name)
    for name in ("derive", "vary", "event", "event_x", "event_p", "reset", "reset_x", "reset_p", "outputs", "guard")
)
FINE = 3  # samples of a step in the survey
PEAK = 0.02  # share of a quantity's range by which a sampled extreme may miss the true one
FINEST, COARSEST, AIM = 5.0, 5e-3, 0.2  # errors of a step, in tolerances: most, least, aimed at
LEVEL = 1e-8  # share of an event function's variation within which a segment is as a whole equally far from its surface
ZERO = 1e-13  # share of an event function's variation below which it is rounding
BRIEF = 1e-4  # share of the period below which a segment is too short to tell that of it
SHORT = 0.01  # share of the period below which a mean rate is integrated rather than taken from its ends


@njit(cache=True, error_model="numpy")
def set_parameters(functions, u, m, active, scales, p):
    """Take the active parameters from the unknowns behind the m of the orbit, and recompute the constants behind them."""
    for k in range(active.size):
        p[active[k]] = u[m + k] * scales[k]
    if active.size > 0:
        call(functions[DERIVE], 0, 0, p, 0, p, p, 0)


@njit(cache=True, error_model="numpy")
def largest_terms(functions, modes, u, n, p, terms):
    """Write the largest size of each term J_ij x_j of the states' rates at the segments' starts in `terms`, (n, n)."""
    block = np.empty(2 * n * (n + 1))
    functions, frame, out = pointer(functions, 0), pointer(block, 0), pointer(block, n * (n + 1))
    u, p, terms = pointer(u, 0), pointer(p, 0), pointer(terms, 0)
    for e in range(n * n):
        terms[e] = 0.0
        frame[n + e] = 1.0 if e % (n + 1) == 0 else 0.0
    for i in range(modes.size):
        for e in range(n):
            frame[e] = u[i * (n + 1) + e]
        call(functions[VARY], modes[i], n, frame, 0, p, out, 0)
        for e in range(n * n):
            size = abs(out[n + e] * frame[e % n])
            if terms[e] < size < np.inf:
                terms[e] = size
    keep(block)


@njit(cache=True, error_model="numpy")
def equations(
    functions,
    modes,
    transitions,
    kinds,
    rooted,
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
    shares,
    F,
    J,
    errors,
):
    """Write the residual F, (m,), and the Jacobian J, (m, m + active), of all segment equations.

    u: each segment's state (n,) and duration, m = segments * (n + 1) in all. p: extended parameters. mesh_at: offsets of
    the segments' meshes, one more than segments. rooted: whether the modes' fields have roots that vanish on a surface. anchor: point and direction of the phase condition, (2 n,). shares: each
    segment's part of the period, kept at cuts. Returns the largest error of a step, in tolerances.
    """
    segments, wide, n_active = modes.size, n + 1, active.size
    m = segments * wide
    set_parameters(functions, u, m, active, scales, p)
    worst = 0.0
    rooted = pointer(rooted, 0)
    wanted, F, entries, anchor = pointer(active, 0), pointer(F, 0), pointer(J, 0), pointer(anchor, 0)
    shares = pointer(shares, 0)
    for i in range(m * (m + n_active)):
        entries[i] = 0.0
    total_time = 0.0
    for i in range(segments):
        total_time += abs(u[i * wide + n])
    y = np.empty((n + 1) * (n + n_active + 2))
    block = np.empty(n * n + 5 * n + 4)
    ends, f, gp, ev = pointer(block, 0), pointer(block, n), pointer(block, 2 * n), pointer(block, 3 * n + 2)
    gx = pointer(block, 5 * n + 4)
    start, end = pointer(u, 0), pointer(y, 0)
    for i in range(segments):
        row = i * wide
        following = row + wide if i + 1 < segments else 0
        kind, mode, transition, duration = kinds[i], modes[i], transitions[i], start[row + n]
        mean = kind == MEAN_END and abs(duration) < SHORT * total_time
        columns = n + n_active + (1 if mean else 0)
        count = mesh_at[i + 1] - mesh_at[i] - 1
        flow(
            functions, mode, transition, mean, rooted[mode], u, row, duration, p, active, rtol, atol,
            mesh, mesh_at[i], count, n, y, errors,
        )  # fmt: skip
        for step in range(mesh_at[i], mesh_at[i] + count):
            worst = max(worst, errors[step])
        call(functions[FIELD], mode, 0, end, 0, p, f, 0)
        lands = transition >= 0 and kind != TOUCH_END
        if lands:
            call(functions[RESET], transition, 0, end, 0, p, ends, 0)
            call(functions[RESET_X], transition, 0, end, 0, p, gx, 0)
        else:
            for a in range(n):
                ends[a] = end[a]
                for b in range(n):
                    gx[a * n + b] = 1.0 if a == b else 0.0
        at = row * (m + n_active)
        for a in range(n):
            line = pointer(entries, at + a * (m + n_active))
            F[row + a] = ends[a] - start[following + a]
            gradient = pointer(gx, a * n)
            _chain(line, row, m, n, n + n_active, columns, end, gradient, 1.0)
            total = 0.0
            for b in range(n):
                total += gradient[b] * (end[n + b * columns + columns - 1] if mean else f[b])
            line[row + n] += total
            line[following + a] -= 1.0
        if lands:
            for k in range(n_active):
                call(functions[RESET_P], transition, wanted[k], end, 0, p, gp, 0)
                for a in range(n):
                    entries[at + a * (m + n_active) + m + k] += gp[a]
        if following == 0 and turns > 0:
            F[row + n - 1] -= 2.0 * math.pi * turns
        last = row + n
        line = pointer(entries, last * (m + n_active))
        if mean:
            rates = pointer(end, n * (1 + columns))
            F[last] = rates[0]
            for c in range(n + n_active):
                line[row + c if c < n else m + c - n] += rates[1 + c]
            line[row + n] += rates[columns]
        elif kind == EVENT_END or kind == MEAN_END or kind == TOUCH_END:
            # the mean rate, where nothing cancels, is (h(end) - h(start)) / duration
            per = duration if kind == MEAN_END else 1.0
            call(functions[EVENT_X], transition, 0, end, 0, p, ev, 0)
            height = ev[0]
            _chain(line, row, m, n, n + n_active, columns, end, pointer(ev, 2), per)
            line[row + n] += ev[1] / per
            for k in range(n_active):
                call(functions[EVENT_P], transition, wanted[k], end, 0, p, gp, 0)
                line[m + k] += gp[0] / per
            if kind == MEAN_END:
                call(functions[EVENT_X], transition, 0, start, row, p, ev, 0)
                height = (height - ev[0]) / duration
                line[row + n] -= height / duration
                for b in range(n):
                    line[row + b] -= ev[2 + b] / duration
                for k in range(n_active):
                    call(functions[EVENT_P], transition, wanted[k], start, row, p, gp, 0)
                    line[m + k] -= gp[0] / duration
            F[last] = height
        elif kind == PHASE_END:
            F[last] = start[row + n - 1]
            line[row + n - 1] += 1.0
        elif kind == CUT_END:
            F[last] = shares[i - 1] * duration - shares[i] * start[row - 1]
            line[row + n] += shares[i - 1]
            line[row - 1] -= shares[i]
        else:
            F[last] = 0.0
            for a in range(n):
                F[last] += anchor[n + a] * (start[row + a] - anchor[a])
                line[row + a] += anchor[n + a]
    for k in range(n_active):
        for i in range(m):
            entries[i * (m + n_active) + m + k] *= scales[k]
    keep(y)
    keep(block)
    return worst


@njit(cache=True, error_model="numpy")
def rate(functions, modes, transitions, rooted, segment, n, u, p, active, scales, mesh, mesh_at, gradient, errors):
    """Return the Lie derivative of a segment's event function at its end; its gradient, (m + active,), is written."""
    n_active, row = active.size, segment * (n + 1)
    m, columns = modes.size * (n + 1), n + n_active
    mode, transition, duration = modes[segment], transitions[segment], u[row + n]
    y, block = np.empty(n * (1 + columns)), np.empty(4 * n + 4)
    count = mesh_at[segment + 1] - mesh_at[segment] - 1
    flow(
        functions, mode, transition, False, rooted[mode], u, row, duration, p, active, 0.0, 1.0, mesh, mesh_at[segment], count, n, y,
        errors,
    )  # fmt: skip
    end, line, wanted = pointer(y, 0), pointer(gradient, 0), pointer(active, 0)
    ev, f = pointer(block, 0), pointer(block, 2 * n + 2)
    call(functions[EVENT_X], transition, 0, end, 0, p, ev, 0)
    call(functions[FIELD], mode, 0, end, 0, p, f, 0)
    value = ev[1]
    _chain(line, row, m, n, columns, columns, end, pointer(ev, 2 + n), 1.0)
    for b in range(n):
        line[row + n] += ev[2 + n + b] * f[b]
    for k in range(n_active):
        call(functions[EVENT_P], transition, wanted[k], end, 0, p, f, 0)
        line[m + k] = (line[m + k] + f[1]) * scales[k]
    keep(y)
    keep(block)
    return value


@njit(**INNER)
def _chain(line, row, m, n, kept, columns, y, gradient, per):
    """Add to a row of the Jacobian the derivatives, over `per`, of a function with that gradient at a segment's end."""
    outlined()
    for c in range(kept):
        total = 0.0
        for b in range(n):
            total += gradient[b] * y[n + b * columns + c]
        line[row + c if c < n else m + c - n] += total / per


@njit(cache=True, error_model="numpy")
def pencil(J, kinds, n, vector, sizes, period, P, R):
    """Write the (n, n) pencil P v = mu R v of the linearised return map at the first segment's start.

    Durations are eliminated by reflections and segments joined by orthogonal null spaces, so nothing is divided by the
    normal velocity: where it vanishes (grazing) R is singular and a multiplier infinite. Unless the segment closes without
    an event, the flow `vector` is an eigenvector (of multiplier 0, since the event waits for it), and the quotient by it
    is left in P[1:, 1:] and R[1:, 1:]; it is first improved to the eigenvector of the discrete equations. States are
    taken in units of `sizes`, (n,), and durations of `period`, `vector` with them, so that units do not matter.
    """
    segments, wide, width = kinds.size, n + 1, J.shape[1]
    block = np.empty(2 * wide * n + wide + 7 * n * n + 6 * n)
    left, right = pointer(block, 0), pointer(block, wide * n)
    tau, better, v = pointer(right, wide * n), pointer(right, wide * n + wide), pointer(right, wide * n + wide + n)
    work = pointer(v, n)  # (4 n + 6 n^2,)
    matrix = pointer(work, 4 * n + 6 * n * n)
    J, vector, P, R = pointer(J, 0), pointer(vector, 0), pointer(P, 0), pointer(R, 0)
    whole = False
    for i in range(segments):
        at = i * wide
        for a in range(wide):
            line = pointer(J, (at + a) * width + at)
            unit = 0.0
            if a < n:
                unit = sizes[a]
            else:
                unit = abs(line[n]) * period
                for b in range(n):
                    unit = max(unit, abs(line[b]) * sizes[b])
            unit = 1.0 / unit if unit > 0.0 else 1.0
            tau[a] = line[n] * period * unit
            for b in range(n):
                left[a * n + b] = (line[b] + (1.0 if segments == 1 and a == b else 0.0)) * sizes[b] * unit
                right[a * n + b] = 1.0 if a == b else 0.0
        whole = kinds[i] == PHASE_END or kinds[i] == CLOSED_END
        if not whole:
            _reflect(tau, left, right, wide, n, work)
        # behind the reflection's first row, unless the duration stays
        first = 0 if whole else n
        if i == 0 or whole:
            for a in range(n * n):
                P[a] = left[first + a]
                R[a] = right[first + a]
        else:
            _join(P, R, pointer(left, n), pointer(right, n), n, work)
        if whole:
            break
    if not whole:
        for a in range(n):
            v[a] = 0.0
            for b in range(n):
                matrix[a * n + b] = P[a * n + b]
                v[a] += R[a * n + b] * vector[b]
        sign, _ = solve_flat(matrix, v, n, int64(1))
        size = 0.0
        for a in range(n):
            size = max(size, abs(v[a]))
        for a in range(n):
            better[a] = v[a] / size if sign != 0.0 and 0.0 < size < 1e300 else vector[a]
        _quotient(P, R, better, n, left, right, tau, work)
    keep(block)


@njit(**INNER)
def _quotient(P, R, vector, n, left, right, image, work):
    """Turn a pencil so that its rows and columns behind the first are the quotient by an eigenvector."""
    outlined()
    for a in range(n):
        for b in range(n):
            left[a * n + b] = P[b * n + a]
            right[a * n + b] = R[b * n + a]
    _reflect(vector, left, right, n, n, work)
    size = 0.0
    for a in range(n):
        for b in range(n):
            P[a * n + b] = left[b * n + a]
            R[a * n + b] = right[b * n + a]
        image[a] = R[a * n]
        size = max(size, abs(image[a]))
    if size == 0.0:
        for a in range(n):
            image[a] = P[a * n]
    _reflect(image, P, R, n, n, work)


@njit(cache=True, error_model="numpy")
def pair(P, R, at, values):
    """Write the two generalised eigenvalues of the 2 x 2 pencil that begins at (at, at); infinite ones as inf."""
    width = P.shape[1]
    above, below = pointer(P, at * width + at), pointer(P, (at + 1) * width + at)
    p00, p01, p10, p11 = above[0], above[1], below[0], below[1]
    above, below = pointer(R, at * width + at), pointer(R, (at + 1) * width + at)
    r00, r01, r10, r11 = above[0], above[1], below[0], below[1]
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
    width = J.shape[1]
    matrix, rhs, entries = np.empty(m * m), np.zeros(m), pointer(J, 0)
    for a in range(m):
        for b in range(m):
            matrix[a * m + b] = entries[a * width + b]
    last = m - n - 1
    for a in range(n):
        matrix[(last + a) * m + a] += 2.0
    sign, log = solve_flat(pointer(matrix, 0), pointer(rhs, 0), m, int64(1))
    keep(matrix)
    keep(rhs)
    return sign, log


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


@njit(**INNER)
def _reflect(tau, left, right, size, columns, v):
    """Apply to both matrices, (size, columns), the reflection that turns `tau` onto its first component. v: scratch."""
    outlined()
    norm = 0.0
    for a in range(size):
        v[a] = tau[a]
        norm += v[a] * v[a]
    norm = math.sqrt(norm)
    if norm == 0.0:
        return
    v[0] += norm if v[0] >= 0.0 else -norm
    square = 0.0
    for a in range(size):
        square += v[a] * v[a]
    for b in range(columns):
        one = two = 0.0
        for a in range(size):
            one += v[a] * left[a * columns + b]
            two += v[a] * right[a * columns + b]
        one *= 2.0 / square
        two *= 2.0 / square
        for a in range(size):
            left[a * columns + b] -= one * v[a]
            right[a * columns + b] -= two * v[a]


@njit(**INNER)
def _join(P, R, left, right, n, work):
    """Eliminate the middle state from P x0 = R x1 and left x1 = right x2, leaving P x0 = R x2 in place.

    The rows (R; left) are turned by reflections until only n of them are non-zero; the other n give the new pencil.
    """
    outlined()
    v, stack, wide = work, pointer(work, 2 * n), 3 * n
    for a in range(6 * n * n):
        stack[a] = 0.0
    for a in range(n):
        above, below = pointer(stack, a * wide), pointer(stack, (n + a) * wide)
        for b in range(n):
            above[b] = -R[a * n + b]
            below[b] = left[a * n + b]
            above[n + b] = P[a * n + b]
            below[2 * n + b] = right[a * n + b]
    for c in range(n):
        norm = 0.0
        for a in range(c, 2 * n):
            v[a] = stack[a * wide + c]
            norm += v[a] * v[a]
        norm = math.sqrt(norm)
        if norm == 0.0:
            continue
        v[c] += norm if v[c] >= 0.0 else -norm
        square = 0.0
        for a in range(c, 2 * n):
            square += v[a] * v[a]
        for b in range(c, wide):
            total = 0.0
            for a in range(c, 2 * n):
                total += v[a] * stack[a * wide + b]
            total *= 2.0 / square
            for a in range(c, 2 * n):
                stack[a * wide + b] -= total * v[a]
    for a in range(n):
        for b in range(n):
            P[a * n + b] = stack[(n + a) * wide + n + b]
            R[a * n + b] = stack[(n + a) * wide + 2 * n + b]


@njit(cache=True, error_model="numpy")
def sample(
    functions, mode, what, sign, dense_at, mesh, first, count, n, n_outputs, nodes, nodes_at, coefficients, s, p, x, out
):
    """Return a quantity at clustered time `s` of a segment, its state left in `x`.

    what: a state (below n), an output (below n + n_outputs) or, behind these, the event function of a transition; times `sign`.
    """
    return _sample(
        pointer(functions, 0), mode, what, sign, pointer(mesh, first), count, n, n_outputs, pointer(nodes, nodes_at),
        pointer(coefficients, dense_at), s, pointer(p, 0), pointer(x, 0), pointer(out, 0),
    )  # fmt: skip


@njit(**INNER)
def _sample(functions, mode, what, sign, mesh, count, n, n_outputs, nodes, coefficients, s, p, x, out):
    """Do what `sample` does, on pointers to what belongs to the segment."""
    outlined()
    low, high = 0, count - 1
    while low < high:
        middle = (low + high + 1) // 2
        if mesh[middle] <= s:
            low = middle
        else:
            high = middle - 1
    a, b = mesh[low], mesh[low + 1]
    dense_value(coefficients, low * 7 * n, n, nodes, low * n, (s - a) / (b - a), x)
    if what < n:
        return sign * x[what]
    if what < n + n_outputs:
        call(functions[OUTPUTS], mode, 0, x, 0, p, out, 0)
        return sign * out[what - n]
    call(functions[EVENT], what - n - n_outputs, 0, x, 0, p, out, 0)
    return sign * out[0]


@njit(**INNER)
def lowest(
    functions, mode, what, sign, mesh, count, n, n_outputs, nodes, coefficients, a, m, b, fa, fm, fb, p, x, out
):  # fmt: skip
    """Return the place and value of the least value of a quantity in (a, b), bracketed at m, by parabolas and sections."""
    outlined()
    for step in range(60):
        if b - a < 1e-7 or not fm <= min(fa, fb):
            break
        r, q = (m - a) * (fm - fb), (m - b) * (fm - fa)
        bottom = 2.0 * (r - q)
        t = m - ((m - a) * r - (m - b) * q) / bottom if bottom != 0.0 else m
        margin = 0.02 * min(m - a, b - m)
        if step % 3 == 2 or not (a + margin < t < b - margin) or abs(t - m) < 1e-10:
            t = m + 0.3 * (b - m) if b - m > m - a else m - 0.3 * (m - a)
        ft = _sample(functions, mode, what, sign, mesh, count, n, n_outputs, nodes, coefficients, t, p, x, out)
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


@njit(**INNER)
def _at_phase(
    functions, mode, mesh, count, n, n_outputs, nodes, coefficients, p, low, high, target, at_zero, out
):  # fmt: skip
    """Write the state of a segment at which its phase, between two clustered times, is `target`; its phase is set to 0."""
    outlined()
    start, phase = low, n - 1
    f_low = f_high = 0.0
    for ask in range(124):
        # both ends first, then between them
        middle = low if ask == 0 else high
        if ask > 1:
            if abs(f_high) < 1e-14 or high - low < 1e-16:
                break
            middle = high - f_high * (high - start) / (f_high - f_low) if f_high != f_low else 0.5 * (low + high)
            if ask % 3 == 2 or not low < middle < high:
                middle = 0.5 * (low + high)
        f = _sample(
            functions, mode, phase, 1.0, mesh, count, n, n_outputs, nodes, coefficients, middle, p, at_zero, out
        )  # fmt: skip
        f -= target
        if ask == 0:
            f_low = f
        elif ask == 1:
            f_high = f
        elif f >= 0.0:
            start, f_low = high, f_high
            high, f_high = middle, f
        else:
            low = middle
            start, f_low = middle, f
    _sample(functions, mode, phase, 1.0, mesh, count, n, n_outputs, nodes, coefficients, high, p, at_zero, out)
    at_zero[n - 1] = 0.0


@njit(cache=True, error_model="numpy")
def survey(
    functions,
    modes,
    transitions,
    kinds,
    turns,
    sources,
    directions,
    surfaces,
    n,
    n_modes,
    n_outputs,
    has_phase,
    u,
    p,
    rtol,
    atol,
    sizes,
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

    surfaces: (transitions,), BOUNDARY, STOP or SECTION.
    lows, highs: (n + n_outputs,). margins, places: (segments, transitions): the least interior local minimum of each event
    function in its firing direction (inf where there is none), and where in clustered time; its value at the segment's
    start and WHOLE where it is level. rates: (segments, 3): Lie
    derivative of each segment's event at its end and at its start; in rates[:, 2] how far the segment's end is from the next
    one's start, or from its event. Returns the bits of what makes the orbit inadmissible, and
    COARSE where a step passed over something.
    """  # fmt: skip
    segments, wide, n_transitions, most, longest, pieces = modes.size, n + 1, sources.size, 0, 0, 0
    for i in range(segments):
        longest = mesh_at[i + 1] - mesh_at[i] - 1 + (longest if kinds[i] == CUT_END else 0)
        pieces += 1 if kinds[i] == CUT_END else 0
        most = max(most, FINE * longest + 1)
    # what the pieces of a smooth orbit that is cut are put together in, as one segment
    joined = np.empty((most // FINE + 2) * (8 * n + 1) if pieces > 0 else 0)
    block = np.empty(5 * n + 4 + max(n_outputs, 2) + (n + n_outputs + n_transitions) * most)
    functions, modes = pointer(functions, 0), pointer(modes, 0)
    transitions, kinds = pointer(transitions, 0), pointer(kinds, 0)
    sources, directions, surfaces = pointer(sources, 0), pointer(directions, 0), pointer(surfaces, 0)
    u, p = pointer(u, 0), pointer(p, 0)
    mesh, mesh_at = pointer(mesh, 0), pointer(mesh_at, 0)
    nodes, coefficients = pointer(nodes, 0), pointer(coefficients, 0)
    lows, highs, margins, places = pointer(lows, 0), pointer(highs, 0), pointer(margins, 0), pointer(places, 0)
    rates, at_zero = pointer(rates, 0), pointer(at_zero, 0)
    bad, start = 0, int64(0)
    head, steps = 0, int64(0)
    x, probe, field, slope = pointer(block, 0), pointer(block, n), pointer(block, 2 * n), pointer(block, 3 * n)
    one, out = pointer(block, 5 * n + 2), pointer(block, 5 * n + 4)
    values = pointer(out, max(n_outputs, 2))  # (n + n_outputs, samples)
    heights = pointer(values, (n + n_outputs) * most)  # (n_transitions, samples)
    for q in range(n + n_outputs):
        lows[q] = np.inf
        highs[q] = -np.inf
    found_zero = False
    target = period = 0.0
    for i in range(segments):
        period += abs(u[i * wide + n])
    if has_phase:
        target = 2.0 * math.pi * math.ceil(u[n - 1] / (2.0 * math.pi) - 1e-13)
        nearest = 2.0 * math.pi * math.floor(u[n - 1] / (2.0 * math.pi) + 0.5)
        if transitions[segments - 1] >= 0 and abs(u[n - 1] - nearest) <= AT_WRAP:
            # the strobe looks before the jump at phase 0 that the orbit starts with, which is where the period ends
            target = nearest + 2.0 * math.pi * turns
    for i in range(segments):
        mode, transition, row = modes[i], transitions[i], i * wide
        duration = u[row + n]
        count = mesh_at[i + 1] - mesh_at[i] - 1
        first = mesh_at[i]
        grid, states, curves = pointer(mesh, first), pointer(nodes, first * n), pointer(coefficients, first * 7 * n)
        dense(functions, mode, u, row, duration, p, grid, start, count, n, states, start, curves, start)
        if (not duration > 0.0 and kinds[i] != MEAN_END) or duration < 0.0:
            bad |= DURATION
        for step in range(count):
            a = grid[step]
            if missed(
                functions, mode, duration, a, grid[step + 1] - a, p, curves, step * 7 * n, states, step * n, n, x, probe,
                field, rtol, atol,
            ):  # fmt: skip
                bad |= COARSE
                break
        end = pointer(states, count * n)
        following = row + wide if i + 1 < segments else 0
        for e in range(n):
            x[e] = end[e]
        if transition >= 0 and kinds[i] != TOUCH_END:
            call(functions[RESET], transition, 0, end, 0, p, x, 0)
        gap = 0.0
        for e in range(n):
            turn = 2.0 * math.pi * turns if following == 0 and e == n - 1 else 0.0
            gap = max(gap, abs(x[e] - u[following + e] - turn))
        rates[3 * i + 2] = gap
        if transition >= 0:
            call(functions[EVENT], transition, 0, end, 0, p, one, 0)
            rates[3 * i + 0] = one[1]
            rates[3 * i + 2] = max(gap, abs(one[0]))
            call(functions[EVENT_X], transition, 0, end, 0, p, slope, 0)
            call(functions[FIELD], mode, 0, end, 0, p, field, 0)
            # an event that depends on one state alone is met at a grazing with a velocity that is rounding of nothing
            speed = 0.0
            for e in range(n):
                speed += abs(slope[2 + e] * field[e]) + abs(slope[2 + e]) * sizes[e] / period
            if kinds[i] != TOUCH_END and directions[transition] * one[1] < -1e-9 * speed:
                bad |= DIRECTION
            call(functions[GUARD], n_modes + transition, 0, end, 0, p, one, 0)
            if not one[0] > 0.0:
                bad |= WHEN
            call(functions[EVENT], transition, 0, states, 0, p, one, 0)
            rates[3 * i + 1] = one[1]
        for k in range(n_transitions):
            margins[i * n_transitions + k] = np.inf
            places[i * n_transitions + k] = 0.5
        if kinds[i] != CUT_END:
            head, steps = i, int64(0)
        if head < i or (i + 1 < segments and kinds[i + 1] == CUT_END):
            whole = pointer(joined, 0)
            paths = pointer(whole, most // FINE + 2)
            bends = pointer(paths, (most // FINE + 2) * n)
            for step in range(count + 1):
                whole[steps + step] = i - head + grid[step]
            for e in range((count + 1) * n):
                paths[steps * n + e] = states[e]
            for e in range(count * 7 * n):
                bends[steps * 7 * n + e] = curves[e]
            steps += count
            if i + 1 < segments and kinds[i + 1] == CUT_END:
                continue
            grid, states, curves, count = whole, paths, bends, steps
        total = count * FINE
        for j in range(total + 1):
            step = min(j // FINE, count - 1)
            if j % FINE == 0:
                for e in range(n):
                    x[e] = states[(j // FINE) * n + e]
            else:
                part = (j - step * FINE) / FINE
                dense_value(curves, step * 7 * n, n, states, step * n, part, x)
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
                values[q * (total + 1) + j] = value
                lows[q] = min(lows[q], value)
                highs[q] = max(highs[q], value)
            for k in range(n_transitions):
                if sources[k] == mode:
                    call(functions[EVENT], k, 0, x, 0, p, one, 0)
                    heights[k * (total + 1) + j] = -one[0] if directions[k] > 0 else one[0]
            if has_phase and not found_zero and x[n - 1] >= target - (AT_WRAP if j == total else 1e-13):
                found_zero = True
                _at_phase(
                    functions, mode, grid, count, n, n_outputs, states, curves, p,
                    _fine(grid, count, max(j - 1, 0)), _fine(grid, count, j), target, at_zero, out,
                )  # fmt: skip
        for q in range(2 * (n + n_outputs)):
            sign, q = (1.0, q) if q < n + n_outputs else (-1.0, q - n - n_outputs)
            value = pointer(values, q * (total + 1))
            for j in range(1, total):
                fa, fm, fb = sign * value[j - 1], sign * value[j], sign * value[j + 1]
                least = lows[q] if sign > 0.0 else -highs[q]
                # the sampled peak that wins may belong to another true one
                if fm <= fa and fm < fb and fm <= least + PEAK * (highs[q] - lows[q]):
                    _, least = lowest(
                        functions, mode, q, sign, grid, count, n, n_outputs, states, curves,
                        _fine(grid, count, j - 1), _fine(grid, count, j), _fine(grid, count, j + 1),
                        fa, fm, fb, p, x, out,
                    )  # fmt: skip
                    if sign > 0.0:
                        lows[q] = min(lows[q], least)
                    else:
                        highs[q] = max(highs[q], -least)
        before = transitions[i - 1 if i > 0 else segments - 1]
        for k in range(n_transitions):
            if sources[k] != mode:
                continue
            height = pointer(heights, k * (total + 1))
            sign = -1.0 if directions[k] > 0 else 1.0
            size, top, bottom = 0.0, height[0], height[0]
            for j in range(total + 1):
                size = max(size, abs(height[j]))
                top, bottom = max(top, height[j]), min(bottom, height[j])
            call(functions[EVENT_X], k, 0, states, 0, p, slope, 0)
            reach = 0.0
            for e in range(n):
                reach += abs(slope[2 + e]) * sizes[e]
            small = 1e-9 * (1e-3 * reach + size)
            if directions[k] == 0 and height[0 if abs(height[0]) > small else 1] < 0.0:
                sign, top, bottom = -1.0, -bottom, -top
                for j in range(total + 1):
                    height[j] = -height[j]
            level = duration > BRIEF * period and top - bottom <= LEVEL * reach + 1e-14 * size
            passed = top < -small and directions[k] != 0 and surfaces[k] == BOUNDARY
            if k != transition and k != before and (level or passed):
                held = _held(functions, n_modes + k, grid, count, n, states, curves, p, x, one)
                if passed and held == total + 1:
                    bad |= BEYOND
                if level:
                    if held > 0 and surfaces[k] != SECTION:
                        distance = sign * height[0] if directions[k] == 0 else height[0]
                        margins[head * n_transitions + k] = distance if abs(distance) > ZERO * reach else 0.0
                        places[head * n_transitions + k] = WHOLE
                    continue
            armed = seen = False
            for j in range(total + 1):
                if 2 <= j and height[j - 1] < height[j - 2] and height[j - 1] <= height[j] and seen:
                    place, least = lowest(
                        functions, mode, n + n_outputs + k, sign, grid, count, n, n_outputs, states, curves,
                        _fine(grid, count, j - 2), _fine(grid, count, j - 1), _fine(grid, count, j),
                        height[j - 2], height[j - 1], height[j], p, x, out,
                    )  # fmt: skip
                    call(functions[GUARD], n_modes + k, 0, x, 0, p, one, 0)
                    if one[0] > 0.0:
                        bad |= _noted(margins, places, head * n_transitions + k, least, place, small)
                # from beyond the surface the motion may come back through it for a moment, and meet the event then
                if 2 <= j and not armed and height[j - 2] < height[j - 1] >= height[j] and height[j - 1] <= small:
                    fa, fm, fb = -height[j - 2], -height[j - 1], -height[j]
                    if fm <= max(fa, fb) - fm:
                        place, depth = lowest(
                            functions, mode, n + n_outputs + k, -sign, grid, count, n, n_outputs, states, curves,
                            _fine(grid, count, j - 2), _fine(grid, count, j - 1), _fine(grid, count, j), fa, fm, fb,
                            p, x, out,
                        )  # fmt: skip
                        call(functions[GUARD], n_modes + k, 0, x, 0, p, one, 0)
                        if one[0] > 0.0:
                            bad |= _noted(margins, places, head * n_transitions + k, depth, place, small)
                # an event that has just happened does not happen again as the motion passes on through its surface
                starts = j == 1 and abs(height[0]) <= small and duration > 0.0 and k != before
                if 0 < j < total and height[j] < -small and (armed or starts):
                    low, high = _fine(grid, count, j - 1), _fine(grid, count, j)
                    for _ in range(50 if armed else 0):
                        place = 0.5 * (low + high)
                        value = _sample(
                            functions, mode, n + n_outputs + k, sign, grid, count, n, n_outputs, states, curves, place, p,
                            x, out,
                        )  # fmt: skip
                        if value < 0.0:
                            high = place
                        else:
                            low = place
                    _sample(functions, mode, start, 1.0, grid, count, n, n_outputs, states, curves, low, p, x, out)
                    call(functions[GUARD], n_modes + k, 0, x, 0, p, one, 0)
                    if one[0] > 0.0:
                        bad |= EARLY
                    armed = False
                if j == total and k != transition and armed and height[j] < -small:
                    bad |= EARLY
                if height[j] > small:
                    armed = seen = True
            if kinds[head] == PHASE_END or kinds[head] == CLOSED_END:
                # an orbit without events has no end: an extremum may lie where its segment begins
                for side in range(2):
                    up = 1.0 if side == 0 else -1.0
                    fa, fm, fb = up * height[total - 1], up * height[0], up * height[1]
                    if not (fm <= fa and fm <= fb and fm < max(fa, fb)):
                        continue
                    if not (seen if side == 0 else not seen and fm <= max(fa, fb) - fm):
                        continue
                    place, least = _turning(
                        functions, mode, n + n_outputs + k, up * sign, grid, count, n, n_outputs, states, curves, total, p,
                        x, out,
                    )  # fmt: skip
                    call(functions[GUARD], n_modes + k, 0, x, 0, p, one, 0)
                    if one[0] > 0.0:
                        bad |= _noted(margins, places, head * n_transitions + k, least, place, small)
    if not has_phase or not found_zero:
        for e in range(n):
            at_zero[e] = u[e]
    keep(block)
    keep(joined)
    return bad


@njit(**INNER)
def _noted(margins, places, at, least, place, small):
    """Keep a least distance and its place where none is less yet; the bit of a surface that is passed there, if any."""
    if not least < margins[at]:
        return 0
    margins[at], places[at] = least, place
    return EARLY if least < -small else 0


@njit(**INNER)
def _turning(functions, mode, what, sign, mesh, count, n, n_outputs, nodes, coefficients, total, p, x, out):
    """Return place and value of the least value of an event function, times `sign`, next to where a closed segment begins."""
    outlined()
    _sample(functions, mode, what, sign, mesh, count, n, n_outputs, nodes, coefficients, 0.0, p, x, out)
    low, high = 0.0, 0.0
    if sign * out[1] > 0.0:
        low, high = _fine(mesh, count, total - 1), mesh[count]
    elif sign * out[1] < 0.0:
        high = _fine(mesh, count, 1)
    for _ in range(60):
        place = 0.5 * (low + high)
        _sample(functions, mode, what, sign, mesh, count, n, n_outputs, nodes, coefficients, place, p, x, out)
        if sign * out[1] < 0.0:
            low = place
        else:
            high = place
    return high, _sample(functions, mode, what, sign, mesh, count, n, n_outputs, nodes, coefficients, high, p, x, out)


@njit(**INNER)
def _held(functions, guard, mesh, count, n, nodes, coefficients, p, x, out):
    """Return at how many of a segment's fine samples a transition's condition holds."""
    outlined()
    held = 0
    for j in range(count * FINE + 1):
        step = min(j // FINE, count - 1)
        dense_value(coefficients, step * 7 * n, n, nodes, step * n, (j - step * FINE) / FINE, x)
        call(functions[GUARD], guard, 0, x, 0, p, out, 0)
        if out[0] > 0.0:
            held += 1
    return held


@njit(**INNER)
def _fine(mesh, count, j):
    """Clustered time of the j-th fine sample of a segment."""
    step = min(j // FINE, count - 1)
    a, b = mesh[step], mesh[step + 1]
    return a + (b - a) * (j - step * FINE) / FINE


@njit(cache=True, error_model="numpy")
def remesh(mesh, mesh_at, errors, limit):
    """Return whether the mesh is fine enough, a new flat mesh and the segments' counts; no counts where it may stay.

    It may where the largest error is below `limit` and no segment is much finer than need be.
    """
    segments = mesh_at.size - 1
    mesh_at, errors = pointer(mesh_at, 0), pointer(errors, 0)
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
    at, grid, new, filled = 0, pointer(mesh, 0), pointer(fresh, 0), pointer(counts, 0)
    for i in range(segments):
        first = mesh_at[i]
        count = mesh_at[i + 1] - first - 1
        room = pointer(new, at)
        filled[i] = redistribute(pointer(grid, first), count, pointer(errors, first), AIM, room, 3 * count + 8)
        at += filled[i] + 1
    return worst <= FINEST, fresh, counts
