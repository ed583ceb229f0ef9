"""Border collisions and sliding bifurcations: where the signature of an orbit changes, and what goes on beyond."""

import numpy as np
import pytest

import saltus
from own_states import wall
from saltus import Mode, Transition
from saltus.errors import InputError
from sliding import ADDING, CROSSING, GRAZING, SWITCHING, belt, harvested, limit_of_sticking, planar, relay

WORDS = {"below": "M", "above": "P", "sliding": "S"}
BELT = {"AS": ADDING, "SS": SWITCHING, "GS": GRAZING, "CS": CROSSING}


def word(orbit):
    """Return the modes of an orbit as letters, from the first after a sliding segment that is in no other word."""
    letters = "".join(WORDS[part.mode] for part in orbit.segments)
    return min(letters[i:] + letters[:i] for i in range(len(letters)))


@pytest.fixture(scope="module")
def branch():
    return saltus.continue_orbit(saltus.find_orbit(belt(), {"w": 0.6}, [1.0, 0.0]), "w", (0.4385, 0.7))


@pytest.mark.parametrize("kind", BELT)
def test_one_branch_has_all_four_sliding_bifurcations(branch, kind):
    (point,) = branch.special_points.of_type(kind)
    assert point.value("w") == pytest.approx(BELT[kind], abs=2e-12)


@pytest.mark.parametrize("w", [0.439, 0.445, 0.48, 0.69])
def test_the_same_bifurcations_are_found_from_any_start(w, branch):
    again = saltus.continue_orbit(saltus.find_orbit(belt(), {"w": w}, [1.0, 0.0]), "w", (0.4385, 0.7))
    known, found = ([(p.type, p.value("w")) for p in b.special_points] for b in (branch, again))
    assert [kind for kind, _ in found] == [kind for kind, _ in known] == list(BELT)
    np.testing.assert_allclose([at for _, at in found], [at for _, at in known], atol=1e-11)


@pytest.mark.parametrize("steps", [{"largest": 0.02}, {"largest": 0.2}, {"initial": 1e-3, "deviation": 1e-4}])
def test_the_same_bifurcations_are_found_at_other_steps(steps):
    orbit = saltus.find_orbit(belt(), {"w": 0.6}, [1.0, 0.0])
    again = saltus.continue_orbit(orbit, "w", (0.4385, 0.7), steps=saltus.StepControl(**steps))
    np.testing.assert_allclose([p.value("w") for p in again.special_points], list(BELT.values()), atol=1e-11)


def test_between_the_bifurcations_orbits_have_the_words_of_motions(branch):
    ends = [0.4385, *BELT.values(), 0.7]
    known = ["MS", "MSPS", "MPSPS", "MPS", "MP"]
    for low, high, letters in zip(ends[:-1], ends[1:], known, strict=True):
        inside = [i for i, w in enumerate(branch.values) if 0.05 < (w - low) / (high - low) < 0.95]
        assert inside
        assert {word(branch.solution(i)) for i in inside} == {letters}
        assert all(branch.solution(i).admissible for i in inside)


@pytest.mark.parametrize(("at", "below", "above"), [(GRAZING, 0.0024, 0.7436), (CROSSING, -0.71636, -0.71721)])
def test_the_multiplier_jumps_at_grazing_sliding_alone(at, below, above):
    for w, known in ((at - 2e-4, below), (at + 2e-4, above)):
        values = saltus.find_orbit(belt(), {"w": w}, [1.0, 0.0]).multipliers
        assert values[0] == pytest.approx(known, abs=6e-5)


@pytest.mark.parametrize("kind", BELT)
def test_each_bifurcation_has_a_locus_and_a_point_of_it_is_found_again(branch, kind):
    (point,) = branch.special_points.of_type(kind)
    locus = saltus.continue_locus(point, ("w", "F"), {"w": (0.3, 0.9), "F": (0.38, 0.5)})
    assert locus.type == kind
    columns = {name: i for i, name in enumerate(locus.names)}
    row = locus.values[int(np.argmin(np.abs(locus.values[:, columns["F"]] - 0.45)))]
    w, F = row[columns["w"]], row[columns["F"]]
    start = saltus.find_orbit(belt(), {"w": w + 1e-3, "F": F}, [1.0, 0.0])
    again = saltus.continue_orbit(start, "w", (w - 2e-3, w + 2e-3))
    near = [p.value("w") for p in again.special_points.of_type(kind)]
    assert min(abs(value - w) for value in near) < 1e-9


def test_loci_meet_where_each_of_them_says(branch):
    bounds = {"w": (0.3, 0.8), "F": (0.2, 0.6)}
    found = {}
    for kind, other in (("AS", "SS"), ("SS", "AS")):
        (point,) = branch.special_points.of_type(kind)
        locus = saltus.continue_locus(point, ("w", "F"), bounds)
        (meeting,) = locus.special_points.of_type(other)
        found[kind] = meeting.value("w"), meeting.value("F")
    np.testing.assert_allclose(found["AS"], found["SS"], atol=1e-7)


def test_the_limit_of_sticking_is_den_hartogs():
    limit = float(limit_of_sticking(np.array(0.8)))
    for start in (0.9, 1.1):
        orbit = saltus.find_orbit(belt(), {"w": 0.8, "u": 0.0, "F": limit * start}, [1.0, 0.1])
        branch = saltus.continue_orbit(orbit, "F", (limit * 0.85, limit * 1.15))
        (point,) = branch.special_points.of_type("CS")
        assert point.value("F") == pytest.approx(limit, abs=1e-12)
        assert {len(orbit.segments) for orbit in (branch.solution(0), branch.solution(len(branch) - 1))} == {2, 4}
    locus = saltus.continue_locus(point, ("w", "F"), {"w": (0.55, 2.0), "F": (0.05, 1.5)})
    w, F = (locus.values[:, locus.names.index(name)] for name in ("w", "F"))
    np.testing.assert_allclose(F, limit_of_sticking(w), rtol=1e-9)
    assert np.ptp(w) == pytest.approx(1.45)


@pytest.mark.parametrize(
    ("system", "parameters", "x0", "name", "bounds", "kind", "value"),
    [
        (planar, {"mu": 1.1}, [1.0, 0.2], "mu", (0.8, 1.3), "GS", 1.0),
        (planar, {"mu": 0.9}, [1.0, 0.2], "mu", (0.8, 1.3), "GS", 1.0),
        (relay, {}, [0.5, 0.2, 1.0], "r", (0.7, 1.3), "CS", 1.2130256057989),
        (harvested, {}, [0.3, 1.0], "P", (1.4, 2.7), "GS", 2.44070780948),
        (harvested, {"P": 2.6}, [0.3, 1.0], "P", (1.4, 2.7), "GS", 2.44070780948),
    ],
)
def test_autonomous_cycles_change_where_closed_forms_say(system, parameters, x0, name, bounds, kind, value):
    branch = saltus.continue_orbit(saltus.find_orbit(system(), parameters, x0), name, bounds)
    (point,) = branch.special_points
    assert point.type == kind
    assert point.value(name) == pytest.approx(value, abs=2e-11)
    assert all(reason.endswith("bound reached") for reason in branch.stopped)


def boost():
    """Return a boost converter with ideal switches: the diode blocks when its current is gone."""
    return saltus.HybridSystem(
        ("i", "v"), {"E": 1.0, "R": 2.0, "L": 1.0, "C": 10.0, "D": 0.4, "w": 2 * np.pi},
        {
            "on": Mode({"i": "E/L", "v": "-v/(R*C)"}),
            "off": Mode({"i": "(E - v)/L", "v": "i/C - v/(R*C)"}),
            "empty": Mode({"i": "0", "v": "-v/(R*C)"}),
        },
        [
            Transition("on", "off", at_phase="2*pi*D"), Transition("off", "on", at_phase=0),
            Transition("off", "empty", "i", -1), Transition("empty", "on", at_phase=0),
        ],
        phase=("theta", "w"), name="boost converter",
    )  # fmt: skip


def test_a_converter_enters_discontinuous_conduction_from_either_side():
    values = []
    for load, x0 in ((2.0, [1.0, 1.5]), (40.0, [0.0, 1.5])):
        branch = saltus.continue_orbit(saltus.find_orbit(boost(), {"R": load}, x0), "R", (2.0, 40.0))
        (point,) = branch.special_points
        assert point.type == "BC"
        values.append(point.value("R"))
        assert sorted(len(branch.solution(i).segments) for i in (0, len(branch) - 1)) == [2, 3]
        np.testing.assert_allclose(branch.values[[0, -1]], [2.0, 40.0])
    np.testing.assert_allclose(*values, rtol=1e-11)
    beside = saltus.find_orbit(boost(), {"R": values[0]}, [1.0, 1.5])
    assert min(abs(part.state[0]) for part in beside.segments) < 1e-8


def test_the_border_of_discontinuous_conduction_has_a_locus():
    branch = saltus.continue_orbit(saltus.find_orbit(boost(), {"R": 2.0}, [1.0, 1.5]), "R", (2.0, 40.0))
    locus = saltus.continue_locus(branch["BC1"], ("R", "D"), {"R": (2.0, 40.0), "D": (0.2, 0.8)})
    assert len(locus) < 80
    R, D = (locus.values[:, locus.names.index(name)] for name in ("R", "D"))
    # an ideal converter, without a ripple of the voltage, conducts all the time for R < 2 L / (T D (1 - D)^2)
    np.testing.assert_allclose(R, 2.0 / (D * (1.0 - D) ** 2), rtol=0.02)


def collided(a, b, mu, side):
    """Return the branch in mu of the map x -> a x + mu left of 0, b x + mu right of it, as resets once a period."""
    system = saltus.HybridSystem(
        ("x",), {"a": a, "b": b, "mu": mu, "w": 1.0}, {"wait": Mode({"x": "0"})},
        [
            Transition("wait", "wait", at_phase=0, when="-x", reset={"x": "a*x + mu"}, name="left"),
            Transition("wait", "wait", at_phase=0, when="x", reset={"x": "b*x + mu"}, name="right"),
        ],
        phase=("theta", "w"),
    )  # fmt: skip
    x = mu / (1.0 - (a if side == "left" else b))
    orbit = saltus.solve_orbit(system, {"mu": mu}, segments=[("wait", side, [x, 0.0], 2.0 * np.pi)])
    return saltus.continue_orbit(orbit, "mu", (-0.5, 0.5))


@pytest.mark.parametrize(("a", "b"), [(0.5, -0.5), (0.4, -2.0), (-0.3, 0.6)])
def test_a_fixed_point_of_a_piecewise_linear_map_persists(a, b):
    for mu, side in ((-0.3, "left"), (0.3, "right")):
        branch = collided(a, b, mu, side)
        (point,) = branch.special_points
        assert (point.type, point.of) == ("BC", "")
        assert point.value("mu") == pytest.approx(0.0, abs=1e-12)
        x, values = branch.x0[:, 0], branch.values
        np.testing.assert_allclose(x, np.where(values < 0.0, values / (1.0 - a), values / (1.0 - b)), atol=1e-10)


@pytest.mark.parametrize(("a", "b", "mu", "side"), [(0.5, 1.5, -0.3, "left"), (0.5, 1.5, -0.3, "right"),
                                                    (1.5, 0.5, 0.3, "right")])  # fmt: skip
def test_fixed_points_of_a_piecewise_linear_map_meet_in_a_non_smooth_fold(a, b, mu, side):
    branch = collided(a, b, mu, side)
    (point,) = branch.special_points
    assert (point.type, point.of) == ("BC", "non-smooth fold")
    assert np.all(branch.values * mu >= -1e-12)
    assert {bool(x > 0.0) for x in branch.x0[[0, -1], 0]} == {True, False}
    np.testing.assert_allclose(sorted({round(abs(m), 9) for m in branch.multipliers[:, 0].tolist()}), [0.5, 1.5])


def test_orbits_of_the_signatures_that_meet_are_one_motion(branch):
    for kind in ("SS", "GS", "CS"):
        (point,) = branch.special_points.of_type(kind)
        orbits = saltus.grazing_orbits(point)
        assert len(orbits) == 2
        assert abs(len(orbits[0].segments) - len(orbits[1].segments)) in (1, 2)
        np.testing.assert_allclose(orbits[0].period, orbits[1].period, rtol=1e-12)


def test_a_neuron_stops_firing_where_its_equilibrium_meets_the_threshold():
    neuron = saltus.HybridSystem(
        ("v",), {"I": 1.5, "h": 1.0}, {"on": Mode({"v": "I - v"})},
        [Transition("on", "on", "v - h", 1, {"v": "0"}, name="spike")],
    )  # fmt: skip
    orbit = saltus.find_orbit(neuron, {}, [0.0])
    assert orbit.period == pytest.approx(np.log(3.0), abs=1e-11)
    branch = saltus.continue_orbit(orbit, "I", (0.5, 2.0))
    end = next(reason for reason in branch.stopped if "without bound" in reason)
    assert end.endswith("the equilibrium of mode 'on' meets the event 'spike' at I = 1")
    point = branch["BC1"]
    assert point.parameters["I"] == pytest.approx(1.0, abs=1e-13)
    assert repr(point).splitlines()[1] == "equilibrium on the event 'spike', at"
    assert float(point.sensitivity(["h"])["I"].sel(parameter="h")) == pytest.approx(1.0, abs=1e-12)
    assert saltus.verify(branch).passed
    with pytest.raises(InputError, match="an equilibrium meets the event 'spike': switch_branch gives it"):
        saltus.grazing_orbits(point)
    rest = saltus.continue_equilibrium(saltus.switch_branch(point), "I", (0.0, 2.0))
    assert rest["BE1"].parameters["I"] == pytest.approx(1.0, abs=1e-13)
    locus = saltus.continue_locus(point, ("I", "h"), {"I": (0.0, 3.0), "h": (0.5, 2.0)})
    np.testing.assert_allclose(locus.values[:, 0], locus.values[:, 1], atol=1e-12)


@pytest.mark.campaign
def test_the_equilibrium_on_an_event_of_a_later_mode_is_kept_in_files(tmp_path):
    modes = {"refractory": Mode({"v": "1.2 - v"}), "on": Mode({"v": "I - v"})}
    transitions = [
        Transition("refractory", "on", "v - 0.5", 1, {"v": "0.1"}, name="ready"),
        Transition("on", "refractory", "v - 1", 1, {"v": "0"}, name="spike"),
    ]
    neuron = saltus.HybridSystem(("v",), {"I": 1.5}, modes, transitions)
    branch = saltus.continue_orbit(saltus.find_orbit(neuron, {}, [0.0], mode="refractory"), "I", (0.5, 2.0))
    assert branch["BC1"].equilibrium.mode == "on"
    branch.save(tmp_path / "branch.nc")
    again = saltus.load(tmp_path / "branch.nc")
    assert again == branch
    assert repr(again["BC1"]) == repr(branch["BC1"])


def test_a_border_collision_meets_bifurcations_of_the_neighbouring_signature():
    branch = collided(0.5, -0.5, -0.3, "left")
    locus = saltus.continue_locus(branch["BC1"], ("mu", "b"), {"mu": (-0.5, 0.5), "b": (-2.0, 2.0)})
    assert {(p.type, p.of): round(p.value("b"), 9) for p in locus.special_points} == {
        ("PD", "smaller signature"): -1.0, ("SN", "smaller signature"): 1.0,
    }  # fmt: skip
    np.testing.assert_allclose(locus.values[:, locus.names.index("mu")], 0.0, atol=1e-12)


def impacting(**options):
    """Return a driven mass that a wall turns back."""
    return saltus.HybridSystem(
        ("x", "v"), {"c": 0.1, "d": 1.0, "e": 0.8, "w": 0.7, "A": 0.4},
        {"free": Mode({"x": "v", "v": "A*cos(s) - c*v - x"})},
        [Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact", **options)], phase=("s", "w"),
    )  # fmt: skip


@pytest.mark.campaign
@pytest.mark.parametrize("amplitude", [0.4, 0.65])
def test_a_condition_on_the_speed_changes_no_branch_and_no_locus(amplitude):
    found = []
    for options in ({}, {"when": "3*v"}):
        orbit = saltus.find_orbit(impacting(**options), {"A": amplitude}, [0.0, 0.0])
        branch = saltus.continue_orbit(orbit, "A", (0.3, 0.7))
        assert saltus.verify(branch).passed
        locus = saltus.continue_locus(branch["GR1"], ("A", "w"), {"A": (0.2, 1.0), "w": (0.5, 1.5)})
        points = [(point.label, point.parameters["A"]) for point in (*branch.special_points, *locus.special_points)]
        found.append((points, branch.stopped, locus.stopped))
    assert [label for label, _ in found[0][0]] == ["GR1", "PD1", "SN1", "PD1"]
    assert [value for _, value in found[0][0]] == pytest.approx([value for _, value in found[1][0]], abs=1e-10)
    assert found[0][1:] == found[1][1:]


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore:saltus. 'release' lands beyond")
def test_a_touch_with_a_condition_on_the_speed_is_located():
    branch = saltus.continue_orbit(saltus.find_orbit(wall(), {}, [0.0, 0.0], mode="free"), "w", (0.6, 1.4))
    assert branch.stopped == ("w = 0.6: bound reached", "w = 1.4: bound reached")
    assert [point.label for point in branch.special_points] == ["SN1", "SN2", "GR1"]
    assert saltus.verify(branch).passed


@pytest.mark.parametrize(("length", "rate"), [(1e3, 1e3), (1e6, 1.0), (1.0, 1e3), (1e-9, 1e6)])
def test_sliding_bifurcations_are_the_same_in_all_units(length, rate):
    pull = "W**2*(A*cos(theta) - x{}F)"
    system = saltus.filippov(
        ("x", "v"), {"F": 0.4 * length, "u": 0.3 * length * rate, "w": 0.6 * rate, "A": length, "W": rate},
        surface="v - u", above={"x": "v", "v": pull.format("-")}, below={"x": "v", "v": pull.format("+")},
        phase=("theta", "w"),
    )  # fmt: skip
    orbit = saltus.find_orbit(system, {}, [length, 0.0])
    branch = saltus.continue_orbit(orbit, "w", (0.4385 * rate, 0.7 * rate))
    assert all(reason.endswith("bound reached") for reason in branch.stopped)
    found = {point.type: (point.parameters["w"] / rate, point.of) for point in branch.special_points}
    assert {name: of for name, (_, of) in found.items()} == dict.fromkeys(("AS", "SS", "GS", "CS"), "")
    expected = {"AS": ADDING, "SS": SWITCHING, "GS": GRAZING, "CS": CROSSING}
    assert {name: w for name, (w, _) in found.items()} == pytest.approx(expected, rel=1e-10)
    assert branch.admissible.all()
