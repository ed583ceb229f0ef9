"""Impacts that accumulate: when a motion rests, how exactly, and what is refused."""

import math

import numpy as np
import pytest

import saltus
from saltus import Mode, Transition
from saltus.errors import ChatteringError, DefinitionError
from sliding import table


def ball(g=1.0, height=1.0, rests="rest", reset="-e*v", event="z", direction=-1):
    """Return a ball on a floor, on which it comes to rest."""
    return saltus.HybridSystem(
        ("z", "v"), {"e": 0.5, "g": g}, {"flight": Mode({"z": "v", "v": "-g"}), "rest": Mode({"z": "0", "v": "0"})},
        [
            Transition("flight", "flight", event, direction, {"v": reset}, name="impact", rests=rests,
                       rest_time=1e-5 * math.sqrt(2.0 * height / g) if rests else None),
        ],
        name="ball",
    )  # fmt: skip


@pytest.mark.parametrize("e", [0.2, 0.5, 0.8, 0.95])
@pytest.mark.parametrize(("g", "height"), [(1.0, 1.0), (9.81, 1e-6), (1e-3, 1e5)])
def test_a_ball_rests_after_the_sum_of_its_flights(e, g, height):
    fall = math.sqrt(2.0 * height / g)
    motion = saltus.simulate(ball(g, height), {"e": e}, [height, 0.0], t_end=50.0 * fall)
    (rest,) = motion.events["time"][motion.events["mode_after"] == "rest"]
    assert rest == pytest.approx(fall * (1.0 + e) / (1.0 - e), rel=1e-11)
    assert motion.mode_end == "rest"
    np.testing.assert_allclose(motion.x_end, 0.0, atol=1e-9 * height)


def test_without_being_asked_a_motion_that_accumulates_is_told():
    with pytest.raises(ChatteringError):
        saltus.simulate(ball(rests=None), {}, [1.0, 0.0], t_end=20.0)


@pytest.mark.parametrize(("e", "rests"), [(0.5, 4.1336062005398752), (0.3, 3.7345970187604894)])
def test_the_sum_has_an_error_of_the_order_of_the_cube_of_the_time_left(e, rests):
    begun = math.asin(1.0 / 1.2)
    errors = []
    for left in (0.04, 0.02, 0.01):
        system = table(rest_time=left)
        motion = saltus.simulate(
            system, {"e": e}, [1.0, 1.2 * math.cos(begun), begun], mode="flight", t_end=4.0, tolerance=1e-13
        )
        (rest,) = motion.events["time"][motion.events["mode_after"] == "rest"]
        errors.append(abs(rest + begun - rests))
    assert errors[0] < 1e-4
    assert errors[2] < 0.3 * errors[0]
    finest = saltus.simulate(
        table(), {"e": e}, [1.0, 1.2 * math.cos(begun), begun], mode="flight", t_end=4.0, tolerance=1e-13
    )
    (rest,) = finest.events["time"][finest.events["mode_after"] == "rest"]
    assert rest + begun == pytest.approx(rests, abs=1e-10)


def test_a_rest_ends_where_the_surface_lets_go_and_the_motion_repeats_itself():
    motion = saltus.simulate(table(), {}, [0.0, 5.0], periods=12)
    log = motion.events
    leaves = log["after"][log["name"] == "leave"]
    assert len(leaves) >= 8
    np.testing.assert_allclose(leaves[2:, 2], math.asin(1.0 / 1.2), atol=1e-9)


def test_a_branch_of_orbits_that_rest_has_no_points_where_impacts_are_summed_up():
    orbit = saltus.find_orbit(table(), {}, [0.0, 5.0])
    branch = saltus.continue_orbit(orbit, "e", (0.3, 0.6))
    assert not len(branch.special_points)
    assert all(reason.endswith("bound reached") for reason in branch.stopped)
    counts = {len(branch.solution(i).segments) for i in range(len(branch))}
    assert len(counts) > 3
    index = int(np.argmin(np.abs(branch.values - 0.4)))
    again = saltus.find_orbit(table(), {"e": float(branch.values[index])}, [0.0, 5.0])
    np.testing.assert_allclose(branch.x0[index], again.x0, atol=1e-9)


@pytest.mark.campaign
def test_sweeps_go_through_rests():
    swept = saltus.run_sweep(table(), "a", [1.1, 1.2, 1.3], x0=[0.0, 5.0])
    assert "period-1" in repr(swept)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rests": "bed"}, "a mode to rest in"),
        ({"direction": 0}, "with a direction"),
        ({"reset": "v"}, "turns the velocity of the event back"),
    ],
)
def test_what_does_not_come_to_rest_is_told(change, words):
    with pytest.raises(DefinitionError, match=words):
        ball(**change)


def test_an_impact_that_changes_the_pull_has_no_such_sum():
    with pytest.raises(DefinitionError, match="changes no state and no pull"):
        saltus.HybridSystem(
            ("x", "v", "s"), {"e": 0.7, "A": 0.2, "w": 1.0},
            {"rock": Mode({"x": "v", "v": "-1 - s*A*cos(theta)", "s": "0"}),
             "rest": Mode({"x": "0", "v": "0", "s": "0"})},
            [Transition("rock", "rock", "x", -1, {"v": "-e*v", "s": "-s"}, name="impact", rests="rest")],
            phase=("theta", "w"),
        )  # fmt: skip


def test_a_valve_that_is_pressed_onto_its_seat_closes():
    # a spring with preload, friction in proportion to the velocity: as many impacts one by one, until they are 1e-9
    fields = {"open": Mode({"x": "v", "v": "-(x + p) - 0.2*v"}), "shut": Mode({"x": "0", "v": "0"})}

    def closes(rests, **kwargs):
        impact = Transition("open", "open", "x", -1, {"v": "-e*v"}, name="impact", rests=rests)
        system = saltus.HybridSystem(("x", "v"), {"e": 0.6, "p": 0.5}, fields, [impact])
        return saltus.simulate(system, {}, [1.0, 0.0], mode="open", tolerance=1e-13, **kwargs)

    motion = closes("shut", t_end=20.0)
    (end,) = motion.events["time"][motion.events["mode_after"] == "shut"]
    counted = closes(None, t_end=20.0, options=saltus.options.SimulationOptions(max_events=38))
    last = counted.events[-1]
    left = 2.0 * last["after"][1] / 0.5 / (1.0 - 0.6)
    assert left < 1e-6
    assert end == pytest.approx(last["time"] + left, abs=1e-11)


def block(right="1", left="1"):
    """Return a block that rocks from one edge to the other, pulled back by two forces."""
    return saltus.HybridSystem(
        ("q", "v"), {"e": 0.6},
        {"right": Mode({"q": "v", "v": f"-({right})"}), "left": Mode({"q": "v", "v": left}),
         "rest": Mode({"q": "0", "v": "0"}, surface="q")},
        [
            Transition("right", "left", "q", -1, {"v": "e*v"}, name="to_left", rests="rest"),
            Transition("left", "right", "q", 1, {"v": "e*v"}, name="to_right", rests="rest"),
        ],
        name="block",
    )  # fmt: skip


@pytest.mark.parametrize(("right", "left"), [(1.0, 1.0), (1.0, 2.0), (0.3, 7.0)])
@pytest.mark.parametrize("e", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_block_that_rocks_rests_after_the_sum_of_its_swings(right, left, e, side):
    pulls = (right, left) if side > 0.0 else (left, right)
    first, velocity = math.sqrt(2.0 / pulls[0]), math.sqrt(2.0 * pulls[0])
    swings = 2.0 * velocity * e * (1.0 / pulls[1] + e / pulls[0]) / (1.0 - e * e)
    motion = saltus.simulate(block(str(right), str(left)), {"e": e}, [side, 0.0], t_end=2.0 * (first + swings))
    (rest,) = motion.events["time"][motion.events["mode_after"] == "rest"]
    assert rest == pytest.approx(first + swings, rel=1e-12)


def test_a_way_to_the_other_side_needs_a_way_back():
    one_way = [Transition("right", "left", "q", -1, {"v": "e*v"}, rests="rest")]
    modes = {
        "right": Mode({"q": "v", "v": "-1"}),
        "left": Mode({"q": "v", "v": "1"}),
        "rest": Mode({"q": "0", "v": "0"}),
    }
    with pytest.raises(DefinitionError, match="another back at the same event"):
        saltus.HybridSystem(("q", "v"), {"e": 0.6}, modes, one_way)


def test_a_file_keeps_what_was_made_for_the_rest(tmp_path):
    motion = saltus.simulate(ball(), {}, [1.0, 0.0], t_end=5.0)
    motion.save(tmp_path / "motion.nc")
    assert saltus.load(tmp_path / "motion.nc").system == ball()


@pytest.mark.parametrize("rest_time", [None, 0.01])
def test_a_rest_that_lacks_the_velocity_sums_up_the_same_impacts(rest_time):
    def moving(states, field):
        resets = {} if states is None else {"v": "-a*w*sin(theta)"}
        return saltus.HybridSystem(
            ("z", "v"), {"a": 0.3, "e": 0.5, "g": 1.0, "w": 1.0},
            {
                "flight": Mode({"z": "v", "v": "-g"}),
                "rest": Mode({"z": "-a*w*sin(theta)", **field}, surface="z - a*cos(theta)", states=states),
            },
            [
                Transition(
                    "flight", "flight", "z - a*cos(theta)", -1, {"v": "-e*v - (1 + e)*a*w*sin(theta)"},
                    name="impact", rests="rest", rest_time=rest_time,
                ),
                Transition("rest", "flight", "a*w**2*cos(theta) - g", 1, resets),
            ],
            phase=("theta", "w"), name="table",
        )  # fmt: skip

    with_velocity = moving(None, {"v": "-a*w**2*cos(theta)"})
    ends = [
        saltus.simulate(system, {}, [1.0, 0.0], t_end=20.0)
        for system in (with_velocity, moving(("z",), {}))
    ]  # fmt: skip
    assert [motion.mode_end for motion in ends] == ["rest", "rest"]
    rested = [motion.events["time"][motion.events["mode_after"] == "rest"][0] for motion in ends]
    assert rested[1] == pytest.approx(rested[0], abs=1e-11)
    assert ends[1].x_end[0] == pytest.approx(0.3 * math.cos(20.0), abs=1e-9)


def test_impacts_with_a_condition_come_to_rest_where_it_holds():
    hole = saltus.HybridSystem(
        ("x", "z", "v"), {"g": 1.0, "e": 0.5},
        {"flight": Mode({"x": "0", "z": "v", "v": "-g"}), "rest": Mode({"x": "0", "z": "0", "v": "0"}, surface="z")},
        [Transition("flight", "flight", "z", -1, {"v": "-e*v"}, when="x", name="impact", rests="rest")],
    )  # fmt: skip
    for height in (1e-14, 1e-12, 1e-3):
        assert saltus.simulate(hole, {}, [-1.0, height, 0.0], t_end=2.0).mode_end == "flight"
        assert saltus.simulate(hole, {}, [1.0, height, 0.0], t_end=2.0).mode_end == "rest"


@pytest.mark.parametrize("e", ["e", "0.5"])
@pytest.mark.parametrize(
    ("reset", "pull", "works"),
    [("w + 1", "-g", False), ("-w", "-g - w/9", False), ("w + 1e4*v", "-g", True), ("w", "-g - sign(v)/9", False)],
)
def test_what_an_impact_changes_without_velocity_is_told_whatever_is_a_parameter(e, reset, pull, works):
    def ball():
        return saltus.HybridSystem(
            ("z", "v", "w"), {"g": 1.0, "e": 0.5},
            {"flight": Mode({"z": "v", "v": pull, "w": "0"}), "rest": Mode(dict.fromkeys("zvw", "0"), surface="z")},
            [Transition("flight", "flight", "z", -1, {"v": f"-{e}*v", "w": reset}, name="impact", rests="rest")],
        )  # fmt: skip

    if works:
        assert saltus.simulate(ball(), {}, [1.0, 0.0, 0.0], t_end=9.0).mode_end == "rest"
        return
    with pytest.raises(DefinitionError, match="the flights are not alike then"):
        ball()


def test_a_rest_needs_a_pull():
    with pytest.raises(DefinitionError, match="a force that pulls to the surface"):
        saltus.HybridSystem(
            ("z", "v"), {"e": 0.5},
            {"flight": Mode({"z": "v", "v": "0"}), "rest": Mode({"z": "0", "v": "0"}, surface="z")},
            [Transition("flight", "flight", "z", -1, {"v": "-e*v"}, name="impact", rests="rest")],
        )  # fmt: skip
