"""Tapping mode in nanometres: amplitude and lag over the distance, with the jumps of approach and retraction.

An independent event-exact code finds the jumps at 9.878337793 and 11.50288421 nm, and first contact at 11.34091369 nm.

Field: Atomic force microscopy.

    python 10_distance_curve.py [picture]
"""

import sys
from pathlib import Path

import numpy as np

from saltus import afm

probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
model = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=14.0)

curve = afm.distance_curve(model, (0.5, 14.0), f_kHz="f0")
print(curve)
for jump in curve.jumps:
    print(f"{jump.direction}: at {jump.value:.7f} nm from {jump.before_nm:.4f} to {jump.after_nm:.4f} nm")
contact = max(point.value for point in curve.special_points if point.label == "GR1")
np.testing.assert_allclose(
    [contact, *sorted(jump.value for jump in curve.jumps)], [11.34091369, 9.878337793, 11.50288421], rtol=1e-7
)

for orbit in curve.at(Zc_nm=10.0):
    seen = afm.observables(orbit)
    print(f"Zc = 10 nm: {seen['amplitude_nm']:.6f} nm, lag {seen['lag_deg']:.4f} degrees, {seen['regime']}")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "10_distance_curve.png")
picture.parent.mkdir(parents=True, exist_ok=True)
upper, _ = curve.plot()
upper.figure.savefig(picture, dpi=100)
print("written", picture)
