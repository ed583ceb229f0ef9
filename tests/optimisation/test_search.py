"""Best orbits against closed forms, SciPy, grids of orbits, and each other from several starts."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

import saltus
from saltus import InputError, continue_orbit, find_orbit, optimise
from saltus.optimisation.carrying import carried, carrying
from saltus.options import OptimumOptions
from selection import guarding

LINEAR = {"b": 0.0, "A": 1.0, "c": 0.4, "w": 0.6}
A1 = "amplitude(x, 1)"


@pytest.fixture(scope="module")
def linear(duffing):
    return find_orbit(duffing, LINEAR, [0.0, 0.0])


@pytest.fixture(scope="module")
def driven(duffing):
    return find_orbit(duffing, {"w": 1.2}, [0.0, 0.0])


@pytest.fixture(scope="module")
def response(duffing):
    return continue_orbit(find_orbit(duffing, {"w": 0.6}, [0.0, 0.0]), "w", (0.5, 2.6))


def gain(w, c=0.4, k=1.0):
    """Amplitude of the linear oscillator under a force of amplitude 1."""
    return 1.0 / np.hypot(k - w**2, c * w)


def rate(function, place, step=1e-5):
    return (function(place + step) - function(place - step)) / (2.0 * step)


def of(table, constraint, side):
    """Multiplier of a bound."""
    return float(table.multipliers[list(zip(table.constraints, table.sides, strict=True)).index((constraint, side))])


# closed forms


@pytest.mark.parametrize("w", [0.3, 0.6, 0.95, 1.6])
def test_the_resonance_of_a_linear_oscillator_from_several_starts(duffing, w):
    found = optimise(find_orbit(duffing, {**LINEAR, "w": w}, [0.0, 0.0]), maximise=A1, vary={"w": (None, None)})
    assert found["w"] == pytest.approx(np.sqrt(1.0 - 0.4**2 / 2.0), rel=1e-9)
    assert found.best == pytest.approx(1.0 / (0.4 * np.sqrt(1.0 - 0.4**2 / 4.0)), rel=1e-12)
    assert found.stopped == "the optimum is found"
    assert found.notes == ()
    assert found.curvature > 0.0
    assert not found.active


def test_the_multiplier_of_an_active_bound_is_the_derivative_of_the_best_objective(linear):
    found = optimise(linear, maximise=A1, vary={"w": (None, 0.8)})
    assert found["w"] == 0.8
    assert of(found, "w", "upper") == pytest.approx(rate(gain, 0.8), rel=1e-8)
    least = optimise(linear, minimise=A1, vary={"w": (0.5, 0.8)})
    assert least["w"] == 0.5
    assert of(least, "w", "lower") == pytest.approx(rate(gain, 0.5), rel=1e-8)
    assert least.curvature == np.inf


def test_the_least_damping_for_an_amplitude_and_its_multiplier(linear):
    """The objective is a parameter; the constraint is the closed form of the amplitude."""

    def damping(most):
        return np.sqrt(most**-2 - (1.0 - 0.6**2) ** 2) / 0.6

    found = optimise(linear, minimise="c", vary={"c": (0.01, 2.0)}, subject_to={A1: (None, 1.5)})
    assert found["c"] == pytest.approx(damping(1.5), rel=1e-9)
    assert of(found, A1, "upper") == pytest.approx(rate(damping, 1.5), rel=1e-6)
    assert found.active == {A1: of(found, A1, "upper")}


@pytest.mark.parametrize("unit", [1e6, 1e-9])
def test_units_far_from_one_change_nothing_but_the_units(duffing, linear, unit):
    """Frequencies in `unit`, lengths in thousandths: the same optimum, all multipliers in their own units."""
    values = {"k": unit**2, "c": 0.4 * unit, "b": 0.0, "A": 1e-3 * unit**2, "w": 0.6 * unit}
    other = find_orbit(duffing, values, [0.0, 0.0])
    one, two = (
        optimise(
            orbit, maximise=A1, vary={"w": (None, None), "c": (0.1 * rate, None)},
            subject_to={"max_v": (None, 3.0 * length * rate)},
        )
        for orbit, rate, length in ((linear, 1.0, 1.0), (other, unit, 1e-3))
    )  # fmt: skip
    assert two.values / unit == pytest.approx(one.values, rel=1e-8)
    assert two.best == pytest.approx(1e-3 * one.best, rel=1e-8)
    assert of(two, "max_v", "upper") * unit == pytest.approx(of(one, "max_v", "upper"), rel=1e-6)
    assert of(two, "c", "lower") * unit * 1e3 == pytest.approx(of(one, "c", "lower"), rel=1e-6)


def test_two_active_constraints_leave_the_closed_form(linear):
    """At the least damping the velocity w gain(w) is held; both multipliers follow from the two slopes."""
    found = optimise(
        linear, maximise=A1, vary={"w": (None, None), "c": (0.1, None)}, subject_to={"amplitude(v, 1)": (None, 3.0)}
    )

    def best(c, most):
        w = brentq(lambda w: w * gain(w, c) - most, 0.3, 0.95)
        return gain(w, c)

    assert found.best == pytest.approx(best(0.1, 3.0), rel=1e-9)
    assert of(found, "amplitude(v, 1)", "upper") == pytest.approx(rate(lambda most: best(0.1, most), 3.0), rel=1e-6)
    assert of(found, "c", "lower") == pytest.approx(rate(lambda c: best(c, 3.0), 0.1), rel=1e-6)


def test_an_observable_is_held_by_equal_bounds(linear):
    found = optimise(linear, minimise="A", vary={"A": (None, None), "w": (None, None)}, subject_to={A1: (2.0, 2.0)})
    assert found.orbit.observe(A1)[A1] == pytest.approx(2.0, rel=1e-9)
    assert found["w"] == pytest.approx(np.sqrt(0.92), rel=1e-7)
    assert sum(found.active.values()) == pytest.approx(1.0 / gain(found["w"]), rel=1e-6)


def test_a_phase_goes_on_beyond_a_turn_and_a_formula_in_it_ends_there(linear):
    """The lag of the linear oscillator grows with w towards half a turn; the phase itself passes no cut."""
    found = optimise(linear, minimise="phase(x, 1)", vary={"w": (None, 3.0)})
    assert found["w"] == 3.0
    assert found.best == pytest.approx(np.pi / 2.0 - np.arctan2(0.4 * 3.0, 1.0 - 9.0), rel=1e-10)


# stability, sheets, grazings


@pytest.mark.campaign
def test_at_a_fold_stability_is_active_and_its_multiplier_is_a_derivative(driven, response):
    found, wider = (
        optimise(
            driven,
            minimise="period",
            vary={"w": (None, None)},
            subject_to={"stable": True},
            options=OptimumOptions(margin=margin),
        )
        for margin in (0.01, 0.010001)
    )
    fold = response["SN1"].value("w")
    assert 0.0 < fold - found["w"] < 2e-5
    assert np.abs(found.orbit.multipliers).max() == pytest.approx(0.99, abs=1e-8)
    assert of(found, "stable", "upper") == pytest.approx((found.best - wider.best) / 1e-6, rel=1e-3)
    assert found.notes == ()
    near = optimise(driven, minimise="period", vary={"w": (None, None)}, subject_to={"stable": True})
    assert np.abs(near.orbit.multipliers).max() == pytest.approx(0.999, abs=1e-6)
    assert 0.0 < fold - near["w"] < 2e-7


@pytest.mark.campaign
def test_without_the_constraint_the_fold_ends_the_search_in_words(driven, response):
    found = optimise(driven, minimise="period", vary={"w": (None, None)})
    assert found["w"] == pytest.approx(response["SN1"].value("w"), abs=1e-6)
    assert found["w"] < response["SN1"].value("w")
    assert "no optimum: the smooth piece ends next to w = 2.2119" in found.stopped
    assert found.orbit.max["x"] > 2.0  # not an orbit of the lower sheet


def test_an_orbit_is_not_carried_to_another_sheet(driven, response):
    """Beyond the fold only the small orbit is left, and Newton's method finds it from some guesses."""
    start = carrying(driven, ["w"])
    assert isinstance(carried(start, np.array([2.3])), str)
    there = carried(start, np.array([2.1]))
    upper = max(response.at(2.1), key=lambda orbit: orbit.max["x"])
    assert there.orbit.max["x"] == pytest.approx(upper.max["x"], rel=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize("w", [0.8, 1.2, 2.0])
def test_the_peak_of_a_duffing_oscillator_from_several_starts_and_from_the_branch(duffing, response, w):
    start = max(response.at(w), key=lambda orbit: orbit.max["x"])
    found = optimise(start, maximise=A1, vary={"w": (None, None)}, subject_to={"stable": True})

    def amplitude(value):
        sheet = max(response.at(value), key=lambda orbit: orbit.max["x"])
        return sheet.observe(A1)[A1]

    other = minimize_scalar(lambda value: -amplitude(value), bounds=(2.15, 2.2119), method="bounded")
    assert found.best >= -other.fun - 1e-12
    assert found["w"] == pytest.approx(other.x, abs=1e-5)
    best = optimise(response, maximise=A1, vary={"w": (None, None)}, subject_to={"stable": True})
    assert best["w"] == pytest.approx(found["w"], abs=1e-7)
    assert abs(best.start[0] - best["w"]) < 0.05


@pytest.mark.campaign
def test_the_least_force_for_an_amplitude_over_force_and_frequency(driven):
    """From below, the constraint is violated at the start; the multiplier is that of a changed bound."""

    def least(amplitude):
        limits = {"stable": True, A1: (amplitude, None)}
        return optimise(driven, minimise="A", vary={"A": (None, None), "w": (1.0, 3.0)}, subject_to=limits)

    found = least(1.5)
    assert found.orbit.observe(A1)[A1] == pytest.approx(1.5, rel=1e-9)
    assert of(found, A1, "lower") == pytest.approx(rate(lambda a: least(a).best, 1.5, 1e-4), rel=1e-5)
    for step in (0.01, -0.01):  # at other frequencies the same force gives less
        there = carried(carrying(found.orbit, ["w"]), found.values[1:] + step)
        assert isinstance(there, str) or there.orbit.observe(A1)[A1] < 1.5


def test_the_slowest_impact_and_an_active_grazing_of_an_impact_oscillator(impact_oscillator):
    start = find_orbit(impact_oscillator, {"w": 0.9}, [0.0, 0.0])
    found = optimise(start, minimise="velocity(impact)", vary={"w": (None, None)}, subject_to={"stable": True})
    grid = [one.orbit.observe("velocity(impact)")["velocity(impact)"] for one in
            (carried(carrying(start, ["w"]), np.array([w])) for w in np.linspace(0.88, 0.97, 10))]  # fmt: skip
    assert found.best < min(grid)
    assert found.best == pytest.approx(min(grid), rel=1e-3)
    ended = optimise(start, maximise="max(v)", vary={"w": (0.5, 1.5), "e": (0.3, 0.95)})
    assert "no optimum: the smooth piece ends" in ended.stopped
    assert "grazing" in ended.stopped
    assert ended.orbit.admissible
    assert ended.orbit.signature == start.signature
    assert max(map(abs, ended.orbit.multipliers)) < 1.0


@pytest.mark.campaign
def test_a_gap_of_a_tapping_cantilever_is_kept(afm1):
    start = find_orbit(afm1, {"Omega": 1.0}, [0.0, 0.0])

    def greatest(gap):
        limits = {"stable": True, "min_z": (gap, None)}
        return optimise(start, maximise="amplitude(q1, 1)", vary={"Omega": (None, None), "ybar": (0.05, 0.2)},
                        subject_to=limits)  # fmt: skip

    found = greatest(-0.002)
    assert found.orbit.min["z"] == pytest.approx(-0.002, abs=1e-10)
    assert found["ybar"] == 0.05
    assert of(found, "min_z", "lower") == pytest.approx(rate(lambda gap: greatest(gap).best, -0.002), rel=1e-4)
    grid = [carried(carrying(found.orbit, ["Omega", "ybar"]), found.values + np.array([dw, dy]))
            for dw in (-1e-4, 1e-4) for dy in (0.0, 1e-4)]  # fmt: skip
    better = [one.orbit.observe("amplitude(q1, 1)")["amplitude(q1, 1)"] > found.best for one in grid]
    meets = [one.orbit.min["z"] >= -0.002 for one in grid]
    assert any(better)  # which the gap forbids
    assert not np.any(np.logical_and(better, meets))


@pytest.mark.campaign
def test_the_largest_limit_cycle_of_van_der_pol(duffing):
    """Its amplitude has a maximum over mu (SciPy's integrator at both sides and there)."""
    system = saltus.HybridSystem.smooth({"x": "y", "y": "mu*(1 - x**2)*y - k*x + b"}, {"mu": 1.5, "k": 1.0, "b": 0.0})
    start = find_orbit(system, {}, [2.0, 0.0])
    found = optimise(start, maximise="max(x)", vary={"mu": (None, None)}, subject_to={"stable": True})

    def amplitude(mu):
        def turns(t, y):
            return y[1]

        turns.direction = -1.0
        flow = solve_ivp(
            lambda t, y: [y[1], mu * (1.0 - y[0] ** 2) * y[1] - y[0]], (0.0, 60.0), [2.0, 0.0],
            method="DOP853", rtol=1e-12, atol=1e-12, events=turns,
        )  # fmt: skip
        return flow.y_events[0][-1, 0]

    assert found.best == pytest.approx(amplitude(found["mu"]), abs=1e-10)
    assert amplitude(found["mu"] - 0.05) < found.best > amplitude(found["mu"] + 0.05)
    assert found["mu"] == pytest.approx(3.294, abs=1e-3)


# where there is nothing to find


BAD = {
    "both": ({"minimise": A1}, "maximise, minimise = 'both': must be one of both"),
    "neither": ({"maximise": ""}, "maximise, minimise = 'neither': must be one of both"),
    "no orbit": ({"start": 3.0}, "start = 3.0: must be a Branch or a PeriodicOrbit"),
    "no parameter": ({"vary": {"q": (None, None)}}, "vary = 'q': must be one of k, c, b, A, g, w"),
    "no parameters": ({"vary": {}}, "vary = {}: must be at least one parameter"),
    "no observable": ({"maximise": "amplitud(x, 1)"}, "did you mean 'amplitude'"),
    "a state": ({"maximise": "x"}, "observable = 'x': must be one number of an orbit; as 'mean(x)'"),
    "no constraint": ({"subject_to": {"max(q)": (0.0, 1.0)}}, "q"),
    "one bound": ({"subject_to": {"max(x)": 1.0}}, "a lower and an upper bound, None for none"),
    "swapped": ({"subject_to": {"max(x)": (2.0, 1.0)}}, "the lower first"),
    "a parameter's": ({"subject_to": {"c": (0.0, 1.0)}}, "vary={'c': ...} bounds a parameter"),
    "no bounds": ({"vary": {"w": None}}, "vary['w'] = None: must be a lower and an upper bound"),
    "an empty range": ({"vary": {"w": (1.0, 1.0)}}, "that leave a range"),
    "excluded": ({"vary": {"w": (0.7, None)}}, "w of the start = 0.6: must be between 0.7 and inf, as in `vary`"),
    "stable": ({"subject_to": {"stable": 1}}, "subject_to['stable'] = 1: must be True or False"),
    "does not move": ({"vary": {"k": (None, None)}, "maximise": "period"},
        "vary = 'k': must be parameters that move period"),
    "rounding": ({"maximise": "mean(x)"}, "but for rounding, it is constant next to the start"),
    "infeasible": ({"subject_to": {A1: (9.0, None)}}, "must be constraints that an orbit can meet; w = 0.9591663"),
    "contrary": ({"subject_to": {"max(x)": (2.0, None), "min(x)": (-1.0, None)}}, "at best"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_bad_input_is_told(linear, what):
    given, message = BAD[what]
    with pytest.raises(InputError) as caught:
        optimise(**({"start": linear, "maximise": A1, "vary": {"w": (None, None)}} | given))
    assert message in str(caught.value)


def test_an_unstable_start_is_told_under_stable_alone(response):
    middle = next(orbit for orbit in response.at(2.0) if not orbit.stable)
    with pytest.raises(InputError, match=r"start = 'unstable, \|multiplier\| .*must be stable, as in `subject_to`"):
        optimise(middle, minimise=A1, vary={"w": (None, None)}, subject_to={"stable": True})
    found = optimise(middle, minimise=A1, vary={"w": (1.8, 2.1)})
    assert found["w"] == 1.8
    assert not found.orbit.stable


@pytest.mark.parametrize("field", [{"margin": 0.0}, {"reach": -1.0}, {"max_orbits": 0}])
def test_options_are_checked(field):
    with pytest.raises(InputError, match=f"OptimumOptions.{next(iter(field))}"):
        OptimumOptions(**field)


def test_a_branch_without_a_usable_orbit_is_told(response):
    with pytest.raises(InputError, match="admissible, stable orbit within `vary`"):
        optimise(response, maximise=A1, vary={"w": (3.0, 4.0)}, subject_to={"stable": True})


def test_the_start_of_a_minimum_for_a_maximum_is_no_optimum(duffing):
    """At w**2 = 0.92 the slope vanishes exactly to rounding: the curvature tells which optimum it is."""
    peak = find_orbit(duffing, {**LINEAR, "w": np.sqrt(0.92)}, [0.0, 0.0])
    found = optimise(peak, minimise=A1, vary={"w": (None, None)})
    assert found.curvature < 0.0 or found["w"] != pytest.approx(np.sqrt(0.92), abs=1e-3)
    assert found.stopped != "the optimum is found" or any("no optimum" in note for note in found.notes)


def test_an_interrupt_and_a_limit_of_orbits_keep_the_best_so_far(linear):
    seen = []

    def stop(progress):
        seen.append(progress)
        if progress.done == 3:
            raise KeyboardInterrupt

    found = optimise(linear, maximise=A1, vary={"w": (None, None)}, progress=stop)
    assert found.stopped == "interrupted: the best so far"
    assert found.best > gain(0.6)
    assert A1 in seen[0].text
    few = optimise(linear, maximise=A1, vary={"w": (None, None)}, options=OptimumOptions(max_orbits=2))
    assert few.stopped == "no more orbits are allowed: the best so far"
    assert np.isnan(few.mismatch)


# the result


@pytest.fixture(scope="module")
def optimum(linear):
    return optimise(
        linear,
        maximise=A1,
        vary={"w": (None, None), "c": (0.1, None)},
        subject_to={"max_v": (None, 3.0), "stable": True},
    )


@pytest.mark.campaign
def test_an_optimum_is_saved_read_pickled_and_told(optimum, tmp_path):
    again = saltus.load(optimum.save(tmp_path / "optimum.nc"))
    assert again == optimum
    assert pickle.loads(pickle.dumps(optimum)) == optimum
    assert again["w"] == optimum["w"]
    assert again.orbit == optimum.orbit
    assert "active: max_v <= 3, multiplier" in repr(again)
    assert "the optimum is found" in repr(again)
    table = optimum.to_dataframe()
    assert table.loc["max_v", "bound"] == 3.0
    assert table.loc["stable", "multiplier"] == 0.0
    assert optimum.path_objective[-1] == optimum.best
    assert replace(optimum, best=0.0) != optimum


def test_a_file_whose_orbit_is_at_other_parameters_is_refused(optimum):
    dataset = optimum.to_xarray()
    dataset["value"] = dataset["value"] + 1.0
    with pytest.raises(InputError, match="the parameters of the orbit"):
        saltus.results.Optimum.from_xarray(dataset)


def test_the_picture_shows_the_way_and_active_bounds(optimum):
    ax = optimum.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$w$", "$c$")
    assert ax.lines[0].get_xdata() == pytest.approx(optimum.path[:, 0])
    assert list(ax.lines[-1].get_ydata()) == [0.1, 0.1]  # the bound of c
    other = optimum.plot("c", A1, legend=False)
    assert other.lines[0].get_ydata() == pytest.approx(optimum.path_objective)
    with pytest.raises(InputError, match="quantity = 'k'"):
        optimum.plot("k")


# bounds where orbits end


def struck(limit=1.0):
    """A driven oscillator x'' = -x - c x' + A cos(w t) before a wall at `limit`."""
    reset = saltus.Transition("f", "f", "x - d", 1, reset={"v": "-0.8*v"}, name="hit")
    return saltus.HybridSystem(
        ("x", "v"),
        {"c": 0.1, "w": 0.7, "A": 0.3 * limit, "d": limit},
        {"f": saltus.Mode({"x": "v", "v": "-x - c*v + A*cos(s)"})},
        [reset],
        phase=("s", "w"),
    )


@pytest.mark.parametrize("limit", guarding([1e-9, 1.0, 1e9], 1.0))
def test_a_bound_at_the_grazing_is_the_optimum(limit):
    """The greatest x without an impact is that of the wall, and A is that at which it is touched."""
    start = saltus.find_orbit(struck(limit), {}, [0.0, 0.0])
    found = saltus.optimise(
        start, maximise="max(x)", vary={"A": (0.1 * limit, 2.0 * limit)}, subject_to={"max(x)": (None, limit)}
    )
    assert found.stopped == "the optimum is found"
    assert found["A"] == pytest.approx(np.hypot(1.0 - 0.49, 0.07) * limit, rel=1e-5)
    assert found.multipliers[0] == pytest.approx(1.0, rel=1e-4)  # the best x is the bound itself
    assert "the optimum lies on a bound" in found.notes[0]


def test_rest_on_a_bound_is_the_optimum(duffing):
    start = saltus.find_orbit(duffing, {"b": 0.0, "w": 0.7}, [0.0, 0.0])
    found = saltus.optimise(start, minimise="max(x)", vary={"A": (0.0, 1.0)})
    assert found.stopped == "the optimum is found"
    assert found["A"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("c", "w", "A"), np.random.default_rng(0).uniform((0.05, 0.4, 0.1), (0.5, 2.0, 0.9), (12, 3)))
def test_multiplier_at_a_rest_on_a_bound_is_that_of_its_side(duffing, c, w, A):
    """max(x) is |A| over the known stiffness: it has a corner at the bound A = 0, where derivatives are rounding."""
    start = saltus.find_orbit(duffing, {"b": 0.0, "w": w, "c": c, "A": A}, [0.0, 0.0])
    found = saltus.optimise(start, minimise="max(x)", vary={"A": (0.0, 1.0)})
    assert found.stopped == "the optimum is found"
    assert found["A"] == pytest.approx(0.0, abs=1e-6)
    right = found.multipliers[0] == pytest.approx(1.0 / np.hypot(1.0 - w * w, c * w), rel=1e-6)
    assert right or "disagree" in " ".join(found.notes)


def test_the_end_of_a_smooth_piece_away_from_bounds_is_none():
    start = saltus.find_orbit(struck(), {}, [0.0, 0.0])
    found = saltus.optimise(start, maximise="max(x)", vary={"A": (0.1, 0.7)})
    assert "no optimum: the smooth piece ends" in found.stopped
