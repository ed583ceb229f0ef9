"""A boost converter enters discontinuous conduction: a branch of orbits with a border collision.

A switch is on for a share D of each period. With a small load R the current never stops. From the border collision on
it falls to 0 before the period ends, and the diode blocks. Known answer without the ripple of the voltage: the border
is at R = 2 L/(T D (1 - D)^2), and in discontinuous conduction the voltage is E (1 + sqrt(1 + 2 D^2 R T/L))/2.

Field: Electronics and control.

    python 14_border_collision.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

boost = saltus.HybridSystem(
    states=("i", "v"),
    parameters={"E": 1.0, "R": 2.0, "L": 1.0, "C": 10.0, "D": 0.4, "w": 2.0 * np.pi},
    modes={
        "on": saltus.Mode({"i": "E/L", "v": "-v/(R*C)"}),
        "off": saltus.Mode({"i": "(E - v)/L", "v": "i/C - v/(R*C)"}),
        "empty": saltus.Mode({"i": "0", "v": "-v/(R*C)"}),
    },
    transitions=[
        saltus.Transition("on", "off", at_phase="2*pi*D"),
        saltus.Transition("off", "on", at_phase=0),
        saltus.Transition("off", "empty", event="i", direction=-1),
        saltus.Transition("empty", "on", at_phase=0),
    ],
    phase=("theta", "w"),
    name="boost converter",
)
branch = saltus.continue_orbit(saltus.find_orbit(boost, x0=[1.0, 1.5]), "R", bounds=(2.0, 40.0))
print(branch)
border = branch["BC1"].parameters["R"]

D = boost.parameters["D"]
R = np.linspace(2.0, 40.0, 400)
ideal = np.where(R < 2.0 / (D * (1.0 - D) ** 2), 1.0 / (1.0 - D), 0.5 * (1.0 + np.sqrt(1.0 + 2.0 * D**2 * R)))
print(f"border at R = {border:.9f}, without ripple {2.0 / (D * (1.0 - D) ** 2):.4f}")

figure, (left, right) = plt.subplots(
    1, 2, figsize=(10.5, 4.4), layout="constrained", gridspec_kw={"width_ratios": [1.4, 1]}
)
branch.plot("R", "max_v", ax=left, legend=False)
left.plot(R, ideal, ":", color="#0072b2", label="without ripple")
left.axvline(border, color="0.75", linewidth=0.8, zorder=0)
for x, words in (
    (0.5 * (2.0 + border), "continuous\nconduction"),
    (0.5 * (border + 40.0), "discontinuous\nconduction"),
):
    left.text(x, 2.45, words, ha="center", va="center")
left.set(
    xlabel="load $R$ (units of $L/T$)", ylabel="greatest voltage $v$ (units of $E$)", xlim=(2, 40), ylim=(1.6, 2.6)
)
left.set(title=f"{boost.name}, $D = 0.4$, $C = 10\\,T^2/L$")
left.legend(loc="lower right")
for load, colour in ((6.0, "#1b1b1e"), (border, "#35b755"), (35.0, "#d55e00")):
    orbit = branch["BC1"].orbit if load == border else branch.at(load)[0]
    sample = orbit.sample()
    phase, i = sample["theta"].values / (2.0 * np.pi) % 1.0, sample["i"].values
    order = np.argsort(phase, kind="stable")
    name = f"$R = {load:.4g}$" + (" (BC)" if load == border else "")
    right.plot(phase[order], i[order], color=colour, label=name)
right.axvline(D, color="0.75", linewidth=0.8, zorder=0)
right.set(xlabel="time in the period $t/T$", ylabel="current $i$ (units of $E\\,T/L$)", xlim=(0, 1), ylim=(-0.03, 0.95))
right.set(title="on until $t = D\\,T$, then off")
right.legend(loc="upper right")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "14_border_collision.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
