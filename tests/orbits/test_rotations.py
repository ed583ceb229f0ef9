"""Orbits of states on a circle: rotations and swings, against closed forms and SciPy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

from saltus import (
    ConvergenceError,
    HybridSystem,
    InputError,
    Mode,
    Transition,
    continue_equilibrium,
    continue_orbit,
    diagram,
    find_equilibrium,
    find_orbit,
    load,
    solve_orbit,
    switch_branch,
)
from saltus.errors import DefinitionError

TURN = 2.0 * math.pi
JUNCTION = HybridSystem.smooth({"phi": "I - sin(phi)"}, {"I": 1.5}, angles=("phi",), name="junction")
PENDULUM = HybridSystem.smooth(
    {"phi": "v", "v": "I - c*v - sin(phi)"}, {"c": 0.3, "I": 0.8}, angles=("phi",), name="pendulum"
)
FORCED = HybridSystem.smooth(
    {"phi": "v", "v": "g*cos(s) - v/q - sin(phi)"}, {"g": 1.35, "q": 2.0, "w": 2 / 3}, phase=("s", "w"),
    angles=("phi",), name="forced pendulum",
)  # fmt: skip


def followed(field, x, time):
    """The end of a motion, by SciPy."""
    return solve_ivp(field, (0.0, time), x, rtol=1e-12, atol=1e-13, method="DOP853").y[:, -1]


def circle(difference):
    """A difference of angles, taken on the circle."""
    return (np.asarray(difference) + math.pi) % TURN - math.pi


def forced_field(g):
    return lambda t, y: [y[1], g * math.cos(2 / 3 * t) - y[1] / 2.0 - math.sin(y[0])]


@pytest.mark.parametrize("current", [1.001, 1.5, 40.0])
@pytest.mark.parametrize("start", [0.3, 0.3 + 200.0 * math.pi, -2.0])
def test_period_of_a_rotating_junction_is_the_closed_form(current, start):
    orbit = find_orbit(JUNCTION, {"I": current}, x0=[start])
    assert orbit.period == pytest.approx(TURN / math.sqrt(current**2 - 1.0), rel=1e-9)
    assert orbit.winding == {"phi": 1}
    assert -math.pi <= orbit.x0[0] < math.pi
    assert orbit.max["phi"] - orbit.min["phi"] == pytest.approx(TURN, abs=1e-9)


def test_rotation_the_other_way_has_winding_number_minus_one():
    orbit = find_orbit(JUNCTION, {"I": -1.5}, x0=[0.3])
    assert orbit.winding == {"phi": -1}
    assert orbit.period == pytest.approx(TURN / math.sqrt(1.25), rel=1e-9)


def test_branch_of_rotations_ends_at_the_saddle_node_on_the_circle():
    branch = continue_orbit(find_orbit(JUNCTION, x0=[0.3]), "I", (0.5, 3.0))
    (point,) = branch.special_points
    assert point.type == "SNIC"
    assert point.parameters["I"] == pytest.approx(1.0, abs=1e-8)
    exact = TURN / np.sqrt(branch.values**2 - 1.0)
    assert branch.period == pytest.approx(exact, rel=1e-5)
    assert all(branch.solution(i).winding == {"phi": 1} for i in (0, len(branch) // 2, -1))


def test_pendulum_under_torque_rotates_and_rests_at_the_same_torque():
    orbit = find_orbit(PENDULUM, x0=[0.0, 3.0])
    end = followed(lambda t, y: [y[1], 0.8 - 0.3 * y[1] - math.sin(y[0])], orbit.x0, orbit.period)
    assert end - orbit.x0 == pytest.approx([TURN, 0.0], abs=1e-8)
    assert orbit.observe("mean(v)")["mean(v)"] == pytest.approx(TURN / orbit.period, rel=1e-10)
    # the power of the torque is the loss: I <v> = c <v^2>
    assert 0.3 * orbit.observe("mean(v**2)")["mean(v**2)"] == pytest.approx(0.8 * TURN / orbit.period, rel=1e-8)
    with pytest.raises(ConvergenceError, match="comes to rest"):
        find_orbit(PENDULUM, x0=[0.8, 0.0])


def homoclinic_torque(c):
    """The torque at which the manifolds of the upper equilibrium meet over a turn, by SciPy."""

    def miss(torque):
        def field(_, y):
            return [y[1], torque - c * y[1] - math.sin(y[0])]

        top = math.pi - math.asin(torque)
        values, vectors = np.linalg.eig([[0.0, 1.0], [-math.cos(top), -c]])
        slopes = {np.sign(value): vector[1] / vector[0] for value, vector in zip(values, vectors.T, strict=True)}
        speeds = []
        for start, time in (
            ((top - TURN + 1e-7, 1e-7 * slopes[1.0]), 200.0),
            ((top - 1e-7, -1e-7 * slopes[-1.0]), -200.0),
        ):

            def half_way(_, y, top=top):
                return y[0] - top + math.pi

            half_way.terminal = True
            found = solve_ivp(field, (0, time), start, events=half_way, rtol=1e-12, atol=1e-14, method="DOP853")
            speeds.append(found.y[1, -1])
        return speeds[0] - speeds[1]

    return brentq(miss, 0.9 * 4.0 * c / math.pi, 1.1 * 4.0 * c / math.pi, xtol=1e-13)


@pytest.mark.campaign
@pytest.mark.parametrize(("c", "start"), [(0.3, 0.0), (0.3, 2.5), (0.1, 0.0)])
def test_rotations_end_at_the_homoclinic_orbit_round_the_circle(c, start):
    orbit = find_orbit(PENDULUM, {"c": c}, x0=[start, 3.0])
    branch = continue_orbit(orbit, "I", (0.05, 1.5))
    (point,) = branch.special_points
    assert point.type == "HOM"
    assert point.parameters["I"] == pytest.approx(homoclinic_torque(c), abs=1e-8)


@pytest.mark.parametrize(("g", "winding", "turns"), [(0.9, 0, 1), (1.35, -1, 1), (1.45, -2, 2)])
def test_forced_pendulum_swings_or_rotates_with_its_drive(g, winding, turns):
    orbit = find_orbit(FORCED, {"g": g}, x0=[0.0, 0.0])
    assert orbit.winding == {"phi": winding}
    assert orbit.form.turns == turns
    end = followed(forced_field(g), orbit.x0, turns * 3.0 * math.pi)
    assert end - orbit.x0 == pytest.approx([TURN * winding, 0.0], abs=1e-7)


def test_solve_orbit_takes_the_turns_from_the_guess():
    orbit = find_orbit(FORCED, x0=[0.0, 0.0])
    same = solve_orbit(FORCED, x0=np.array(orbit.x0) + np.array([6.0 * math.pi + 0.01, 0.01]), period=orbit.period)
    assert same.winding == {"phi": -1}
    assert same.x0 == pytest.approx(orbit.x0, abs=1e-9)


@pytest.mark.campaign
def test_period_doubling_of_a_rotation_doubles_its_turns():
    orbit = find_orbit(FORCED, x0=[0.0, 0.0])
    branch = continue_orbit(orbit, "g", (1.3, 1.46))
    point = next(point for point in branch.special_points if point.type == "PD")

    def misses(u):
        """The fixed point of the map of a period, and a multiplier -1, by differences."""
        x, g = np.array(u[:2]), u[2]

        def image(y):
            return followed(forced_field(g), y, 3.0 * math.pi)

        steps = 1e-4 * np.eye(2)
        slope = np.array([(image(x + h) - image(x - h)) / 2e-4 for h in steps]).T
        return [*circle(image(x) - x), np.linalg.det(slope + np.eye(2))]

    exact = fsolve(misses, [*point.orbit.x0, point.parameters["g"]], xtol=1e-10)
    assert point.parameters["g"] == pytest.approx(exact[2], abs=1e-6)
    assert switch_branch(point).winding == {"phi": -2}


@pytest.mark.campaign
def test_branch_of_junction_equilibria_closes_round_the_circle():
    found = find_equilibrium(JUNCTION, {"I": 0.5}, x0=[math.pi - 0.5 + 40.0 * math.pi])
    assert found.state[0] == pytest.approx(math.pi - math.asin(0.5), abs=1e-13)
    branch = continue_equilibrium(found, "I", (-2.0, 2.0))
    assert sorted(point.parameters["I"] for point in branch.special_points) == pytest.approx([-1.0, 1.0], abs=1e-9)
    assert branch.stopped == ("the branch is closed", "the branch is closed")
    assert (
        len(diagram(JUNCTION, "I", (-2.0, 2.0), parameters={"I": 0.5}, x0=[[0.5], [2.6], [0.5 + 4.0 * math.pi]])) == 1
    )


KICKED = HybridSystem(
    ("phi", "v"), {"c": 0.2, "I": 0.5, "k": 0.3},
    {"free": Mode({"phi": "v", "v": "I - c*v"})},
    [Transition("free", "free", "sin(phi - 1)", 1, {"v": "v - k*v"}, when="cos(phi - 1)", name="kick")],
    angles=("phi",), name="kicked rotor",
)  # fmt: skip


def test_rotor_that_is_braked_once_a_turn_has_the_closed_form():
    orbit = find_orbit(KICKED, x0=[0.0, 2.0])
    assert orbit.winding == {"phi": 1}
    assert orbit.signature == (("free", "kick"),)

    def turn(v0):
        """Angle gone when the speed is such that the brake restores it."""
        after, time = v0, math.log((v0 / 0.7 - 2.5) / (v0 - 2.5)) / -0.2
        return 2.5 * time + (after - 2.5) * (1.0 - math.exp(-0.2 * time)) / 0.2 - TURN

    exact = brentq(turn, 0.6, 1.74)
    assert orbit.segments[0].state == pytest.approx([1.0, exact], abs=1e-9)
    branch = continue_orbit(orbit, "I", (0.45, 0.7))
    assert branch.solution(-1).winding == {"phi": 1}


def test_two_rounds_of_a_rotation_are_one_orbit():
    orbit = find_orbit(FORCED, x0=[0.0, 0.0])
    twice = solve_orbit(FORCED, x0=orbit.x0, period=2.0 * orbit.period)
    assert twice.rounds == 2
    assert twice.winding == {"phi": -2}
    pendulum = find_orbit(PENDULUM, x0=[0.0, 3.0])
    assert solve_orbit(PENDULUM, x0=pendulum.x0, period=3.0 * pendulum.period).rounds == 3


def test_three_locked_oscillators_turn_with_the_mean_frequency():
    """Kuramoto's model: couplings cancel in the sum, so that all turn with the mean of the frequencies."""
    system = HybridSystem.smooth(
        {
            "a": "-d + K/3*(sin(b - a) + sin(c - a))",
            "b": "K/3*(sin(a - b) + sin(c - b))",
            "c": "d + K/3*(sin(a - c) + sin(b - c)) + 0.3",
        },
        {"d": 0.5, "K": 0.4}, angles=("a", "b", "c"),
    )  # fmt: skip
    orbit = find_orbit(system, {"K": 3.0}, x0=[0.0, 0.1, 0.2])
    assert orbit.period == pytest.approx(TURN / 0.1, rel=1e-8)
    assert orbit.winding == {"a": 1, "b": 1, "c": 1}


def test_rotations_are_kept_in_files(tmp_path):
    orbit = find_orbit(PENDULUM, x0=[0.0, 3.0])
    orbit.save(tmp_path / "orbit.nc")
    kept = load(tmp_path / "orbit.nc")
    assert kept.system == PENDULUM
    assert kept.system.angles == ("phi",)
    assert kept.winding == {"phi": 1}
    assert "angles      phi, modulo 2 pi" in repr(PENDULUM)
    plain = HybridSystem.smooth({"phi": "I - sin(phi)"}, {"I": 1.5}, name="junction")
    assert "angles" not in plain.definition()
    assert plain != JUNCTION


def test_observables_that_grow_with_a_rotation_are_refused():
    orbit = find_orbit(PENDULUM, x0=[0.0, 3.0])
    assert orbit.observe("max(cos(phi))")["max(cos(phi))"] == pytest.approx(1.0, abs=1e-12)
    for ask in (orbit.observe, lambda name: orbit.sensitivity([name])):
        with pytest.raises(InputError, match=r"which rotates on this orbit; write cos\(phi\)"):
            ask("mean(phi)")
    swing = find_orbit(FORCED, {"g": 0.9}, x0=[0.0, 0.0])
    assert abs(swing.observe("mean(phi)")["mean(phi)"]) < 1e-6


@pytest.mark.parametrize(
    ("field", "angle"),
    [({"phi": "I - phi"}, "phi"), ({"phi": "sin(phi/2)"}, "phi"), ({"phi": "sin(I*phi)"}, "phi"),
     ({"phi": "1e-7*I*phi"}, "phi")],
)  # fmt: skip
def test_fields_without_the_period_are_refused(field, angle):
    with pytest.raises(DefinitionError, match="mode 'smooth' = .*of period 2 pi in the angle 'phi'"):
        HybridSystem.smooth(field, {"I": 1.0}, angles=(angle,))


def test_what_is_no_angle_is_refused_with_a_cure():
    field = {"phi": "v", "v": "-sin(phi)"}
    with pytest.raises(DefinitionError, match=r"event 'sin\(phi - a\)', when='cos\(phi - a\)'"):
        HybridSystem(
            ("phi", "v"), {}, {"free": Mode(field)}, [Transition("free", "free", "phi - pi", 1)], angles=("phi",)
        )
    with pytest.raises(DefinitionError, match="did you mean 'phi'"):
        HybridSystem.smooth(field, {}, angles=("phj",))
    with pytest.raises(DefinitionError, match="output 'E'"):
        HybridSystem.smooth(field, {}, outputs={"E": "phi**2"}, angles=("phi",))
    with pytest.raises(DefinitionError, match="the phase is an angle already"):
        HybridSystem.smooth(field, {"w": 1.0}, phase=("s", "w"), angles=("s",))
    with pytest.raises(DefinitionError, match="put it into a list"):
        HybridSystem.smooth(field, {}, angles="phi")
    turned = HybridSystem(
        ("phi", "v"), {}, {"free": Mode(field)},
        [Transition("free", "free", "sin(phi)", 1, {"phi": "2*phi + pi"})], angles=("phi",),
    )  # fmt: skip
    assert turned.angles == ("phi",)


def test_the_multipliers_of_slow_rotations_are_those_of_liouville():
    branch = continue_orbit(find_orbit(PENDULUM, x0=[0.0, 3.0]), "I", (0.373480, 0.9))
    periods, multipliers = branch.period, branch.multipliers[:, 0].real
    assert periods.max() > 16.0
    assert multipliers == pytest.approx(np.exp(-0.3 * periods), rel=2e-8)


@pytest.mark.parametrize("rate", [1.2, -1.2, 1.2e9, -1.2e-9])
def test_a_uniform_rotation_is_an_orbit_of_one_turn(rate):
    """Its steps grow without bound: nothing bends the motion."""
    orbit = find_orbit(HybridSystem.smooth({"u": f"{rate!r}"}, {}, angles=("u",)), x0=[0.4])
    assert orbit.period == pytest.approx(2.0 * math.pi / abs(rate), rel=1e-10)
    assert orbit.winding == {"u": math.copysign(1, rate)}


@pytest.mark.parametrize("start", [0.0, 1e-13, 3.0])
@pytest.mark.parametrize("p", [0.05, -0.15])
def test_a_locked_pair_of_rotations_has_the_multiplier_of_its_phase_difference(p, start):
    """The difference d of the angles obeys d' = 2 p - 2 k sin d, and both turn at the mean rate 1.2."""
    k = 0.2
    pair = HybridSystem.smooth(
        {"u": "1.2 + p - k*sin(u - q)", "q": "1.2 - p - k*sin(q - u)"}, {"p": p, "k": k}, angles=("u", "q")
    )
    orbit = find_orbit(pair, x0=[start, start + 0.3])
    period = 2.0 * math.pi / 1.2
    assert orbit.period == pytest.approx(period, rel=1e-9)
    moduli = sorted(np.abs(orbit.multipliers))
    assert moduli == pytest.approx([math.exp(-2.0 * k * math.cos(math.asin(p / k)) * period), 1.0], rel=1e-6)
