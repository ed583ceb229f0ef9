"""A cantilever in water and in air: its modes, and how it taps a soft sample.

The fluid moves along with the beam, and rubs on it, after Sader (J. Appl. Phys. 84 (1998) 64): with T = pi rho b/(4
rho_c h) a mode has w = w_vac/sqrt(1 + T Re G(w)) and Q = (1/T + Re G)/Im G, where G is the hydrodynamic function.
Known answers: SciPy's root of that equation; contact begins where the distance is the free amplitude; and in a cycle
the drive gives what the fluid takes, as a Hertzian sample takes nothing.

Field: Atomic force microscopy.

    python afm_liquid.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.optimize import brentq

import saltus
from saltus import afm

width, thickness, density = 29e-6, 2e-6, 2320.0
lever = afm.Cantilever(length=197e-6, width=width, thickness=thickness, density=density, young=169e9)
vacuum = 1.875104068711961**2 / (2.0 * np.pi) * thickness / 197e-6**2 * np.sqrt(169e9 / (12.0 * density))
fluids = {"air": (afm.Fluid.air(), "#d55e00"), "water": (afm.Fluid.water(), "#0072b2")}


def mode_of(fluid):
    """Natural frequency in kHz and quality factor in a fluid, by a search for the root."""
    load = np.pi * fluid.density_kg_m3 * width / (4.0 * density * thickness)

    def flow(f):
        reynolds = fluid.density_kg_m3 * 2.0 * np.pi * f * width**2 / (4.0 * fluid.viscosity_Pa_s)
        return complex(afm.hydrodynamic_function(reynolds))

    root = brentq(lambda f: f - vacuum / np.sqrt(1.0 + load * flow(f).real), 1e3, vacuum, xtol=1e-8)
    return root / 1e3, (1.0 / load + flow(root).real) / flow(root).imag


figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
for name, (fluid, colour) in fluids.items():
    f0, quality = mode_of(fluid)
    probe = afm.immersed(lever, fluid, R_nm=10.0)
    print(f"{name}: f0 {probe.f0_kHz[0]:.6f} kHz, formula {f0:.6f}; Q {probe.Q[0]:.6f}, formula {quality:.6f}")
    assert abs(probe.f0_kHz[0] / f0 - 1.0) < 1e-6
    assert abs(probe.Q[0] / quality - 1.0) < 1e-6
    model = afm.model(probe, afm.Hertz(E_GPa=0.01), afm.Drive(A0_nm=20.0), Zc_nm=10.0)
    curve = saltus.continue_orbit(saltus.find_orbit(model, x0=[0.0, 0.0]), "Zc_nm", bounds=(2.0, 25.0))
    print(curve)
    seen = afm.observables(curve.at(10.0)[0])
    print(f"at 10 nm a cycle takes {seen['E_ext_eV']:.6f} eV, of which the fluid has {seen['E_med_eV']:.6f}")
    assert abs(curve["GR1"].parameters["Zc_nm"] - 20.0) < 1e-6
    assert abs(seen["E_ext_eV"] - seen["E_med_eV"]) < 1e-6
    f = np.linspace(0.2, 1.6, 500)
    label = f"{name}, $f_0$ = {probe.f0_kHz[0]:.1f} kHz, Q = {probe.Q[0]:.3g}"
    left.semilogy(f * probe.f0_kHz[0], 1.0 / np.hypot(1.0 - f**2, f / probe.Q[0]), color=colour, label=label)
    right.plot(curve.column("Zc_nm"), curve.column("max_indentation_nm"), color=colour, label=name)
left.axvline(vacuum / 1e3, color="0.6", linewidth=1.0, zorder=0, label="natural frequency in vacuum")
left.set(xlabel="frequency in kHz", ylabel="response (units of the static one)", ylim=(0.2, 2e4))
left.set_title("response of the first mode")
left.legend(fontsize="small")
right.set(
    xlabel="distance $Z_c$ in nm", ylabel="greatest indentation in nm", title="free amplitude 20 nm, sample of 10 MPa"
)
right.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "afm_liquid.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
