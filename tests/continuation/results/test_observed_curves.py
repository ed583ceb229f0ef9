"""Observables along branches and loci, against closed forms and the orbits' own."""

import math

import numpy as np
import pytest

import saltus
from oracles.closed_forms import ImpactOrbit
from saltus.errors import InputError


@pytest.fixture(scope="module")
def branch(impact_oscillator):
    """From impacts through the fold and the grazing to the response without impacts."""
    closed = ImpactOrbit(1.1)
    guess = [("free", "impact", closed.after_impact(closed.speeds(1.0)[1]), closed.period)]
    orbit = saltus.solve_orbit(impact_oscillator, {"w": 1.1, "A": 1.0}, guess)
    return saltus.continue_orbit(orbit, "A", bounds=(0.05, 2.0))


@pytest.fixture(scope="module")
def response(impact_oscillator):
    """A resonance without impacts, along the frequency."""
    z = 0.05 / complex(1.0 - 0.5**2, 0.1 * 0.5)
    guess = [("free", "theta", [z.real, -0.5 * z.imag], 2.0 * math.pi / 0.5)]
    orbit = saltus.solve_orbit(impact_oscillator, {"w": 0.5, "A": 0.05}, guess)
    return saltus.continue_orbit(orbit, "w", bounds=(0.5, 2.0))


def test_speeds_of_impact_follow_the_closed_form_along_a_branch(branch):
    speeds = branch.column("velocity(impact)")
    hits = np.isfinite(speeds)
    assert 5 < hits.sum() < len(branch)
    amplitudes = [ImpactOrbit(1.1).amplitude(U) for U in speeds[hits]]
    assert amplitudes == pytest.approx(branch.values[hits], abs=1e-9)
    free = [all(transition != "impact" for _, transition in branch.signature(i)) for i in range(len(branch))]
    assert np.array_equal(~hits, free)


def test_amplitude_and_phase_of_a_resonance_are_those_of_its_impedance(response):
    observed = response.observe("amplitude(x, 1)", "phase(x, 1)")
    w = response.values
    z = 0.05 / (1.0 - w**2 + 0.1j * w)
    assert np.array_equal(observed["w"].values, w)
    assert observed["amplitude(x, 1)"].values == pytest.approx(np.abs(z), abs=1e-10)
    assert observed["phase(x, 1)"].values == pytest.approx(np.angle(z) + math.pi / 2.0, abs=1e-9)


def test_a_phase_runs_on_along_a_curve(response):
    """That of -x falls by nearly pi, from -pi/2, and passes -pi where x lags behind the drive by a quarter turn."""
    phase = response.column("phase(-x, 1)")
    assert phase.min() < -math.pi
    assert np.abs(np.diff(phase)).max() < 1.0
    lag = phase - response.column("phase(x, 1)")
    assert lag == pytest.approx(np.full(len(response), -math.pi), abs=1e-9)


def test_points_and_special_points_have_the_observables_of_their_orbits(branch):
    for name in ("amplitude(x, 1)", "phase(x, 1)", "mean(x**2)", "max(v)"):
        column = branch.column(name)
        assert column[7] == pytest.approx(branch.solution(7).observe(name)[name], abs=1e-12)
        for point in branch.special_points:
            lower = int(point.position)
            low, high = sorted(column[[lower, min(lower + 1, len(branch) - 1)]])
            assert low - 0.1 <= branch.value_at(point, name) <= high + 0.1
    fold = branch["SN1"]
    assert branch.value_at(fold, "velocity(impact)") == pytest.approx(ImpactOrbit(1.1).U_fold, abs=1e-6)


SURVEYED = ("mean(x)", "amplitude(x, 1)", "phase(x, 1)", "amplitude(v, 1)", "fraction(free)", "max(x)", "min(v)")


@pytest.mark.campaign
def test_what_the_survey_sums_is_what_each_orbit_shows_by_itself(branch, tmp_path):
    held = saltus.load(branch.save(tmp_path / "branch.nc"))
    for name in SURVEYED:
        alone = np.array([orbit.observe(name)[name] for orbit in branch])
        along = branch.column(name)
        assert (
            np.angle(np.exp(1j * (along - alone))) == pytest.approx(0.0, abs=1e-10)
            if "phase" in name
            else (along == pytest.approx(alone, abs=1e-10))
        )
        assert np.array_equal(held.column(name), along)


def test_harmonics_of_doubled_and_of_autonomous_orbits_are_the_orbits_own(impact_oscillator):
    twice = saltus.find_orbit(impact_oscillator, {"w": 1.1, "A": 4.5}, [0.0, 0.0])
    doubled = saltus.continue_orbit(twice, "A", bounds=(4.45, 4.6))
    van_der_pol = saltus.HybridSystem.smooth({"x": "y", "y": "mu*(1 - x**2)*y - x"}, {"mu": 1.0})
    cycles = saltus.continue_orbit(saltus.find_orbit(van_der_pol, {}, [2.0, 0.0]), "mu", bounds=(0.8, 1.2))
    for curve, names in ((doubled, ("mean(x)", "amplitude(x, 1)")), (cycles, ("amplitude(y, 1)", "mean(x)"))):
        for name in names:
            alone = [orbit.observe(name)[name] for orbit in curve]
            assert curve.column(name) == pytest.approx(np.array(alone), abs=1e-10)


@pytest.mark.campaign
def test_formulas_in_observables_and_parameters_are_columns(response):
    w = response.values
    z = 0.05 / (1.0 - w**2 + 0.1j * w)
    lag = response.column("-degrees(phase(x, 1))")
    assert lag == pytest.approx(-np.degrees(np.angle(z) + math.pi / 2.0), abs=1e-7)
    gain = response.column("(max(x) - min(x))/(2*A)*w")
    assert gain == pytest.approx(np.abs(z) / 0.05 * w, abs=1e-9)
    special = saltus.continue_orbit(
        response.solution(0), "w", bounds=(0.5, 2.0), events={"(max(x) - min(x))/2": 0.3}
    ).special_points
    assert [abs(0.05 / (1.0 - p.parameters["w"] ** 2 + 0.1j * p.parameters["w"])) for p in special] == pytest.approx(
        [0.3, 0.3], abs=1e-9
    )


def test_the_period_is_part_of_formulas_of_orbits(response, impact_oscillator):
    assert response.column("2*pi/period") == pytest.approx(response.values, rel=1e-14)
    orbit = response.solution(3)
    assert orbit.observe("mean(x)*0 + period") == {"mean(x)*0 + period": pytest.approx(orbit.period, rel=1e-14)}
    motion = saltus.simulate(impact_oscillator, {}, [0.0, 0.0], periods=3)
    with pytest.raises(InputError, match="observable = 'period': must be of a periodic motion"):
        motion.observe("2*pi/period")


def test_extremes_are_those_that_the_branch_keeps(branch):
    observed = branch.observe("max(x)", "min(v)")
    assert observed["max(x)"].values == pytest.approx(branch.column("max_x"), abs=1e-10)
    assert observed["min(v)"].values == pytest.approx(branch.column("min_v"), abs=1e-10)


def test_a_locus_is_observed_like_a_branch(branch):
    """On the SN locus the speed of the impact is the closed form of the fold's, at each frequency."""
    locus = saltus.continue_locus(branch["SN1"], ("w", "A"), bounds={"w": (1.05, 1.2), "A": (0.01, 2.0)})
    speeds = locus.column("velocity(impact)")
    assert len(locus) > 3
    assert speeds == pytest.approx([ImpactOrbit(w).U_fold for w in locus.column("w")], abs=1e-6)


@pytest.mark.campaign
def test_a_saved_branch_is_observed_alike(branch, tmp_path):
    again = saltus.load(branch.save(tmp_path / "branch.nc"))
    assert np.array_equal(again.column("amplitude(x, 2)"), branch.column("amplitude(x, 2)"))
    assert again == branch


def test_an_observable_is_drawn_against_the_parameter(branch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    ax = branch.plot(y="amplitude(x, 1)")
    drawn = np.concatenate([line.get_xydata() for line in ax.lines if line.get_marker() in ("None", "")])
    for place in np.column_stack([branch.values, branch.column("amplitude(x, 1)")]):
        assert np.abs(drawn - place).max(axis=1).min() < 1e-9
    assert ax.get_ylabel() == "amplitude(x, 1)"
    branch.plot(y="velocity(impact)", x="phase(x, 1)")
    pyplot.close("all")


def test_a_column_that_is_not_there_is_told(branch):
    with pytest.raises(InputError, match=r"quantity = 'max_y': must be one of A, .* or an observable, .* 'max_x'"):
        branch.column("max_y")
    with pytest.raises(InputError, match=r"observable = 'amp\(x, 1\)': must be one of max\(expression\)"):
        branch.column("amp(x, 1)")
    with pytest.raises(InputError, match=r"expression = 'y': must be in x, v, theta"):
        branch.observe("mean(x)", "mean(y)")
