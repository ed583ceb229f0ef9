"""Extrema of quantities along branches: closed forms, both ways along a branch, and what cannot be asked for."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import saltus
from saltus import InputError, continue_equilibrium, continue_orbit, find_equilibrium, find_orbit

A1 = "amplitude(x, 1)"
LINEAR = {"b": 0.0, "A": 1.0, "c": 0.4}


@pytest.fixture(scope="module")
def duffing():
    return saltus.HybridSystem.smooth(
        {"x": "v", "v": "-c*v - k*x - b*x**3 + A*g*cos(s)"},
        {"k": 1.0, "c": 0.1, "b": 1.0, "A": 0.5, "g": 1.0, "w": 1.0},
        phase=("s", "w"), name="Duffing",
    )  # fmt: skip


@pytest.mark.campaign
def test_the_resonances_of_a_linear_oscillator_in_displacement_velocity_and_acceleration(duffing):
    """Of displacement at w**2 = 1 - c**2/2, of velocity at 1, of acceleration at 1/(1 - c**2/2)."""
    events = dict.fromkeys(("x", "max_v", A1, f"{A1}*w**2", "period"), "extremum")
    branch = continue_orbit(find_orbit(duffing, {**LINEAR, "w": 0.6}, [0.0, 0.0]), "w", (0.4, 2.0), events=events)
    places = {"min_x": np.sqrt(0.92), "max_x": np.sqrt(0.92), A1: np.sqrt(0.92), "max_v": 1.0}
    places |= {f"{A1}*w**2": 1.0 / np.sqrt(0.92)}
    found = {point.of: point for point in branch.special_points}
    assert set(found) == set(places)  # the period has none
    for name, place in places.items():
        assert found[name].type == "EX"
        assert found[name].value("w") == pytest.approx(place, abs=1e-10)
        assert abs(found[name].test) < 1e-9
    assert found[A1].orbit.observe(A1)[A1] == pytest.approx(1.0 / (0.4 * np.sqrt(0.96)), rel=1e-12)


def test_a_frequency_far_from_one_changes_nothing(duffing):
    values = {"k": 1e12, "c": 0.4e6, "b": 0.0, "A": 1e9, "w": 0.6e6}
    branch = continue_orbit(
        find_orbit(duffing, values, [0.0, 0.0]), "w", (0.4e6, 2e6), events={A1: "extremum"}, stop_at="EX"
    )
    assert branch["EX1"].value("w") == pytest.approx(1e6 * np.sqrt(0.92), rel=1e-10)
    assert branch.stopped[1].endswith(": EX")


@pytest.fixture(scope="module")
def response(duffing):
    return continue_orbit(find_orbit(duffing, {"w": 0.6}, [0.0, 0.0]), "w", (0.5, 2.6), events={A1: "extremum"})


@pytest.mark.campaign
def test_the_peak_of_a_duffing_oscillator_before_its_fold(response):
    """SciPy's search among orbits that the branch finds."""
    (peak,) = response.special_points.of_type("EX")

    def amplitude(w):
        return max(orbit.observe(A1)[A1] for orbit in response.at(w))

    other = minimize_scalar(lambda w: -amplitude(w), bounds=(2.2, 2.2115), method="bounded", options={"xatol": 1e-9})
    assert peak.value("w") == pytest.approx(other.x, abs=1e-6)
    assert peak.orbit.observe(A1)[A1] >= -other.fun
    assert [point.label for point in response.special_points] == ["EX1", "SN1", "SN2"]


def test_from_the_other_end_the_same_peak_is_found_behind_both_folds(duffing, response):
    back = continue_orbit(find_orbit(duffing, {"w": 2.5}, [0.0, 0.0]), "w", (0.5, 2.6), events={A1: "extremum"})
    assert [point.type for point in back.special_points].count("EX") == 1
    assert back["EX1"].value("w") == pytest.approx(response["EX1"].value("w"), abs=1e-11)


@pytest.mark.campaign
@pytest.mark.parametrize("with_parameters", [True, False])
def test_a_quantity_of_a_family_of_swings_has_a_least_value(with_parameters):
    """Of a system without parameters too, by differences."""
    values, field = ({"k": 1.0, "b": 1.0, "c": 0.0}, "-k*x - b*x**3 + c*v") if with_parameters else ({}, "-sin(x)")
    system = saltus.HybridSystem.smooth({"x": "v", "v": field}, values)
    swing = saltus.solve_orbit(system, x0=[1.0, 0.0], period=5.5, fix={"max_x": 1.0})
    name = "mean((x**2 - 1)**2)"
    swings = continue_orbit(swing, "max_x", (0.5, 2.0), events={name: "extremum", "max_v": "extremum"})
    (least,) = swings.special_points.of_type("EX")
    assert least.of == name
    column = swings.column(name)
    i = int(np.argmin(column))
    near = np.polyfit(swings.values[i - 2 : i + 3], column[i - 2 : i + 3], 4)
    place = next(
        root.real
        for root in np.roots(np.polyder(near))
        if abs(root.imag) < 1e-9 and swings.values[i - 2] < root.real < swings.values[i + 2]
    )
    assert least.value("max_x") == pytest.approx(place, abs=1e-5)


def test_the_slowest_impact_of_an_impact_oscillator(impact_oscillator):
    start = find_orbit(impact_oscillator, {"w": 0.9}, [0.0, 0.0])
    branch = continue_orbit(start, "w", (0.88, 0.97), events={"velocity(impact)": "extremum"})
    best = saltus.optimise(start, minimise="velocity(impact)", vary={"w": (None, None)})
    assert branch["EX1"].value("w") == pytest.approx(best["w"], abs=1e-9)


@pytest.mark.campaign
def test_at_a_corner_of_the_quantity_rejected_steps_tell_that_there_is_no_zero(duffing):
    """The least value at w = 1, where the maximum changes places, is none of a smooth quantity."""
    name = "max((x - 5*(w - 1))**2)"
    start = find_orbit(duffing, {**LINEAR, "w": 0.95}, [0.0, 0.0])
    branch = continue_orbit(start, "w", (0.9, 1.04), events={name: "extremum"})
    assert branch.values[np.argmin(branch.column(name))] == pytest.approx(1.0, abs=1e-5)
    assert not len(branch.special_points)
    assert any("no zero of EX 0" in told for told in branch.rejected)


def test_of_equilibria_and_fixed_points_states_and_outputs_have_extrema():
    """Along p the state is x = p and y = x (2 - x), greatest at p = 1; the output y - x/2 is greatest at p = 3/4."""
    outputs = {"low": "y - x/2"}
    field = saltus.HybridSystem.smooth({"x": "p - x", "y": "x*(2 - x) - y"}, {"p": 0.2}, outputs=outputs)
    points = saltus.Map(("x", "y"), {"p": 0.2}, {"x": "p", "y": "x*(2 - x)"}, outputs=outputs)
    events = {"y": "extremum", "low": "extremum", "x": 0.5}
    rests = continue_equilibrium(find_equilibrium(field, x0=[0.2, 0.36]), "p", (0.0, 2.0), events=events)
    cycles = continue_orbit(saltus.find_orbit(points, x0=[0.2, 0.36]), "p", (0.0, 2.0), events=events)
    for branch in (rests, cycles):
        found = {(point.type, point.of): point.value("p") for point in branch.special_points}
        assert found == pytest.approx({("x", ""): 0.5, ("EX", "low"): 0.75, ("EX", "y"): 1.0}, abs=1e-9)
    ended = continue_equilibrium(
        find_equilibrium(field, x0=[0.2, 0.36]), "p", (0.0, 2.0), events={"y": "extremum"}, stop_at="y"
    )
    assert ended.values[-1] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.campaign
def test_extrema_are_saved_and_drawn(response, tmp_path):
    again = saltus.load(response.save(tmp_path / "response.nc"))
    assert again == response
    assert again["EX1"].of == A1
    assert again.options["events"] == {A1: "extremum"}
    assert "extremum of amplitude(x, 1)" in repr(again["EX1"])
    ax = response.plot(y=A1)
    assert "EX, extremum" in [text.get_text() for text in ax.get_legend().get_texts()]


BAD = {
    "the parameter": ({"w": "extremum"}, "where the branch turns in it is an SN"),
    "another word": ({A1: "peak"}, "must be a finite number, or 'extremum'"),
    "a jump": ({"mean(sign(v))": "extremum"}, "of orbits that have its derivative"),
    "no quantity": ({"max_q": "extremum"}, "max_q"),
}


@pytest.mark.parametrize("what", BAD)
def test_what_has_no_extremum_is_told(duffing, what):
    events, message = BAD[what]
    with pytest.raises(InputError) as caught:
        continue_orbit(find_orbit(duffing, {"w": 0.6}, [0.0, 0.0]), "w", (0.5, 0.7), events=events)
    assert message in str(caught.value)


def test_an_end_at_an_extremum_needs_one_that_is_asked_for(duffing):
    with pytest.raises(InputError, match="stop_at = 'EX'"):
        continue_orbit(find_orbit(duffing, {"w": 0.6}, [0.0, 0.0]), "w", (0.5, 0.7), stop_at="EX")
