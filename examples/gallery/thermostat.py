"""A thermostat with hysteresis: the house swings between two temperatures, at a period in closed form.

The heater goes on where the temperature falls to low, and off where it rises to high. Newton's cooling to an outside
at 0 with rate 1, and heat P. Known answer from the two exponentials: the period is ln((P - low)/(P - high)) +
ln(high/low). No cycle exists below P = high, where the house never gets warm enough.

Field: Electronics and control.

    python thermostat.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

low, high = 0.9, 1.1
house = saltus.HybridSystem(
    states=("T",),
    parameters={"P": 2.0, "low": low, "high": high},
    modes={"heating": saltus.Mode({"T": "P - T"}), "cooling": saltus.Mode({"T": "-T"})},
    transitions=[
        saltus.Transition("heating", "cooling", event="T - high", direction=1),
        saltus.Transition("cooling", "heating", event="T - low", direction=-1),
    ],
    name="thermostat",
)
orbit = saltus.find_orbit(house, x0=[1.0], mode="heating")
branch = saltus.continue_orbit(orbit, "P", bounds=(1.101, 4.0))
print(branch)
heat = branch.values
period = np.array([one.period for one in branch])
exact = np.log((heat - low) / (heat - high)) + np.log(high / low)
print(f"period, difference {np.max(np.abs(period - exact)):.1e}")
assert np.max(np.abs(period - exact)) < 1e-9

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
motion = saltus.simulate(house, x0=[0.5], mode="heating", t_end=3.0)
t = np.linspace(0.0, 3.0, 1500)
left.axhspan(low, high, color="0.93")
left.plot(t, motion(t)[:, 0], color="#d55e00")
left.set(xlabel="time (units of cooling)", ylabel="temperature", title="from a cold house, $P = 2$")
right.plot(heat, period, color="#1b1b1e", label="found")
right.plot(heat[::4], exact[::4], "o", mfc="none", color="#d55e00", label="closed form")
right.set(xlabel="heat $P$", ylabel="period", title="the cycle over the heat")
right.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "thermostat.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
