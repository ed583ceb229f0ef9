"""Cycles along a canard, of which nothing is left but the slow motion along what repels."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

import saltus
from oracles.shooting import distance
from saltus.continuation.problems.phase_plane import transferred
from saltus.orbits.cuts import clustered
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, CUT_END, Signature
from selection import guarding


def hindmarsh_rose(r):
    field = {"x": "y - x**3 + 3*x**2 - z + I", "y": "1 - 5*x**2 - y", "z": "r*(4*(x + 1.6) - z)"}
    return saltus.HybridSystem.smooth(field, {"I": 1.0, "r": r})


@pytest.mark.parametrize("r", guarding([0.005, 0.01]))
def test_cycles_go_on_along_a_canard_as_shooting_does(r):
    rest = saltus.find_equilibrium(hindmarsh_rose(r), x0=[-1.3, -7.5, 1.2])
    branch = saltus.continue_equilibrium(rest, "I", bounds=(0.0, 6.0))
    born = saltus.switch_branch(branch["HB1"])
    cycles = saltus.continue_orbit(born, "I", (0.0, 6.0), steps=saltus.StepControl(max_points=70))
    beyond = 289.0 if r == 0.005 else 172.0  # where branches ended: 286.6 and 170.7
    rows = np.flatnonzero(cycles.period > beyond)
    assert rows.size
    orbit = cycles.solution(int(rows[np.argmin(cycles.period[rows])]))
    level = orbit.x0[0]

    def gap(u):
        run = solve_ivp(
            lambda t, x: [x[1] - x[0] ** 3 + 3 * x[0] ** 2 - x[2] + u[2], 1 - 5 * x[0] ** 2 - x[1],
                          r * (4 * (x[0] + 1.6) - x[2])],
            (0, orbit.period), [level, u[0], u[1]], rtol=1e-12, atol=1e-13, method="DOP853",
        )  # fmt: skip
        return run.y[:, -1] - [level, u[0], u[1]]

    found = fsolve(gap, [*orbit.x0[1:3], orbit.parameters["I"]], xtol=1e-13, full_output=True)[0]
    assert np.max(np.abs(gap(found))) < 1e-7  # shooting has found an orbit of its own
    assert orbit.parameters["I"] == pytest.approx(found[2], rel=1e-9)


def test_meshes_that_do_not_settle_are_cut_where_they_are_too_coarse():
    problem = OrbitProblem(hindmarsh_rose(0.01), Signature((0,), (-1,), (CLOSED_END,), 0), np.array([3.0, 0.01]))
    u = np.array([0.0, 0.0, 3.0, 5.0])
    problem.start(u)
    problem.evaluate(u)
    for _ in range(8):  # errors that moves of meshes do not lessen
        places = problem.mesh[0].copy()
        problem._errors[:] = 1.0
        problem._errors[3] = problem._worst = 20.0
        assert not problem.refine()
    assert problem.mesh[0] == pytest.approx(np.insert(places, 4, 0.5 * (places[3] + places[4])))
    assert problem.mesh[1][-1] == problem.mesh[0].size
    assert np.isfinite(problem.evaluate(u)[1]).all()


@pytest.mark.parametrize("r", guarding([0.005]))
def test_a_turn_on_a_canard_is_a_saddle_node_where_shooting_finds_the_turn(r):
    rest = saltus.find_equilibrium(hindmarsh_rose(r), x0=[-1.3, -7.5, 1.2])
    branch = saltus.continue_equilibrium(rest, "I", bounds=(0.0, 6.0))
    born = saltus.switch_branch(branch["HB1"])
    cycles = saltus.continue_orbit(born, "I", (0.0, 6.0), steps=saltus.StepControl(max_points=110))
    assert cycles.audit.passed
    assert not cycles.audit.remarks  # the parameter rests there within 1e-9, but the cycles are no family
    turn = max(cycles.special_points.of_type("SN"), key=lambda point: point.orbit.period)
    assert turn.orbit.period == pytest.approx(331.02, abs=0.01)
    # the whole way onto the canard and back takes some hundred points
    assert np.any((cycles.period < 200.0) & (cycles.values > 1.3))
    orbit, found = turn.orbit, []
    for period in orbit.period + np.array([0.0, -1.0, 0.1]):

        def gap(u, period=period):
            run = solve_ivp(
                lambda t, x: [x[1] - x[0] ** 3 + 3 * x[0] ** 2 - x[2] + u[2], 1 - 5 * x[0] ** 2 - x[1],
                              r * (4 * (x[0] + 1.6) - x[2])],
                (0, period), [orbit.x0[0], u[0], u[1]], rtol=1e-12, atol=1e-13, method="DOP853",
            )  # fmt: skip
            return run.y[:, -1] - [orbit.x0[0], u[0], u[1]]

        u = fsolve(gap, [*orbit.x0[1:3], orbit.parameters["I"]], xtol=1e-13, full_output=True)[0]
        assert np.max(np.abs(gap(u))) < 1e-6  # which shooting magnifies 1e6 times on the way
        found.append(u[2])
    assert turn.parameters["I"] == pytest.approx(found[0], rel=1e-9)
    assert found[0] < min(found[1:]) + 1e-8  # the error of shooting
    assert found[0] < max(found[1:])


def test_pieces_on_planes_have_the_tangent_of_pieces_with_shares_of_the_period():
    """A cut that keeps its place moves along the orbit, over one that keeps its share of the period, by the time that
    the durations before it lose."""
    count, rest = 4, saltus.find_equilibrium(hindmarsh_rose(0.01), x0=[-1.3, -7.5, 1.2])
    born = saltus.switch_branch(saltus.continue_equilibrium(rest, "I", bounds=(0.0, 6.0))["HB1"])
    whole, n = born.problem(), 3
    u = born.unknowns
    whole.resolve(u)
    whole.survey(u)
    starts = [u[:n], *(whole.state_on(0, clustered(i / count)) for i in range(1, count))]
    form = Signature((0,) * count, (-1,) * count, (CLOSED_END,) + (CUT_END,) * (count - 1), 0)
    problem = OrbitProblem(whole.system, form, whole.parameters_at(u), (0,), np.ones(1))
    cut = np.append(np.concatenate([np.append(x, u[n] / count) for x in starts]), born.parameters["I"])
    problem.start(cut)
    shares = null_vector(problem.resolve(cut)[1])
    problem.fix_phase(cut, problem.survey(cut), cuts=True)
    planes = null_vector(problem.evaluate(cut)[1])
    assert np.max(np.abs(problem.evaluate(cut)[0][n :: n + 1])) == 0.0
    assert problem.facings(cut) == pytest.approx(np.ones(count))
    moved = transferred(problem, cut, shares)
    assert moved * np.sign(moved @ planes) / np.linalg.norm(moved) == pytest.approx(planes, abs=1e-7)
    assert moved[n:-1:4].sum() == pytest.approx(shares[n:-1:4].sum(), rel=1e-9)


def null_vector(J):
    return np.linalg.svd(J)[2][-1]


def rates(x, p):
    """Hindmarsh and Rose's field, for SciPy."""
    return np.array([x[1] - x[0] ** 3 + 3 * x[0] ** 2 - x[2] + p["I"], 1 - 5 * x[0] ** 2 - x[1],
                     p["r"] * (4 * (x[0] + 1.6) - x[2])])  # fmt: skip


@pytest.fixture(scope="module")
def bursting():
    return saltus.find_orbit(hindmarsh_rose(0.005), {"I": 1.49}, x0=[-1.0, -4.0, 1.7])


def test_a_look_at_implicit_steps_that_are_not_taken_moves_no_mesh(bursting):
    problem, u = bursting.problem(), bursting.unknowns
    problem.start(u)
    problem.resolve(u)
    assert not problem.stiff
    places, errors, worst = problem.mesh[0].copy(), problem._errors.copy(), problem.worst
    problem._looked = 0
    assert problem.steps > 500  # so that the look is taken
    assert not problem.stabilise(u)
    assert np.array_equal(problem.mesh[0], places)
    assert np.array_equal(problem._errors, errors)
    assert problem.worst == worst
    problem.prepare(u)
    F, J = problem.evaluate(u)
    assert np.abs(F).max() < 1e-9
    assert np.isfinite(J).all()


@pytest.mark.campaign
def test_bursts_go_on_behind_the_canard_at_which_they_lose_a_spike(bursting):
    steps = saltus.StepControl(max_points=16)
    branch = saltus.continue_orbit(bursting, "I", (1.0, 2.0), directions="up", steps=steps)
    assert branch.stopped[1].endswith("16 points")
    assert distance(branch.solution(15), rates, "I", pieces=24) < 1e-9


@pytest.mark.parametrize("r", guarding([0.005, 0.01]))
def test_branch_adds_and_loses_spikes_at_canard_after_canard(r):
    rest = saltus.find_equilibrium(hindmarsh_rose(r), x0=[-1.3, -7.5, 1.2])
    born = saltus.switch_branch(saltus.continue_equilibrium(rest, "I", bounds=(0.0, 6.0))["HB1"])
    branch = saltus.continue_orbit(born, "I", (0.0, 6.0))
    assert not branch.audit.breaches
    assert branch.stopped[1].endswith("the cycle shrinks to an equilibrium")
    if r == 0.005:  # towards a homoclinic orbit that passes its equilibrium twice
        assert "the period grows without bound" in branch.stopped[0]
        assert branch.period.max() > 1000.0
        assert np.ptp(branch.values) > 1.2
    else:
        assert branch.stopped[0].endswith("the period halves")
    rows = np.flatnonzero(branch.period < 400.0)[5:-5]  # without those at which two branches meet
    for row in rows[np.linspace(0, rows.size - 1, 12).astype(int)]:
        assert distance(branch.solution(int(row)), rates, "I", pieces=40) < 1e-8
