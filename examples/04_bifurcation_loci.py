"""An oscillator with a stop in two parameters: saddle-node, period doubling and grazing meet at one point.

Known answer for x'' + c x' + k x = A cos(w t), v := -e v at x = d, one impact a period (Recipes for Continuation,
SIAM 2013, ex. 15.2): with U the speed before the impact, trace and determinant of the impact map are explicit, and with
them its loci in drive frequency w and amplitude A. They meet where w is twice the frequency of free decay.

Field: Impacts.

    python 04_bifurcation_loci.py [picture]
"""

import math
import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.linalg import expm

import saltus

k, c, d, e = 1.0, 0.1, 1.0, 0.8
oscillator = saltus.HybridSystem(
    states=("x", "v"),
    parameters={"k": k, "c": c, "d": d, "e": e, "w": 1.1, "A": 1.0},
    modes={"free": saltus.Mode({"x": "v", "v": "-k*x - c*v + A*cos(theta)"})},
    transitions=[saltus.Transition("free", "free", event="x - d", direction=1, reset={"v": "-e*v"}, name="impact")],
    phase=("theta", "w"),
    positive=["w"],
    name="oscillator with a stop",
)

bounds = {"w": (0.9, 2.5), "A": (0.05, 8.0)}
slow = saltus.continue_orbit(saltus.find_orbit(oscillator, {"w": 1.1}, x0=[0.0, 0.0]), "A", bounds=bounds["A"])
fast = saltus.continue_orbit(saltus.find_orbit(oscillator, {"w": 2.2}, x0=[0.0, 0.0]), "A", bounds=bounds["A"])
loci = {
    "GR": saltus.continue_locus(slow["GR1"], ("w", "A"), bounds),
    "SN": saltus.continue_locus(slow["SN1"], ("w", "A"), bounds),
    "PD": saltus.continue_locus(fast["PD1"], ("w", "A"), bounds),
}
for locus in loci.values():
    print(locus)


def amplitude(kind, w):
    """Return A at which the impact is a grazing (GR), or its map has a multiplier 1 (SN) or -1 (PD)."""
    Z = math.hypot(k - w**2, c * w)  # the impedance
    if kind == "GR":
        return d * Z
    M = expm(np.array([[0.0, 1.0], [-k, -c]]) * 2.0 * math.pi / w)  # the period without its impact
    al, be = np.linalg.solve(M - np.eye(2), [0.0, 1.0 + e])
    if kind == "SN":
        U = al * w**2 * d / ((al * w) ** 2 + (be + e) ** 2)
    else:
        m = M[0, 1] * (1.0 + e)
        rest = 1.0 + e**2 * np.linalg.det(M) - e * np.trace(M)  # trace = -(1 + determinant), linear in U
        U = m * w**2 * d / (rest - m * ((k - w**2) * al + c * (be + e)))
    return Z / w * math.hypot(w * (d - al * U), (be + e) * U)


off = max(abs(A - amplitude(kind, w)) for kind, locus in loci.items() for w, A in locus.values)
print(f"{sum(map(len, loci.values()))} orbits on three loci, closed forms of A, largest difference {off:.1e}")
assert off < 1e-10
exact = 2.0 * math.sqrt(k - c**2 / 4.0)
meeting = loci["PD"]["GR1"].parameters["w"]
print(f"they meet at w = {meeting:.12f}, closed form {exact:.12f}, difference {meeting - exact:.1e}")
assert abs(meeting - exact) < 1e-10

figure, ax = plt.subplots(layout="constrained")
for locus in loci.values():
    locus.plot(ax=ax, special=False)
ax.plot(exact, amplitude("GR", exact), "ko", label="all three meet", zorder=7)
ax.set(xlabel="$w$ (units of $\\sqrt{k/m}$)", ylabel="$A$ (units of $k\\,d$)", title=oscillator.name)
ax.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "04_bifurcation_loci.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
