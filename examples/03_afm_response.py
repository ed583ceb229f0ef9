"""Frequency response of a tapping cantilever, and the orbit that taps.

In Fig. 3 of doi:10.1115/1.4062228 a fold lies next to each grazing, where the motion begins to touch the sample.

Field: Atomic force microscopy.

    python 03_afm_response.py [picture]
"""

import sys
from pathlib import Path

from matplotlib import pyplot as plt

import saltus
from saltus import afm

model = afm.tapping_mode(afm.table1(), modes=1)
orbit = saltus.find_orbit(model, {"Omega": 1.05}, x0=[-0.7, 0.7])
branch = saltus.continue_orbit(orbit, "Omega", bounds=(0.8, 1.4))
print(orbit)
print(branch)

grazings = [point.parameters["Omega"] for point in branch.special_points if point.type == "GR"]
folds = [point.parameters["Omega"] for point in branch.special_points if point.type == "SN"]
assert len(grazings) == 2
for grazing in grazings:
    fold = min(folds, key=lambda place: abs(place - grazing))
    print(f"grazing at Omega = {grazing:.6f}, the next fold at {fold:.6f}")
    assert abs(fold - grazing) < 4e-4

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
branch.plot("Omega", "min_z", ax=left)
left.set(xlabel="drive frequency (units of $\\omega_1$)", ylabel="least gap (units of the gap at rest)")
left.legend(loc="upper center", bbox_to_anchor=(0.37, 1.0), fontsize="small")
orbit.plot("z", "v1", ax=right)
right.set(xlabel="gap (units of the gap at rest)", ylabel="velocity $v_1$", title="$\\Omega = 1.05$")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "03_afm_response.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
