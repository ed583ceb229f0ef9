"""A drill string sticks and slips below the speed of a Hopf point, and beside it up to twice as fast.

The bit turns at the rate v, the table above at Omega, and the string between them is twisted: J v' = k twist - c v -
T(v), twist' = Omega - v. The rock resists with dry friction that falls with the speed, T = Tc + (Ts - Tc) exp(-v/s), a
law as in Navarro-Lopez and Cortes (J. Sound Vib. 307 (2007) 152). Known answers: the trace vanishes at Omega = s
ln((Ts - Tc)/(c s)); a bit that is held lets go at the twist Ts/k, so that it is held for as long as the table needs;
and over a cycle the bit turns by as much as the table.

Field: Friction and sliding.

    python drill_string.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

c, s, Tc, Ts = 0.05, 0.5, 0.5, 1.0
drill = saltus.filippov(
    states=("twist", "v"),
    parameters={"Omega": 1.0, "J": 1.0, "k": 1.0, "c": c, "s": s, "Tc": Tc, "Ts": Ts},
    surface="v",
    above={"twist": "Omega - v", "v": "(k*twist - c*v - Tc - (Ts - Tc)*exp(-v/s))/J"},
    below={"twist": "Omega - v", "v": "(k*twist - c*v + Tc + (Ts - Tc)*exp(v/s))/J"},
    name="drill string",
)
steady = saltus.find_equilibrium(drill, {"Omega": 4.0}, x0=[0.7, 4.0], mode="above")
drilling = saltus.continue_equilibrium(steady, "Omega", bounds=(0.2, 4.0))
orbit = saltus.find_orbit(drill, {"Omega": 1.0}, x0=[0.9, 0.0])
cycles = saltus.continue_orbit(orbit, "Omega", bounds=(0.2, 4.0))
print(drilling, cycles, sep="\n")

hopf = s * np.log((Ts - Tc) / (c * s))
print(f"HB1 at {drilling['HB1'].parameters['Omega']:.12f}, closed form {hopf:.12f}")
assert abs(drilling["HB1"].parameters["Omega"] - hopf) < 1e-9
rates, held = [], []
for one in cycles:
    parts = {part.mode: part for part in one.segments}
    turned = one.observe("mean(v)")["mean(v)"] - one.parameters["Omega"]
    assert abs(turned) < 1e-8
    if "sliding" in parts:
        rates.append(one.parameters["Omega"])
        held.append(parts["sliding"].duration)
        assert abs(held[-1] - (Ts - parts["sliding"].state[0]) / rates[-1]) < 1e-8
last = cycles["GS1"].parameters["Omega"]
print(f"{len(held)} cycles are held for (Ts - twist)/Omega; the last of them is at Omega = {last:.9f}")

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
drilling.plot("Omega", "v", ax=left)
cycles.plot("Omega", "max_v", ax=left, legend=False)
left.axvspan(hopf, last, color="0.93", zorder=0)
left.set(xlabel=r"rate of the table $\Omega$", ylabel="rate of the bit $v$, greatest in a cycle")
left.set_title("grey: the bit turns steadily, or sticks and slips")
for rate, colour in ((0.5, "#0072b2"), (1.2, "#009e73"), (2.2, "#d55e00")):
    for one in cycles.at(rate):
        sample = one.sample()
        kind = "-" if one.stable else "--"
        right.plot(
            sample["twist"], sample["v"], kind, color=colour, label=rf"$\Omega = {rate:g}$" if one.stable else None
        )
right.axhline(0.0, color="0.6", linewidth=1.0, zorder=0)
right.set(xlabel="twist of the string (units of $T_s/k$)", ylabel="rate of the bit $v$")
right.set_title("the bit sticks at $v = 0$; dashed: unstable cycle")
right.set_ylim(-0.5, 6.2)
right.legend(ncols=3, loc="upper center")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "drill_string.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
