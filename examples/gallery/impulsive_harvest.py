"""Harvest at intervals: how much can be taken before the stock dies out.

Fish grow by N' = r N (1 - N), and once a period T a share E of them is caught. Known answer (from the logistic map
over a period; Zhang, Shuai and Wang, Nonlinear Analysis: RWA 4 (2003) 639): just after a catch N = ((1 - E) exp(r T)
- 1)/(exp(r T) - 1). At E = 1 - exp(-r T) the stock dies out by a transcritical bifurcation. The catch a period is
greatest at E = 1 - exp(-r T/2).

Field: Life.

    python impulsive_harvest.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

r = 1.0
stock = saltus.HybridSystem(
    states=("N",),
    parameters={"r": r, "E": 0.5, "w": 2.0 * np.pi},
    modes={"growth": saltus.Mode({"N": "r*N*(1 - N)"})},
    transitions=[saltus.Transition("growth", "growth", at_phase=0, reset={"N": "(1 - E)*N"}, name="catch")],
    phase=("theta", "w"),
    name="impulsive harvest",
)
orbit = saltus.find_orbit(stock, x0=[0.5])
branch = saltus.continue_orbit(orbit, "E", bounds=(0.02, 0.7))
print(branch)
crossing = 1.0 - np.exp(-r)
found = branch["BP1"].parameters["E"]
print(f"the stock dies out at E = {found:.12f}, difference {found - crossing:.1e}")
assert abs(found - crossing) < 1e-8

share = branch.values
after = branch.column("min_N")
exact = ((1.0 - share) * np.exp(r) - 1.0) / (np.exp(r) - 1.0)
alive = share < crossing - 1e-6
print(f"stock after a catch, difference {np.max(np.abs(after - exact)[alive]):.1e}")
assert np.max(np.abs(after - exact)[alive]) < 1e-9
best = 1.0 - np.exp(-0.5 * r)

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
motion = saltus.simulate(stock, {"E": best}, x0=[0.9], periods=10)
t = np.linspace(0.0, 10.0, 2000)
left.plot(t, motion(t)[:, 0], color="#0072b2")
left.set(xlabel="time (units of $T$)", ylabel="stock $N$", ylim=(0, 1), title="the best harvest, $E = 1 - e^{-rT/2}$")
right.plot(share[alive], (after * share / (1.0 - share))[alive], color="#1b1b1e", label="catch a period")
right.plot(share[alive], after[alive], color="#009e73", label="stock after a catch")
right.axvline(best, color="0.75", linewidth=0.8, zorder=0)
right.axvline(crossing, color="#d55e00", linewidth=0.8, zorder=0)
right.set(xlabel="share caught $E$", xlim=(0, 0.7), title="it dies out at $E = 1 - e^{-rT}$")
right.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "impulsive_harvest.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
