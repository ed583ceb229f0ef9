"""Branches along a quantity of the orbits: backbone curves, parameters that reach a value, events of observables."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import ellipk

from saltus import (
    HybridSystem,
    InputError,
    Mode,
    StepControl,
    Transition,
    continue_family,
    continue_locus,
    continue_orbit,
    follow_cascade,
    load,
    solve_orbit,
    switch_branch,
)

HENON = {"x": "u", "y": "v", "u": "-x - 2*x*y", "v": "-y - x**2 + y**2"}
ENERGY = "(u**2 + v**2 + x**2 + y**2)/2 + x**2*y - y**3/3"


@pytest.fixture(scope="module")
def swinging():
    system = HybridSystem.smooth({"x": "v", "v": "-sin(x)"}, outputs={"energy": "v**2/2 - cos(x)"})
    return solve_orbit(system, x0=[1.0, 0.0], period=6.7, fix={"max_x": 1.0})


@pytest.fixture(scope="module")
def jumping():
    flight, hit = Mode({"z": "v", "v": "-g"}), Transition("flight", "flight", "z", -1, {"v": "-e*v"}, name="hit")
    ball = HybridSystem(("z", "v"), {"g": 1.0, "e": 1.0}, {"flight": flight}, [hit])
    return solve_orbit(ball, {}, [("flight", "hit", [0.0, 1.0], 2.0)], fix={"period": 3.0})


@pytest.fixture(scope="module")
def driven():
    field = {"x": "v", "v": "-0.1*v - x - x**3 + A*cos(s)"}
    system = HybridSystem.smooth(field, {"A": 0.3, "w": 1.2}, phase=("s", "w"))
    return solve_orbit(system, x0=[0.5, 0.0], fix={"max_x": 0.6}, free="A")


@pytest.fixture(scope="module")
def response(driven):
    """Orbits along the quantity max_x, the drive A freed, and along A itself."""
    events = {"A": 0.3, "amplitude(x, 1)": 1.0, "phase(x, 1)": 0.5, "mean(x**2)": 0.5}
    freed = continue_orbit(driven, "max_x", (0.05, 1.3), events=events)
    del events["A"]
    events |= {"max_x": 0.9, "max(x*v)": 0.3}
    return freed, continue_orbit(driven, "A", (0.001, 1.0), events=events)


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("quantity", "bounds"),
    [("max_x", (0.1, 3.1)), ("period", (6.3, 20.0)), ("energy", (-0.99, 0.99)), ("amplitude(x, 1)", (0.1, 2.5))],
)
def test_a_backbone_curve_of_the_pendulum_is_one_call(swinging, quantity, bounds):
    branch = continue_orbit(swinging, quantity, bounds)
    periods = 4.0 * ellipk(np.sin(0.5 * branch.column("max_x")) ** 2)
    assert branch.period == pytest.approx(periods, rel=1e-9)
    assert (branch.values[0], branch.values[-1]) == pytest.approx(bounds, rel=1e-12)
    assert branch.column(quantity) == pytest.approx(branch.values, rel=1e-10)
    assert (branch.stable.all(), branch.admissible.all(), len(branch.special_points)) == (True, True, 0)
    assert np.all(np.isnan(branch.freed))


@pytest.mark.parametrize(
    ("quantity", "rest", "high"), [("period", 2.0 * math.pi, 7.0), ("energy", -1.0, 0.0), ("max_x", 0.0, 1.2)]
)
def test_a_family_ends_at_the_rest_to_which_it_shrinks(swinging, quantity, rest, high):
    branch = continue_orbit(swinging, quantity, (rest - 0.5, high))
    end = branch.special_points.of_type("HB")[0]
    assert end.value(quantity) == pytest.approx(rest, abs=1e-12)
    assert end.orbit.period == pytest.approx(2.0 * math.pi, rel=1e-9)


def test_jumps_of_an_elastic_ball_along_their_period(jumping):
    branch = continue_orbit(jumping, "period", (0.5, 10.0), events={"mean(z)": 0.3, "max_z": 1.0})
    assert branch.column("max_z") == pytest.approx(branch.period**2 / 8.0, rel=1e-12)
    assert branch["mean(z)1"].orbit.period == pytest.approx(math.sqrt(0.3 * 12.0), rel=1e-9)
    assert branch["max_z1"].orbit.period == pytest.approx(math.sqrt(8.0), rel=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize("free", [None, "c"])
def test_a_hardening_spring_in_micrometres_and_microseconds(free):
    system = HybridSystem.smooth({"x": "v", "v": "-k*x - b*x**3 + c*v"}, {"k": 1e12, "b": 1e30, "c": 0.0})
    orbit = solve_orbit(system, x0=[1e-9, 0.0], period=5e-6, fix={"max_x": 1.5e-9}, free=free)
    branch = continue_orbit(orbit, "max_x", (1e-10, 4e-9))
    a = branch.values * 1e9
    wanted = 4.0 * ellipk(a * a / (2.0 * (1.0 + a * a))) / np.sqrt(1.0 + a * a)
    assert branch.period * 1e6 == pytest.approx(wanted, rel=1e-9)
    assert np.array_equal(branch.freed, np.full(len(branch), 0.0 if free else np.nan), equal_nan=True)


def test_an_asymmetric_potential_has_the_period_of_its_quadrature():
    """x'' = -x - 0.4 x^2: the period as an integral between the turning points."""
    system = HybridSystem.smooth({"x": "v", "v": "-x - 0.4*x**2"}, outputs={"energy": "v**2/2 + x**2/2 + 0.4*x**3/3"})
    orbit = solve_orbit(system, x0=[0.3, 0.0], period=6.3, fix={"max_x": 0.3})
    branch = continue_orbit(orbit, "energy", (0.01, 0.6))
    for i in range(0, len(branch), 7):
        roots = np.sort(np.roots([0.4 / 3.0, 0.5, 0.0, -branch.values[i]]).real)
        far, low, high = roots
        middle, half = 0.5 * (low + high), 0.5 * (high - low)

        def slowness(angle, far=far, middle=middle, half=half):
            return 1.0 / math.sqrt(2.0 * 0.4 / 3.0 * (middle + half * math.sin(angle) - far))

        assert branch.period[i] == pytest.approx(
            2.0 * quad(slowness, -math.pi / 2, math.pi / 2, epsabs=1e-13)[0], rel=1e-9
        )


def test_the_straight_mode_of_henon_and_heiles_bifurcates_where_brack_has_it():
    """Brack, Found. Phys. 31 (2001) 209: the orbit A gives birth to R5 and L6 at 6 E = 0.969309 and 0.986709."""
    system = HybridSystem.smooth(HENON, outputs={"energy": ENERGY})
    orbit = solve_orbit(system, x0=[0.0, 0.4, 0.0, 0.0], period=6.6, fix={"energy": 0.05})
    branch = continue_orbit(orbit, "energy", (0.01, 0.1657))
    born = [6.0 * point.value("energy") for point in branch.special_points.of_type("BP")]
    assert born == pytest.approx([0.969309, 0.986709], abs=1e-6)
    assert branch.lows[:, -1] == pytest.approx(branch.highs[:, -1], rel=1e-10)
    after = branch["PD1"].position
    assert branch.stable[: math.floor(after)].all()
    assert not branch.stable[math.ceil(after)]


@pytest.mark.campaign
def test_a_mode_of_two_coupled_oscillators_closes_in_another_solver():
    field = {"x": "u", "y": "v", "u": "-x - x**3 - k*(x - y)", "v": "-y - k*(y - x)"}
    energy = "(u**2 + v**2 + x**2 + y**2)/2 + x**4/4 + k*(x - y)**2/2"
    system = HybridSystem.smooth(field, {"k": 0.2}, outputs={"energy": energy})
    orbit = solve_orbit(system, x0=[0.3, 0.3, 0.0, 0.0], period=6.2, fix={"energy": 0.1})
    branch = continue_orbit(orbit, "energy", (0.01, 20.0))

    def flow(t, z):
        x, y, u, v = z
        return [u, v, -x - x**3 - 0.2 * (x - y), -y - 0.2 * (y - x)]

    for i in range(0, len(branch), 20):
        one = branch.solution(i)
        start = one.states[0]
        end = solve_ivp(flow, (0.0, one.period), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        assert np.abs(end - start).max() < 1e-9 * np.abs(one.highs).max()
        assert one.max["energy"] - one.min["energy"] < 1e-10 * one.max["energy"]


@pytest.mark.campaign
def test_a_family_goes_on_through_a_grazing_at_an_elastic_wall():
    wall = Transition("free", "free", "x - d", 1, {"v": "-v"}, name="wall")
    system = HybridSystem(("x", "v"), {"d": 1.0}, {"free": Mode({"x": "v", "v": "-x"})}, [wall])
    orbit = solve_orbit(system, {}, [("free", None, [0.5, 0.0], 6.2)], fix={"max_x": 0.5})
    branch = continue_orbit(orbit, "min_x", (-4.0, -0.2))
    amplitude = -branch.values
    hit = amplitude > 1.0
    assert branch["GR1"].value("min_x") == pytest.approx(-1.0, rel=1e-9)
    wanted = 2.0 * math.pi - 2.0 * np.arccos(1.0 / amplitude[hit])
    assert branch.period[hit] == pytest.approx(wanted, rel=1e-9)
    assert branch.period[~hit] == pytest.approx(2.0 * math.pi, rel=1e-10)
    assert (branch.signature(0), branch.signature(-1)) == ((("free", "wall"),), (("free", ""),))


@pytest.mark.campaign
def test_a_freed_parameter_follows_the_branch_along_that_parameter(response):
    freed, plain = response
    assert [p.type for p in freed.special_points.of_type("SN", "TP")] == ["SN", "SN"]
    ours = sorted(p.parameters["A"] for p in freed.special_points.of_type("SN"))
    assert ours == pytest.approx(sorted(p.parameters["A"] for p in plain.special_points.of_type("SN")), rel=1e-9)
    assert freed["A1"].parameters["A"] == pytest.approx(0.3, rel=1e-9)
    for i in range(0, len(freed), 25):
        one = freed.solution(i)
        again = solve_orbit(one.system, {"A": freed.column("A")[i]}, x0=one.x0, period=one.period)
        assert again.max["x"] == pytest.approx(freed.values[i], rel=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["amplitude(x, 1)", "phase(x, 1)", "mean(x**2)"])
def test_events_of_observables_are_located_along_either(response, name):
    wanted = {"amplitude(x, 1)": 1.0, "phase(x, 1)": 0.5, "mean(x**2)": 0.5}[name]
    places = []
    for branch in response:
        points = branch.special_points.of_type(name)
        assert [point.orbit.observe(name)[name] for point in points] == pytest.approx([wanted] * len(points), rel=1e-9)
        places.append([point.parameters["A"] for point in points])
    assert places[0] == pytest.approx(places[1], rel=1e-9)
    assert len(places[0]) == 1


@pytest.mark.campaign
def test_an_event_of_any_expression_is_located(response):
    _, plain = response
    point = plain["max(x*v)1"]
    assert point.orbit.observe("max(x*v)")["max(x*v)"] == pytest.approx(0.3, rel=1e-9)


def test_a_phase_that_jumps_by_a_turn_is_no_event(driven):
    branch = continue_orbit(driven, "A", (0.001, 1.0), events={"phase(x, 1)": 0.5 - math.pi})
    assert branch.special_points.of_type("phase(x, 1)") == []


def test_shares_of_time_periods_and_speeds_are_events():
    free, wall = Mode({"x": "v", "v": "-x - 0.1*v + A*cos(s)"}), {"v": "v"}
    contact = Mode({"x": "v", "v": "-x - 0.1*v + A*cos(s) - 20*(x - 1)"})
    hits = [
        Transition("free", "contact", "x - 1", 1, wall, name="in"),
        Transition("contact", "free", "x - 1", -1, wall, name="out"),
    ]
    modes = {"free": free, "contact": contact}
    system = HybridSystem(("x", "v"), {"A": 0.1, "w": 0.8}, modes, hits, phase=("s", "w"))
    orbit = solve_orbit(system, {}, [("free", "s", [0.27, 0.0], 2.0 * math.pi / 0.8)])
    events = {"fraction(contact)": 0.05, "velocity(in)": 0.2, "period": 7.0}
    branch = continue_orbit(orbit, "A", (0.05, 0.8), events=events)
    for name in ("fraction(contact)", "velocity(in)"):
        for point in branch.special_points.of_type(name):
            assert point.orbit.observe(name)[name] == pytest.approx(events[name], rel=1e-9)
        assert branch.special_points.of_type(name)
    along = continue_orbit(orbit, "w", (0.7, 1.0), events=events, stop_at="period")
    assert along["period1"].parameters["w"] == pytest.approx(2.0 * math.pi / 7.0, rel=1e-9)


@pytest.mark.campaign
def test_a_file_keeps_a_branch_along_a_quantity(response, swinging, tmp_path):
    half = continue_orbit(swinging, "period", (6.0, 9.0), events={"mean(v**2)": 0.3})
    rare = continue_orbit(swinging, "amplitude(x, 1)", (0.9, 1.1))
    for branch in (response[0], half, rare):
        branch.save(tmp_path / "branch.nc")
        again = load(tmp_path / "branch.nc")
        assert (again.parameter, again.fixed) == (branch.parameter, branch.fixed)
        assert np.array_equal(again.values, branch.values)
        assert np.array_equal(again.freed, branch.freed, equal_nan=True)
        for ours, theirs in zip(branch.special_points, again.special_points, strict=True):
            assert (ours.label, ours.orbit.fixed) == (theirs.label, theirs.orbit.fixed)
            assert dict(ours.parameters) == dict(theirs.parameters)
        assert again.solution(3).fixed == branch.solution(3).fixed
        assert again.solution(3).residual < 1e-10
        assert again.special_points.to_dataframe().shape == branch.special_points.to_dataframe().shape


def test_a_branch_goes_on_from_an_orbit_of_another(swinging):
    last = continue_orbit(swinging, "max_x", (0.5, 1.5)).solution(-1)
    branch = continue_orbit(last, "period", (7.0, 9.0))
    assert branch.period == pytest.approx(4.0 * ellipk(np.sin(0.5 * branch.column("max_x")) ** 2), rel=1e-10)


@pytest.mark.campaign
def test_cycles_shrink_to_their_hopf_point_along_their_size():
    system = HybridSystem.smooth({"x": "v", "v": "mu*v - x - x**2*v"}, {"mu": 0.5})
    orbit = solve_orbit(system, x0=[1.2, 0.0], period=6.3, fix={"max_x": 1.0}, free="mu")
    branch = continue_orbit(orbit, "max_x", (-1.0, 3.0))
    assert branch["HB1"].parameters["mu"] == pytest.approx(0.0, abs=1e-12)
    assert branch["HB1"].orbit.period == pytest.approx(2.0 * math.pi, rel=1e-12)


@pytest.mark.campaign
def test_a_freed_parameter_keeps_to_its_bounds():
    field = {"x": "v", "v": "-0.1*v - x - x**3 + A*cos(s)"}
    system = HybridSystem.smooth(field, {"A": 0.3, "w": 1.2}, phase=("s", "w"), positive=["A"])
    orbit = solve_orbit(system, x0=[-0.6, 0.1], fix={"max_x": 0.3}, free="A")
    branch = continue_orbit(orbit, "max_x", (-0.3, 0.4))
    assert np.all(branch.freed > 0.0)
    assert branch.freed[0] < 1e-4


@pytest.mark.campaign
def test_a_quantity_that_turns_has_a_turning_point():
    """x'' = -x + x^3 - 0.4 x^5: the period grows with the amplitude, then falls."""
    system = HybridSystem.smooth({"x": "v", "v": "-x + x**3 - 0.4*x**5"})
    orbit = solve_orbit(system, x0=[0.5, 0.0], period=6.9, fix={"max_x": 0.5})
    along = continue_orbit(orbit, "max_x", (0.1, 2.0))
    turned = continue_orbit(orbit, "period", (6.3, 12.0), directions="up", steps=StepControl(largest=0.05))
    top = turned["TP1"].value("period")
    assert top == pytest.approx(along.period.max(), rel=1e-3)
    assert top >= along.period.max() * (1.0 - 1e-9)


BAD = [
    (("max_q", (0.1, 1.0)), {}, "quantity = 'max_q'"),
    (("max_x", (1.5, 2.0)), {}, "an interval that holds the start, max_x = 1"),
    (("max_x", (2.0, 1.5)), {}, "bounds"),
    (("max_x", (0.1, 1.5)), {"directions": "left"}, "directions"),
    (("max_x", (0.1, 1.5)), {"events": {"mean(q)": 1.0}}, "q"),
    (("max_x", (0.1, 1.5)), {"stop_at": "XY"}, "stop_at"),
    (("v", (0.1, 1.5)), {}, "an interval that holds the start|constant"),
]


@pytest.mark.parametrize(("arguments", "options", "message"), BAD)
def test_what_cannot_be_used_is_named(swinging, arguments, options, message):
    with pytest.raises(InputError, match=message):
        continue_orbit(swinging, *arguments, **options)


def test_a_quantity_needs_an_orbit_that_was_solved_with_it(driven):
    bare = solve_orbit(driven.system, {"A": 0.3}, x0=[0.5, 0.0])
    with pytest.raises(InputError, match="a quantity varies along orbits that solve_orbit found with fix="):
        continue_orbit(bare, "max_x", (0.1, 2.0))


def test_a_quantity_that_rests_is_told():
    centre = HybridSystem.smooth({"x": "y", "y": "-x"})
    orbit = solve_orbit(centre, x0=[0.5, 0.0], period=6.0, fix={"max_x": 1.0})
    with pytest.raises(InputError, match="a quantity that varies from orbit to orbit; it rests here"):
        continue_orbit(orbit, "period", (1.0, 10.0))


def test_a_family_has_no_branch_along_a_parameter(jumping):
    with pytest.raises(InputError, match="the orbit is one of a family: vary a quantity"):
        continue_orbit(jumping, "g", (0.5, 2.0))


def test_what_follows_parameters_refuses_points_along_quantities(response, swinging):
    point = response[0]["SN1"]
    with pytest.raises(InputError, match="a point of a branch along a parameter; a branch along 'A'"):
        switch_branch(point)
    with pytest.raises(InputError, match="a PD of a branch"):
        follow_cascade(point, (0.1, 1.0))
    with pytest.raises(InputError, match="parameter = 'max_x'"):
        continue_family(point.orbit, "max_x", {"w": [1.2]}, (0.1, 1.0), workers=1)
    with pytest.raises(InputError, match="isolated at its parameters"):
        continue_locus(swinging, ("a", "b"), {}, type="SN")
    assert point.normal_form.type == "SN"


def test_a_family_whose_orbits_are_cut_in_pieces_goes_on():
    """Beyond 1/6 the orbit round which these go twice is so unstable that two rounds are cut."""
    system = HybridSystem.smooth(
        {"x": "u", "y": "v", "u": "-x - 2*x*y", "v": "-y - x**2 + y**2"},
        outputs={"energy": "(u**2 + v**2 + x**2 + y**2)/2 + x**2*y - y**3/3"},
    )
    start = [0.0002004, 0.326403, 0.46545, -9.46628e-05]
    twice = solve_orbit(system, x0=start, period=12.086, fix={"energy": 0.15})
    branch = continue_orbit(twice, "energy", (0.14, 1.0), directions="up")
    assert branch.stopped[1].endswith("bound reached")
    assert {len(form) for form in branch.forms} == {1, 2}
    start, period = branch.solution(len(branch) - 1).states[0], branch.period[-1]
    ends = solve_ivp(
        lambda t, z: [z[2], z[3], -z[0] - 2 * z[0] * z[1], -z[1] - z[0] ** 2 + z[1] ** 2],
        (0.0, period), start, method="DOP853", rtol=1e-13, atol=1e-13,
    ).y[:, -1]  # fmt: skip
    assert np.abs(ends - start).max() < 1e-6
    assert branch.lows[-1, 4] == pytest.approx(1.0, rel=1e-9) == branch.highs[-1, 4]
