"""The critical amplitude grows with the tip's radius, so that a measured one tells the radius.

Field: Atomic force microscopy.

    python 12_tip_radius.py [picture]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt

from saltus import afm

MEASURED = 9.0  # nm, a critical amplitude

probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=8.0)
law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
model = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)

radii, amplitudes = [4.0, 8.0, 12.0, 16.0, 20.0, 25.0], []
for R in radii:
    region = afm.bistability(model, A0_nm=(0.5, 30.0), Zc_nm=(0.5, 30.0), parameters={"R_nm": R})
    amplitudes.append(region.critical_amplitude_nm)
    print(f"R = {R:g} nm: critical amplitude {amplitudes[-1]:.4f} nm")
radius = afm.tip_radius(model, MEASURED)
print(f"a critical amplitude of {MEASURED:g} nm tells a radius of {radius:.4f} nm")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "12_tip_radius.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure, ax = plt.subplots(layout="constrained")
ax.plot(radii, amplitudes, "o-", label="bistability")
ax.plot([0.0, radius, radius], [MEASURED, MEASURED, 0.0], ":", color="tab:red")
ax.plot(radius, MEASURED, "s", color="tab:red", label=f"tip_radius: {radius:.2f} nm")
ax.set(xlabel="radius of the tip (nm)", ylabel="critical amplitude (nm)", xlim=(0.0, None), ylim=(0.0, None))
ax.legend(frameon=False, loc="lower right")
figure.savefig(picture, dpi=100)
print("written", picture)
