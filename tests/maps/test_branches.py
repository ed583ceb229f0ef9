"""Branches of orbits of maps against closed forms, and against the same maps with a clock."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from known_maps import cusp, delayed, henon, logistic, tent
from saltus import HybridSystem, InputError, Map, Mode, Piece, StepControl, Transition
from selection import guarding


def branch_of(system, parameter, bounds, x0, parameters=None, period=1, **options):
    return saltus.continue_orbit(
        saltus.solve_orbit(system, parameters, x0=x0, period=period), parameter, bounds, **options
    )


def places(branch):
    return {point.label: point.parameters[branch.parameter] for point in branch.special_points}


def test_the_fixed_point_of_the_logistic_map_doubles_at_three():
    branch = branch_of(logistic(), "r", (0.5, 4.0), [0.6])
    assert places(branch) == {"BP1": pytest.approx(1.0, abs=1e-10), "PD1": pytest.approx(3.0, abs=1e-10)}
    assert branch.multipliers[:, 0].real == pytest.approx(2 - branch.column("r"), abs=1e-11)
    assert branch.column("x") == pytest.approx(1 - 1 / branch.column("r"), abs=1e-11)
    assert np.array_equal(branch.stable, np.abs(branch.multipliers[:, 0]) < 1)


def test_the_doubled_orbit_ends_where_its_period_halves_and_doubles_at_one_plus_the_root_of_six():
    branch = branch_of(logistic(), "r", (2.5, 3.6), [0.5], period=2)
    assert branch.stopped[0] == "r = 3: the period halves"
    assert branch["PD1"].parameters["r"] == pytest.approx(1 + math.sqrt(6), abs=1e-10)
    assert branch.iteration("x", 1).shape == branch.column("x").shape


def test_the_orbit_of_period_three_is_born_at_one_plus_the_root_of_eight():
    branch = branch_of(logistic(), "r", (3.0, 4.0), [0.15], {"r": 3.84}, period=3)
    assert branch["SN1"].parameters["r"] == pytest.approx(1 + math.sqrt(8), abs=1e-10)
    assert branch["PD1"].parameters["r"] == pytest.approx(3.841499007543509, abs=1e-9)


def test_the_fixed_points_of_the_henon_map_fold_and_double_where_they_should():
    b = 0.3
    branch = branch_of(henon(), "a", (-1.0, 2.0), [0.7, 0.2], {"a": 0.1})
    assert branch["SN1"].parameters["a"] == pytest.approx(-((1 - b) ** 2) / 4, abs=1e-10)
    assert branch["PD1"].parameters["a"] == pytest.approx(3 * (1 - b) ** 2 / 4, abs=1e-10)
    assert branch.stopped[0].endswith("the orbit grows without bound")
    assert np.prod(branch.multipliers, axis=1).real == pytest.approx(-b, abs=1e-9)


def test_the_delayed_logistic_map_has_its_neimark_sacker_point_at_two():
    branch = branch_of(delayed(), "r", (1.5, 2.5), [0.47, 0.47])
    point = branch["TR1"]
    assert point.parameters["r"] == pytest.approx(2.0, abs=1e-10)
    assert np.angle(point.map_orbit.multipliers[0]) == pytest.approx(math.pi / 3, abs=1e-10)


def test_the_cusp_map_folds_twice_and_doubles_twice():
    """At x^2 = (h - 1)/3 and at x^2 = (h + 1)/3, on r = x - h x + x^3."""
    branch = branch_of(cusp(), "r", (-1.0, 1.0), [0.9])
    for kind, x in (("SN", math.sqrt(0.5 / 3)), ("PD", math.sqrt(2.5 / 3))):
        r = abs(x - 1.5 * x + x**3)
        found = sorted(value for label, value in places(branch).items() if label.startswith(kind))
        assert found == pytest.approx([-r, r], abs=1e-10)


@pytest.mark.parametrize(("b", "kind", "going_on"), [(-0.6, "persistence", 1.0), (2.0, "nonsmooth fold", -1.0)])
def test_a_border_collision_is_persistence_or_a_nonsmooth_fold(b, kind, going_on):
    """di Bernardo et al. 2008, section 3.1: with slopes a < 1 and b the fixed point persists for b < 1."""
    branch = branch_of(tent(), "mu", (-1.0, 1.0), [-0.4], {"b": b}, directions="up")
    point = branch["BC1"]
    assert point.parameters["mu"] == pytest.approx(0.0, abs=1e-14)
    assert (point.kind, point.of) == (kind, "-x")
    assert branch.column("mu")[-1] == pytest.approx(going_on)
    assert branch.itinerary[0] == ("left",)
    assert branch.itinerary[-1] == ("right",)
    assert branch.regular.all()


def test_a_branch_can_go_on_virtual_or_stop_at_a_border():
    passed = branch_of(tent(), "mu", (-1.0, 1.0), [-0.4], steps=StepControl(at_grazing="pass"))
    assert np.array_equal(passed.regular, passed.column("mu") <= 0)
    stopped = branch_of(tent(), "mu", (-1.0, 1.0), [-0.4], directions="up", stop_at="BC")
    assert stopped.stopped[1] == "mu = 0: BC"


def test_a_branch_ends_where_the_map_jumps():
    jump = Map(
        ("x",), {"mu": -0.2},
        pieces={"left": Piece({"x": "x/2 + mu"}, "-x"), "right": Piece({"x": "x/2 + mu - 1"}, "x")},
    )  # fmt: skip
    branch = branch_of(jump, "mu", (-1.0, 1.0), [-0.4], directions="up")
    assert branch.stopped[1] == "mu = 0: border collision, the map jumps there"


def pieces_of(tl, dl, tr, dr, unit=1.0):
    """Return the normal form of a border collision in the plane, its states in a unit."""
    return Map(
        ("x", "y"), {"tl": tl, "dl": dl, "tr": tr, "dr": dr, "mu": unit},
        pieces={
            "L": Piece({"x": "tl*x + y + mu", "y": "-dl*x"}, "-x"),
            "R": Piece({"x": "tr*x + y + mu", "y": "-dr*x"}, "x"),
        },
    )  # fmt: skip


@pytest.mark.parametrize(("itinerary", "slopes"), [
    ("LR", (0.5, 0.3, -2.0, 0.3)), ("LR", (0.4, -0.2, -1.7, 0.1)), ("RL", (0.5, 0.3, -2.0, 0.3)),
    ("LR", (0.1, 0.6, -2.5, 0.6)),
])  # fmt: skip
@pytest.mark.parametrize("unit", guarding((1.0, 1e-9, 1e9), 1.0))
def test_a_cycle_that_shrinks_on_a_border_ends_there(itinerary, slopes, unit):
    system = pieces_of(*slopes, unit)
    tl, dl, tr, dr = slopes
    A = {"L": np.array([[tl, 1.0], [-dl, 0.0]]), "R": np.array([[tr, 1.0], [-dr, 0.0]])}
    product, offset = np.eye(2), np.zeros(2)
    for piece in itinerary:
        product, offset = A[piece] @ product, A[piece] @ offset + [1.0, 0.0]
    x = [np.linalg.solve(np.eye(2) - product, offset)]
    for piece in itinerary[:-1]:
        x.append(A[piece] @ x[-1] + [1.0, 0.0])
    assert all((point[0] > 0.0) == (piece == "R") for point, piece in zip(x, itinerary, strict=True))
    start = saltus.solve_orbit(system, segments=tuple(itinerary))
    branch = saltus.continue_orbit(start, "mu", (-unit, 2.0 * unit))
    (border,) = branch.special_points
    assert (border.type, border.kind) == ("BC", "")
    assert border.value("mu") == pytest.approx(0.0, abs=1e-10 * unit)
    assert branch.stopped[0].endswith("border collision, the orbit shrinks to one of period 1")
    assert branch.audit.passed
    for mu in (0.5, 1.5):
        (orbit,) = branch.at(mu * unit)
        np.testing.assert_allclose(orbit.points, mu * unit * np.array(x), atol=1e-9 * unit)


def test_a_branch_ends_where_a_linear_flip_makes_all_orbits_meet_one_value():
    """Right of the border x -> t x - d x' doubles at t = -1 - d, where each point has period two."""
    planar = Map(
        ("x", "y"), {"a": 0.5, "c": 0.3, "t": -2.0, "d": 0.4, "mu": 0.2},
        pieces={
            "left": Piece({"x": "a*x + y + mu", "y": "-c*x"}, "-x"),
            "right": Piece({"x": "t*x + y + mu", "y": "-d*x"}, "x"),
        },
    )  # fmt: skip
    orbit = saltus.solve_orbit(planar, segments=("left", "right"))
    branch = saltus.continue_orbit(orbit, "t", (-4.0, 1.0), directions="up")
    assert branch.stopped[1] == "t = -1.4: border collision, beyond it all lie at one value of t"
    assert [point.type for point in branch.special_points] == ["BC"]


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_units_do_not_matter(unit):
    scaled = Map(("x",), {"r": 3.2, "u": 1.0}, {"x": "r*x*(1 - x/u)"})
    branch = branch_of(scaled, "r", (2.5, 3.6), [0.5 * unit], {"u": unit}, period=2)
    assert branch["PD1"].parameters["r"] == pytest.approx(1 + math.sqrt(6), abs=1e-9)
    assert branch.stopped[0] == "r = 3: the period halves"


@pytest.mark.campaign
def test_the_branch_is_that_of_the_map_with_a_clock():
    clocked = HybridSystem(
        ("x", "s"), {"r": 2.8}, {"carry": Mode({"x": "0", "s": "1"})},
        [Transition("carry", "carry", "s - 1", 1, {"x": "r*x*(1 - x)", "s": "0"}, name="map")],
    )  # fmt: skip
    orbit = saltus.solve_orbit(clocked, {}, [("carry", "map", [0.64, 0.0], 1.0)])
    other = saltus.continue_orbit(orbit, "r", (2.5, 3.4))["PD1"]
    own = branch_of(logistic(), "r", (2.5, 3.4), [0.64], {"r": 2.8})["PD1"]
    assert own.parameters["r"] == pytest.approx(other.parameters["r"], abs=1e-9)
    assert own.normal_form.coefficient == pytest.approx(other.normal_form.coefficient, rel=1e-6)


def test_events_and_types_stop_a_branch():
    branch = branch_of(logistic(), "r", (2.0, 4.0), [0.6], {"r": 2.5}, events={"x": 0.65}, directions="up")
    assert branch["x1"].parameters["r"] == pytest.approx(1 / 0.35, abs=1e-9)
    stopped = branch_of(logistic(), "r", (2.0, 4.0), [0.6], {"r": 2.5}, stop_at="PD", directions="up")
    assert stopped.stopped[1] == "r = 3: PD"
    assert branch.value_at(branch["x1"], "x") == pytest.approx(0.65)


@pytest.mark.campaign
def test_a_branch_is_saved_and_loaded(tmp_path):
    for branch in (
        branch_of(tent(), "mu", (-1.0, 1.0), [-0.4]),
        branch_of(logistic(), "r", (0.5, 4.0), [0.5], {"r": 3.3}, period=2),
    ):
        assert saltus.load(branch.save(tmp_path / "branch.nc")) == branch
        again = branch.solution(3)
        assert again.points == pytest.approx(branch.points[3])


def test_an_interrupt_keeps_what_is_done():
    told = []

    def interrupt(progress):
        told.append(progress)
        if len(told) == 5:
            raise KeyboardInterrupt

    branch = branch_of(logistic(), "r", (2.0, 4.0), [0.6], {"r": 2.5}, progress=interrupt)
    assert len(branch) == 6
    assert "interrupted" in branch.stopped


def test_what_cannot_be_used_is_named():
    orbit = saltus.solve_orbit(logistic(), {"r": 2.5}, x0=[0.6])
    with pytest.raises(InputError, match="parameter"):
        saltus.continue_orbit(orbit, "q", (2.0, 3.0))
    with pytest.raises(InputError, match="stop_at"):
        saltus.continue_orbit(orbit, "r", (2.0, 3.0), stop_at="GR")
    with pytest.raises(InputError, match="events"):
        saltus.continue_orbit(orbit, "r", (2.0, 3.0), events={"y": 1.0})


def test_points_that_move_to_different_sides_of_borders_met_at_once_end_the_branch():
    """At mu = 0 both points of the orbit meet the border; it is virtual on either side, and so is the turned one."""
    pieces = {
        "left": Piece({"x": "x/2 + y + mu", "y": "-3*x/10"}, where="-x"),
        "right": Piece({"x": "-6*x/5 + y + mu", "y": "-2*x/5"}, where="x"),
    }
    system = Map(("x", "y"), {"mu": 0.2}, pieces=pieces)
    start = saltus.solve_orbit(system, segments=("left", "right"))
    assert not start.regular
    branch = saltus.continue_orbit(start, "mu", (-1.0, 1.0))
    assert branch["BC1"].parameters["mu"] == pytest.approx(0.0, abs=1e-12)
    assert "meet borders at once" in branch.stopped[0]
    assert "bound reached" in branch.stopped[1]
    assert len(branch) < 200


def test_the_parameter_turns_at_a_pitchfork_without_a_saddle_node():
    """At b = 1 both multipliers of the Duffing map's point 0 are 1, and x^2 = 1 - b meets it."""
    system = Map(("x", "y"), {"b": 0.2}, {"x": "y", "y": "-b*x + 2*y - y**3"})
    branch = saltus.continue_orbit(saltus.solve_orbit(system, x0=[0.9, 0.9]), "b", (-2.0, 2.0))
    assert [point.type for point in branch.special_points] == ["PD", "BP", "PD"]
    assert branch["BP1"].parameters["b"] == pytest.approx(1.0, abs=1e-10)
    assert branch.x0[:, 0] ** 2 == pytest.approx(1.0 - branch.values, abs=1e-9)


def test_a_loop_of_nonsmooth_folds_is_followed_once():
    """A branch of virtual orbits enters a loop between two nonsmooth folds; each round begins at another point."""
    parameters = {"p": -0.1626564684583851, "q": -0.844126052125311, "r": 0.3859767611271874, "s": 1.131582096201642}
    pieces = {
        "left": Piece({"x": "p*x + y + 1/5", "y": "-q*x"}, where="-x"),
        "right": Piece({"x": "r*x + y + 1/5", "y": "-s*x"}, where="x"),
    }
    start = saltus.solve_orbit(Map(("x", "y"), parameters, pieces=pieces), segments=("right", "left", "left", "right"))
    branch = saltus.continue_orbit(start, "r", (-4.0, 3.0))
    assert "followed already" in branch.stopped[0]
    assert [point.kind for point in branch.special_points.of_type("BC")] == ["nonsmooth fold"] * 2
    assert len(branch) < 300
    last, met = branch.solution(0), branch.special_points[-1].map_orbit
    assert last.parameters["r"] == pytest.approx(met.parameters["r"], abs=1e-9)
    assert sorted(last.points[:, 0]) == pytest.approx(sorted(met.points[:, 0]), abs=1e-9)


@pytest.mark.parametrize("largest", [0.03, 0.1])
@pytest.mark.parametrize(
    ("kinds", "blocks"),
    [
        ("TR TR", ("turns 1.3", "turns 2.1")),
        ("PD PD", ("flips", "flips")),
        ("BP BP", ("grows", "grows")),
        ("TR PD", ("turns 1.3", "flips")),
    ],
)
def test_values_that_change_sides_in_opposite_directions_are_told(kinds, blocks, largest):
    """A block leaves the unit circle at p = 0 as another one enters at p = 0.003."""
    images = {}
    for k, (block, size) in enumerate(zip(blocks, ("(1 + 0.2*p)", "(1 - 0.2*(p - 0.003))"), strict=True)):
        what, _, angle = block.partition(" ")
        x, y = f"x{k}", f"y{k}"
        if what == "turns":
            c, s = math.cos(float(angle)), math.sin(float(angle))
            images[x] = f"{size}*({c}*{x} - {s}*{y}) - {x}*({x}**2 + {y}**2)"
            images[y] = f"{size}*({s}*{x} + {c}*{y}) - {y}*({x}**2 + {y}**2)"
        else:
            images[x] = f"{'-' if what == 'flips' else ''}{size}*{x} - {x}**3"
    blocked = Map(tuple(images), {"p": -1.0}, images)
    branch = branch_of(blocked, "p", (-1.0, 1.0), np.zeros(len(images)), steps=StepControl(largest=largest))
    assert " ".join(point.type for point in branch.special_points) == kinds
    assert [point.parameters["p"] for point in branch.special_points] == pytest.approx([0.0, 0.003], abs=1e-9)
