"""A boost converter under current control doubles its period, meets a border, and becomes chaotic.

A clock closes the switch, and it opens where the current has risen to Iref, after Deane (IEEE Trans. Circuits Syst. I
39 (1992) 680): E = 10 V, L = 1 mH, C = 12 uF, R = 20 ohm, a clock of 10 kHz. Time is in periods of the clock. Known
answer: all fields are linear, so that the map from clock to clock is one of exponentials; where the period doubles, a
multiplier of it is -1. At the border the switch opens just when the clock would close it.

Field: Electronics and control.

    python boost_converter.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.optimize import fsolve

import saltus

E, T, L, C, R = 10.0, 1e-4, 1e-3, 12e-6, 20.0
boost = saltus.HybridSystem(
    states=("i", "v"),
    parameters={"Iref": 1.0, "E": E, "T": T, "L": L, "C": C, "R": R, "w": 2.0 * np.pi},
    modes={
        "on": saltus.Mode({"i": "T*E/L", "v": "-T*v/(R*C)"}),
        "off": saltus.Mode({"i": "T*(E - v)/L", "v": "T*(i - v/R)/C"}),
    },
    transitions=[
        saltus.Transition("on", "off", event="i - Iref", direction=1, name="peak"),
        saltus.Transition("off", "on", at_phase=0, when="Iref - i", name="clock"),
    ],
    phase=("theta", "w"),
    name="boost converter",
)
orbit = saltus.find_orbit(boost, x0=[0.4, 12.0], mode="on")
branch = saltus.continue_orbit(orbit, "Iref", bounds=(0.7, 4.0), stop_at="PD")
doubled = saltus.continue_orbit(saltus.switch_branch(branch["PD1"]), "Iref", bounds=(0.7, 4.0))
print(branch, doubled, sep="\n")


rates, shapes = np.linalg.eig(T * np.array([[0.0, -1.0 / L, E / L], [1.0 / C, -1.0 / (R * C), 0.0], [0.0, 0.0, 0.0]]))
weights = np.linalg.inv(shapes)


def by_clock(state, peak):
    """Current and voltage a period of the clock later, in closed form."""
    on = min(L * (peak - state[0]) / (E * T), 1.0)
    top = state[0] + E * T * on / L
    begins = weights @ [top, state[1] * np.exp(-T * on / (R * C)), 1.0]
    return (shapes @ (np.exp(rates * (1.0 - on)) * begins)).real[:2]


peak = branch["PD1"].parameters["Iref"]
state = fsolve(lambda s: by_clock(s, peak) - s, [0.9, 18.0], xtol=1e-13)
steps = 1e-6 * np.eye(2)
slopes = np.array([(by_clock(state + step, peak) - by_clock(state - step, peak)) / 2e-6 for step in steps]).T
multipliers = np.linalg.eigvals(slopes)
print(f"the period doubles at {peak:.9f} A; multipliers of the map in closed form: {multipliers}")
assert np.abs(multipliers + 1.0).min() < 1e-6

border = doubled["BC1"].parameters["Iref"]
first = fsolve(lambda s: by_clock(by_clock(s, border), border) - s, [border - E * T / L, 15.0], xtol=1e-13)
second = by_clock(first, border)
closed = L * (border - min(first[0], second[0])) / (E * T)
print(f"border at {border:.9f} A: the switch is closed for {closed:.9f} periods")
assert abs(closed - 1.0) < 1e-8

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
dots, state = [], np.array([0.4, 12.0])
for peak in np.linspace(0.8, 4.0, 97):
    for i in range(140):
        state = by_clock(state, peak)
        if i >= 100:
            dots.append((peak, state[0]))
left.plot(*np.transpose(dots), ".", color="#56b4e9", markersize=2.0, label="map in closed form")
branch.plot("Iref", "min_i", ax=left)
doubled.plot("Iref", "min_i", ax=left, legend=False)
left.set(xlabel="reference $I_{ref}$ in A", ylabel="current at the clock, least of a cycle, in A")
left.set_title("period doubling, border collision, chaos")
t = np.linspace(0.0, 8.0, 2000)
for reference, colour in ((1.5, "#0072b2"), (2.2, "#009e73"), (3.5, "#d55e00")):
    state = [0.4, 12.0]
    for _ in range(200):
        state = by_clock(state, reference)
    again = saltus.simulate(boost, {"Iref": reference}, x0=state, mode="on", periods=8)
    right.plot(t, again(t)[:, 0], color=colour, label=f"$I_{{ref}} = {reference:g}$ A")
right.set(xlabel="time (periods of the clock)", ylabel="current $i$ in A", ylim=(0.0, 4.4))
right.set_title("period 1, period 2 and chaos")
right.legend(loc="upper center", ncols=3, fontsize="small")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "boost_converter.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
