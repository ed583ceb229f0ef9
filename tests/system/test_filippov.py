"""Filippov systems: modes and transitions of fields that jump on surfaces."""

import numpy as np
import pytest

import saltus
from saltus.errors import DefinitionError, DivergenceError, InputError
from sliding import belt, harvested, planar

UP, DOWN = {"x": "1", "y": "-1"}, {"x": "1", "y": "1"}


def test_the_sliding_field_is_the_convex_combination():
    system = planar()
    parameters = {"mu": 1.2, "c": -6.0}
    for x in (-0.9, -0.1, 0.03, 0.2):
        up, down = (system.field(mode, [x, -1.0], parameters=parameters) for mode in ("above", "below"))
        weight = down[1] / (down[1] - up[1])
        slides = system.field("sliding", [x, -1.0], parameters=parameters)
        np.testing.assert_allclose(slides, weight * up + (1.0 - weight) * down, rtol=1e-12, atol=1e-13)
        assert slides[1] == 0.0


def test_the_sliding_field_leads_back_to_the_surface_and_nothing_on_it_depends_on_how_fast():
    slow, fast = (
        saltus.filippov(("x", "y"), {"k": k}, surface="y - 0.1*x**2", above=UP, below=DOWN, pull="k") for k in (1, 50)
    )
    on = [system.field("sliding", [0.3, 0.009]) for system in (slow, fast)]
    np.testing.assert_allclose(*on, rtol=1e-12)
    above = fast.field("sliding", [0.3, 0.009 + 1e-6]) - fast.field("sliding", [0.3, 0.009])
    rate = float(np.array([-0.06, 1.0]) @ above)
    assert rate == pytest.approx(-50 * 1e-6, rel=1e-4)


def test_a_motion_slides_crosses_and_leaves_where_the_rates_say():
    motion = saltus.simulate(planar(), {"mu": 1.2}, [1.0, 0.2], t_end=20.0)
    left = motion.events["after"][motion.events["name"] == "sliding_to_above"]
    np.testing.assert_allclose(left, [[0.170820393249937, -1.0]] * len(left), atol=1e-9)
    assert len(left) >= 2
    crossing = saltus.simulate(belt(), {"w": 0.7}, [1.0, 0.0], periods=5)
    assert {"above_to_below", "below_to_above"} <= set(crossing.events["name"].tolist())


def test_a_start_on_the_surface_takes_the_mode_that_goes_on():
    assert saltus.simulate(planar(), {"mu": 1.2}, [0.0, -1.0], t_end=0.1).mode_at(0.01) == "sliding"
    assert saltus.simulate(planar(), {"mu": 1.2}, [1.0, -1.0], t_end=0.1).mode_at(0.01) == "above"


def test_a_start_from_which_motions_may_go_either_way_is_refused():
    repelling = saltus.filippov(("x", "y"), {}, surface="y", above=DOWN, below=UP)
    with pytest.raises(InputError, match="one motion from it"):
        saltus.simulate(repelling, {}, [0.0, 0.0], t_end=1.0)


def test_a_start_off_the_surface_does_not_slide():
    with pytest.raises(InputError, match="on the surface of mode 'sliding'"):
        saltus.simulate(planar(), {}, [0.0, -0.9], mode="sliding", t_end=1.0)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_units_do_not_matter(scale):
    system = saltus.filippov(
        ("x", "y"), {"s": scale}, surface="y", above={"x": "s", "y": "-s"}, below={"x": "s", "y": "s"}
    )
    motion = saltus.simulate(system, {}, [0.0, scale], t_end=3.0, tolerance=(1e-10, 1e-12 * scale))
    np.testing.assert_allclose(motion.x_end / scale, [3.0, 0.0], atol=1e-9)
    assert motion.mode_end == "sliding"


def test_a_motion_along_one_surface_crosses_another_one():
    fields = {
        "++": {"x": "-1 - y", "y": "-1"}, "-+": {"x": "1 - y", "y": "-1"},
        "+-": {"x": "-1", "y": "-1"}, "--": {"x": "1", "y": "-1"},
    }  # fmt: skip
    system = saltus.filippov(("x", "y"), {}, surfaces=("x", "y"), fields=fields)
    motion = saltus.simulate(system, {}, [0.2, 0.5], t_end=2.0)
    assert motion.mode_end == "0-"
    np.testing.assert_allclose(motion.x_end, [0.0, -1.5], atol=1e-9)


def test_a_place_where_surfaces_meet_without_one_way_on_is_told():
    rates = {"+": "-1", "-": "1"}
    fields = {a + b: {"x": rates[a], "y": rates[b], "z": "1" if a == b else "0"} for a in "+-" for b in "+-"}
    system = saltus.filippov(("x", "y", "z"), {}, surfaces=("x", "y"), fields=fields)
    with pytest.raises(saltus.SaltusError, match=r"in mode '0\+', .* no single way on$"):
        saltus.simulate(system, {}, [0.2, 0.5, 0.0], t_end=2.0)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"surface": "y"}, "surface=, above= and below="),
        ({"surface": "y", "above": UP, "below": {"x": "1"}}, "'y' is missing"),
        ({"surface": "y", "above": UP, "below": {**UP, "q": "1"}}, "a state"),
        ({"surface": "y", "above": UP, "below": UP}, "the fields agree on it"),
        ({"surface": "y", "above": {"x": "1", "y": "0"}, "below": {"x": "2", "y": "0"}}, "no field crosses it"),
        ({"surface": "k", "above": UP, "below": DOWN}, "a function of the state"),
        ({"surfaces": ("x", "y"), "fields": {"+": UP, "-": DOWN}}, "a text of 2 signs"),
        ({"surfaces": ("x", "y"), "fields": {"++": UP, "--": DOWN}}, "both sides"),
        ({"surfaces": ("x",) * 5, "fields": {"+++++": UP}}, "at most 4"),
    ],
)
def test_what_cannot_slide_is_told(given, words):
    with pytest.raises(DefinitionError, match=words):
        saltus.filippov(("x", "y"), {"k": 1.0}, **given)


def test_a_file_keeps_the_surface_of_a_mode(tmp_path):
    motion = saltus.simulate(harvested(), {}, [0.3, 1.0], t_end=60.0)
    motion.save(tmp_path / "motion.nc")
    again = saltus.load(tmp_path / "motion.nc").system
    assert again == motion.system
    assert again.modes["sliding"].surface == motion.system.modes["sliding"].surface


@pytest.mark.parametrize("c", [1.0, 2.0])
@pytest.mark.parametrize(("up", "down"), [("k*x", "-c*x"), ("k*(x**2 - 0.5)*(x + 2)", "-c*(x**2 - 0.5)")])
def test_a_motion_that_slides_to_a_two_fold_ends_there(up, down, c):
    system = saltus.filippov(
        ("x", "y"), {"c": c, "k": 0.7}, surface="y", above={"x": "1", "y": up}, below={"x": "1", "y": down}
    )
    for start in (-0.55, -0.5, -0.45):
        with pytest.raises(DivergenceError, match="it comes to a two-fold, where motions leave the surface y = 0"):
            saltus.simulate(system, {}, [start, 0.05], t_end=3.0)


@pytest.mark.parametrize("start", [[0.0, 0.0], [1.0, 0.0]])
def test_a_start_where_both_fields_lead_away_is_refused_whatever_the_fields_depend_on(start):
    system = saltus.filippov(("x", "y"), {}, surface="y", above={"x": "1", "y": "x"}, below={"x": "1", "y": "-x"})
    with pytest.raises(InputError, match="a start with one motion from it"):
        saltus.simulate(system, {}, start, t_end=1.0)
    with pytest.raises(InputError, match="in the domain of mode 'sliding'"):
        saltus.simulate(system, {}, start, mode="sliding", t_end=1.0)


def test_an_equilibrium_where_both_fields_lead_away_is_virtual():
    system = saltus.filippov(
        ("x", "y"), {"m": 0.3}, surface="y", above={"x": "m - x", "y": "x + 1"}, below={"x": "m - x", "y": "-1 - x"}
    )
    found = saltus.find_equilibrium(system, {}, [0.2, 0.0], mode="sliding")
    assert not found.regular
    assert saltus.find_equilibrium(system, {"m": -1.3}, [-1.2, 0.0], mode="sliding").regular


def test_rates_that_do_not_vary_bound_the_parameters_at_which_motions_slide():
    system = saltus.filippov(
        ("x", "y"), {"F": -1.0}, surface="y", above={"x": "-x", "y": "F"}, below={"x": "-x", "y": "1"}
    )
    branch = saltus.continue_equilibrium(
        saltus.find_equilibrium(system, {}, [0.2, 0.0], mode="sliding"), "F", (-2.0, 1.0)
    )
    assert branch.stopped[1] == "F = 0: the domain of mode sliding ends"
    assert branch.values.max() < 1e-9
    motion = saltus.simulate(system, {"F": 0.5}, [1.0, -0.5], t_end=3.0)
    assert motion.mode_end == "above"


@pytest.mark.parametrize("below", ["0", "c"])
def test_a_field_along_the_surface_slides_too(below):
    system = saltus.filippov(
        ("x", "y"), {"c": 0.0}, surface="y", above={"x": "1", "y": "-1"}, below={"x": "1", "y": below}
    )
    motion = saltus.simulate(system, {}, [0.0, 1.0], t_end=3.0)
    assert motion.mode_end == "sliding"
    np.testing.assert_allclose(motion.x_end, [3.0, 0.0], atol=1e-12)


def test_a_start_off_the_surface_lies_on_its_side_where_the_other_field_does_not_cross_it():
    ends = []
    for x in (1.5, 1.5 - 1e-9, 1.5 + 1e-9):  # at 1.5 the rate along the field below is exactly 0
        motion = saltus.simulate(belt(), {"F": 0.5}, [x, 0.0], t_end=2.0)
        assert motion.mode_at(0.0) == "below"
        ends.append(motion.x_end)
    np.testing.assert_allclose(ends, np.broadcast_to(ends[0], (3, 3)), atol=1e-7)


def test_a_region_without_a_field_is_entered_by_no_motion():
    system = saltus.filippov(
        ("x", "y"), {}, surfaces=("x", "y"), fields={"++": {"x": "-1", "y": "-1"}, "-+": {"x": "1", "y": "-1"}}
    )
    with pytest.raises(
        DivergenceError, match="motion ends at t = 1\\.0+1? in mode '\\+\\+', .* a region without a field"
    ):
        saltus.simulate(system, {}, [2.0, 1.0], t_end=1.5)
    with pytest.raises(InputError, match="before its events"):
        saltus.simulate(system, {}, [1.0, -1.0], t_end=1.5)
    for name in ("no field there", "elsewhere"):  # an end is no mode
        with pytest.raises(InputError, match=r"must be one of \+\+, -\+, 0\+$"):
            saltus.simulate(system, {}, [2.0, 1.0], t_end=0.5, mode=name)
    assert "mode no" not in str(system)
    assert "end, no field there: ++ when y falls through 0" in str(system)


def test_crossings_that_accumulate_at_a_two_fold_are_told_as_one():
    above, below = {"x": "-y", "y": "1", "z": "p"}, {"x": "z", "y": "m", "z": "1"}
    system = saltus.filippov(("x", "y", "z"), {"p": -1.5, "m": -1.2}, surface="x", above=above, below=below)
    rng = np.random.default_rng(1)
    starts = rng.normal(size=(14, 3)) * 0.5
    for start in starts[[0, 7]]:  # one slides to the two-fold, of the other the crossings accumulate there
        with pytest.raises(DivergenceError, match="comes to a two-fold, where motions leave the surface x = 0") as told:
            saltus.simulate(system, {}, start, t_end=20.0)
        assert told.value.state == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)


def test_a_pull_away_from_the_surface_is_refused():
    with pytest.raises(DefinitionError, match="0 or more, and it is -1"):
        saltus.filippov(
            ("x", "y"), {"k": -1.0}, surface="y", above={"x": "1", "y": "-1"}, below={"x": "1", "y": "1"}, pull="k"
        )


@pytest.mark.campaign
def test_two_oblique_surfaces_with_long_fields_are_defined_in_seconds():
    def rate(a, own, b, other, c):
        return f"{a} - 0.3*{own} + ({b})*{other} + ({c})*cos(theta)"

    numbers = {"++": (-0.61, 0.3, -0.9, 0.2, 0.71, 0.33), "+-": (-0.1, 0.13, -0.29, 0.52, 0.11, 0.63),
               "-+": (0.61, 0.23, 0.59, -0.2, 0.17, 0.83), "--": (0.16, 0.63, -0.49, 0.42, 0.21, 0.93)}  # fmt: skip
    fields = {
        word: {"x": rate(n[0], "x", n[1], "y", n[2]), "y": rate(n[3], "y", n[4], "x", n[5])}
        for word, n in numbers.items()
    }
    system = saltus.filippov(
        ("x", "y"), {"w": 1.3}, surfaces=("x - 0.1*y", "y - 0.2"), fields=fields, phase=("theta", "w")
    )
    assert len(system.transitions) == 48


@pytest.mark.parametrize("g", [0.3, 1.0, 1e9])
def test_a_side_whose_rate_across_is_a_parameter_slides_as_with_its_number(g):
    above = {"x": "x*(1.1 - x**2 - y**2) - y", "y": "y*(1.1 - x**2 - y**2) + x"}
    made = [
        saltus.filippov(("x", "y"), parameters, surface="y + 1", above=above, below={"x": "0", "y": rate})
        for parameters, rate in (({"g": g}, "g"), ({}, repr(g)))
    ]
    named, plain = (saltus.find_orbit(system, x0=[1.0, 0.2]) for system in made)
    assert named.signature == plain.signature
    assert named.period == pytest.approx(plain.period, rel=1e-12)


def test_nothing_slides_where_a_rate_across_leads_away():
    above = {"x": "x*(1.1 - x**2 - y**2) - y", "y": "y*(1.1 - x**2 - y**2) + x"}
    system = saltus.filippov(("x", "y"), {"g": -2.0}, surface="y + 1", above=above, below={"x": "0", "y": "g"})
    with pytest.raises(InputError, match="must be in the domain of mode 'sliding'"):
        saltus.simulate(system, {}, [-0.9, -1.0], t_end=1.0, mode="sliding")
