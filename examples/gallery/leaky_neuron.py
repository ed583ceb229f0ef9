"""A leaky integrate-and-fire neuron: firing rate over the current, and nothing below the threshold.

The potential leaks, v' = I - v in units of the membrane's time, and is set to 0 where it reaches 1. A refractory mode
waits for a time R after each spike. Known answer (Lapicque 1907; Dayan and Abbott, Theoretical Neuroscience, 2001,
chapter 5): the time between spikes is R + ln(I/(I - 1)) for I > 1.

Field: Life.

    python leaky_neuron.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

neuron = saltus.HybridSystem(
    states=("v", "clock"),
    parameters={"I": 1.5, "R": 0.2},
    modes={
        "charging": saltus.Mode({"v": "I - v", "clock": "-clock"}),
        "refractory": saltus.Mode({"v": "-v", "clock": "1"}),
    },
    transitions=[
        saltus.Transition("charging", "refractory", event="v - 1", direction=1, reset={"v": "0", "clock": "0"}),
        saltus.Transition("refractory", "charging", event="clock - R", direction=1),
    ],
    name="integrate-and-fire neuron",
)
orbit = saltus.find_orbit(neuron, x0=[0.0, 0.0], mode="charging")
branch = saltus.continue_orbit(orbit, "I", bounds=(1.0005, 3.0))
print(branch)
current = branch.values
period = np.array([one.period for one in branch])
exact = 0.2 + np.log(current / (current - 1.0))
print(f"time between spikes, difference {np.max(np.abs(period - exact)):.1e}")
assert np.max(np.abs(period - exact)) < 1e-8

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
motion = saltus.simulate(neuron, x0=[0.0, 0.0], mode="charging", t_end=8.0)
t = np.linspace(0.0, 8.0, 2000)
left.plot(t, motion(t)[:, 0], color="#0072b2")
left.vlines(motion.events["time"][::2], 1.0, 1.6, color="#0072b2")
left.set(xlabel="time (units of the membrane's)", ylabel="potential $v$", title="$I = 1.5$; strokes are spikes")
right.plot(current, 1.0 / period, color="#1b1b1e", label="found")
right.plot(current[::6], 1.0 / exact[::6], "o", mfc="none", color="#d55e00", label="closed form")
right.set(xlabel="current $I$", ylabel="firing rate", xlim=(0.0, 3.0), title="no firing below $I = 1$")
right.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "leaky_neuron.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
