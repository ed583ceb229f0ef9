"""Forces from averages: closed forms of an exponential force, quadrature of others, coverage of errors."""

import math

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.special import ive

from saltus import afm
from saltus.afm.reconstruction.averages import averages, grid_of
from saltus.errors import InputError
from selection import guarding

K, F0, L = 26e3, 300.0, 0.7  # N/m, so stiff that a motion is harmonic; kHz; nm
PROBE = afm.Probe(k_N_m=K, f0_kHz=F0, Q=400.0, R_nm=12.0, check=False)
GAPS = np.geomspace(0.3, 12.0, 120)


def morse(D, U=0.5, length=0.3, D0=0.6):
    u = (D - D0) / length
    return 2.0 * U / length * (np.exp(-2.0 * u) - np.exp(-u))


def lennard_jones(D, H=0.2, R=12.0, sigma=0.6):
    return H * R / 6.0 * (sigma**6 / (30.0 * D**8) - 1.0 / D**2)


def exponential(D):
    return -3.0 * np.exp(-D / L)


def reduced_of_exponential(nearest, A):
    """Closed form: the mean of exp(-A cos/l) cos is -I1(A/l)."""
    return -3.0 * np.exp(-nearest / L) * ive(1, A / L) / (K * A)


def reduced(law, nearest, A):
    """Reduced shift of a force, by adaptive quadrature of its average."""

    def integrand(angle):
        return law(nearest + A * (1.0 + math.cos(angle))) * math.cos(angle)

    told = quad_vec(integrand, 0.0, math.pi, epsrel=1e-9, points=[math.pi - 0.3], limit=2000)[0]
    return -told / (math.pi * K * A)


def shift_data(omega, nearest, A):
    return {
        "Zc_nm": nearest + A,
        "shift_Hz": 1e3 * F0 * (np.sqrt(1.0 + 2.0 * omega) - 1.0),
        "deflection_pm": 0.0 * omega,
    }


def error(force, law):
    wanted = law(force.D_nm)
    return float(np.abs(force.F_nN - wanted).max() / np.abs(wanted).max())


@pytest.mark.parametrize("A", [0.05, 1.0, 30.0])
def test_averages_of_a_spline_are_those_of_a_closed_form(A):
    grid = grid_of(GAPS, 12.0 + 2.0 * A, 150)
    _, moment = averages(GAPS + A, np.full(120, A), grid)
    wanted = -exponential(GAPS) * ive(1, A / L)
    near = GAPS < 6.0  # farther away the tail counts, which is no exponential
    np.testing.assert_allclose((moment @ grid.spread @ exponential(grid.knots))[near], wanted[near], rtol=2e-3)


@pytest.mark.parametrize("A", [0.05, 0.7, 30.0])
def test_the_matrix_gives_a_force_back_at_any_amplitude(A):
    force = afm.reconstruct_force(shift_data(reduced_of_exponential(GAPS, A), GAPS, A), PROBE, A_nm=A)
    assert error(force, exponential) < 1e-3
    assert force.messages == ()


@pytest.mark.parametrize(("law", "A"), [(morse, 0.05), (morse, 20.0), (lennard_jones, 0.05), (lennard_jones, 20.0)])
def test_quadrature_of_a_law_is_inverted_within_one_percent(law, A):
    gaps = np.geomspace(0.45, 10.0, 60)
    force = afm.reconstruct_force(shift_data(reduced(law, gaps, A), gaps, A), PROBE, A_nm=A)
    assert error(force, law) < 0.01


@pytest.mark.parametrize(
    ("method", "A", "most"),
    [
        ("sader-jarvis", 0.005, 0.02),
        ("sader-jarvis", 0.7, 0.06),  # as the paper says of its kernel: within 5 % at any amplitude
        ("sader-jarvis", 70.0, 0.006),
        ("hoelscher", 70.0, 0.01),
        ("payam", 70.0, 0.01),
        ("payam", 0.005, 0.12),
    ],
)
def test_formulas_in_print_hold_where_they_are_said_to(method, A, most):
    force = afm.reconstruct_force(shift_data(reduced_of_exponential(GAPS, A), GAPS, A), PROBE, A_nm=A, method=method)
    assert error(force, exponential) < most


def test_katans_formula_is_sader_and_jarvis_with_amplitudes_that_vary():
    A = 20.0 + 0.5 * np.tanh(GAPS - 2.0)
    data = lag_data(reduced_of_exponential(GAPS, A), GAPS, A)
    drive = afm.Drive(A0_nm=21.0)
    found = {
        m: afm.reconstruct_force(data, PROBE, drive=drive, method=m) for m in ("katan", "sader-jarvis", "hoelscher")
    }
    assert np.array_equal(found["katan"].F_nN, found["sader-jarvis"].F_nN)
    assert error(found["katan"], exponential) < 0.05
    assert error(found["hoelscher"], exponential) < 0.05


def lag_data(omega, nearest, A, A0=21.0):
    """Amplitude and lag at f0 by the balance of the first harmonic: A0/(Q A) cos(lag) = 2 Omega."""
    lag = np.degrees(np.arccos(2.0 * omega * A * 400.0 / A0))
    return {"Zc_nm": nearest + A, "amplitude_nm": A, "lag_deg": lag, "deflection_pm": 0.0 * lag}


def test_the_matrix_takes_amplitudes_that_vary():
    A = 20.0 - 4.0 * np.exp(-GAPS)
    data = lag_data(reduced_of_exponential(GAPS, A), GAPS, A)
    force = afm.reconstruct_force(data, PROBE, drive=afm.Drive(A0_nm=21.0))
    assert error(force, exponential) < 1e-3


def test_a_drive_beside_the_resonance_counts_by_its_frequency():
    """A force F0 at f: (f/f0)**2 - 1 + F0/(k A) cos(lag) = 2 Omega."""
    A, f = 5.0, 299.0
    omega = reduced_of_exponential(GAPS, A)
    lag = np.degrees(np.arccos((2.0 * omega + 1.0 - (f / F0) ** 2) * K * A / 1000.0))
    data = {"Zc_nm": GAPS + A, "amplitude_nm": np.full(120, A), "lag_deg": lag, "deflection_pm": 0.0 * lag}
    force = afm.reconstruct_force(data, PROBE, drive=afm.Drive.force(F0_nN=1000.0), f_kHz=f)
    assert error(force, exponential) < 1e-3


@pytest.mark.parametrize("told", guarding([True, False], False), ids=["errors given", "errors estimated"])
def test_standard_errors_hold_the_force_as_often_as_they_should(told):
    rng, A = np.random.default_rng(7), 2.0
    data = shift_data(reduced_of_exponential(GAPS, A), GAPS, A)
    noise = 0.01 * np.abs(data["shift_Hz"]).max()
    within = []
    for _ in range(15):
        noisy = data | {"shift_Hz": data["shift_Hz"] + noise * rng.normal(size=120)}
        force = afm.reconstruct_force(noisy, PROBE, A_nm=A, sigma={"shift_Hz": noise} if told else None)
        within.append(np.abs(force.F_nN - exponential(force.D_nm)) < force.sigma_nN)
    assert 0.55 < np.mean(within) < 0.85


def test_errors_of_amplitude_and_lag_add_up():
    """Both are propagated to the reduced shift: beside the resonance's lag, mainly by the lag's sine."""
    A = np.full(120, 20.0)
    data = lag_data(reduced_of_exponential(GAPS, A), GAPS, A)
    drive = afm.Drive(A0_nm=21.0)
    force = afm.reconstruct_force(data, PROBE, drive=drive, sigma={"lag_deg": 1e-4})
    wanted = 21.0 / (2.0 * 400.0 * 20.0) * np.sin(np.radians(data["lag_deg"])) * math.radians(1e-4)
    np.testing.assert_allclose(force.shift_sigma, wanted, rtol=2e-3)
    both = afm.reconstruct_force(data, PROBE, drive=drive, sigma={"lag_deg": 1e-4, "amplitude_nm": 0.05})
    assert (both.shift_sigma >= force.shift_sigma * (1.0 - 1e-3)).all()
    assert both.sigma_nN[0] > force.sigma_nN[0]


def test_the_inflection_of_morses_force_has_its_closed_form():
    """F'' = 0 at D0 + l log 4, where F'''/F' = -2/l**2: S = -z**2/(2 l**2), amplitudes from l/sqrt(2) to z/2."""
    A = 0.2
    gaps = np.linspace(0.3, 6.0, 240)
    data = shift_data(reduced(lambda D: morse(D, 1.0, 0.25, 0.4), gaps, A), gaps, A)
    with pytest.warns(RuntimeWarning, match=r"ill-posed: the force bends at D = 0.75\d? nm with S = -1.[567]"):
        force = afm.reconstruct_force(data, PROBE, A_nm=A)
    (found,) = force.inflections
    z = 0.25 * math.log(4.0) + 0.1
    assert found.D_nm == pytest.approx(0.3 + z, abs=0.01)
    assert pytest.approx(-(z**2) / (2.0 * 0.25**2), rel=0.1) == found.S
    assert found.least_nm == pytest.approx(0.25 / math.sqrt(2.0), rel=0.05)
    assert found.most_nm == pytest.approx(0.5 * z, rel=0.03)
    assert not found._replace(A_nm=1.0).ill_posed


@pytest.mark.filterwarnings("ignore:saltus")
def test_sparse_data_are_told_with_how_much_the_force_of_every_other_differs():
    gaps = np.linspace(0.45, 10.0, 12)
    data = shift_data(reduced(lennard_jones, gaps, 1.0), gaps, 1.0)
    force = afm.reconstruct_force(data, PROBE, A_nm=1.0)
    assert force.halved > 0.1
    assert f"too few data: every other one tells a force that differs by {100 * force.halved:.2g} %" in force.messages


def test_data_that_end_where_the_force_is_large_are_told_with_its_size():
    near = GAPS[GAPS < 2.0]
    with pytest.warns(RuntimeWarning, match=r"data that end early: at the last gap the force is \d+ %"):
        afm.reconstruct_force(shift_data(reduced_of_exponential(near, 0.3), near, 0.3), PROBE, A_nm=0.3)


def test_data_without_a_force_are_refused_with_its_size_in_errors():
    rng = np.random.default_rng(3)
    data = {"Zc_nm": GAPS + 5.0, "shift_Hz": rng.normal(size=120), "deflection_pm": 0.0 * GAPS}
    with pytest.raises(InputError, match=r"greatest force over its error = \d.*: must be 3 .* the data are too noisy"):
        afm.reconstruct_force(data, PROBE, A_nm=5.0, sigma={"shift_Hz": 1.0})


def test_wrong_data_are_told_in_a_line():
    whole = shift_data(reduced_of_exponential(GAPS, 1.0), GAPS, 1.0)
    short = {name: values[:5] for name, values in whole.items()}
    lag = lag_data(reduced_of_exponential(GAPS, 20.0), GAPS, np.full(120, 20.0))
    drive = afm.Drive(A0_nm=21.0)
    for data, options, told in (
        (short, {"A_nm": 1.0}, "data = 5: must be 8 rows or more"),
        (whole, {}, "A_nm, drive = .*: must be one of both"),
        (whole, {"A_nm": 1e-9}, "A_nm = 1e-09: must be between .* in m. then it is 1 nm; no other value is taken"),
        (whole, {"A_nm": 1.0, "drive": drive}, "must be one of both"),
        (whole, {"drive": drive}, "no 'amplitude_nm'"),
        (lag, {"A_nm": 1.0}, "no 'shift_Hz'"),
        (lag | {"amplitude_nm": 0.0 * GAPS}, {"drive": drive}, "amplitude_nm = 0.0: must be above 0"),
        (lag, {"drive": afm.Drive.base(1.0)}, "drive = .*: must be a force"),
        (lag | {"lag_deg": np.radians(lag["lag_deg"])}, {"drive": drive}, "greatest lag_deg = .* in rad. then it is"),
        (lag, {"drive": 3}, "drive = 3: must be a Drive"),
        (whole, {"A_nm": 1.0, "method": "magic"}, "method = 'magic'"),
        (whole, {"A_nm": 1.0, "sigma": {"shift_Hz": -1.0}}, r"sigma\['shift_Hz'\] = -1.0"),
        (whole, {"A_nm": 1.0, "sigma": {"shift_Hz": [1.0, 2.0]}}, r"sigma\['shift_Hz'\]"),
        (whole, {"A_nm": 1.0, "sigma": {"lag_deg": 1.0}}, "sigma = 'lag_deg'"),
        (whole | {"Zc_nm": ["a"] * 120}, {"A_nm": 1.0}, "columns of numbers"),
        (3, {"A_nm": 1.0}, "data = 3"),
        (whole | {"Zc_nm": 1e-9 * whole["Zc_nm"]}, {"A_nm": 1.0}, "distances that span 0.001 nm or more; in m. then"),
        (whole | {"Zc_nm": 0.0 * whole["Zc_nm"]}, {"A_nm": 1.0}, "distances that span 0.001 nm or more; all are one"),
        (whole | {"shift_Hz": 0.0 * whole["shift_Hz"]}, {"A_nm": 1.0}, "data = 0.0: must be changed by a force"),
    ):
        with pytest.raises(InputError, match=told):
            afm.reconstruct_force(data, PROBE, **options)
    exact = afm.reconstruct_force(whole, PROBE, A_nm=1.0, sigma={"shift_Hz": 1e-3})
    with pytest.raises(InputError, match="R_nm = 1.2e-08: must be .* no other value is taken"):
        exact.fit(afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3), {"H_aJ": (0.01, 1.0)}, R_nm=12e-9)
    with pytest.raises(InputError, match="probe = None"):
        afm.reconstruct_force(whole, None, A_nm=1.0)
    twice = {name: np.repeat(values, 2) for name, values in whole.items()}
    with pytest.raises(InputError, match="least gap = .*: must be different in each row; method='matrix' takes them"):
        afm.reconstruct_force(twice, PROBE, A_nm=1.0, method="payam")
    assert error(afm.reconstruct_force(twice, PROBE, A_nm=1.0), exponential) < 1e-3


@pytest.mark.campaign
@pytest.mark.parametrize("noise", [1e-3, 1e-2])  # over the greatest shift
def test_errors_hold_the_force_beside_a_sharp_bend(noise):
    """The law of the gap 0.3 nm, of which contact is flat and what is farther is steep."""
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    nearest, A = np.concatenate([np.linspace(-0.6, 1.5, 45), np.geomspace(1.6, 8.0, 30)]), 10.0
    angles = (np.arange(4000) + 0.5) * np.pi / 4000
    along = law.force_nN(nearest[:, None] + A * (1.0 + np.cos(angles)), R_nm=12.0)
    whole = shift_data(-(along * np.cos(angles)).mean(axis=1) / (K * A), nearest, A)
    error = noise * float(np.abs(whole["shift_Hz"]).max())
    held, beside = [], []
    for seed in range(40):
        seen = whole | {"shift_Hz": whole["shift_Hz"] + error * np.random.default_rng(seed).normal(size=len(nearest))}
        force = afm.reconstruct_force(seen, PROBE, A_nm=A, sigma={"shift_Hz": error})
        within = np.abs(force.F_nN - law.force_nN(force.D_nm, R_nm=12.0)) <= 2.0 * force.sigma_nN
        held.append(within.mean())
        beside.append(within[np.abs(force.D_nm - 0.3) < 0.25].mean())
    assert np.mean(held) > 0.95
    assert np.mean(beside) > 0.9


def noisy_gaps(law, nearest, A, seed, blur=0.03, noise=5e-3):
    """Shifts of a law with errors of theirs and of the distance, and these errors."""
    angles = (np.arange(2000) + 0.5) * np.pi / 2000
    along = law.force_nN(nearest[:, None] + A * (1.0 + np.cos(angles)), R_nm=12.0)
    whole = shift_data(-(along * np.cos(angles)).mean(axis=1) / (K * A), nearest, A)
    errors = {"Zc_nm": blur, "shift_Hz": noise * float(np.abs(whole["shift_Hz"]).max())}
    random = np.random.default_rng(seed)
    return {k: v + errors.get(k, 0.0) * random.normal(size=len(v)) for k, v in whole.items()}, errors


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_errors_of_gaps_count_where_data_lie_nearer_than_these(seed):
    """In contact data lie 0.01 nm apart, and distances are known to 0.03 nm."""
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    nearest = np.concatenate([np.linspace(-0.8, -0.5, 31), np.linspace(-0.45, 0.5, 20), np.geomspace(0.55, 8.0, 30)])
    data, errors = noisy_gaps(law, nearest, 10.0, seed)
    force = afm.reconstruct_force(data, PROBE, A_nm=10.0, sigma=errors)
    assert error(force, lambda gap: law.force_nN(gap, R_nm=12.0)) < 0.25
    assert np.diff(force.D_nm).min() > 0.03
    guess = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=2.0)
    found = force.fit(guess, {"H_aJ": (0.01, 1.0), "E_GPa": (0.1, 10.0)})
    assert abs(found.values["E_GPa"] - 1.5) < 3.0 * found.sigma["E_GPa"] < 0.15
    assert found.chi2 == pytest.approx(len(nearest), rel=0.5)


@pytest.mark.filterwarnings("ignore:saltus")
def test_what_no_datum_reaches_is_told():
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    nearest = np.concatenate([np.linspace(-0.8, -0.55, 30), np.geomspace(0.12, 8.0, 60)])
    data, errors = noisy_gaps(law, nearest, 10.0, 0, blur=1e-4, noise=1e-3)
    (told,) = afm.reconstruct_force(data, PROBE, A_nm=10.0, sigma=errors).messages
    assert told.startswith("a gap in the data: none comes as near as D = -0.55 to 0.1")
    blurred, errors = noisy_gaps(law, nearest, 10.0, 0, blur=0.12)
    with pytest.warns(RuntimeWarning, match="blurred data: errors of gaps are 0.12 nm"):
        afm.reconstruct_force(blurred, PROBE, A_nm=10.0, sigma=errors)
    unlike = dict.fromkeys(errors, 1e-4)
    with pytest.warns(RuntimeWarning, match="chi2 = .* of 90 data: no smooth force"):
        afm.reconstruct_force(blurred, PROBE, A_nm=10.0, sigma=unlike)


@pytest.mark.filterwarnings("ignore:saltus")
def test_data_whose_sample_would_give_energy_are_refused_or_told():
    """The lags of a conservative force: sin(lag) is what the lever loses, A/A0 at its natural frequency."""
    soft, drive = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0), afm.Drive(A0_nm=12.0)
    lag = 90.0 + 40.0 * np.exp(-GAPS / 2.0)
    data = {"Zc_nm": GAPS + 12.0, "amplitude_nm": 12.0 * np.sin(np.radians(lag)), "lag_deg": lag}
    given = (
        "energy of the drive over the lever's loss = {}: must be between 0.5 and 1000: a sample gives no energy; lags"
    )
    for wrong, share in (
        ({"lag_deg": 90.0 - lag}, "-0.277"),
        ({"lag_deg": data["amplitude_nm"], "amplitude_nm": lag}, "0.0[12][0-9]*"),
        ({"amplitude_nm": 1e-9 * data["amplitude_nm"]}, "1000000000.0"),
    ):
        with pytest.raises(InputError, match=given.format(share)):
            afm.reconstruct_force(data | wrong, soft, drive=drive)
    with pytest.warns(RuntimeWarning, match="the drive gives 0.83 of what the lever loses, and a sample gives none"):
        afm.reconstruct_force(data, soft, drive=afm.Drive(A0_nm=10.0))


def test_a_motion_that_no_cosine_describes_is_refused_with_what_goes():
    """Forces of many nN bend a lever of 0.5 N/m at Q = 3 further than the averages allow."""
    soft, n = afm.Probe(k_N_m=0.5, f0_kHz=20.0, Q=3.0, R_nm=12.0), np.arange(30)
    lag = 90.0 + 40.0 * np.sin(2.0 * n) * np.minimum(1.0, n / 10)
    data = {"Zc_nm": 12.0 - 0.2 * n, "amplitude_nm": 9.0 - 0.02 * n, "lag_deg": lag}
    with pytest.raises(InputError, match=r"soft lever at a low Q\? afm.fit of a law takes any motion$"):
        afm.reconstruct_force(data, soft, drive=afm.Drive(A0_nm=10.0), sigma={"amplitude_nm": 0.01, "lag_deg": 0.1})
