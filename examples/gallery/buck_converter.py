"""A buck converter under voltage control doubles its period.

The switch is closed where a ramp stands above the amplified error of the voltage, after Deane and Hamill (IEEE Trans.
Power Electron. 5 (1990) 260) and Fossas and Olivar (IEEE Trans. Circuits Syst. I 43 (1996) 13): L = 20 mH, C = 47 uF,
R = 22 ohm, gain 8.4, reference 11.3 V, a ramp from 3.8 to 8.2 V in 400 us. Time is in units of the ramp. The period
doubling at an input of 24.516 V is in di Bernardo, Budd, Champneys and Kowalczyk, Piecewise-smooth Dynamical Systems,
2008.

Field: Electronics and control.

    python buck_converter.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

buck = saltus.HybridSystem(
    states=("v", "i", "u"),
    parameters={"E": 22.0, "T": 4e-4, "L": 20e-3, "C": 47e-6, "R": 22.0, "w": 2.0 * np.pi},
    modes={
        "off": saltus.Mode({"v": "T*(i - v/R)/C", "i": "-T*v/L", "u": "4.4"}),
        "on": saltus.Mode({"v": "T*(i - v/R)/C", "i": "T*(E - v)/L", "u": "4.4"}),
    },
    transitions=[
        saltus.Transition("off", "on", event="u - 8.4*(v - 11.3)", direction=1, name="ramp above the error"),
        saltus.Transition("on", "off", at_phase=0, reset={"u": "3.8"}, name="ramp ends"),
    ],
    phase=("theta", "w"),
    name="buck converter",
)
orbit = saltus.find_orbit(buck, x0=[12.0, 0.55, 3.8], mode="off")
branch = saltus.continue_orbit(orbit, "E", bounds=(20.0, 33.0))
print(branch)
doubling = branch["PD1"]
print(f"PD1 at E = {doubling.parameters['E']:.3f} V, printed 24.516 V")
assert abs(doubling.parameters["E"] - 24.516) < 5e-3
doubled = saltus.continue_orbit(saltus.switch_branch(doubling), "E", bounds=(20.0, 33.0))
print(doubled)

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
branch.plot("E", "max_v", ax=left, legend=False)
doubled.plot("E", "max_v", ax=left, legend=False)
left.set(xlabel="input $E$ in V", ylabel="greatest output voltage in V", title="period doubling, printed at 24.516 V")
motion = saltus.simulate(buck, {"E": 23.0}, x0=[12.0, 0.55, 3.8], mode="off", periods=60)
t = np.linspace(55.0, 60.0, 1500)
right.plot(t - 55.0, motion(t)[:, 2], color="0.6", label="ramp")
right.plot(t - 55.0, 8.4 * (motion(t)[:, 0] - 11.3), color="#0072b2", label="error, amplified")
right.set(xlabel="time (ramps)", ylabel="volt", title="the switch closes where the ramp meets the error")
right.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "buck_converter.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
