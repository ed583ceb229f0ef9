"""Doses at intervals: a drug whose elimination saturates, and the dose that is too much.

Michaelis-Menten elimination, C' = -V C/(K + C), and a dose D once a period T = 1. Known answer by separation of
variables (Wagner, J. Pharmacokin. Biopharm. 1 (1973) 103): K ln(peak/trough) + D = V T with peak = trough + D. So the
trough is D/(exp((V T - D)/K) - 1), and grows without bound as the dose a period comes near V T.

Field: Life.

    python impulsive_dosing.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

V, K = 2.0, 1.0
drug = saltus.HybridSystem(
    states=("C",),
    parameters={"V": V, "K": K, "D": 1.0, "w": 2.0 * np.pi},
    modes={"elimination": saltus.Mode({"C": "-V*C/(K + C)"})},
    transitions=[saltus.Transition("elimination", "elimination", at_phase=0, reset={"C": "C + D"}, name="dose")],
    phase=("theta", "w"),
    name="impulsive dosing",
)
orbit = saltus.find_orbit(drug, x0=[1.0])
branch = saltus.continue_orbit(orbit, "D", bounds=(0.1, 1.9))
print(branch)
dose = branch.values
trough, peak = branch.column("min_C"), branch.column("max_C")
exact = dose / np.expm1((V - dose) / K)
print(f"trough, difference {np.max(np.abs(trough - exact)):.1e}")
assert np.max(np.abs(trough - exact)) < 1e-7

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
t = np.linspace(0.0, 12.0, 2400)
for amount, colour in ((0.8, "#0072b2"), (1.4, "#009e73"), (2.1, "#d55e00")):
    motion = saltus.simulate(drug, {"D": amount}, x0=[0.0], periods=12)
    left.plot(t, motion(t)[:, 0], color=colour, label=f"$D = {amount:g}$")
left.set(xlabel="time (units of $T$)", ylabel="concentration $C/K$", title="above $D = VT = 2$ it only grows")
left.legend()
right.fill_between(dose, trough, peak, color="#0072b2", alpha=0.25, label="trough to peak")
right.plot(dose[::5], exact[::5], "o", mfc="none", color="#d55e00", label="trough, closed form")
right.set(xlabel="dose $D$ (units of $K$)", ylabel="concentration $C/K$", ylim=(0, 16), title="the steady course")
right.legend(loc="upper left")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "impulsive_dosing.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
