"""Ways past windows of motions that are not followed, against motions that are followed on their own."""

import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import saltus
from saltus import afm
from saltus.errors import ConvergenceError
from selection import guarding


@pytest.mark.campaign
def test_an_approach_to_an_adhesive_contact_goes_on_behind_its_first_touches():
    """Between the first touch and the tapping motion of period 1 there are long periods alone."""
    probe = afm.Probe(k_N_m=40.0, f0_kHz=300.0, Q=300.0, R_nm=10.0)
    system = afm.model(probe, afm.JKR(E_GPa=1.0, w_N_m=0.05), afm.Drive(A0_nm=20.0), Zc_nm=30.0)
    curve = afm.distance_curve(system, (14.0, 24.0))
    (window,) = curve.ways[0].windows
    assert window.begin == pytest.approx(20.0, abs=1e-6)  # it touches where the free amplitude is the distance
    assert window.end == pytest.approx(19.8425, abs=1e-4)
    assert window.words.startswith("the motion settles on a motion of period")
    assert [way.stopped for way in curve.ways] == [
        "Zc_nm = 14: the end of the range",
        "Zc_nm = 24: the end of the range",
    ]
    assert curve.jumps == ()
    path = curve.path("approach")
    assert json.loads(path.attrs["windows"]) == [list(window)]
    settled = saltus.find_orbit(system, {"Zc_nm": 15.0}, [0.0, 0.0])
    on_way = np.interp(-15.0, -path["Zc_nm"].values, path["amplitude_nm"].values)
    assert on_way == pytest.approx(afm.observables(settled)["amplitude_nm"], rel=1e-4)
    panel = curve.plot()[0]
    assert "window of other motions" in [text.get_text() for text in panel.get_legend().get_texts()]


@pytest.fixture(scope="module")
def water():
    """A lever in water over a stiff sample, with two stable motions in many ranges of the frequency."""
    lever = afm.Cantilever(length=197e-6, width=29e-6, thickness=2e-6, density=2320.0, young=169e9)
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0)
    return afm.model(afm.immersed(lever, afm.Fluid.water(), R_nm=10.0), law, afm.Drive(A0_nm=10.0), Zc_nm=3.0)


def simulated(p, f_kHz, start):
    """Return the largest displacement on which a motion settles, by SciPy: one oscillator, the force of the law."""
    omega, omega0 = 2e-3 * math.pi * f_kHz, 2e-3 * math.pi * p["f0_kHz"]
    mass, a0 = p["k_N_m"] / omega0**2, p["a0_nm"]

    def field(t, x):
        gap = p["Zc_nm"] + x[0]
        force = -p["H_aJ"] * p["R_nm"] / (6.0 * max(gap, a0) ** 2)
        force += 4.0 / 3.0 * p["E_GPa"] * math.sqrt(p["R_nm"]) * max(a0 - gap, 0.0) ** 1.5
        force += p["k_N_m"] * p["A0_nm"] / p["Q"] * math.cos(omega * t)
        return x[1], (force - p["k_N_m"] * x[0]) / mass - omega0 / p["Q"] * x[1]

    period = 2.0 * math.pi / omega
    times = np.linspace(80.0, 82.0, 2001) * period
    found = solve_ivp(field, (0.0, times[-1]), start, "DOP853", times, rtol=1e-9, atol=1e-11, max_step=period / 60.0)
    return found.y[0].max()


def test_a_jump_lands_on_its_sheet_between_the_last_stable_point_and_the_fold(water):
    """Both ways land next to a special point of the sheet, behind its last point: no window lies there."""
    curve = afm.frequency_curve(water, (30.0, 40.0))
    assert [way.windows for way in curve.ways] == [[], []]
    assert [round(jump.value, 4) for jump in curve.jumps] == [33.473, 33.4587, 32.2218, 32.3056, 33.4731, 34.812]


def test_a_curve_that_begins_amid_chaos_says_where(water, monkeypatch):
    def chaotic(*_):
        raise ConvergenceError("periodic attractor", 0.07, 732, "settle= allows more periods", unit="forcing periods")

    monkeypatch.setattr("saltus.afm.curves.curves.free_orbit", chaotic)
    told = "curve begins, at Zc_nm = 3, f_kHz = 9.28: no convergence, residual 0.07 after 732 forcing .*chaotic"
    with pytest.raises(ConvergenceError, match=told):
        afm.frequency_curve(water, (9.28, 9.6))


@pytest.fixture(scope="module")
def wide(water):
    """The curve of the lever in water over its whole first peak."""
    return afm.frequency_curve(water, (5.0, 60.0))


@pytest.mark.filterwarnings("ignore:saltus. motions may be missing")  # chaotic ones near 9.3 kHz are told
@pytest.mark.parametrize("place", guarding([6.5, 11.8, 12.5, 20.0, 28.0, 45.0], campaign=2))
def test_all_motions_that_an_independent_code_settles_on_are_on_a_curve_in_water(water, wide, place):
    stable = {round(orbit.max["z1_nm"], 3) for orbit in wide.at(f_kHz=place) if orbit.stable}
    for start in ((0.0, 0.0), (2.0, 0.0), (-2.0, 0.5), (6.0, 0.0), (0.0, 1.2), (-3.2, 0.0)):
        z = simulated(water.parameters, place, start)
        nearest = min(stable, key=lambda one: abs(one - z))
        assert abs(nearest - z) < 2e-3, (start, z, stable)
