"""Known answers of atomic force microscopy: beams, fluids, laws of force, losses, calibration."""

from __future__ import annotations

from functools import cache

import numpy as np

import saltus
from answers.answer import Answer
from saltus import afm
from saltus.afm.calibration.stiffness import modal_over_static, optical_chi
from saltus.afm.paper.galerkin import coefficients
from saltus.afm.probe.beam import wavenumbers
from saltus.afm.probe.blade_flow import blade_load

PAPER = "ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Table 1 with E = 176 GPa; closed form"
BEAM = "roots of cos(b) cosh(b) = -1, in the literature"
BLADE = "Brumley, Willcox, Sader, Phys. Fluids 22 (2010) 052001, Tables I and II with their erratum"
JKR = "Johnson, Kendall, Roberts; closed form"

AJ = 0.1602176634  # aJ in 1 eV

# by log10(Re), for a thin blade
PUBLISHED = {
    -2.0: "41.6417 + 140.659i",
    -1.5: "20.1196 + 54.4049i",
    -1.0: "10.4849 + 21.8269i",
    -0.5: "5.96655 + 9.16870i",
    0.0: "3.73387 + 4.07467i",
    0.5: "2.56548 + 1.93366i",
    1.0: "1.91834 + 0.981710i",
    1.5: "1.54554 + 0.527773i",
    2.0: "1.32633 + 0.296143i",
    2.5: "1.19577 + 0.171115i",
    3.0: "1.11746 + 0.100688i",
}


@cache
def table1():
    setup = afm.table1()
    return coefficients(setup.cantilever, setup.sample, setup.eta, 2)


def load(logarithm):
    found = blade_load(10.0**logarithm)
    return found.real, found.imag


def force(law, gap, region=None, R=20.0):
    return float(law.force_nN(gap, region, R_nm=R) if region else law.force_nN(gap, R_nm=R))


def loss(law, Zc, A, f=70.0, R=20.0):
    return float(law.energy_per_cycle_eV(Zc_nm=Zc, A_nm=A, f_kHz=f, R_nm=R))


def static_ratio():
    lever = afm.Cantilever(length=240e-6, width=64e-6, thickness=2.1e-6, density=2300.0, young=176e9)
    return lever.k / (176e9 * 64e-6 * 2.1e-6**3 / (4.0 * 240e-6**3))


@cache
def lever():
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)


def free_motion():
    far = {"Zc_nm": 100.0, "H_aJ": 0.0, "f_kHz": 300.3}
    seen = afm.observables(saltus.find_orbit(lever(), far, x0=[0.0, 0.0]))
    return seen["amplitude_nm"], seen["lag_deg"], seen["E_med_eV"]


def shift():
    curve = afm.frequency_shift(lever(), (13.0, 14.0), 10.0, points=2, parameters={"k_N_m": 2600.0})
    return tuple(curve.column("shift_Hz"))


@cache
def adhesive():
    return afm.JKR(E_GPa=0.05, w_N_m=0.05)


LEVERS = [
    Answer("clamped beam: wavenumbers of the first five modes", BEAM,
           "(1.875104068712, 4.694091132974, 7.854757438238, 10.995540734875, 14.137168391046)",
           lambda: tuple(wavenumbers(5))),
    Answer("rectangular cantilever: stiffness of the first mode over the static one",
           "Melcher, Hu, Raman, Appl. Phys. Lett. 91 (2007) 053101", "1.030", static_ratio),
    Answer("the same: static stiffness over that of the first mode", "closed form", "0.971",
           lambda: 1.0 / modal_over_static(), "12/1.875104068712**4"),
    Answer("the same: optical sensitivity, static over first mode", "closed form", "1.0897", optical_chi,
           "3/2/1.875104068712*(cosh(1.875104068712) + cos(1.875104068712))"
           "/(sinh(1.875104068712) - sin(1.875104068712))"),
    Answer("silicon cantilever in air, 397 x 29 um, 17.36 kHz, Q = 55.5: spring constant in N/m",
           "Sader, Chon, Mulvaney, Rev. Sci. Instrum. 70 (1999) 3967, Table 1", "0.157",
           lambda: afm.sader_stiffness(17.36, 55.5, length_um=397.0, width_um=29.0, fluid=afm.Fluid.air())),
    Answer("free cantilever, 26 N/m, Q = 400, driven 0.1 % above resonance: amplitude in nm, lag, loss in eV",
           "closed form", "(9.362889, 128.645845, 111.842458)", free_motion,
           "0.03/sqrt((1 - 1.001**2)**2 + (1.001/400)**2), 180/pi*(pi - atan(1.001/400/(1.001**2 - 1))), "
           "pi*26*0.03**2*1.001/400/((1 - 1.001**2)**2 + (1.001/400)**2)/0.1602176634"),
    Answer("stiff cantilever above a van der Waals force, amplitude 10 nm held: frequency shifts in Hz",
           "Giessibl, Phys. Rev. B 56 (1997) 16010; closed form", "(-0.0294, -0.0483)", shift,
           "-300000*0.12*12/(6*2600*96**1.5), -300000*0.12*12/(6*2600*69**1.5)", campaign=True),
    Answer("tapping cantilever: frequency in Hz and modal stiffness in N/m", PAPER, "(51519.24, 1.9434665)",
           lambda: (table1().f_1, table1().k)),
    Answer("the same: ratio of the first two stiffnesses, drives of both modes", PAPER,
           "(39.2739482, 1.56598351, -0.86787179)", lambda: (table1().K[1], *table1().B)),
    Answer("the same: attraction and contact stiffness, without dimension", PAPER, "(-2.35038841e-6, 247.16423658)",
           lambda: (table1().C, table1().G)),
    *(
        Answer(f"thin blade in a viscous fluid, log10(Re) = {logarithm}: load", BLADE, printed,
               lambda logarithm=logarithm: load(logarithm))
        for logarithm, printed in PUBLISHED.items()
    ),
]  # fmt: skip

FORCES = [
    Answer("van der Waals force of a sphere, H = 0.2 aJ, R = 10 nm, 2 nm away, in nN", "closed form",
           "-0.0833333333333",
           lambda: force(afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3), 2.0, R=10.0), "-1/12"),
    Answer("Hertz's contact, E* = 2 GPa, R = 20 nm, 0.4 nm deep, in nN", "closed form", "3.0169889331",
           lambda: force(afm.Hertz(E_GPa=2.0), -0.4), "8/3*sqrt(20)*0.4**(3/2)"),
    Answer("DMT contact: pull-off force, H = 0.2 aJ, a0 = 0.165 nm, in nN", "closed form", "-24.4872972146",
           lambda: force(afm.VanDerWaals(H_aJ=0.2, a0_nm=0.165) + afm.DMT(E_GPa=1.0), 0.165),
           "-0.2*20/(6*0.165**2)"),
    Answer("JKR contact, E* = 0.05 GPa, w = 0.05 N/m, R = 20 nm: force without indentation, in nN", JKR,
           "-4.188790205", lambda: force(adhesive(), 0.0, "contact"), "-4*pi/3"),
    Answer("the same: greatest adhesion, in nN", JKR, "-4.712389",
           lambda: float(adhesive().force_nN(np.linspace(-5.0, 4.3, 20001), "contact", R_nm=20.0).min()), "-3*pi/2"),
    Answer("the same: loss of a cycle of contact and pull-off, in eV", JKR, "120.1564252",
           lambda: loss(adhesive(), 8.0, 10.0),
           "(0.15*2**(8/3) + 0.1)*pi**(5/3)*(0.05**5*20**4/0.05**2)**(1/3)/0.1602176634"),
    Answer("cone of 35 degrees, E* = 2 GPa, 7 nm deep, in nN", "Sneddon; closed form", "43.6850644313",
           lambda: force(afm.Cone(E_GPa=2.0, half_angle_deg=35.0), -7.0), "4/pi*49*tan(35*pi/180)"),
    Answer("flat punch, E* = 0.1 GPa, radius 30 nm, 2 nm deep, in nN", "Sneddon; closed form", "12.0000000000",
           lambda: force(afm.FlatPunch(E_GPa=0.1, punch_nm=30.0, a0_nm=0.2), -1.8), "2*0.1*30*2"),
    Answer("capillary neck, 0.072 N/m, R = 20 nm, made at 1 nm, broken at 3 nm: loss in eV", "closed form",
           "28.23592184", lambda: loss(afm.Neck(gamma_N_m=0.072, h_nm=1.0, on_nm=1.0, off_nm=3.0), 10.0, 9.5),
           "4*pi*0.072*20*(1/2 - 1/4)/0.1602176634"),
    Answer("viscous contact, 10 Pa s, amplitude 20 nm, 1 nm deep, 70 kHz: loss in aJ", "quadrature",
           "0.097091042",
           lambda: loss(afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0), 19.0, 20.0) * AJ),
    Answer("dashpot of 2 uN s/m in contact, amplitude 10 nm, 1 nm deep, 300 kHz: loss in eV", "closed form",
           "138.18167638",
           lambda: loss(afm.Hertz(E_GPa=1.0) + afm.Dashpot(c_uNs_m=2.0), 9.0, 10.0, 300.0),
           "2*100*2*pi*300/10**3*(acos(0.9) - 0.9*sqrt(0.19))/0.1602176634"),
    Answer("standard linear solid always in contact, 70 kHz: loss in eV", "closed form", "34.08459445",
           lambda: loss(afm.SLS(k1_N_m=2.0, k2_N_m=4.0, c_uNs_m=1.0), -20.0, 2.0),
           "16*pi*(2*pi*70/4000)/(1 + (2*pi*70/4000)**2)/0.1602176634"),
]  # fmt: skip
