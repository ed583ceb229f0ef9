"""Orbits of tip and sample: numbers found by SciPy beforehand, SciPy here, energies, Liouville's theorem.

Lever S: k 26 N/m, f0 300 kHz, Q 400. Lever P: k 2, f0 70, Q 150. The quoted numbers are the converged digits of a code
that integrates by DOP853 at 1e-11 from event to event and applies Newton's method to the period map.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from oracles.tip import Stretch, Tip, attraction, jkr, sphere, two_sided
from saltus import afm
from saltus.errors import InputError

LEVER_S = {"k_N_m": 26.0, "f0_kHz": 300.0, "Q": 400.0}
LEVER_P = {"k_N_m": 2.0, "f0_kHz": 70.0, "Q": 150.0}


def tip_of(system, values, modes=1):
    """The same probe and drive for SciPy."""
    p = system.resolve(values)
    ends = ["" if i == 1 else f"_{i}" for i in range(1, modes + 1)]
    k, f0, Q, A0 = ([p[name + end] for end in ends] for name in ("k_N_m", "f0_kHz", "Q", "A0_nm"))
    F = [k_ * A / Q_ for k_, A, Q_ in zip(k, A0, Q, strict=True)]
    return Tip(k, f0, Q, F, [p["f_kHz"] * p.get(f"ratio{end}", 1.0) for end in ends], p["Zc_nm"]), p


def assert_scipy_agrees(orbit, law, region="far", turns=1, modes=1):
    """One period by SciPy from the orbit's state comes back, with the same means."""
    tip, p = tip_of(orbit.system, orbit.parameters, modes)
    found = tip.cycles(law(p), region, np.array(orbit.x0), turns)
    # DOP853 at 1e-11 over a period of some hundred steps; a jump of the force is met to the accuracy of the event
    np.testing.assert_allclose(found["end"], orbit.x0, rtol=0.0, atol=2e-8 * np.abs(orbit.x0).max())
    for mode in range(1, modes + 1):
        seen, end = afm.observables(orbit, of=mode), "" if mode == 1 else f"_{mode}"
        assert seen[f"amplitude_nm{end}"] == pytest.approx(found["amplitude_nm"][mode - 1], rel=1e-8)
        assert seen[f"lag_deg{end}"] == pytest.approx(found["lag_deg"][mode - 1], abs=1e-6)
    for name in ("E_ext_eV", "E_med_eV", "virial_eV"):
        assert seen[name] == pytest.approx(found[name], rel=1e-7)
    assert seen["E_ts_eV"] == pytest.approx(found["E_ts_eV"], abs=1e-8 * found["E_ext_eV"])
    if not math.isnan(seen["contact_fraction"]):
        assert seen["contact_fraction"] == pytest.approx(found["contact_fraction"], abs=1e-7)
    return seen


def assert_energies_balance(seen):
    assert seen["E_ext_eV"] - seen["E_med_eV"] == pytest.approx(seen["E_ts_eV"], abs=1e-9 * seen["E_ext_eV"])


def decay(orbit):
    """Exponent by which the cantilever's own damping contracts areas in a period."""
    p = orbit.parameters
    return 2e-3 * math.pi * p["f0_kHz"] / p["Q"] * orbit.period


def product(orbit):
    return float(np.prod(orbit.multipliers).real)


# van der Waals, DMT, a dashpot in contact


@pytest.fixture(scope="module")
def dmt():
    probe = afm.Probe(**LEVER_S, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5) + afm.Dashpot(c_uNs_m=0.0)
    return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)


@pytest.fixture(scope="module")
def approach(dmt):
    orbit = saltus.find_orbit(dmt, x0=[0.0, 0.0])
    return saltus.continue_orbit(orbit, "Zc_nm", bounds=(9.0, 13.0), events={"Zc_nm": 10.0})


@pytest.fixture(scope="module")
def damped(dmt):
    return saltus.find_orbit(dmt, {"c_uNs_m": 2.0}, x0=[0.0, 0.0])


def dmt_law(p):
    pull = attraction(p["H_aJ"], p["R_nm"], p["a0_nm"])
    return two_sided(
        lambda D, V, s: pull(D),
        lambda D, V, s: pull(D) + sphere(p["E_GPa"], p["R_nm"], p["a0_nm"] - D) - p["c_uNs_m"] * V,
        p["a0_nm"],
    )


@pytest.mark.campaign
def test_three_amplitudes_coexist_at_one_height(approach):
    orbits = [point.orbit for point in approach.special_points if point.type == "Zc_nm"]
    seen = sorted((afm.observables(orbit) for orbit in orbits), key=lambda one: -one["amplitude_nm"])
    wanted = [
        (10.71569893, 63.24971471, True, "repulsive"),
        (10.04804853, 123.1398751, False, "attractive"),
        (9.895278868, 124.4512443, True, "attractive"),
    ]
    assert len(seen) == 3
    for one, (amplitude, lag, stable, regime) in zip(seen, wanted, strict=True):
        assert one["amplitude_nm"] == pytest.approx(amplitude, rel=1e-9)
        assert one["lag_deg"] == pytest.approx(lag, rel=1e-9)
        assert (one["stable"], one["regime"]) == (stable, regime)
        assert_energies_balance(one)
        assert abs(one["E_ts_eV"]) < 1e-9 * one["E_ext_eV"]
    assert seen[0]["virial_eV"] == pytest.approx(-11.7498125, rel=1e-8)
    assert seen[2]["deflection_pm"] == pytest.approx(-8.75335, rel=1e-6)
    for orbit in orbits:
        assert_scipy_agrees(orbit, dmt_law)


def test_jumps_and_grazing_on_approach(approach):
    found = {point.type: [] for point in approach.special_points}
    for point in approach.special_points:
        found[point.type].append(point)
    jumps = sorted(point.parameters["Zc_nm"] for point in found["SN"])
    assert jumps == pytest.approx([9.878337793, 11.50288421], rel=1e-9)
    (grazing,) = found["GR"]
    assert grazing.parameters["Zc_nm"] == pytest.approx(11.34091369, rel=1e-9)
    assert afm.observables(grazing.orbit)["amplitude_nm"] == pytest.approx(11.04138, rel=1e-6)
    assert grazing.orbit.min["D_nm"] == pytest.approx(0.3, abs=1e-8)


@pytest.mark.campaign
def test_locus_of_the_jump_has_the_cusp_and_the_critical_amplitude(approach):
    bounds = {"Zc_nm": (1.0, 40.0), "A0_nm": (5.0, 40.0)}
    locus = saltus.continue_locus(approach["SN1"], ("Zc_nm", "A0_nm"), bounds)
    (cusp,) = (point.parameters for point in locus.special_points if point.type == "CP")
    assert (cusp["A0_nm"], cusp["Zc_nm"]) == (pytest.approx(25.6149973, abs=1e-7), pytest.approx(25.1789782, abs=1e-7))
    turns = [point.parameters for point in locus.special_points if point.type == "TP"]
    lowest = min(turns, key=lambda p: p["A0_nm"])
    assert lowest["A0_nm"] == pytest.approx(10.5434078, abs=1e-7)  # no jump to the repulsive branch below
    assert lowest["Zc_nm"] == pytest.approx(5.9804976, abs=1e-7)


def test_damping_in_contact(damped):
    orbit = damped
    seen = assert_scipy_agrees(orbit, dmt_law)
    wanted = {
        "amplitude_nm": 9.80540558, "lag_deg": 121.946729, "E_ts_eV": 4.712305, "min_force_nN": -8.005223,
        "contact_fraction": 0.04685831,
    }  # fmt: skip
    for name, value in wanted.items():
        assert seen[name] == pytest.approx(value, rel=2e-7), name
    assert np.abs(orbit.multipliers) == pytest.approx([0.9824323, 0.9601421], abs=1e-7)
    mass = 26.0 / (2e-3 * math.pi * 300.0) ** 2
    contact = seen["contact_time_us"] * 2.0 / mass
    assert product(orbit) == pytest.approx(math.exp(-decay(orbit) - contact), rel=1e-9)
    assert_energies_balance(seen)


def slope(orbit, name):
    """Derivatives of amplitude and lag by differences of solved orbits, of fourth order."""
    guess = [(one.mode, one.transition, one.state, one.duration) for one in orbit.segments]
    value = orbit.parameters[name]

    def at(step):
        seen = afm.observables(saltus.solve_orbit(orbit.system, {**orbit.parameters, name: value + step}, guess))
        return np.array([seen["amplitude_nm"], seen["lag_deg"]])

    step = 1e-4 * value
    near, far = ((at(h) - at(-h)) / (2.0 * h) for h in (step, 2.0 * step))
    return (4.0 * near - far) / 3.0


@pytest.mark.parametrize(
    ("name", "amplitude", "lag"),
    [
        ("H_aJ", -3.047971, 175.5153), ("E_GPa", 0.00742867, None), ("c_uNs_m", -0.01686345, None),
        ("R_nm", -0.03001542, None), ("a0_nm", 1.153323, None), ("Zc_nm", 0.9298894, -4.812085),
        ("A0_nm", 0.1052797, None),
    ],
)  # fmt: skip
def test_amplitude_and_lag_depend_on_every_parameter(damped, name, amplitude, lag):
    exact = damped.sensitivity(["amplitude(z1_nm, 1)", "90 - degrees(phase(z1_nm, 1))"], [name])
    found = [float(exact[column][0]) for column in list(exact)[:2]]
    assert found[0] == pytest.approx(amplitude, rel=1e-6)
    assert lag is None or found[1] == pytest.approx(lag, rel=1e-6)
    assert found == pytest.approx(slope(damped, name), rel=1e-6)


def test_the_radius_enters_with_the_hamaker_constant_and_the_modulus_only(damped):
    # as H R and E sqrt(R)
    names = [
        "amplitude(z1_nm, 1)",
        "phase(z1_nm, 1)",
        "min(D_nm)",
        "max(force_nN)",
        "mean(virial_aJ)",
        "fraction(contact)",
    ]
    slopes = damped.sensitivity(names)
    for column in names:
        by = {name: slopes[column].sel(parameter=name) * damped.parameters[name] for name in ("R_nm", "H_aJ", "E_GPa")}
        np.testing.assert_allclose(by["R_nm"], by["H_aJ"] + 0.5 * by["E_GPa"], rtol=1e-11)


def test_jumps_and_grazing_move_with_the_radius_as_with_the_constants_that_it_multiplies(approach):
    for kind in ("SN", "GR"):
        found = approach.special_points.of_type(kind)[0].sensitivity()["Zc_nm"]
        by = {name: float(found.sel(parameter=name)) for name in ("R_nm", "H_aJ", "E_GPa", "A0_nm")}
        if kind == "SN":
            assert 12.0 * by["R_nm"] == pytest.approx(0.12 * by["H_aJ"] + 0.75 * by["E_GPa"], rel=1e-8)
        assert abs(by["A0_nm"]) > 0.1


def test_observables_of_an_orbit_from_a_file_are_the_same(damped, tmp_path):
    read = saltus.load(damped.save(tmp_path / "orbit.nc"))
    assert dict(afm.observables(read)) == dict(afm.observables(damped))


def test_elastic_part_of_the_force_is_the_one_without_the_dashpot(dmt):
    orbit = saltus.find_orbit(dmt, {"c_uNs_m": 2.0, "Zc_nm": 5.0, "A0_nm": 40.0}, x0=[0.0, 0.0])
    seen = assert_scipy_agrees(orbit, dmt_law)
    deepest = -0.12 * 12.0 / (6.0 * 0.09) + sphere(1.5, 12.0, seen["indentation_nm"])
    assert seen["peak_elastic_nN"] == pytest.approx(deepest, rel=1e-8)
    assert seen["peak_force_nN"] > deepest > 0.0


def test_pull_in_of_a_tip_without_drive(dmt):
    rest = 1.5 * (0.12 * 12.0 / (3.0 * 26.0)) ** (1.0 / 3.0)
    z = saltus.simulate(dmt, {"A0_nm": 0.0, "Q": 1.0, "Zc_nm": 1.001 * rest}, [0.0, 0.0], periods=60)
    assert z.observe("min(D_nm)")["min(D_nm)"] == pytest.approx(2.0 / 3.0 * rest, rel=0.1)
    z = saltus.simulate(dmt, {"A0_nm": 0.0, "Q": 1.0, "Zc_nm": 0.999 * rest}, [0.0, 0.0], periods=60)
    assert z.observe("min(D_nm)")["min(D_nm)"] < 0.3


def test_a_repulsive_hamaker_constant_and_a_base_below_the_surface_are_allowed(dmt):
    orbit = saltus.find_orbit(dmt, {"H_aJ": -0.05, "Zc_nm": -1.0, "A0_nm": 300.0}, x0=[1.0, 0.0])
    seen = assert_scipy_agrees(orbit, dmt_law)
    assert seen["regime"] == "repulsive"
    assert_energies_balance(seen)


# Kelvin and Voigt


def voigt_law(p):
    pull = attraction(p["H_aJ"], p["R_nm"], p["a0_nm"])

    def contact(D, V, s):
        h = max(p["a0_nm"] - D, 0.0)
        return pull(D) + sphere(p["E_GPa"], p["R_nm"], h) - 1e-3 * p["eta_Pa_s"] * math.sqrt(p["R_nm"] * h) * V

    return two_sided(lambda D, V, s: pull(D), contact, p["a0_nm"])


@pytest.fixture(scope="module", params=["impulse", "raw"])
def voigt(request):
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0, form=request.param)
    return afm.model(afm.Probe(**LEVER_P, R_nm=20.0), law, afm.Drive(A0_nm=30.0), Zc_nm=24.0)


def test_both_forms_of_kelvin_and_voigt_have_one_orbit(voigt):
    orbit = saltus.find_orbit(voigt, x0=[0.0, 0.0])
    seen = assert_scipy_agrees(orbit, voigt_law)
    assert seen["amplitude_nm"] == pytest.approx(24.94540152, rel=1e-9)
    assert seen["lag_deg"] == pytest.approx(56.87312727, rel=2e-9)
    assert seen["E_ts_eV"] == pytest.approx(1.159090801, rel=1e-9)
    assert seen["contact_fraction"] == pytest.approx(0.1000831, abs=1e-7)
    assert abs(orbit.multipliers[0]) == pytest.approx(0.9765853, abs=1e-7)
    rooted = orbit.observe("mean(sqrt(indentation_nm))")["mean(sqrt(indentation_nm))"] * orbit.period
    contact = 1e-2 * math.sqrt(20.0) * rooted * (2e-3 * math.pi * 70.0) ** 2 / 2.0
    assert product(orbit) == pytest.approx(math.exp(-decay(orbit) - contact), rel=1e-8)
    assert_energies_balance(seen)


@pytest.mark.campaign
def test_jumps_with_viscous_contact_are_the_same_in_both_forms_and_lie_on_the_locus_of_the_impulse(voigt):
    lever = {"A0_nm": 12.0, "f_kHz": 300.0, "R_nm": 12.0, "H_aJ": 0.12, "E_GPa": 1.5, "Zc_nm": 10.0, **LEVER_S}

    def jump(eta):
        orbit = saltus.find_orbit(voigt, {**lever, "eta_Pa_s": eta}, x0=[8.0, 0.0])
        return saltus.continue_orbit(orbit, "Zc_nm", bounds=(9.5, 12.0))["SN1"]

    low, middle = jump(5.0), jump(20.0)
    assert low.parameters["Zc_nm"] == pytest.approx(11.471462976, rel=1e-9)  # both forms
    bounds = {"Zc_nm": (9.5, 12.0), "eta_Pa_s": (5.0, 25.0)}
    if voigt.modes["contact"].field["z1_nm"] == "v1_nm_us":
        with pytest.raises(InputError, match="slope is infinite there: loci crawl; give the force by its impulse"):
            saltus.continue_locus(middle, ("Zc_nm", "eta_Pa_s"), bounds)
        return
    locus = saltus.continue_locus(middle, ("Zc_nm", "eta_Pa_s"), bounds)
    ends = dict(zip(locus.column("eta_Pa_s")[[0, -1]].round(9), locus.column("Zc_nm")[[0, -1]], strict=True))
    assert ends[5.0] == pytest.approx(low.parameters["Zc_nm"], rel=1e-10)


@pytest.mark.campaign
def test_the_impulse_of_several_modes_over_a_shaken_base_is_the_viscous_force():
    probe = afm.Probe(k_N_m=(2.0, 70.0), f0_kHz=(70.0, 400.0), Q=(5.0, 9.0), R_nm=20.0)
    law = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0)
    system = afm.model(probe, law, afm.Drive.base(Y_nm=0.8), Zc_nm=2.0)
    w, own = 2e-3 * math.pi * 70.0, 2e-3 * math.pi * np.array([70.0, 400.0])
    mass = np.array([2.0, 70.0]) / own**2
    state = np.array([-3.1, -0.4, 0.9, -0.3, 0.7])
    rate = system.field("contact", state)

    def velocities(at):
        return system.field("contact", at)[:2]

    step = 1e-5
    acceleration = (velocities(state + step * rate) - velocities(state - step * rate)) / (2.0 * step)
    z, velocity = state[:2], rate[:2]
    gap, gap_rate = 2.0 + z.sum() + 0.8 * math.cos(0.7), velocity.sum() - 0.8 * w * math.sin(0.7)
    assert gap < -0.5
    force = sphere(1.0, 20.0, -gap) - 1e-2 * math.sqrt(20.0 * -gap) * gap_rate
    inertia = mass * np.array([1.56598351, -0.86787179]) * w**2 * 0.8 * math.cos(0.7)
    expected = (force + inertia) / mass - own**2 * z - own / np.array([5.0, 9.0]) * velocity
    np.testing.assert_allclose(acceleration, expected, rtol=1e-7)


# hysteresis


@pytest.fixture(scope="module")
def schwarz():
    law = afm.Schwarz(E_GPa=1.0, w1_N_m=0.05, w2_N_m=0.0, a0_nm=0.3)
    probe = afm.Probe(k_N_m=40.0, f0_kHz=300.0, Q=300.0, R_nm=10.0)
    return afm.model(probe, law, afm.Drive(A0_nm=20.0), Zc_nm=15.0)


def schwarz_law(p):
    E, w1, w2, R, a0 = (p[name] for name in ("E_GPa", "w1_N_m", "w2_N_m", "R_nm", "a0_nm"))
    end = 3.0 * (math.pi * R * R * w1 / (8.0 * E)) ** (2.0 / 3.0) / R
    pull = 2.0 * math.pi * R * w2
    return {
        "far": Stretch(lambda D, V, s: -pull * (a0 / (a0 + D)) ** 2, [(lambda s: 0.0, -1, "contact")]),
        "contact": Stretch(lambda D, V, s: jkr(D, E, w1, R) - pull, [(lambda s: end, 1, "far")], contact=True),
    }


def jkr_loss(E, w, R):
    return (
        (0.15 * 2.0 ** (8.0 / 3.0) + 0.1) * math.pi ** (5.0 / 3.0) * (w**5 * R**4 / E**2) ** (1.0 / 3.0) / 0.1602176634
    )


@pytest.mark.campaign
def test_adhesive_contact(schwarz):
    orbit = saltus.find_orbit(schwarz, x0=[0.0, 0.0])
    seen = assert_scipy_agrees(orbit, schwarz_law)
    wanted = {
        "amplitude_nm": 16.9055245, "lag_deg": 58.495571, "deflection_pm": 17.559841, "E_ts_eV": 6.471729266,
        "virial_eV": -73.52099,
    }  # fmt: skip
    for name, value in wanted.items():
        assert seen[name] == pytest.approx(value, rel=2e-8), name
    assert seen["E_ts_eV"] == pytest.approx(jkr_loss(1.0, 0.05, 10.0), rel=1e-9)
    assert seen["min_force_nN"] == pytest.approx(-1.5 * math.pi * 0.05 * 10.0, rel=1e-8)
    assert product(orbit) == pytest.approx(math.exp(-decay(orbit)), rel=1e-9)
    assert_energies_balance(seen)


@pytest.mark.campaign
def test_adhesion_costs_the_same_along_branches(schwarz):
    orbit = saltus.find_orbit(schwarz, x0=[0.0, 0.0])
    for name, bounds in (("w1_N_m", (0.02, 0.08)), ("R_nm", (5.0, 30.0))):
        branch = saltus.continue_orbit(orbit, name, bounds=bounds)
        for end in (branch.solution(0), branch.solution(len(branch) - 1)):
            p, seen = end.parameters, afm.observables(end)
            assert p[name] in (pytest.approx(bounds[0]), pytest.approx(bounds[1]))
            assert seen["E_ts_eV"] == pytest.approx(jkr_loss(p["E_GPa"], p["w1_N_m"], p["R_nm"]), rel=1e-9)
            assert_energies_balance(seen)


@pytest.mark.campaign
def test_long_forces_of_the_transition_cost_what_they_lose_until_pull_off(schwarz):
    orbit = saltus.find_orbit(schwarz, {"w1_N_m": 0.03, "w2_N_m": 0.02}, x0=[16.0, 0.0])
    seen = assert_scipy_agrees(orbit, schwarz_law)
    end = 3.0 * (math.pi * 100.0 * 0.03 / 8.0) ** (2.0 / 3.0) / 10.0
    long = 2.0 * math.pi * 10.0 * 0.02 * end**2 / (0.3 + end) / 0.1602176634
    assert seen["E_ts_eV"] == pytest.approx(jkr_loss(1.0, 0.03, 10.0) + long, rel=1e-9)
    assert_energies_balance(seen)


@pytest.fixture(scope="module")
def neck():
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0)
    law += afm.Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.6, off_nm=1.5)
    return afm.model(afm.Probe(**LEVER_P, R_nm=20.0), law, afm.Drive(A0_nm=40.0), Zc_nm=20.0)


def neck_law(p):
    pull = attraction(p["H_aJ"], p["R_nm"], p["a0_nm"])
    a0, h = p["a0_nm"], p["h_nm"]

    def liquid(D):
        return -4.0 * math.pi * p["gamma_N_m"] * p["R_nm"] / (1.0 + max(D, a0) / h) ** 2

    return {
        "far_dry": Stretch(lambda D, V, s: pull(D), [(lambda s: p["on_nm"], -1, "far_wet")]),
        "far_wet": Stretch(
            lambda D, V, s: pull(D) + liquid(D),
            [(lambda s: a0, -1, "contact_wet"), (lambda s: p["off_nm"], 1, "far_dry")],
        ),
        "contact_wet": Stretch(
            lambda D, V, s: pull(D) + liquid(D) + sphere(p["E_GPa"], p["R_nm"], a0 - D),
            [(lambda s: a0, 1, "far_wet")],
            contact=True,
        ),
    }


@pytest.mark.parametrize(
    ("Zc", "amplitude", "lag", "virial"),
    [(20.0, 21.33823403, 33.22464051, -29.979803), (30.0, 31.32631888, 52.46536244, None)],
)
def test_a_neck_a_cycle(neck, Zc, amplitude, lag, virial):
    orbit = saltus.find_orbit(neck, {"Zc_nm": Zc}, x0=[0.0, 0.0])
    seen = assert_scipy_agrees(orbit, neck_law, "far_dry")
    assert seen["amplitude_nm"] == pytest.approx(amplitude, rel=1e-9)
    assert seen["lag_deg"] == pytest.approx(lag, rel=1e-9)
    assert seen["E_ts_eV"] == pytest.approx(3.208627482, rel=1e-9)
    assert virial is None or seen["virial_eV"] == pytest.approx(virial, rel=1e-7)
    assert product(orbit) == pytest.approx(math.exp(-decay(orbit)), rel=1e-9)
    assert_energies_balance(seen)


@pytest.mark.campaign
@pytest.mark.parametrize(("Zc", "period", "necks"), [(33.0, 3, 2), (30.0, 4, 3)])
def test_necks_in_some_cycles_only(neck, Zc, period, necks):
    values = {"H_aJ": 0.0, "gamma_N_m": 0.072, "h_nm": 1.0, "on_nm": 1.0, "off_nm": 3.0, "Zc_nm": Zc}
    starts = [[40.0, 0.0], [0.0, 15.0], [-20.0, 0.0], [0.0, 0.0]]
    orbits = (saltus.find_orbit(neck, values, x0=x0) for x0 in starts)
    orbit = next(one for one in orbits if round(one.period * 0.07) == period)
    seen = afm.observables(orbit)
    assert [name for _, name in orbit.signature].count("form") == necks
    assert seen["E_ts_eV"] == pytest.approx(28.23592184 * necks / period, rel=1e-9)
    assert_energies_balance(seen)


@pytest.mark.parametrize("values", [{"on_nm": 0.1}, {"a0_nm": 0.7}, {"off_nm": 0.5}])
def test_gaps_in_another_order_are_refused_by_the_domain(neck, values):
    with pytest.raises((saltus.errors.DivergenceError, InputError), match=r"the domain of .*mode"):
        saltus.simulate(neck, values, [0.0, 0.0], periods=100)


@pytest.mark.campaign
def test_a_branch_ends_where_gaps_change_their_order(neck):
    orbit = saltus.find_orbit(neck, x0=[0.0, 0.0])
    for name, bounds, last in (("on_nm", (0.1, 0.6), 0.3), ("off_nm", (0.2, 1.5), 0.6)):
        branch = saltus.continue_orbit(orbit, name, bounds=bounds, directions="down")
        assert branch.solution(len(branch) - 1).parameters[name] == pytest.approx(last, abs=1e-4)
        # two events coincide where the domain ends
        assert "domain" in branch.stopped[-1] or "border collision" in branch.stopped[-1]


# a law with a state


def solid_law(p):
    k1, k2, c = (p[name] for name in ("k1_N_m", "k2_N_m", "c_uNs_m"))

    def surface(s):
        return -k2 * s[0] / (k1 + k2)

    return {
        "far": Stretch(
            lambda D, V, s: 0.0,
            [(surface, -1, "contact")],
            lambda D, s: -k1 * k2 / (k1 + k2) * s / c,
        ),
        "contact": Stretch(
            lambda D, V, s: -k1 * D + k2 * (-D - s[0]),
            [(surface, 1, "far")],
            lambda D, s: k2 * (-D - s) / c,
            contact=True,
        ),
    }


def test_standard_linear_solid():
    law = afm.SLS(k1_N_m=2.0, k2_N_m=4.0, c_uNs_m=1.0)
    system = afm.model(afm.Probe(**LEVER_P, R_nm=20.0), law, afm.Drive(A0_nm=30.0), Zc_nm=24.0)
    orbit = saltus.find_orbit(system, x0=[0.0, 0.0, 0.0])
    seen = assert_scipy_agrees(orbit, solid_law)
    wanted = {"amplitude_nm": 24.70401427, "lag_deg": 58.21917859, "E_ts_eV": 5.152299395, "virial_eV": -16.248068}
    for name, value in wanted.items():
        assert seen[name] == pytest.approx(value, rel=1e-7), name
    assert np.abs(orbit.multipliers[:2]) == pytest.approx(0.958067, abs=1e-6)
    assert abs(orbit.multipliers[2]) < 1e-9
    assert_energies_balance(seen)
    # the dashpot takes all of it, in contact and in recovery
    power = {"contact": "4.0*(-D_nm - y_nm)", "far": "-4.0/3.0*y_nm"}
    flow = f"contact*({power['contact']})**2 + (1 - contact)*({power['far']})**2"
    assert orbit.observe(f"mean({flow})")[f"mean({flow})"] * orbit.period * 6.241509074 == pytest.approx(
        seen["E_ts_eV"], rel=1e-8
    )
    slow = saltus.find_orbit(system, {"c_uNs_m": 30.0}, x0=[0.0, 0.0, 0.0])
    share = slow.observe("fraction(contact)")["fraction(contact)"]
    relaxing = slow.period * (share * 4.0 + (1.0 - share) * 8.0 / 6.0) / 30.0
    assert product(slow) == pytest.approx(math.exp(-decay(slow) - relaxing), rel=1e-8)


# several modes and drives, shaken base


@pytest.mark.campaign
def test_two_modes_with_a_drive_each():
    probe = afm.Probe(k_N_m=(2.0, 2.0 * 6.267**2), f0_kHz=(70.0, 70.0 * 19.0 / 3.0), Q=(150.0, 450.0), R_nm=10.0)
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.2) + afm.DMT(E_GPa=2.0) + afm.Dashpot(c_uNs_m=0.0)
    drive = afm.Drive(A0_nm=20.0) + afm.Drive(A0_nm=1.0, mode=2, ratio="19/3")
    system = afm.model(probe, law, drive, Zc_nm=17.0)
    orbit = saltus.find_orbit(system, x0=[0.0] * 4)
    seen, second = assert_scipy_agrees(orbit, dmt_law, turns=3, modes=2), afm.observables(orbit, of=2)
    first = afm.observables(orbit, of=1)
    assert first["amplitude_nm"] == pytest.approx(17.77703712, rel=1e-9)
    assert first["lag_deg"] == pytest.approx(63.53805690, rel=1e-9)
    assert second["amplitude_nm_2"] == pytest.approx(0.2224599398, rel=1e-9)
    assert second["lag_deg_2"] == pytest.approx(6.703975286, rel=1e-8)
    assert [name for _, name in orbit.signature].count("touch") == 3
    assert_energies_balance(seen)
    assert second.harmonic_nm(3) == pytest.approx(orbit.observe("amplitude(deflection_nm, 9)").popitem()[1])
    with pytest.raises(InputError, match="ratio_2"):
        system.resolve({"ratio_2": 6.0})


@pytest.mark.campaign
def test_a_ratio_that_does_not_repeat_is_simulated():
    probe = afm.Probe(k_N_m=(2.0, 78.5), f0_kHz=(70.0, 438.7), Q=(15.0, 45.0), R_nm=10.0)
    second = afm.Drive(A0_nm=1.0, mode=2)
    systems = [
        afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=20.0) + one, Zc_nm=18.0)
        for one in (
            second.at_any_ratio(438.7 / 70.0),
            second.at_any_ratio(19.0 / 3.0),
            afm.Drive(1.0, mode=2, ratio="19/3"),
        )
    ]
    free = saltus.simulate(systems[0], {"Zc_nm": 100.0}, [0.0] * 5, periods=300)
    largest = free.observe("max(z1_nm)", "max(z2_nm)", t_start=290.0 / 0.07)
    assert list(largest.values()) == pytest.approx([20.0, 1.0], rel=1e-4)  # each at its own natural frequency
    locked, same = (saltus.simulate(system, x0=[0.0] * len(system.states), t_end=300.0) for system in systems[2:0:-1])
    np.testing.assert_allclose(same(300.0)[:4], locked(300.0)[:4], rtol=1e-8)
    assert systems[0].resolve({"ratio_2": 6.1})["ratio_2"] == 6.1
    with pytest.raises(InputError, match="must be a model whose drives repeat; no motion of it repeats while theta_2"):
        afm.distance_curve(systems[0], (5.0, 20.0))
    with pytest.raises(InputError, match="1 for the first drive"):
        afm.model(probe, afm.Hertz(E_GPa=1.0), second.at_any_ratio(1.0), Zc_nm=18.0)
    with pytest.raises(saltus.ConvergenceError, match="quasi-periodic"):
        saltus.find_orbit(systems[0], x0=[0.0] * 5, settle=300)


@pytest.fixture(scope="module")
def liquid():
    probe = afm.Probe(k_N_m=0.5, f0_kHz=10.0, Q=2.0, R_nm=10.0)
    drive = afm.Drive.base(Y_nm=1.0) + afm.Drive(A0_nm=0.0, ratio=2, phase_deg=30.0, check=False)
    return afm.model(probe, afm.Hertz(E_GPa=1.0), drive, Zc_nm=100.0)


@pytest.mark.campaign
def test_a_shaken_base_in_liquid(liquid):
    orbit = saltus.find_orbit(liquid, x0=[0.0, 0.0])
    light, tip = afm.observables(orbit), afm.observables(orbit, of="tip")
    assert light["amplitude_nm"] == pytest.approx(3.131967022, rel=1e-9)
    assert light["lag_deg"] == pytest.approx(90.0, rel=1e-9)
    assert tip["amplitude_nm"] == pytest.approx(3.287737432, rel=1e-9)
    assert tip["lag_deg"] == pytest.approx(72.292333, rel=1e-8)
    assert light["regime"] == "free"
    assert_energies_balance(light)


def test_work_of_the_base_and_of_a_force_at_twice_the_frequency_balances(liquid):
    orbit = saltus.find_orbit(liquid, {"Zc_nm": 4.0, "A0_nm_2": 3.0, "Y_nm": 2.0}, x0=[0.0, 0.0])
    seen = afm.observables(orbit)
    assert seen["contact_fraction"] > 0.1
    assert_energies_balance(seen)
    assert abs(seen["E_ts_eV"]) < 1e-9 * seen["E_ext_eV"]


def test_a_free_response_lags_from_the_lead_of_its_own_drive(liquid):
    orbit = saltus.find_orbit(liquid, {"A0_nm_2": 3.0}, x0=[0.0, 0.0])
    seen = afm.observables(orbit)
    r, Q = 2.0, 2.0
    response = 1.0 / complex(1.0 - r * r, r / Q)
    assert seen["amplitude_nm_2"] == pytest.approx(3.0 / Q * abs(response), rel=1e-9)
    assert seen["lag_deg_2"] == pytest.approx(-math.degrees(math.atan2(response.imag, response.real)), rel=1e-8)


@pytest.mark.campaign
def test_free_amplitude_at_the_peak_or_at_a_frequency():
    probe = afm.Probe(k_N_m=0.5, f0_kHz=10.0, Q=2.0, R_nm=10.0)

    def force_and_place(drive, **options):
        system = afm.model(probe, afm.Hydration(F_nN=1.0, l_nm=1.0), drive, Zc_nm=100.0, **options)
        power = system.outputs["drive_pW"]["free"].removesuffix("*v1_nm_us").replace("theta", "0.0")
        names = {**system.parameters, "cos": math.cos, "sqrt": math.sqrt}
        return eval(power, names), system.parameters["f_kHz"]

    at_f0, f0 = force_and_place(afm.Drive(A0_nm=10.0))
    assert (at_f0, f0) == (0.5 * 10.0 / 2.0, 10.0)
    _, peak = force_and_place(afm.Drive(A0_nm=10.0), f_kHz="peak")
    assert peak / f0 == pytest.approx(0.935414347, rel=1e-9)
    with pytest.raises(InputError, match="Q = 0.6"):
        afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(1.0, at="peak"), Zc_nm=100.0).resolve({"Q": 0.6})
    for at, f in (("peak", peak), (7.0, 7.0)):
        force, _ = force_and_place(afm.Drive(A0_nm=10.0, at=at))
        r = f / 10.0
        assert force / 0.5 / math.hypot(1.0 - r * r, r / 2.0) == pytest.approx(10.0, rel=1e-12)
    r = peak / 10.0
    assert at_f0 / 0.5 / math.hypot(1.0 - r * r, r / 2.0) / 10.0 == pytest.approx(1.032795559, rel=1e-9)
    assert math.degrees(math.atan2(r / 2.0, 1.0 - r * r)) == pytest.approx(75.036783, rel=1e-8)


# laws without regions


@pytest.mark.campaign
def test_smooth_laws_lose_no_energy_and_have_no_contact():
    law = afm.LennardJones(H_aJ=0.1, sigma_nm=0.34) + afm.DLVO(
        tip_mC_m2=-20.0, sample_mC_m2=-30.0, debye_nm=3.0, H_aJ=0.1
    )
    law += afm.Hydration(F_nN=1.0, l_nm=0.3) + afm.Morse(U_aJ=0.1, l_nm=0.3, D0_nm=0.4)
    system = afm.model(afm.Probe(**LEVER_P, R_nm=20.0), law, afm.Drive(A0_nm=10.0), Zc_nm=6.0)
    orbit = saltus.find_orbit(system, x0=[0.0, 0.0])

    def force(p):
        R, H = p["R_nm"], p["H_aJ"]
        charge = 4.0 * math.pi * 20e-9 * 3e-9 * 20e-3 * 30e-3 / (78.36 * 8.8541878128e-12) * 1e9

        def at(D, V, s):
            u = (D - 0.4) / 0.3
            pair = H * R / 6.0 * (0.34**6 / (30.0 * D**8) - 1.0 / D**2)
            layers = charge * math.exp(-D / 3.0) - H * R / (6.0 * D * D)
            bond = 2.0 * 0.1 / 0.3 * (math.exp(-2.0 * u) - math.exp(-u))
            return pair + layers + math.exp(-D / 0.3) + bond

        return {"free": Stretch(at, [])}

    seen = assert_scipy_agrees(orbit, force, "free")
    assert_energies_balance(seen)
    assert abs(seen["E_ts_eV"]) < 1e-9 * seen["E_ext_eV"]
    assert math.isnan(seen["contact_fraction"])
    assert orbit.min["D_nm"] < 1.0
    assert product(orbit) == pytest.approx(math.exp(-decay(orbit)), rel=1e-9)


# what is refused


def test_implausible_and_wrong_arguments_are_told():
    probe, law = afm.Probe(**LEVER_P, R_nm=20.0), afm.Hertz(E_GPa=1.0)
    with pytest.raises(InputError, match=r"f_kHz = 300000\.0.*in Hz\? then it is 300 kHz; check=False insists"):
        afm.model(probe, law, afm.Drive(10.0), Zc_nm=10.0, f_kHz=300e3)
    with pytest.raises(InputError, match="one of f0, peak"):
        afm.model(probe, law, afm.Drive(10.0), Zc_nm=10.0, f_kHz="resonance")
    with pytest.raises(InputError, match="a mode of the probe, up to 1"):
        afm.model(probe, law, afm.Drive(10.0, mode=2), Zc_nm=10.0)
    with pytest.raises(InputError, match="1 for the first drive"):
        afm.model(probe, law, afm.Drive(10.0, ratio=2), Zc_nm=10.0)
    with pytest.raises(InputError, match="law"):
        afm.model(probe, "Hertz", afm.Drive(10.0), Zc_nm=10.0)
    with pytest.raises(InputError, match=r"above sqrt\(1/2\)"):
        afm.model(afm.Probe(k_N_m=1.0, f0_kHz=10.0, Q=0.6, R_nm=10.0), law, afm.Drive(10.0), Zc_nm=10.0, f_kHz="peak")


def test_observables_of_another_system_are_refused(afm1):
    orbit = saltus.find_orbit(afm1, {"Omega": 1.05}, x0=[-0.67, 0.75])
    with pytest.raises(InputError, match="saltus.afm.model"):
        afm.observables(orbit)
