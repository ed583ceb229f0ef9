"""The force between tip and sample from both ways of a tapping-mode curve, and the law that is fitted to it.

Field: Atomic force microscopy.

    python 19_force_from_data.py [picture]
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

from saltus import afm
from saltus.continuation import StepControl

probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
drive = afm.Drive(A0_nm=12.0)
model = afm.model(probe, law, drive, Zc_nm=10.0)
curve = afm.distance_curve(model, (9.0, 18.0), steps=StepControl(largest=0.1))
ways = pd.concat([curve.path(way).to_dataframe() for way in curve.directions], ignore_index=True)

force = afm.reconstruct_force(ways, probe, drive=drive, sigma={"amplitude_nm": 0.03, "lag_deg": 0.3})
print(force)
guess = afm.VanDerWaals(H_aJ=0.05, a0_nm=0.3) + afm.DMT(E_GPa=3.0)
found = force.fit(guess, {"H_aJ": (0.01, 1.0), "E_GPa": (0.1, 10.0)})
print(found)

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "19_force_from_data.png")
picture.parent.mkdir(parents=True, exist_ok=True)
axes = force.plot({"law of the curve": law, "fitted law": found.law})
axes.set_xlim(-0.8, 3.0)
axes.figure.savefig(picture, dpi=100)
print("written", picture)
plt.close("all")
