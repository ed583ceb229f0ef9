"""The FitzHugh-Nagumo neuron: firing between two Hopf points.

v' = v - v^3/3 - w + I and w' = c (v + a - b w), after FitzHugh (Biophys. J. 1 (1961) 445) with a = 0.7, b = 0.8 and c
= 0.08. Known answer: the trace vanishes at v = -+sqrt(1 - b c), and the current there is I = (v + a)/b - v + v^3/3.
Both Hopf points are subcritical, so that rest and firing coexist beside them.

Field: Life.

    python fitzhugh_nagumo.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

a, b, c = 0.7, 0.8, 0.08
neuron = saltus.HybridSystem.smooth(
    {"v": "v - v**3/3 - w + I", "w": "c*(v + a - b*w)"},
    parameters={"I": 0.0, "a": a, "b": b, "c": c},
    name="FitzHugh-Nagumo neuron",
)
rest = saltus.continue_equilibrium(saltus.find_equilibrium(neuron, x0=[-1.2, -0.6]), "I", bounds=(0.0, 2.0))
print(rest)
for label, sign in (("HB1", -1.0), ("HB2", 1.0)):
    v = sign * np.sqrt(1.0 - b * c)
    exact = (v + a) / b - v + v**3 / 3.0
    found = rest[label].parameters["I"]
    print(f"{label} at I = {found:.12f}, difference {found - exact:.1e}")
    assert abs(found - exact) < 1e-9
cycles = saltus.continue_orbit(saltus.switch_branch(rest["HB1"]), "I", bounds=(0.0, 2.0))
print(cycles)

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
rest.plot("I", "v", ax=left, legend=False)
cycles.plot("I", "max_v", ax=left, legend=False)
cycles.plot("I", "min_v", ax=left, legend=False)
left.set(xlabel="current $I$", ylabel="potential $v$ at rest, greatest and least", title="rest and firing")
motion = saltus.simulate(neuron, {"I": 0.5}, x0=[-1.2, -0.6], t_end=200.0)
t = np.linspace(0.0, 200.0, 2000)
right.plot(t, motion(t)[:, 0], color="#0072b2", label="$v$")
right.plot(t, motion(t)[:, 1], color="#d55e00", label="$w$")
right.set(xlabel="time", title="firing at $I = 0.5$")
right.legend(loc="lower right")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "fitzhugh_nagumo.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
