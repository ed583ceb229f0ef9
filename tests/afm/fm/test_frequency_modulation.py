"""Frequency modulation at constant amplitude: Giessibl's formula, energies, the driven motion, files and pictures."""

from __future__ import annotations

import math

import matplotlib
import numpy as np
import pytest
from scipy.fft import dct
from scipy.integrate import quad

import saltus
from explained import unexplained
from saltus import afm
from saltus.errors import InputError
from selection import guarding

matplotlib.use("Agg")

A = 10.0  # nm, amplitude that is held
STIFF = 26e3  # N/m, at which a motion is harmonic and its mean is at rest
EV = 6.241509074460763  # eV in 1 aJ
PROBE = {"k_N_m": 26.0, "f0_kHz": 300.0, "Q": 400.0, "R_nm": 12.0}
CONSERVATIVE = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
SMOOTH = {  # laws without a loss
    "contact": CONSERVATIVE,
    "bond": afm.LennardJones(H_aJ=0.12, sigma_nm=0.3),
    "water": afm.Hydration(F_nN=3.0, l_nm=0.8),
}
ANGLES = np.pi * (np.arange(1 << 15) + 0.5) / (1 << 15)
DAMPED = CONSERVATIVE + afm.Dashpot(c_uNs_m=2.0)


def stiffened(law):
    return afm.model(afm.Probe(**PROBE | {"k_N_m": STIFF}, check=False), law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)


@pytest.fixture(scope="module")
def lever():
    return afm.model(afm.Probe(**PROBE), CONSERVATIVE, afm.Drive(A0_nm=12.0), Zc_nm=10.0)


@pytest.fixture(scope="module")
def curve(lever):
    return afm.frequency_shift(lever, (9.5, 14.0), A, points=10)


@pytest.fixture(scope="module")
def lossy():
    return afm.model(afm.Probe(**PROBE), DAMPED, afm.Drive(A0_nm=12.0), Zc_nm=10.0)


@pytest.fixture(scope="module")
def damped(lossy):
    return afm.frequency_shift(lossy, (9.7, 10.5), A, points=5)


def giessibl(k, Zc):
    """Shift in Hz of small forces: the force weighted by the displacement of a harmonic motion."""

    def integrand(angle):
        z = A * math.cos(angle)
        return float(CONSERVATIVE.force_nN(Zc + z, R_nm=12.0, region="contact" if Zc + z < 0.3 else "far")) * z

    touch = math.acos(min(max((0.3 - Zc) / A, -1.0), 1.0))
    parts = [quad(integrand, *ends, epsabs=1e-12, epsrel=1e-11)[0] for ends in ((0.0, touch), (touch, math.pi))]
    return -300e3 / (k * A**2) * sum(parts) / math.pi


@pytest.mark.campaign
def test_small_forces_shift_the_frequency_as_giessibl_says(lever):
    """Van der Waals force far from contact: f0 H R / 6 k (Zc**2 - A**2)**1.5, closer for a stiffer lever."""
    for k, error in ((26.0, 2e-3), (2600.0, 2e-5)):
        found = afm.frequency_shift(lever, (10.8, 14.0), A, points=3, parameters={"k_N_m": k})
        Zc = found.column("Zc_nm")
        wanted = -300e3 * 0.12 * 12.0 / (6.0 * k * (Zc**2 - A**2) ** 1.5)
        np.testing.assert_allclose(found.column("shift_Hz"), wanted, rtol=error)


@pytest.mark.campaign
def test_shift_in_contact_is_the_weighted_force_too():
    stiff = afm.frequency_shift(stiffened(CONSERVATIVE), (9.6, 10.4), A, points=5)
    wanted = [giessibl(STIFF, Zc) for Zc in stiff.column("Zc_nm")]
    np.testing.assert_allclose(stiff.column("shift_Hz"), wanted, rtol=1e-4)
    assert stiff.column("peak_force_nN")[-1] > 0.0


def forces(law, gaps):
    """Force of a law at gaps, in contact below 0.3 nm where it has a contact."""
    if len(law.regions) == 1:
        return law.force_nN(gaps, R_nm=12.0)
    outside = law.force_nN(np.maximum(gaps, 0.3), R_nm=12.0, region="far")
    return np.where(gaps < 0.3, law.force_nN(np.minimum(gaps, 0.3), R_nm=12.0, region="contact"), outside)


def harmonics(law, gap, amplitude):
    """Cosine coefficients of the force along a harmonic motion about a gap, the first of them twice the mean."""
    return dct(forces(law, gap + amplitude * np.cos(ANGLES))) / ANGLES.size


def averaged(law, gap, amplitude, k):
    """Shift in Hz of first and of second order, by averaging; the second is a derivative by the amplitude."""

    def sum_of_squares(at):
        n = np.arange(2, ANGLES.size)
        return np.sum(harmonics(law, gap, at)[2:] ** 2 / (n**2 - 1.0))

    h = 1e-4 * min(amplitude, 1.0)
    near, far = (sum_of_squares(amplitude + m * h) - sum_of_squares(amplitude - m * h) for m in (1, 2))
    first = -300e3 * harmonics(law, gap, amplitude)[1] / (2.0 * k * amplitude)
    bent = 300e3 / (4.0 * k**2 * amplitude) * (8.0 * near - far) / (12.0 * h)
    return first, bent - first**2 / (2.0 * 300e3)


def greatest(law, gap, amplitude, k):
    """What the second order of the shift cannot exceed, in Hz: by the inequality of Cauchy and Schwarz."""
    gaps, h = gap + amplitude * np.cos(ANGLES), 1e-5
    mean, first = harmonics(law, gap, amplitude)[:2] * (0.5, 1.0)
    rest = forces(law, gaps) - mean - first * np.cos(ANGLES)
    slope = (forces(law, gaps + h) - forces(law, gaps - h)) / (2.0 * h)
    sizes = math.sqrt(np.mean(rest**2) * np.mean((slope * np.cos(ANGLES)) ** 2))
    return 300e3 * ((first / (k * amplitude)) ** 2 / 8.0 + sizes / (3.0 * k**2 * amplitude))


@pytest.mark.parametrize(
    ("name", "amplitude", "nearest"),
    guarding(
        [
            ("contact", 5.0, 0.6),
            ("contact", 5.0, 0.1),
            ("contact", 0.1, 1.0),
            ("bond", 20.0, 0.5),
            ("bond", 1.0, 0.5),
            ("water", 20.0, 0.5),
            ("water", 1.0, 0.5),
        ],
        ("bond", 20.0, 0.5),
    ),
)
def test_averaging_to_second_order_misses_orbits_by_the_third_order_of_the_force(name, amplitude, nearest):
    """A stiffness of twice the size halves the force over it; what is left falls by 8, the second order by 4."""
    law, left = SMOOTH[name], []
    probe = afm.Probe(k_N_m=104.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    system = afm.model(probe, law, afm.Drive(A0_nm=amplitude), Zc_nm=amplitude + nearest)
    for k in (104.0, 208.0, 416.0):
        bounds = amplitude + nearest, amplitude + nearest + 0.2
        found = afm.frequency_shift(system, bounds, amplitude, points=2, parameters={"k_N_m": k})
        gap = found.column("Zc_nm")[-1] + 1e-3 * found.column("deflection_pm")[-1]
        shift, (first, second) = found.column("shift_Hz")[-1], averaged(law, gap, amplitude, k)
        left.append(shift - first - second)
        assert abs(shift - first) <= greatest(law, gap, amplitude, k)
        if name == "bond" and amplitude == 20.0:
            assert shift - first > 60.0 * first**2 / 300e3  # no small number bounds it: it grows as the amplitude
    order = np.log2(np.array(left[:-1]) / left[1:])
    np.testing.assert_allclose(order, 3.0, atol=0.1)


@pytest.mark.campaign
def test_a_conservative_law_takes_no_excitation(curve):
    np.testing.assert_allclose(curve.column("excitation_nm"), A, rtol=1e-9)
    np.testing.assert_allclose(curve.column("E_ts_eV"), 0.0, atol=1e-8)
    assert curve.stopped == "Zc_nm = 9.5: the end of the range"
    np.testing.assert_allclose(curve.column("Zc_nm"), np.linspace(14.0, 9.5, 10))


@pytest.mark.campaign
def test_loss_is_what_the_excitation_adds(damped):
    """The drive's work over the medium's is the excitation over the amplitude, whatever the motion's shape."""
    f = 300e3 + damped.column("shift_Hz")
    medium = math.pi * 26.0 * A**2 / 400.0 * f / 300e3 * EV
    added = (damped.column("excitation_nm") / A - 1.0) * medium
    np.testing.assert_allclose(damped.column("E_ts_eV"), added, rtol=1e-4, atol=1e-9)
    assert damped.column("E_ts_eV")[-1] > 60.0


@pytest.mark.campaign
def test_loss_of_a_stiff_lever_is_that_of_a_prescribed_motion():
    found = afm.frequency_shift(stiffened(DAMPED), (9.7, 10.1), A, points=4)
    for Zc, loss in zip(found.column("Zc_nm"), found.column("E_ts_eV"), strict=True):
        assert loss == pytest.approx(DAMPED.energy_per_cycle_eV(Zc_nm=Zc, A_nm=A, f_kHz=300.0, R_nm=12.0), rel=2e-4)


@pytest.mark.campaign
def test_a_drive_at_the_shifted_frequency_makes_the_same_motion(lever, curve):
    row = int(np.argmin(np.abs(curve.column("Zc_nm") - 11.0)))
    f = 300.0 + 1e-3 * curve.column("shift_Hz")[row]
    force = curve.column("excitation_nm")[row] * f / 300.0
    values = {"Zc_nm": float(curve.column("Zc_nm")[row]), "f_kHz": f, "A0_nm": force}
    driven = saltus.find_orbit(lever, values, x0=[0.0, 2e-3 * math.pi * f * A])
    seen = afm.observables(driven)
    assert seen["amplitude_nm"] == pytest.approx(A, rel=1e-5)
    assert seen["lag_deg"] == pytest.approx(90.0, abs=1e-2)
    assert seen["virial_eV"] == pytest.approx(curve.column("virial_eV")[row], rel=1e-4)


@pytest.mark.campaign
def test_curve_comes_back_from_its_file(curve, tmp_path):
    assert saltus.load(curve.save(tmp_path / "shift.nc")) == curve
    assert unexplained(curve.to_xarray()) == []
    with pytest.raises(InputError, match="shift_Hz"):
        afm.FrequencyShift.from_xarray(curve.to_xarray().drop_vars("shift_Hz"))
    with pytest.raises(InputError, match="amplitude"):
        curve.column("amplitude")
    assert "Zc_nm       9.5 to 14" in repr(curve)


def test_picture_has_shift_over_excitation(curve):
    upper, lower = curve.plot()
    assert upper.get_ylabel() == "frequency shift (Hz)"
    assert lower.get_ylabel() == "excitation, as a free amplitude (nm)"
    assert curve.plot(second="E_ts_eV")[1].get_ylabel() == "energy to the sample in a cycle (eV)"
    np.testing.assert_array_equal(upper.lines[0].get_ydata(), curve.column("shift_Hz"))


def test_wrong_arguments_are_told(lever, afm1):
    with pytest.raises(InputError, match=r"saltus\.afm\.model"):
        afm.self_excited(afm1, A)
    with pytest.raises(InputError, match="in m"):
        afm.self_excited(lever, A * 1e-9)
    with pytest.raises(InputError, match="points"):
        afm.frequency_shift(lever, (9.5, 14.0), A, points=1)
    for drive in (afm.Drive.force(1.0), afm.Drive(A0_nm=10.0, at="peak"), afm.Drive(A0_nm=10.0, phase_deg=30.0)):
        system = afm.model(afm.Probe(**PROBE), afm.Hertz(E_GPa=1.0), drive, Zc_nm=10.0)
        with pytest.raises(InputError, match="one drive of one mode"):
            afm.frequency_shift(system, (9.5, 14.0), A)


@pytest.mark.campaign
def test_adhesion_costs_the_same_at_every_depth_and_nothing_before_the_touch():
    """A hysteretic law: 7.092196 (w**5 R**4 / E**2)**(1/3) a cycle, once the tip touches."""
    probe = afm.Probe(k_N_m=40.0, f0_kHz=300.0, Q=300.0, R_nm=10.0)
    sticky = afm.model(probe, afm.JKR(E_GPa=1.0, w_N_m=0.05), afm.Drive(A0_nm=20.0), Zc_nm=15.0)
    found = afm.frequency_shift(sticky, (15.2, 16.2), 16.0, points=2)
    loss = 7.092195972 * (0.05**5 * 10.0**4) ** (1.0 / 3.0) * EV
    np.testing.assert_allclose(found.column("E_ts_eV"), [0.0, loss], rtol=1e-8, atol=1e-9)
    assert found.column("shift_Hz")[0] == pytest.approx(0.0, abs=1e-6)
