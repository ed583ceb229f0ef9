"""The probe and its drive: beams with a mass at the end by quadrature, plausible values, ratios of frequencies."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from saltus import afm
from saltus.afm.probe.tip_mass import modes_with_mass
from saltus.afm.probe.units import QUANTITIES, check_changes, checked
from saltus.errors import InputError

BEAM = afm.Cantilever(length=240e-6, width=64e-6, thickness=2.1e-6, density=2300.0, young=176e9)
BEAM_NG = 240e-6 * 64e-6 * 2.1e-6 * 2300.0 * 1e12


def test_optical_weights_and_frequencies_of_a_uniform_beam():
    lever = afm.Cantilever.from_measured(k_N_m=2.0, f0_kHz=70.0, Q=150.0)
    probe = afm.Probe.from_cantilever(lever, modes=4, R_nm=10.0)
    np.testing.assert_allclose(probe.optical_weights, [1.0, 3.473127, 5.701878, 7.988279], atol=5e-7)
    np.testing.assert_allclose(np.array(probe.f0_kHz) / 70.0, [1.0, 6.266893, 17.547482, 34.386061], atol=5e-7)
    np.testing.assert_allclose(probe.k_N_m, lever.stiffnesses(4), rtol=1e-13)
    np.testing.assert_allclose(probe.base_weights, [1.56598351, -0.86787179, 0.50885059, -0.36379604], atol=5e-9)


def shape(b, mu, x):
    """A mode of the loaded beam by the two conditions at its end, 1 there."""
    sigma = (math.cosh(b) + math.cos(b)) / (math.sinh(b) + math.sin(b))
    phi = np.cosh(b * x) - np.cos(b * x) - sigma * (np.sinh(b * x) - np.sin(b * x))
    slope = b * (np.sinh(b * x) + np.sin(b * x) - sigma * (np.cosh(b * x) - np.cos(b * x)))
    return phi / phi[-1], slope / phi[-1]


@pytest.mark.parametrize("mu", [0.0, 0.05, 2.0])
def test_modes_of_a_loaded_beam_by_quadrature(mu):
    def condition(b):
        return 1.0 + math.cos(b) * math.cosh(b) + mu * b * (math.cos(b) * math.sinh(b) - math.sin(b) * math.cosh(b))

    grid = np.linspace(0.3, 11.5, 400)
    roots = [brentq(condition, a, b) for a, b in pairwise(grid) if condition(a) * condition(b) < 0.0]
    nodes, weights = np.polynomial.legendre.leggauss(60)
    x = np.append(0.5 * (nodes + 1.0), 1.0)
    for mode, b in zip(modes_with_mass(3, mu), roots, strict=False):
        phi, slope = shape(b, mu, x)
        mass = 0.5 * weights @ phi[:-1] ** 2 + mu
        assert mode.wavenumber == pytest.approx(b, rel=1e-11)
        assert mode.slope == pytest.approx(slope[-1], rel=1e-9)
        assert mode.mass == pytest.approx(mass, rel=1e-9)
        assert mode.base_weight == pytest.approx((0.5 * weights @ phi[:-1] + mu) / mass, rel=1e-9)


def test_a_tips_mass_lowers_the_frequency_as_in_rayleighs_quotient():
    bare = afm.Probe.from_cantilever(BEAM, R_nm=10.0, Q=200.0)
    light = afm.Probe.from_cantilever(BEAM, R_nm=10.0, Q=200.0, tip_mass_ng=1e-4 * BEAM_NG)
    assert light.f0_kHz[0] / bare.f0_kHz[0] == pytest.approx(1.0 - 2e-4, abs=1e-7)  # mass/4 of the beam moves
    assert light.k_N_m[0] == pytest.approx(bare.k_N_m[0], rel=1e-4)
    heavy = afm.Probe.from_cantilever(BEAM, R_nm=10.0, Q=200.0, tip_mass_ng=1e3 * BEAM_NG)
    inertia = 176e9 * 64e-6 * 2.1e-6**3 / 12.0
    assert heavy.k_N_m[0] == pytest.approx(3.0 * inertia / 240e-6**3, rel=1e-3)


def test_a_tilted_lever_is_stiffer_along_the_normal():
    flat = afm.Probe.from_cantilever(BEAM, R_nm=10.0, modes=2, Q=(200.0, 500.0))
    tilted = afm.Probe.from_cantilever(BEAM, R_nm=10.0, modes=2, Q=(200.0, 500.0), tilt_deg=60.0)
    np.testing.assert_allclose(np.array(tilted.k_N_m) / flat.k_N_m, 4.0, rtol=1e-12)
    np.testing.assert_allclose(np.array(tilted.base_weights) / flat.base_weights, 0.25, rtol=1e-12)
    assert tilted.f0_kHz == flat.f0_kHz
    assert tilted.Q == (200.0, 500.0)


def test_a_probe_is_told_what_is_missing_or_too_much():
    with pytest.raises(InputError, match="one number a mode"):
        afm.Probe(k_N_m=(1.0, 2.0), f0_kHz=30.0, Q=(100.0, 200.0), R_nm=10.0)
    with pytest.raises(InputError, match="a beam given by geometry has none"):
        afm.Probe.from_cantilever(BEAM, R_nm=10.0)
    lever = afm.Cantilever.from_measured(k=2.0, f0=70e3, Q=150.0)
    with pytest.raises(InputError, match="contain the tip's mass"):
        afm.Probe.from_cantilever(lever, R_nm=10.0, tip_mass_ng=1.0)
    with pytest.raises(InputError, match="one number for each of 1 modes"):
        afm.Probe(k_N_m=1.0, f0_kHz=30.0, Q=100.0, R_nm=10.0, optical_weights=(1.0, 2.0))


@pytest.mark.parametrize(
    ("name", "value", "meant"),
    [
        ("R_nm", 10e-9, "in m? then it is 10 nm"),
        ("R_nm", 2e5, "in pm? then it is 200 nm"),
        ("k_N_m", 2e-4, "in N/mm? then it is 0.2 N/m"),
        ("f0_kHz", 3e8, "in mHz? then it is 300 kHz"),
        ("Q", 0.4, "below 0.5 a lever creeps back to rest and does not swing; in water Q is 1 to 5"),
        ("permittivity", 78e3, "1000 times too large? then it is 78"),
        ("Q", 1e30, "and 1e+07; check"),
        ("k_N_m", 40e3, "in mN/m? then it is 40 N/m"),
        ("f0_kHz", 300e3, "in Hz? then it is 300 kHz"),
        ("f0_kHz", 0.07, "in MHz? then it is 70 kHz"),
        ("E_GPa", 1e9, "in Pa? then it is 1 GPa"),
        ("H_aJ", -1e-19, "in J? then it is -0.1 aJ"),
        ("a0_nm", 3e-10, "in m? then it is 0.3 nm"),
        ("Zc_nm", 1e6, "in pm? then it is 1000 nm"),
        ("Zc_nm", 10e-9, "in m? then it is 10 nm"),
    ],
)
def test_an_implausible_value_names_the_unit_it_may_be_in(name, value, meant):
    with pytest.raises(InputError) as told:
        checked(name, value)
    assert meant in str(told.value)
    assert "check=False insists" in str(told.value)
    assert checked(name, value, plausible=False) == value


PLAUSIBLE = {
    afm.Probe: {"k_N_m": 26.0, "f0_kHz": 300.0, "Q": 400.0, "R_nm": 12.0},
    afm.Drive: {"A0_nm": 12.0},
    afm.Drive.force: {"F0_nN": 0.5},
    afm.Drive.base: {"Y_nm": 0.1},
    afm.VanDerWaals: {"H_aJ": 0.12, "a0_nm": 0.3},
    afm.DMT: {"E_GPa": 1.5, "a0_nm": 0.3},
    afm.Hertz: {"E_GPa": 1.5},
    afm.Dashpot: {"c_uNs_m": 1.0},
    afm.KelvinVoigt: {"eta_Pa_s": 10.0},
    afm.SLS: {"k1_N_m": 2.0, "k2_N_m": 4.0, "c_uNs_m": 1.0},
    afm.JKR: {"E_GPa": 1.0, "w_N_m": 0.05},
    afm.Schwarz: {"E_GPa": 1.0, "w1_N_m": 0.05, "w2_N_m": 0.02, "a0_nm": 0.3},
    afm.Neck: {"gamma_N_m": 0.072, "h_nm": 1.0, "on_nm": 1.0, "off_nm": 3.0},
    afm.LennardJones: {"H_aJ": 0.1, "sigma_nm": 0.34},
    afm.Hydration: {"F_nN": 1.0, "l_nm": 0.3},
    afm.DLVO: {"tip_mC_m2": -20.0, "sample_mC_m2": -30.0, "debye_nm": 3.0, "H_aJ": 0.01, "permittivity": 78.0},
    afm.Morse: {"U_aJ": 0.4, "l_nm": 0.1, "D0_nm": 0.3},
    afm.Hertz(E_GPa=1.0).energy_per_cycle_eV: {"Zc_nm": 10.0, "A_nm": 12.0, "f_kHz": 70.0, "R_nm": 10.0},
}


@pytest.mark.parametrize("call", PLAUSIBLE, ids=lambda call: call.__qualname__)
def test_a_slip_of_units_is_named_wherever_it_is_not_plausible(call):
    values = PLAUSIBLE[call]
    call(**values)
    for name, value in values.items():
        for slip in (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9):
            quantity = QUANTITIES[name]
            if quantity.low <= abs(value * slip) <= quantity.high:
                continue
            told = quantity.below if quantity.below and abs(value * slip) < quantity.low else ".*\\? then it is .*"
            with pytest.raises(InputError, match=f"^{name} = .*{told}; check=False insists$"):
                call(**values | {name: value * slip})
    assert all(quantity.high < 1e9 * abs(value) for name, value in values.items() for quantity in [QUANTITIES[name]])


@pytest.mark.parametrize(
    ("name", "value", "meant"),
    [
        ("length", 240.0, "in um? then it is 0.00024 m"),
        ("thickness", 2.1, "in um? then it is 2.1e-06 m"),
        ("density", 2.3, "in g/cm^3? then it is 2300 kg/m^3"),
        ("young", 176.0, "in GPa? then it is 1.76e+11 Pa"),
    ],
)
@pytest.mark.filterwarnings("ignore:saltus:RuntimeWarning")  # units of one's own
def test_a_beam_in_other_units_is_told_by_the_probe(name, value, meant):
    beam = dataclasses.asdict(BEAM) | {name: value}
    slipped = afm.Cantilever(**{key: beam[key] for key in ("length", "width", "thickness", "density", "young")})
    with pytest.raises(InputError) as told:
        afm.Probe.from_cantilever(slipped, R_nm=10.0, Q=200.0)
    assert meant in str(told.value)
    assert afm.Probe.from_cantilever(slipped, R_nm=10.0, Q=200.0, check=False).R_nm == 10.0


def test_slips_of_ranges_and_changed_parameters_are_told_before_anything_is_computed():
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    lever = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)
    for call, meant in (
        (
            lambda: afm.distance_curve(lever, (5e-10, 14e-9)),
            "Zc_nm = .*then it is 14 nm; a model with",
        ),
        (lambda: afm.distance_curve(lever, (5.0, 14.0), f_kHz=300e3), "f_kHz = .*in Hz\\? then it is 300 kHz"),
        (
            lambda: afm.distance_curve(lever, (5.0, 14.0), parameters={"R_nm": 12e-9}),
            "R_nm = .*in m\\? then it is 12 nm",
        ),
        (lambda: afm.frequency_curve(lever, (298e3, 302e3)), "f_kHz = .*in Hz\\?"),
        (lambda: afm.frequency_curve(lever, (298.0, 302.0), Zc_nm=8e-9), "Zc_nm = .*in m\\? then it is 8 nm"),
        (lambda: afm.bistability(lever, A0_nm=(1e-9, 30e-9)), "A0_nm = 3e-08: .*in m\\? then it is 30 nm"),
        (lambda: afm.tip_radius(lever, 10.5e-9, R_nm=(1.0, 100.0)), "A0_nm = .*in m\\? then it is 10.5 nm"),
        (lambda: afm.frequency_shift(lever, (9e-9, 14e-9), 10.0), "Zc_nm = .*in m\\? then it is 14 nm"),
    ):
        with pytest.raises(InputError, match=meant):
            call()
    own = afm.model(
        afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=2e5, check=False), law, afm.Drive(12.0), Zc_nm=10.0
    )
    check_changes(own.parameters, {"R_nm": 3e5})


def test_a_frequency_is_held_against_that_of_the_lever_and_against_its_mass():
    values = {"k_N_m": 3.0, "f0_kHz": 75.0, "Q": 200.0, "R_nm": 10.0}
    with pytest.raises(InputError, match=r"f0_kHz = 75000\.0: .*1\.4e-05 ng; in Hz\? then it is 75 kHz; check=False"):
        afm.Probe(**values | {"f0_kHz": 75e3})
    with pytest.raises(InputError, match=r"f0_kHz = 0\.3: .*in MHz\? then it is 300 kHz"):
        afm.Probe(**values | {"k_N_m": 26.0, "f0_kHz": 0.3})
    assert afm.Probe(**values | {"f0_kHz": 75e3}, check=False).f0_kHz == (75e3,)
    afm.Probe(k_N_m=0.1, f0_kHz=3500.0, Q=2.0, R_nm=3.0)  # of high-speed microscopes
    afm.Probe(k_N_m=1800.0, f0_kHz=32.7, Q=1e5, R_nm=5.0)  # a qPlus
    probe, law = afm.Probe(**values), afm.Hertz(E_GPa=1.0)
    for drive, at in ((afm.Drive(10.0), {"f_kHz": 75e3}), (afm.Drive(10.0, at=75e3), {})):
        with pytest.raises(InputError, match=r"= 75000\.0: .*in Hz\? then it is 75 kHz; check=False insists"):
            afm.model(probe, law, drive, Zc_nm=8.0, **at)
    system = afm.model(probe, law, afm.Drive(10.0), Zc_nm=8.0)
    with pytest.raises(InputError, match=r"f_kHz = 80000\.0: .*in Hz\? then it is 80 kHz; a model with such a value"):
        afm.frequency_curve(system, (70e3, 80e3))


def test_arguments_of_other_names_are_told_the_nearest_one():
    for call, other, name in (
        (afm.Probe, {"k": 3.0}, "k_N_m"), (afm.Probe, {"optical": 3.0}, "optical_weights"),
        (afm.Drive, {"A0": 3.0}, "A0_nm"), (afm.Hertz, {"E": 1.0}, "E_GPa"),
        (afm.VanDerWaals, {"H_aJ": 1.0, "a0": 0.3}, "a0_nm"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"did you mean '{name}'"):
            call(**other)


def test_a_drive_without_an_amplitude_is_refused():
    for call in (afm.Drive, afm.Drive.base, afm.Drive.force):
        with pytest.raises(InputError, match="above 0; without a drive nothing swings; check=False insists"):
            call(0.0)
        assert call(0.0, check=False).size[1] == 0.0
    probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=10.0)
    system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=20.0)
    with pytest.raises(InputError, match="without a drive nothing swings"):
        afm.distance_curve(system, (5.0, 15.0), parameters={"A0_nm": 0.0})


def test_signs_that_are_never_allowed_are_refused_without_check_too():
    for name in ("R_nm", "k_N_m", "f0_kHz", "Q", "a0_nm"):
        for value in (0.0, -1.0, math.nan, math.inf, "10"):
            with pytest.raises(InputError):
                checked(name, value, plausible=False)
    with pytest.raises(InputError, match=">= 0"):
        checked("E_GPa", -1.0, plausible=False)
    assert checked("H_aJ", -0.1) == -0.1
    assert checked("Zc_nm", 0.0) == 0.0
    assert all(quantity.low < quantity.high for quantity in QUANTITIES.values())


def test_check_false_insists_for_every_part():
    afm.Probe(k_N_m=1e-5, f0_kHz=0.01, Q=0.3, R_nm=1e6, check=False)
    afm.VanDerWaals(H_aJ=1e3, a0_nm=5.0, check=False)
    afm.Drive(A0_nm=1e5, check=False)
    afm.Drive.base(Y_nm=1e5, check=False)
    afm.Drive.force(F0_nN=1e7, check=False)
    afm.Probe.from_cantilever(BEAM, R_nm=1e6, Q=200.0, check=False)
    with pytest.raises(InputError, match="check=False insists"):
        dataclasses.replace(afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3), a0_nm=5.0)


# drives


@pytest.mark.parametrize("ratio", ["19/3", Fraction(19, 3), 19.0 / 3.0])
def test_a_ratio_is_a_fraction_however_it_is_written(ratio):
    drives = afm.Drive(10.0) + afm.Drive(1.0, mode=2, ratio=ratio)
    assert drives.parts[1].ratio == Fraction(19, 3)
    assert drives.turns == 3
    assert (drives + afm.Drive(1.0, ratio="5/2")).turns == 6


@pytest.mark.parametrize("ratio", ["6.267", 6.267, math.pi, "101/100", "one", "1/0", -2, 0])
def test_a_ratio_that_is_no_small_fraction_is_refused(ratio):
    with pytest.raises(InputError, match="fraction of integers up to 100|> 0"):
        afm.Drive(1.0, ratio=ratio)


def test_a_ratio_without_a_period_says_what_to_do():
    with pytest.raises(InputError, match=r"simulate with at_any_ratio\(3.14159.*\), or take one near, as '22/7'"):
        afm.Drive(1.0, ratio=math.pi)


def test_drives_that_do_not_go_together_are_refused():
    with pytest.raises(InputError, match="another for each drive"):
        afm.Drive(1.0) + afm.Drive(2.0, mode=2)
    with pytest.raises(InputError, match="repeat after at most 100 periods"):
        afm.Drive(1.0) + afm.Drive(2.0, ratio="98/97") + afm.Drive(2.0, ratio="2/3")
    with pytest.raises(InputError, match="exactly one of"):
        afm.Drive()
    with pytest.raises(InputError, match="exactly one of"):
        afm.Drive(1.0, F0_nN=2.0)
    with pytest.raises(InputError, match="belong to A0_nm"):
        afm.Drive(F0_nN=2.0, mode=2)
    with pytest.raises(InputError, match="at"):
        afm.Drive(1.0, at="resonance")


@pytest.mark.parametrize("ratio", ["0/3", "-1/2"])
def test_a_ratio_that_is_not_positive_has_no_neighbour_to_take(ratio):
    with pytest.raises(InputError) as caught:
        afm.Drive(A0_nm=1.0, ratio=ratio)
    assert "take one near" not in str(caught.value)
