"""A linear oscillator that hits a stop: from the motion without impacts through the grazing to the impacting one.

Known answer for x'' + c x' + k x = A cos(w t), v := -e v at x = d, one impact a period (Recipes for Continuation,
SIAM 2013, ex. 15.2): the branch is a conic in A and the speed U before the impact, with GR at U = 0.

Field: Impacts.

    python 02_impact_oscillator.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from scipy.linalg import expm

import saltus

k, c, d, e, w = 1.0, 0.1, 1.0, 0.8, 1.1
oscillator = saltus.HybridSystem(
    states=("x", "v"),
    parameters={"k": k, "c": c, "d": d, "e": e, "w": w, "A": 1.0},
    modes={"free": saltus.Mode({"x": "v", "v": "-k*x - c*v + A*cos(theta)"})},
    transitions=[saltus.Transition("free", "free", event="x - d", direction=1, reset={"v": "-e*v"}, name="impact")],
    phase=("theta", "w"),
    name="oscillator with a stop",
)

orbit = saltus.find_orbit(oscillator, {"A": 1.0}, x0=[0.0, 0.0])
branch = saltus.continue_orbit(orbit, "A", bounds=(0.05, 1.5))

Z = np.hypot(k - w**2, c * w)  # the impedance
M = expm(np.array([[0.0, 1.0], [-k, -c]]) * 2.0 * np.pi / w)  # the period without its impact
al, be = np.linalg.solve(M - np.eye(2), [0.0, 1.0 + e])
U = al * w**2 * d / ((al * w) ** 2 + (be + e) ** 2)
fold = Z / w * np.hypot(w * (d - al * U), (be + e) * U)
print(branch)
for label, exact in (("GR1", d * Z), ("SN1", fold)):
    found = branch[label].parameters["A"]
    print(f"{label}  A = {found:.12f}, closed form {exact:.12f}, difference {found - exact:.1e}")
    assert abs(found - exact) < 1e-10

ax = branch.plot("A", "max_v")
for exact in (d * Z, fold):
    ax.axvline(exact, color="0.7", linewidth=0.8, zorder=0)
ax.set(xlabel="$A$ (units of $k\\,d$)", ylabel="greatest velocity (units of $d\\sqrt{k/m}$)", title=oscillator.name)

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "02_impact_oscillator.png")
picture.parent.mkdir(parents=True, exist_ok=True)
ax.figure.savefig(picture, dpi=150)
print("written", picture)
