"""Where two motions of a tapping tip coexist, over free amplitude and distance, with the critical amplitude.

Below the critical amplitude a tip that approaches stays attracted all the way. An independent event-exact code finds
it at 10.5434078 nm.

Field: Atomic force microscopy.

    python 11_critical_amplitude.py [picture]
"""

import sys
from pathlib import Path

from saltus import afm

probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
model = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)

region = afm.bistability(model, A0_nm=(1.0, 30.0), Zc_nm=(0.5, 30.0))
print(region)
assert abs(region.critical_amplitude_nm - 10.5434078) < 1e-6

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "11_critical_amplitude.png")
picture.parent.mkdir(parents=True, exist_ok=True)
ax = region.plot()
ax.figure.savefig(picture, dpi=100)
print("written", picture)
