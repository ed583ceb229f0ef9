"""Compiled looks at one segment's dense output: a quantity at a place, its least value, where a phase is reached."""

from __future__ import annotations

from typing import NamedTuple

from saltus.flow.kernels.stages import dense_value
from saltus.flow.kernels.state import EPSILON
from saltus.orbits.records import Dense, Mesh
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.machine_code import kernel, njit
from saltus.system.numba_tools.pointers import INNER, call, outlined, pointer

EVENT = FUNCTIONS.index("event")
OUTPUTS = FUNCTIONS.index("outputs")
GUARD = FUNCTIONS.index("guard")
FINE = 3  # samples of a step in the survey


class View(NamedTuple):
    """The system and the events, as a survey needs them, on pointers.

    Attributes
    ----------
    functions, p : pointer
        Addresses of the generated functions; extended parameters.
    n, modes, outputs, transitions : int
        Components of the full state; counts of modes, outputs and transitions.
    sources, directions, surfaces : pointer to int64
        As in `saltus.orbits.records.Events`.
    alike, idle, absent : pointer to int64
        As in `saltus.orbits.records.Events`.
    sizes : pointer to float64, (n,)
        Typical sizes of the states.
    period : float
        Sum of the durations' sizes.
    implicit : int
        Address of the dense output of implicit steps; 0 where steps are explicit.
    check : int
        Address of the check of a step's dense output between its stages; 0 where explicit steps check it, too.
    """

    functions: object
    p: object
    n: int
    modes: int
    outputs: int
    transitions: int
    sources: object
    directions: object
    surfaces: object
    alike: object
    idle: object
    absent: object
    sizes: object
    period: float
    implicit: int
    check: int


class Curve(NamedTuple):
    """A segment's dense output, on pointers.

    Attributes
    ----------
    mode : int
        Index of the mode.
    duration : float
        Duration of the segment, or of its last piece where it is cut.
    mesh : pointer to float64, (count + 1,)
        Clustered times.
    count : int
        Steps.
    nodes, coefficients : pointer to float64, (count + 1, n) and (count, 7 n)
        States at the steps' ends, and the interpolants.
    """

    mode: int
    duration: float
    mesh: object
    count: int
    nodes: object
    coefficients: object


class Room(NamedTuple):
    """Scratch of a survey, on pointers.

    Attributes
    ----------
    x, probe, field, slope, one, out : pointer to float64
        Sizes n, n, n, 2 n + 2, 2 and max(outputs, 2).
    values : pointer to float64, (n + outputs, samples)
        States and outputs at the fine samples of a segment.
    heights : pointer to float64, (transitions, samples)
        Event functions there, positive before the event.
    """

    x: object
    probe: object
    field: object
    slope: object
    one: object
    out: object
    values: object
    heights: object


@njit(**INNER)
def _state(curve, n, s, x):
    """Leave the state at clustered time `s` in `x`, (n,)."""
    mesh = curve.mesh
    low, high = 0, curve.count - 1
    while low < high:
        middle = (low + high + 1) // 2
        if mesh[middle] <= s:
            low = middle
        else:
            high = middle - 1
    a, b = mesh[low], mesh[low + 1]
    dense_value(curve.coefficients, low * 7 * n, n, curve.nodes, low * n, (s - a) / (b - a), x)


@kernel
def state_on(mesh, dense, segment, s, x):
    """Write the full state at clustered time `s` of a segment, as last surveyed, into `x`, (n,)."""
    mesh, dense, n = Mesh(*mesh), Dense(*dense), x.size
    first = mesh.starts[segment]
    count = mesh.starts[segment + 1] - first - 1
    nodes, coefficients = pointer(dense.nodes, first * n), pointer(dense.coefficients, first * 7 * n)
    _state(Curve(0, 0.0, pointer(mesh.places, first), count, nodes, coefficients), n, s, pointer(x, 0))


@njit(**INNER)
def sample(view, curve, what, sign, s, x, out):
    """Return a quantity at clustered time `s` of a segment, its state left in `x`.

    what: a state (below n), an output (below n + outputs) or, behind these, the event function of a transition; times `sign`.
    """
    outlined()
    n = view.n
    _state(curve, n, s, x)
    if what < n:
        return sign * x[what]
    if what < n + view.outputs:
        call(view.functions[OUTPUTS], curve.mode, 0, x, 0, view.p, out, 0)
        return sign * out[what - n]
    call(view.functions[EVENT], what - n - view.outputs, 0, x, 0, view.p, out, 0)
    return sign * out[0]


@njit(**INNER)
def fine(curve, j):
    """Clustered time of the j-th fine sample of a segment."""
    step = min(j // FINE, curve.count - 1)
    a, b = curve.mesh[step], curve.mesh[step + 1]
    return a + (b - a) * (j - step * FINE) / FINE


@njit(**INNER)
def lowest(view, curve, what, sign, j, fa, fm, fb, x, out):
    """Return the place and value of the least value of a quantity near the fine sample `j`, by parabolas and sections.

    fa, fm, fb: its values at the samples before, at and after `j`, which bracket it.
    """
    places = fine(curve, j - 1), fine(curve, j), fine(curve, j + 1)
    return lowest_between(view, curve, what, sign, places, (fa, fm, fb), x, out)


@njit(**INNER)
def lowest_between(view, curve, what, sign, places, values, x, out):
    """Return what `lowest` does between three places, with the values there."""
    outlined()
    a, m, b = places
    fa, fm, fb = values
    narrow = min(1e-7, 1e-5 * (b - a))
    for step in range(60):
        if b - a < narrow or not fm <= min(fa, fb):
            break
        r, q = (m - a) * (fm - fb), (m - b) * (fm - fa)
        bottom = 2.0 * (r - q)
        t = m - ((m - a) * r - (m - b) * q) / bottom if bottom != 0.0 else m
        margin = 0.02 * min(m - a, b - m)
        if step % 3 == 2 or not (a + margin < t < b - margin) or abs(t - m) < 1e-3 * narrow:
            t = m + 0.3 * (b - m) if b - m > m - a else m - 0.3 * (m - a)
        ft = sample(view, curve, what, sign, t, x, out)
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
def lowest_at_end(view, curve, what, sign, ends, values, x, out):
    """Return the least value of a quantity between an end of a segment and the fine sample next to it.

    ends, values: places of the end and of the sample, and `sign` times the quantity there, least at the end. In clustered
    time a dip between them is as deep as the fourth power of its distance, so nearer places than the root are rounding.
    Where the quantity rises from the end on, there is no dip.
    """
    outlined()
    end, near = ends
    value, before = values
    if sample(view, curve, what, sign, end + EPSILON**0.25 * (near - end), x, out) > value:
        return value
    share = 0.5
    while share > EPSILON**0.25:
        beside = end + 2.0 * share * (near - end)
        place = end + share * (near - end)
        there = sample(view, curve, what, sign, place, x, out)
        if there < value:
            if near > end:
                places, heights = (end, place, beside), (value, there, before)
            else:
                places, heights = (beside, place, end), (before, there, value)
            return lowest_between(view, curve, what, sign, places, heights, x, out)[1]
        before = there
        share *= 0.5
    return value


@njit(**INNER)
def turning(view, curve, what, sign, x, out):
    """Return place and value of the least value of an event function, times `sign`, next to where a closed segment begins."""
    outlined()
    sample(view, curve, what, sign, 0.0, x, out)
    low, high = 0.0, 0.0
    if sign * out[1] > 0.0:
        low, high = fine(curve, curve.count * FINE - 1), curve.mesh[curve.count]
    elif sign * out[1] < 0.0:
        high = fine(curve, 1)
    for _ in range(60):
        place = 0.5 * (low + high)
        sample(view, curve, what, sign, place, x, out)
        if sign * out[1] < 0.0:
            low = place
        else:
            high = place
    return high, sample(view, curve, what, sign, high, x, out)


@njit(**INNER)
def at_phase(view, curve, low, high, target, at_zero, out):
    """Write the state of a segment at which its phase, between two clustered times, is `target`; its phase is set to 0."""
    outlined()
    start, phase = low, view.n - 1
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
        f = sample(view, curve, phase, 1.0, middle, at_zero, out)
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
    sample(view, curve, phase, 1.0, high, at_zero, out)
    at_zero[phase] = 0.0


@njit(**INNER)
def held(view, curve, transition, x, out):
    """Return at how many of a segment's fine samples a transition's condition holds."""
    outlined()
    n, count = view.n, 0
    for j in range(curve.count * FINE + 1):
        step = min(j // FINE, curve.count - 1)
        dense_value(curve.coefficients, step * 7 * n, n, curve.nodes, step * n, (j - step * FINE) / FINE, x)
        call(view.functions[GUARD], view.modes + transition, 0, x, 0, view.p, out, 0)
        if out[0] > 0.0:
            count += 1
    return count
