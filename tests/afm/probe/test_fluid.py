"""Cantilevers in fluids: modes against the frequency response of the beam, a shaken base, what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import saltus
from saltus import afm
from saltus.afm.probe.beam import wavenumbers
from saltus.errors import InputError

LEVER = afm.Cantilever(length=197e-6, width=29e-6, thickness=2e-6, density=2320.0, young=169e9)
WATER = afm.Fluid.water()


def response(lever, fluid, frequency, gap=None):
    """Displacement of the end of a beam under a force there, by the beam's equation with the fluid's load."""
    omega = math.tau * frequency
    reynolds = fluid.density_kg_m3 * omega * lever.width**2 / 4.0 / fluid.viscosity_Pa_s
    load = complex(afm.hydrodynamic_function(reynolds, gap))
    mass = lever.density * lever.width * lever.thickness + math.pi / 4 * fluid.density_kg_m3 * lever.width**2 * load
    bending = lever.young * lever.width * lever.thickness**3 / 12.0
    b = (mass * omega**2 / bending) ** 0.25 * lever.length
    shape = (np.sin(b) * np.cosh(b) - np.cos(b) * np.sinh(b)) / (1.0 + np.cos(b) * np.cosh(b))
    return shape * lever.length**3 / bending / b**3


@pytest.mark.parametrize("gap_um", [None, 10.0])
def test_a_mode_is_that_of_the_whole_beam_where_the_peak_is_narrow(gap_um):
    air = afm.Fluid.air()
    mode = afm.fluid_modes(LEVER, air, gap_um=gap_um)[0]
    gap = None if gap_um is None else gap_um / 29.0

    def size(frequency):
        return abs(response(LEVER, air, frequency, gap))

    f0 = 1e3 * mode.f0_kHz
    peak = minimize_scalar(lambda f: -size(f), bracket=(f0 * (1 - 2 / mode.Q), f0, f0 * (1 + 2 / mode.Q)), tol=1e-10)
    assert peak.x == pytest.approx(
        f0 * math.sqrt(1.0 - 0.5 / mode.Q**2), rel=1.0 / mode.Q**2
    )  # the load changes over the peak
    stiffness = LEVER.k
    assert size(peak.x) * stiffness == pytest.approx(mode.Q, rel=2e-3)


def test_in_water_one_oscillator_is_near_the_whole_beam():
    mode = afm.fluid_modes(LEVER, WATER)[0]
    f0 = 1e3 * mode.f0_kHz
    peak = minimize_scalar(lambda f: -abs(response(LEVER, WATER, f)), bounds=(0.5 * f0, 1.5 * f0), method="bounded")
    assert peak.x == pytest.approx(f0 * math.sqrt(1.0 - 0.5 / mode.Q**2), rel=0.03)  # the load changes over the peak
    assert 1.0 < mode.Q < 5.0


def test_modes_keep_their_own_equations():
    for number, mode in enumerate(afm.fluid_modes(LEVER, WATER, 2), 1):
        load = complex(afm.hydrodynamic_function(mode.reynolds))
        ratio = math.pi * WATER.density_kg_m3 * 29e-6 / (4.0 * 2320.0 * 2e-6)
        vacuum = LEVER.f0 * (wavenumbers(number)[-1] / wavenumbers(1)[0]) ** 2 * 1e-3
        assert mode.f0_kHz == pytest.approx(vacuum / math.sqrt(1.0 + ratio * load.real), rel=1e-9)
        assert mode.added_mass == pytest.approx(ratio * load.real, rel=1e-9)
        assert pytest.approx((1.0 / ratio + load.real) / load.imag, rel=1e-9) == mode.Q
        assert mode.reynolds == pytest.approx(WATER.reynolds(mode.f0_kHz, 29.0), rel=1e-12)


def test_a_lever_measured_in_air_has_the_modes_of_its_geometry():
    air = afm.Fluid.air()
    seen = afm.fluid_modes(LEVER, air)[0]
    measured = afm.Cantilever.from_measured(k=LEVER.k, f0=1e3 * seen.f0_kHz, Q=seen.Q)
    sizes = {"plan_um": (197.0, 29.0)}
    found = afm.fluid_modes(measured, WATER, 2, measured_in=air, **sizes)
    for one, other in zip(found, afm.fluid_modes(LEVER, WATER, 2), strict=True):
        assert one == pytest.approx(other, rel=2e-5)  # what the frequency in air gives of the added mass there


def test_a_wall_slows_and_damps():
    free, near = afm.fluid_modes(LEVER, WATER)[0], afm.fluid_modes(LEVER, WATER, gap_um=5.0)[0]
    assert near.f0_kHz < 0.9 * free.f0_kHz
    assert near.Q < 0.5 * free.Q


def test_an_immersed_probe_keeps_stiffness_and_weights():
    wet = afm.immersed(LEVER, WATER, 2, R_nm=10.0, tilt_deg=11.0)
    dry = afm.Probe.from_cantilever(LEVER, modes=2, R_nm=10.0, Q=(1.0, 1.0), tilt_deg=11.0)
    assert (wet.k_N_m, wet.optical_weights, wet.base_weights) == (dry.k_N_m, dry.optical_weights, dry.base_weights)
    assert wet.f0_kHz == tuple(mode.f0_kHz for mode in afm.fluid_modes(LEVER, WATER, 2))


def test_an_overdamped_probe_is_refused_with_what_can_be_done():
    glycerol = afm.Fluid(density_kg_m3=1260.0, viscosity_Pa_s=0.5)
    with pytest.raises(InputError, match="Q = 0.33.*: must be at least 0.5 in mode 1.*check=False\\) takes") as told:
        afm.immersed(LEVER, glycerol, R_nm=10.0)
    assert "insists" not in str(told.value)
    # what the hint says is true: such a probe is a model like others
    (mode,) = afm.fluid_modes(LEVER, glycerol)
    probe = afm.Probe(k_N_m=LEVER.k, f0_kHz=mode.f0_kHz, Q=mode.Q, R_nm=10.0, check=False)
    model = afm.model(probe, afm.Hertz(E_GPa=0.1), afm.Drive(A0_nm=5.0), Zc_nm=20.0)
    assert saltus.find_orbit(model, x0=[0.0, 0.0]).max["z1_nm"] == pytest.approx(5.0, rel=1e-9)


def test_what_cannot_be_is_refused():
    measured = afm.Cantilever.from_measured(k=2.0, f0=70e3, Q=150.0)
    with pytest.raises(InputError, match="given for a measured cantilever"):
        afm.fluid_modes(measured, WATER)
    with pytest.raises(InputError, match="a beam given by geometry has its own"):
        afm.fluid_modes(LEVER, WATER, plan_um=(100.0, 20.0))
    with pytest.raises(InputError, match="in m\\? then it is 29 um; no other value is taken"):
        afm.fluid_modes(measured, WATER, plan_um=(197.0, 29e-6))
    with pytest.raises(InputError, match="in mPa s\\? then it is 0.089 Pa s"):
        afm.Fluid(density_kg_m3=997.0, viscosity_Pa_s=89.0)
    with pytest.raises(InputError, match="fluid"):
        afm.fluid_modes(LEVER, "water")
    soft = afm.Cantilever.from_measured(k=1e-4, f0=70e3, Q=2.0)
    with pytest.raises(InputError, match="heavier than the beam"):
        afm.fluid_modes(soft, WATER, plan_um=(200.0, 30.0), measured_in=WATER)


def test_short_waves_are_told():
    short = afm.Cantilever(length=80e-6, width=40e-6, thickness=2e-6, density=2320.0, young=169e9)
    with pytest.warns(RuntimeWarning, match="in modes 2, 3 the flow along the beam counts"):
        found = afm.fluid_modes(short, WATER, 3)
    assert len(found) == 3


def free_motion(drive, Q=2.0):
    probe = afm.Probe(k_N_m=0.5, f0_kHz=10.0, Q=Q, R_nm=10.0)
    orbit = saltus.find_orbit(afm.model(probe, afm.Hertz(E_GPa=1.0), drive, Zc_nm=100.0), x0=[0.0, 0.0])
    return afm.observables(orbit), afm.observables(orbit, of="tip"), probe.base_weights[0]


def test_a_base_shaken_in_a_fluid_at_rest_drags_it():
    seen, tip, weight = free_motion(afm.Drive.base(Y_nm=1.0, fluid="rests"))
    motion = weight * (1.0 - 0.5j) / 0.5j  # (omega**2 - i omega omega_0/Q) b / (omega_0**2 - omega**2 + i omega ...)
    assert seen["amplitude_nm"] == pytest.approx(abs(motion), rel=1e-9)
    assert seen["lag_deg"] == pytest.approx(-math.degrees(np.angle(motion)), abs=1e-7)
    assert tip["amplitude_nm"] == pytest.approx(abs(1.0 + motion), rel=1e-9)
    assert seen["E_ext_eV"] == pytest.approx(seen["E_med_eV"], rel=1e-9)


def test_a_base_with_its_fluid_keeps_the_lag_of_90_degrees():
    seen, tip, _ = free_motion(afm.Drive.base(Y_nm=1.0))
    assert seen["amplitude_nm"] == pytest.approx(3.131967022, rel=1e-9)
    assert seen["lag_deg"] == pytest.approx(90.0, abs=1e-6)
    assert tip["lag_deg"] == pytest.approx(72.292333, abs=1e-6)


def test_only_a_shaken_base_has_a_fluid():
    with pytest.raises(InputError, match="left out where the base is not shaken"):
        afm.Drive(A0_nm=1.0, fluid="rests")
    with pytest.raises(InputError, match="fluid"):
        afm.Drive.base(Y_nm=1.0, fluid="flows")
