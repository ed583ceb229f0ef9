"""The laws of force between tip and sample: force against the gap, both ways where they differ.

Way in and way out differ for laws with hysteresis, and for those whose force depends on the rate. The latter are drawn
along the motion ``Zc + A cos(2 pi f t)``. The area between both ways is the energy that a cycle loses.

Field: Atomic force microscopy.

    python 13_laws_of_force.py [picture [folder]]

A folder gets one picture a law as well.
"""

import math
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import solve_ivp

from saltus import afm

R = 10.0  # nm, radius of the tip
ZC, A, F = 18.0, 20.0, 300.0  # nm, nm and kHz: the motion along which forces that depend on the rate are drawn
OMEGA = 2e-3 * math.pi * F  # 1/us
SPHERE = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0)
VISCOUS = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=100.0)
PULL_OFF = 3.0 * (math.pi * R**2 * 0.05 / 8.0) ** (2.0 / 3.0) / R  # nm, for E = 1 GPa and w = 0.05 N/m


def static(law, gaps):
    """One way: the force does not depend on the way."""
    return [("both ways", gaps, law.force_nN(gaps, R_nm=R))]


def compared(laws, gaps):
    """One way of several laws, each with its name."""
    return [(name, gaps, law.force_nN(gaps, R_nm=R)) for name, law in laws.items()]


def hysteretic(law, gaps, begins, ends, regions):
    """The way in, along which contact begins at one gap, and the way out, along which it ends at another."""
    outer, inner = regions
    ways = []
    for name, level in (("approach", begins), ("retraction", ends)):
        force = np.where(gaps > level, law.force_nN(np.maximum(gaps, level), outer, R_nm=R), np.nan)
        inside = gaps <= level
        force[inside] = law.force_nN(gaps[inside], inner, R_nm=R)
        ways.append((name, gaps, force))
    return ways


def moving(law, low, high):
    """Both ways along the motion."""
    ways = []
    for name, direction in (("approach", -1.0), ("retraction", 1.0)):
        gaps = np.linspace(low, high, 801)
        rates = direction * OMEGA * np.sqrt(A**2 - (gaps - ZC) ** 2)
        ways.append((name, gaps, law.force_nN(gaps, R_nm=R, V_nm_us=rates)))
    return ways


def solid(k1, k2, c):
    """Both ways of a solid with arms, in the second cycle: the surface recovers between taps."""
    k2, c = np.array(k2), np.array(c)

    def surface(y):
        return k2 @ y / (k1 + k2.sum())

    def rate(t, y):
        depth = -ZC - A * math.cos(OMEGA * t)
        return k2 * (max(depth, surface(y)) - y) / c

    cycle = 2.0 * math.pi / OMEGA
    times = np.linspace(cycle, 2.0 * cycle, 4001)
    start = np.zeros(k2.size)
    y = solve_ivp(rate, (0.0, 2.0 * cycle), start, "LSODA", times, rtol=1e-8, atol=1e-10, max_step=cycle / 500).y
    gaps = ZC + A * np.cos(OMEGA * times)
    force = np.where(-gaps > surface(y), -k1 * gaps + k2 @ (-gaps - y), 0.0)
    near = gaps < 1.5
    falling = times < 1.5 * cycle
    return [
        (name, gaps[near & way], force[near & way]) for name, way in (("approach", falling), ("retraction", ~falling))
    ]


LAWS = {
    "van_der_waals": ("VanDerWaals", static(afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3), np.linspace(-0.5, 4.0, 600))),
    "dmt": ("DMT, with VanDerWaals", static(SPHERE, np.linspace(-1.5, 3.0, 600))),
    "hertz": ("Hertz", static(afm.Hertz(E_GPa=1.0), np.linspace(-2.0, 2.0, 600))),
    "cone": ("Cone", static(afm.Cone(E_GPa=1.0, half_angle_deg=35.0), np.linspace(-2.0, 2.0, 600))),
    "sphere_cone": (
        "SphereCone",
        compared(
            {
                "sphere on cone": afm.SphereCone(E_GPa=1.0, half_angle_deg=35.0),
                "paraboloid": afm.Hertz(E_GPa=1.0),
                "cone": afm.Cone(E_GPa=1.0, half_angle_deg=35.0),
            },
            np.linspace(-30.0, 2.0, 600),
        ),
    ),
    "flat_punch": ("FlatPunch", static(afm.FlatPunch(E_GPa=1.0, punch_nm=5.0), np.linspace(-2.0, 2.0, 600))),
    "thin_sphere": (
        "ThinSphere",
        compared(
            {"thin": afm.ThinSphere(E_GPa=1.0, thickness_nm=10.0), "thick": afm.Hertz(E_GPa=1.0)},
            np.linspace(-3.0, 1.0, 600),
        ),
    ),
    "thin_cone": (
        "ThinCone",
        compared(
            {
                "thin": afm.ThinCone(E_GPa=1.0, half_angle_deg=35.0, thickness_nm=10.0),
                "thick": afm.Cone(E_GPa=1.0, half_angle_deg=35.0),
            },
            np.linspace(-10.0, 2.0, 600),
        ),
    ),
    "thin_punch": (
        "ThinPunch",
        compared(
            {
                "thin": afm.ThinPunch(E_GPa=1.0, punch_nm=5.0, thickness_nm=10.0),
                "thick": afm.FlatPunch(E_GPa=1.0, punch_nm=5.0),
            },
            np.linspace(-3.0, 1.0, 600),
        ),
    ),
    "dashpot": ("Dashpot, with Hertz", moving(afm.Hertz(E_GPa=1.0) + afm.Dashpot(c_uNs_m=0.3), -1.995, 1.5)),
    "kelvin_voigt": ("KelvinVoigt, with Hertz", moving(VISCOUS, -1.995, 1.5)),
    "sls": ("SLS", solid(2.0, [4.0], [1.0])),
    "generalised_maxwell": ("GeneralisedMaxwell, two arms", solid(1.0, [4.0, 3.0], [0.3, 5.0])),
    "jkr": (
        "JKR",
        hysteretic(afm.JKR(E_GPa=1.0, w_N_m=0.05), np.linspace(-2.0, 2.0, 1201), 0.0, PULL_OFF, ("far", "contact")),
    ),
    "schwarz": (
        "Schwarz",
        hysteretic(
            afm.Schwarz(E_GPa=1.0, w1_N_m=0.05, w2_N_m=0.02, a0_nm=0.3),
            np.linspace(-2.0, 2.0, 1201), 0.0, PULL_OFF, ("far", "contact"),
        ),
    ),
    "neck": (
        "Neck",
        hysteretic(
            afm.Neck(gamma_N_m=0.072, h_nm=1.0, on_nm=1.0, off_nm=3.0),
            np.linspace(0.0, 5.0, 1201), 1.0, 3.0, ("dry", "wet"),
        ),
    ),
    "meniscus": (
        "Meniscus",
        hysteretic(
            afm.Meniscus(gamma_N_m=0.072, V_nm3=50.0, on_nm=1.0),
            np.linspace(0.0, 5.0, 1201), 1.0, 50.0 ** (1.0 / 3.0), ("dry", "wet"),
        ),
    ),
    "electrostatic": (
        "Electrostatic",
        compared(
            {"1 V": afm.Electrostatic(bias_V=1.0), "2 V": afm.Electrostatic(bias_V=2.0)}, np.linspace(0.5, 20.0, 600)
        ),
    ),
    "electrostatic_tip": (
        "ElectrostaticTip",
        compared(
            {
                "sphere and cone": afm.ElectrostaticTip(bias_V=1.0, half_angle_deg=15.0, cone_height_nm=1e4),
                "sphere alone": afm.Electrostatic(bias_V=1.0),
            },
            np.linspace(0.5, 20.0, 600),
        ),
    ),
    "magnetic_dipoles": (
        "MagneticDipoles",
        compared(
            {
                "parallel": afm.MagneticDipoles(tip_A_nm2=100.0, sample_A_nm2=100.0, centres_nm=40.0),
                "opposed": afm.MagneticDipoles(tip_A_nm2=100.0, sample_A_nm2=-100.0, centres_nm=40.0),
            },
            np.linspace(0.0, 60.0, 600),
        ),
    ),
    "lennard_jones": ("LennardJones", static(afm.LennardJones(H_aJ=0.1, sigma_nm=0.34), np.linspace(0.19, 2.0, 600))),
    "hydration": ("Hydration", static(afm.Hydration(F_nN=2.0, l_nm=0.3), np.linspace(0.0, 2.0, 600))),
    "dlvo": (
        "DLVO",
        static(
            afm.DLVO(tip_mC_m2=-20.0, sample_mC_m2=-30.0, debye_nm=3.0, H_aJ=0.02), np.linspace(0.3, 12.0, 600)
        ),
    ),
    "morse": ("Morse", static(afm.Morse(U_aJ=0.4, l_nm=0.1, D0_nm=0.3), np.linspace(0.22, 1.0, 600))),
}  # fmt: skip
COLOURS = ("tab:blue", "tab:orange", "tab:green")
LINES = ("-", "--", ":")


def draw(ax, title, ways):
    for (name, gaps, force), colour, line in zip(ways, COLOURS, LINES, strict=False):
        ax.plot(gaps, force, line, color=colour, label=name)
    ax.axhline(0.0, color="0.8", lw=0.8, zorder=0)
    ax.set_title(title)
    ax.set_xlabel("gap $D$ (nm)")
    ax.set_ylabel("force (nN)")
    if len(ways) > 1:
        ax.legend(frameon=False)


figure, axes = plt.subplots(8, 3, figsize=(10.0, 22.0), layout="constrained")
for ax, (title, ways) in zip(axes.flat, LAWS.values(), strict=False):
    draw(ax, title, ways)
for ax in axes.flat[len(LAWS) :]:
    ax.set_visible(False)

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "13_laws_of_force.png")
picture.parent.mkdir(parents=True, exist_ok=True)
if len(sys.argv) > 2:
    folder = Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for name, (title, ways) in LAWS.items():
        one, ax = plt.subplots(figsize=(5.0, 3.4), layout="constrained")
        draw(ax, title, ways)
        one.savefig(folder / f"{name}.png", dpi=90)
        plt.close(one)
        print("written", folder / f"{name}.png")
figure.savefig(picture, dpi=80)
print("written", picture)
