"""A driven mass at a viscoelastic wall: a state that exists only while they touch.

The wall is a standard linear solid, a spring k0 beside a spring k1 in series with a dashpot. Its memory q begins at 0
at each touch. The wall lets go where its force is 0, while the mass is still beyond the wall's place at rest. Known
answer, by matrix exponentials: at w = 1.2 the mass touches with the velocity 2.5064148550713, for 0.7577372022708.

Field: Friction and sliding.

    python 17_changing_dimension.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

force = "k0*(x - d) + k1*(x - d - q)"
mass = {"x": "v", "v": "A*cos(theta) - c*v - x"}
wall = saltus.HybridSystem(
    states=("x", "v", "q"),
    parameters={"A": 1.0, "c": 0.1, "d": 0.5, "k0": 10.0, "k1": 20.0, "tau": 0.1, "w": 1.2},
    modes={
        "free": saltus.Mode(mass, states=("x", "v")),
        "contact": saltus.Mode({"x": "v", "v": f"A*cos(theta) - c*v - x - ({force})", "q": "(x - d - q)/tau"}),
        "leaving": saltus.Mode(mass, states=("x", "v")),
    },
    transitions=[
        saltus.Transition("free", "contact", event="x - d", direction=1, reset={"q": "0"}, name="touch"),
        saltus.Transition("contact", "leaving", event=force, direction=-1, name="release"),
        saltus.Transition("leaving", "free", event="x - d", direction=-1),
    ],
    phase=("theta", "w"),
    outputs={"force": {"free": "0", "contact": force, "leaving": "0"}},
    name="mass and a viscoelastic wall",
)
orbit = saltus.find_orbit(wall, x0=[0.0, 0.0, 0.0])
print(orbit)
contact = next(part for part in orbit.segments if part.mode == "contact")
speed = contact.state[1]
print(f"touches at v = {speed:.11f}, lasts {contact.duration:.11f}, apart {speed - 2.5064148550713:.0e}")

figure, (left, right) = plt.subplots(
    1, 2, figsize=(10.5, 4.4), layout="constrained", gridspec_kw={"width_ratios": [1, 1.2]}
)
orbit.plot("x", "v", ax=left, legend=False)
left.axvline(0.5, color="0.75", linewidth=0.8, zorder=0)
left.text(0.47, 0.5, "wall at rest, $x = d$", rotation=90, ha="right", va="center", color="0.4")
left.set(xlabel="position $x$ (units of $A/k$)", ylabel=r"velocity $v$ (units of $A/\sqrt{k m}$)", title=wall.name)
left.legend(loc="center", bbox_to_anchor=(0.4, 0.5))

sample = orbit.sample(800)
start = contact.state[-1] % (2.0 * np.pi)
time = ((sample["theta"].values - start) % (2.0 * np.pi)) / 1.2
order = time.argsort(kind="stable")
order = order[(time[order] > 1e-9) & (time[order] < orbit.period - 1e-9)]  # both ends are the touch
held = order[sample["mode"].values[order] == wall.mode_names.index("contact")]
right.axvspan(0.0, contact.duration, color="0.93", zorder=0)
right.text(0.5 * contact.duration, -1.1, "contact", rotation=90, ha="center", va="center", color="0.4")
right.axhline(0.5, color="0.75", linewidth=0.8, zorder=0)
right.text(0.99 * orbit.period, 0.53, "$d$", ha="right", va="bottom", color="0.4")
right.plot(time[order], sample["x"].values[order], color="#1b1b1e", label="position $x$")
right.plot(time[held], sample["q"].values[held], color="#d55e00", linewidth=2.2, label="memory $q$, in contact only")
right.plot(time[held[[0, -1]]], sample["q"].values[held[[0, -1]]], "o", color="#d55e00", markersize=4.0)
right.set(xlabel=r"time since the touch (units of $\sqrt{m/k}$)", ylabel="length (units of $A/k$)")
right.set(title=f"one period, $w = 1.2$: $q$ begins at 0 and ends at {sample['q'].values[held[-1]]:.3f}")
right.set(xlim=(-0.08, orbit.period), ylim=(-2.2, 2.0))
right.legend(loc="upper right")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "17_changing_dimension.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
