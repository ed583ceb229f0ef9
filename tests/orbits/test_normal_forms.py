"""Normal forms against maps with known coefficients, differences of closed-form impact maps, and orbits beyond."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

import systems
from oracles.closed_forms import DELAYED, HENON, LOGISTIC, ImpactOrbit, henon_fixed_point
from oracles.tapping import Tapping
from saltus import InputError, continue_locus, continue_orbit, solve_orbit
from saltus.afm import table1, tapping_mode
from saltus.orbits.normal_forms import normal_form
from selection import guarding


def carried(image, **parameters):
    return systems.carried_map(tuple(image), parameters, image)


def cycle(system, points, **parameters):
    return solve_orbit(system, parameters, [("carry", "map", [*np.atleast_1d(x), 0.0], 1.0) for x in points])


# coefficients from a map's derivatives (Kuznetsov, Elements of Applied Bifurcation Theory, sec. 5.4)


def fold(A, B):
    """|a| of x -> x + a x^2 for a unit eigenvector."""
    q, p = eigenpair(A, 1.0)
    return abs(0.5 * (p @ B(q, q)).real)


def flip(A, B, C):
    q, p = eigenpair(A, -1.0)
    inner = np.linalg.solve(np.eye(len(A)) - A, B(q, q))
    return ((p @ (C(q, q, q) + 3.0 * B(q, inner))) / 6.0).real


def torus(A, B, C, mu):
    q, p = eigenpair(A, mu)
    size = np.eye(len(A))
    mixed = np.linalg.solve(size - A, B(q, q.conj()))
    twice = np.linalg.solve(mu**2 * size - A, B(q, q))
    return (p @ (C(q, q, q.conj()) + 2.0 * B(q, mixed) + B(q.conj(), twice)) / mu / 2.0).real


def eigenpair(A, mu):
    """Right and left eigenvectors, the right one of unit length, their product 1."""
    values, vectors = np.linalg.eig(A)
    q = vectors[:, int(np.argmin(np.abs(values - mu)))]
    values, vectors = np.linalg.eig(A.T)
    p = vectors[:, int(np.argmin(np.abs(values - mu)))]
    q = q / np.linalg.norm(q)
    return q, p / (p @ q)


@pytest.mark.parametrize(("r", "x", "c"), [(3.0, 2.0 / 3.0, 9.0)])
def test_the_logistic_doubling_has_coefficient_nine(r, x, c):
    form = normal_form(cycle(carried(LOGISTIC, a=r), [x]), "PD")
    assert form.coefficient == pytest.approx(c, abs=1e-8)
    assert form.criticality == "supercritical"
    assert form.angle == math.pi
    assert repr(form) == "NormalForm PD: supercritical, coefficient 9"


def test_the_doubling_of_the_logistic_two_cycle_is_that_of_the_second_iterate():
    a = 1.0 + math.sqrt(6.0)
    root = math.sqrt((a - 3.0) * (a + 1.0))
    x, y = (a + 1.0 - root) / (2.0 * a), (a + 1.0 + root) / (2.0 * a)

    def derivatives(at, then):
        """First three of f(f(x)): f' = a (1 - 2 x), f'' = -2 a."""
        f, g, bend = a * (1.0 - 2.0 * at), a * (1.0 - 2.0 * then), -2.0 * a
        return g * f, bend * f * f + g * bend, 3.0 * bend * f * bend

    for points in ((x, y), (y, x)):
        first, second, third = derivatives(*points)
        assert first == pytest.approx(-1.0)
        form = normal_form(cycle(carried(LOGISTIC, a=a), points), "PD")
        assert form.coefficient == pytest.approx(second**2 / 4.0 + third / 6.0, rel=1e-8)


@pytest.mark.parametrize("b", [-0.6, 0.0, 0.3, 0.8])
def test_henons_fold_and_doubling_have_the_coefficients_of_the_map(b):
    system = carried(HENON, a=0.2, b=b)
    x = henon_fixed_point(0.2, b)
    branch = continue_orbit(cycle(system, [(x, x)]), "a", (-1.5, 2.5))

    def bilinear(u, v):
        return np.array([-2.0 * u[0] * v[0], 0.0])

    def at(point):
        return np.array([[-2.0 * point.orbit.x0[0], b], [1.0, 0.0]])

    form = branch["SN1"].normal_form
    assert abs(form.coefficient) == pytest.approx(fold(at(branch["SN1"]), bilinear), rel=1e-7)
    assert form.criticality == "nondegenerate"
    form = branch["PD1"].normal_form
    wanted = flip(at(branch["PD1"]), bilinear, lambda *_: np.zeros(2))
    assert form.coefficient == pytest.approx(wanted, rel=1e-7)
    assert form.criticality == "supercritical"


def delayed_pieces(a, c):
    """Derivatives of (x, y) -> (y, a y (1 - x) - c (y - x)) at its fixed point 1 - 1/a."""
    x = 1.0 - 1.0 / a
    A = np.array([[0.0, 1.0], [-a * x + c, a * (1.0 - x) - c]])
    return A, lambda u, v: np.array([0.0, -a * (u[0] * v[1] + u[1] * v[0])]), lambda *_: np.zeros(2)


@pytest.mark.parametrize("c", [-0.9, -0.5, 0.0, 0.4, 1.2, 1.7, 2.3, 2.9])
def test_the_delayed_logistic_map_has_the_torus_coefficient_of_its_derivatives(c):
    a = 2.0 + c
    x = 1.0 - 1.0 / a
    A, B, C = delayed_pieces(a, c)
    mu = complex((1.0 - c) / 2.0, math.sqrt(1.0 - ((1.0 - c) / 2.0) ** 2))
    form = normal_form(cycle(carried(DELAYED, a=a, c=c), [(x, x)]), "TR")
    assert form.coefficient == pytest.approx(torus(A, B, C, mu), rel=1e-6)
    assert form.angle == pytest.approx(math.acos((1.0 - c) / 2.0), abs=1e-8)


@pytest.mark.campaign
def test_the_delayed_logistic_torus_is_born_on_the_predicted_side():
    """c = 0: Re d < 0 (the classical delayed logistic map): beyond a = 2 an attracting closed curve, radius from d."""
    branch = continue_orbit(cycle(carried(DELAYED, a=1.5, c=0.0), [(1 / 3, 1 / 3)]), "a", (1.2, 2.5))
    form = branch["TR1"].normal_form
    assert form.criticality == "supercritical"
    a = 2.0 + 2e-4
    x = 1.0 - 1.0 / a
    A = delayed_pieces(a, 0.0)[0]
    mu = np.linalg.eigvals(A)[0]
    wanted = math.sqrt((abs(mu) - 1.0) / -form.coefficient)
    q, p = eigenpair(A, mu if mu.imag > 0 else mu.conjugate())
    state = np.array([x, x]) + 2.0 * (1.3 * wanted * q).real
    radii = []
    for i in range(200000):
        u, v = state
        state = np.array([v, a * v * (1.0 - u)])
        if i > 190000:
            radii.append(abs(p @ (state - x)))
    assert np.sqrt(np.mean(np.square(radii))) == pytest.approx(wanted, rel=0.01)


# impact oscillator: the closed-form map from impact to impact, differentiated with fifty digits


def impact_map(w, A, **others):
    """(v, s) just after an impact to (v, s) just after the next, at fifty digits."""
    values = {"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8} | others
    k, c, d, e, w, A = (mpmath.mpf(x) for x in (*values.values(), w, A))
    z = A / mpmath.mpc(k - w**2, c * w)
    W = mpmath.sqrt(k - c**2 / 4)

    def forced(s):
        turned = z * mpmath.expj(s)
        return turned.real, -w * turned.imag

    def step(v, s, guess):
        x0, v0 = forced(s)
        a, b = d - x0, v - v0
        b = (b + c / 2 * a) / W

        def free(t):
            decay, C, S = mpmath.exp(-c / 2 * t), mpmath.cos(W * t), mpmath.sin(W * t)
            x = decay * (a * C + b * S)
            return x, -c / 2 * x + decay * W * (b * C - a * S)

        t = mpmath.findroot(lambda t: free(t)[0] + forced(s + w * t)[0] - d, guess)
        return -e * (free(t)[1] + forced(s + w * t)[1]), s + w * t

    return step


def derivatives(step, v, s, guess):
    """A, B, C of a planar map with its turns taken off, by differences of order 4 at fifty digits."""
    h = mpmath.mpf(10) ** -8
    cache = {}

    def at(i, j):
        if (i, j) not in cache:
            cache[i, j] = np.array(step(v + i * h, s + j * h, guess), dtype=object)
        return cache[i, j]

    weights = {0: {0: 1}, 1: {-1: -0.5, 1: 0.5}, 2: {-1: 1, 0: -2, 1: 1}, 3: {-2: -0.5, -1: 1, 1: -1, 2: 0.5}}

    def partial(m, n):
        total = sum(
            mpmath.mpf(a) * mpmath.mpf(b) * at(i, j) for i, a in weights[m].items() for j, b in weights[n].items()
        )
        return np.array([float(x) for x in total / h ** (m + n)])

    A = np.column_stack([partial(1, 0), partial(0, 1)])

    def form(order):
        def apply(*vectors):
            out = np.zeros(2, dtype=complex)
            for index in np.ndindex(*(2,) * order):
                n = sum(index)
                out = out + np.prod([u[i] for u, i in zip(vectors, index, strict=True)]) * tensors[order - n, n]
            return out

        return apply

    tensors = {(m, n): partial(m, n) for m in range(4) for n in range(4) if 2 <= m + n <= 3}
    return A, form(2), form(3)


def impact_pieces(w, m, U, **others):
    form = ImpactOrbit(w, m, **others)
    _, v, s = form.after_impact(U)
    with mpmath.workdps(50):
        return derivatives(impact_map(w, form.amplitude(U), **others), mpmath.mpf(v), mpmath.mpf(s), form.period)


def impact_branch(w, m, U, top):
    form = ImpactOrbit(w, m)
    start = [("free", "impact", form.after_impact(U), form.period)]
    orbit = solve_orbit(systems.impact_oscillator(), {"w": w, "A": form.amplitude(U)}, start)
    return continue_orbit(orbit, "A", (0.01, top))


def test_the_oracle_has_the_trace_and_determinant_of_the_closed_form():
    form = ImpactOrbit(1.1)
    A = impact_pieces(1.1, 1, 0.5)[0]
    assert np.trace(A) == pytest.approx(form.trace(0.5), rel=1e-12)
    assert np.linalg.det(A) == pytest.approx(form.det, rel=1e-12)


@pytest.mark.parametrize(("w", "m", "U"), [(1.1, 1, 0.5), (2.2, 1, 0.5), (0.7, 1, 0.2), (2.5, 2, 1.2)])
def test_impact_doublings_and_folds_have_the_coefficients_of_the_impact_map(w, m, U):
    branch = impact_branch(w, m, U, 6.0)
    checked = 0
    for point in branch.special_points.of_type("SN", "PD"):
        if len(point.orbit.signature) != 1:
            continue
        closed = ImpactOrbit(w, m)
        speed = closed.U_fold if point.type == "SN" else closed.U_doubling
        A, B, C = impact_pieces(w, m, speed)
        if point.type == "SN":
            assert abs(point.normal_form.coefficient) == pytest.approx(fold(A, B), rel=1e-6)
        else:
            assert point.normal_form.coefficient == pytest.approx(flip(A, B, C), rel=1e-6)
        checked += 1
    assert checked


@pytest.mark.parametrize("w", [0.7, 0.9, 0.98])
def test_the_generalised_doubling_of_the_impact_oscillator_is_that_of_the_impact_map(w):
    """Along the doubling locus the coefficient changes its sign where that of the closed form does."""
    branch = impact_branch(0.7, 1, 0.3, 1.0)
    locus = continue_locus(branch["PD1"], ("w", "A"), {"w": (0.66, 1.0), "A": (0.05, 1.0)})
    (point,) = locus.special_points.of_type("GPD")
    where = point.parameters["w"]
    side = flip(*impact_pieces(w, 1, ImpactOrbit(w).U_doubling))
    here = flip(*impact_pieces(where, 1, ImpactOrbit(where).U_doubling))
    assert abs(here) < 1e-6 * abs(side)
    values = [flip(*impact_pieces(where + dw, 1, ImpactOrbit(where + dw).U_doubling)) for dw in (-1e-3, 1e-3)]
    assert values[0] * values[1] < 0.0


@pytest.mark.campaign
def test_impacts_double_as_predicted():
    """Supercritical: two impacts in turn, apart as sqrt(m / c), attract just beyond; before it the orbit alone."""
    branch = impact_branch(2.2, 1, 0.5, 6.0)
    point = branch["PD1"]
    form = point.normal_form
    assert form.criticality == "supercritical"
    closed = ImpactOrbit(2.2)
    critical = point.parameters["A"]
    for A in (critical - 4e-4, critical + 1e-3):
        U = max(closed.speeds(A))
        growth = -float(closed.multipliers(U).real.min()) - 1.0
        v, s = motion_of_impacts(closed, A, U)
        apart = math.hypot(v[-1] - v[-2], s[-1] - s[-2]) / 2.0
        if growth > 0.0:
            assert critical > A
            assert apart == pytest.approx(math.sqrt(growth / form.coefficient), rel=5.0 * growth)
        else:
            assert apart < 1e-8


def motion_of_impacts(closed, A, U):
    """Speeds after impact and phases less whole periods, of many impacts from near an orbit."""
    with mpmath.workdps(18):
        step = impact_map(closed.w, A)
        _, v, s = closed.after_impact(U)
        v, s = mpmath.mpf(v) * mpmath.mpf("1.001"), mpmath.mpf(s)
        speeds, phases = [], []
        for _ in range(1600):
            v, s = step(v, s, closed.period)
            s -= 2 * mpmath.pi * closed.m
            speeds.append(float(v))
            phases.append(float(s))
    return speeds, phases


# the tapping cantilever


@pytest.fixture(scope="module")
def tapping():
    return tapping_mode(table1(), modes=1)


def impacting_branch(system, Omega, x, ybar, bounds):
    _, ((t1, touch), (t2, release)) = Tapping(1, Omega).map(np.array(x), 1e-7)
    end = 2.0 * math.pi / Omega - t2
    segments = [("flight", "touch", x, t1), ("contact", "release", touch, t2 - t1), ("flight", "theta", release, end)]
    orbit = solve_orbit(system, {"Omega": Omega}, segments)
    if ybar is not None:
        lifted = continue_orbit(orbit, "ybar", (orbit.parameters["ybar"], ybar), directions="up")
        orbit = lifted.solution(len(lifted) - 1)
    return continue_orbit(orbit, "Omega", bounds)


def growth_of(orbit):
    """-mu - 1 of the multiplier nearest to -1."""
    values = orbit.multipliers.real
    return -float(values[np.abs(values + 1.0).argmin()]) - 1.0


def beside(point, offset):
    """The orbit of the same branch at a distance from the special point."""
    (name,) = point.varied
    goal = point.parameters[name] + offset
    reach = (goal - 3.0 * abs(offset), goal + 3.0 * abs(offset))
    branch = continue_orbit(point.orbit, name, reach, events={name: goal})
    return branch.special_points.of_type(name)[0].orbit


def critical_direction(orbit):
    """The states' part of the critical eigenvector, of unit length at the first segment's start, from J alone."""
    problem = orbit.problem()
    J = problem.evaluate(orbit.unknowns)[1]
    last = problem.size - problem.n - 1
    J[last : last + problem.n, : problem.n] += 2.0 * np.eye(problem.n)
    q = np.linalg.svd(J)[2][-1]
    return q / np.linalg.norm(q[: problem.n])


def doubled(parent, q):
    """The orbit of twice the period from a guess, the parent moved along q in one period and back in the next."""
    n = len(parent.system.all_states)
    if parent.signature[-1][1] == "theta":
        start = parent.unknowns[: n - 1] + q[: n - 1]
        return solve_orbit(parent.system, dict(parent.parameters), [("flight", "theta", start, 2.0 * parent.period)])
    segments = []
    for turn, sign in ((0, 1.0), (1, -1.0)):
        for (mode, transition), row in zip(
            parent.signature, (parent.unknowns + sign * q).reshape(-1, n + 1), strict=True
        ):
            state = row[:n] + np.eye(n)[-1] * 2.0 * math.pi * turn
            segments.append((mode, transition, state, row[n]))
    return solve_orbit(parent.system, dict(parent.parameters), segments)


DOUBLINGS = [(0.108, "PD1"), (0.108, "PD2"), (0.14, "PD1"), (0.14, "PD2"), (0.14, "PD3"), (0.14, "PD4")]


@pytest.fixture(scope="module")
def responses(tapping):
    x = [-0.48489216, 0.8003283]
    return {ybar: impacting_branch(tapping, 1.0, x, up, (0.85, 1.35)) for ybar, up in ((0.108, None), (0.14, 0.14))}


@pytest.mark.parametrize(("ybar", "label"), DOUBLINGS)
def test_doubled_orbits_of_the_cantilever_lie_where_the_coefficient_says(responses, ybar, label):
    """On one side, sqrt(m / c) off the orbit in turn, m the growth of the multiplier; a supercritical one attracts."""
    point = responses[ybar][label]
    form = point.normal_form
    probe = 1e-9
    slope = growth_of(beside(point, probe)) / probe
    q = critical_direction(point.orbit)
    # next to the grazing, PD1, everything varies so fast that a doubled orbit is solved for only farther off
    for size in (2e-2,) if label == "PD1" else (2e-3, 1e-2):
        offset = math.copysign(size, form.coefficient) / slope
        parent = beside(point, offset)
        growth = growth_of(parent)
        assert growth / form.coefficient > 0.0
        reach = math.sqrt(growth / form.coefficient)
        ahead, back = (doubled(parent, sign * reach * q) for sign in (1.0, -1.0))
        n = len(parent.system.all_states)
        if len(ahead.states) == 2 * len(parent.states):
            apart = (ahead.states[0] - ahead.states[len(parent.states)] + 2.0 * math.pi * np.eye(n)[-1]) / 2.0
        else:
            apart = (ahead.states[0] - back.states[0]) / 2.0
        assert np.linalg.norm(apart) == pytest.approx(reach, rel=8.0 * size)
        assert ahead.stable == (form.criticality == "supercritical")
        assert parent.stable != (form.criticality == "supercritical")
        # by an integrator of its own: two periods bring it back, one does not
        flight = Tapping(1, parent.parameters["Omega"], ybar)
        once = flight.map(ahead.x0)[0]
        twice = flight.map(once)[0]
        np.testing.assert_allclose(twice, ahead.x0, atol=1e-3 * float(np.abs(once - ahead.x0).max()))


@pytest.mark.campaign
@pytest.mark.parametrize(("ybar", "label"), guarding([(0.108, "PD2"), (0.14, "PD3")], campaign=1))
def test_the_cantilever_settles_on_the_doubled_motion_beyond_and_on_none_before(responses, ybar, label):
    """Simulated by SciPy's DOP853: from half the predicted distance it grows, from more it shrinks; before, it dies."""
    point = responses[ybar][label]
    form = point.normal_form
    assert form.criticality == "supercritical"
    slope = growth_of(beside(point, 1e-9)) / 1e-9
    q = critical_direction(point.orbit)[: len(point.orbit.system.all_states)]
    for growth in (0.02, -0.02):
        parent = beside(point, growth / slope)
        flight = Tapping(1, parent.parameters["Omega"], ybar)
        reach = math.sqrt(0.02 / form.coefficient)
        x = np.array(parent.x0)
        away = doubled(parent, reach * critical_direction(point.orbit)).x0 - x if growth > 0.0 else reach * q[:-1]
        for share in (0.5, 1.5):
            moved = x + share * away
            first = np.abs(flight.map(moved, 1e-10)[0] - moved).max()
            for _ in range(40):
                moved = flight.map(moved, 1e-10)[0]
            last = np.abs(flight.map(moved, 1e-10)[0] - moved).max()
            assert (last > first) == (growth > 0.0 and share < 1.0)


# what is refused


def test_a_normal_form_is_of_a_critical_orbit():
    orbit = cycle(carried(LOGISTIC, a=2.5), [0.6])
    for kind, wanted in (("SN", "at 1"), ("PD", "at -1"), ("TR", "on the unit circle")):
        with pytest.raises(InputError, match=f"an orbit with a multiplier {wanted}, as a located {kind} has"):
            normal_form(orbit, kind)
    with pytest.raises(InputError, match="type = 'GR': must be one of SN, PD, TR"):
        normal_form(orbit, "GR")
