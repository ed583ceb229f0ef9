"""The van der Pol oscillator: a cycle from a Hopf point to relaxation.

x'' - mu (1 - x^2) x' + x = 0. At mu = 1 the period 6.66328685932 and the amplitude 2.00861986087 are known from
series (Andersen and Geer, SIAM J. Appl. Math. 42 (1982) 678). For large mu the period grows as (3 - 2 ln 2) mu + 3 a
mu^(-1/3), a = 2.338107 (Dorodnitsyn 1947).

Field: Smooth systems.

    python van_der_pol.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

oscillator = saltus.HybridSystem.smooth(
    {"x": "v", "v": "mu*(1 - x**2)*v - x"}, parameters={"mu": 1.0}, name="van der Pol oscillator"
)
orbit = saltus.find_orbit(oscillator, x0=[2.0, 0.0])
print(f"period {orbit.period:.11f}, amplitude {orbit.max['x']:.11f}")
assert abs(orbit.period - 6.66328685932) < 1e-9
assert abs(orbit.max["x"] - 2.00861986087) < 1e-9
branch = saltus.continue_orbit(orbit, "mu", bounds=(0.1, 12.0))
print(branch)
mu = branch.values
period = np.array([one.period for one in branch])
large = (3.0 - 2.0 * np.log(2.0)) * mu + 3.0 * 2.338107 * mu ** (-1.0 / 3.0)

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
for value, colour in ((0.2, "#0072b2"), (1.0, "#009e73"), (4.0, "#d55e00")):
    sample = branch.at(value)[0].sample(2000)
    left.plot(sample["x"], sample["v"], color=colour, label=f"$\\mu = {value:g}$")
left.set(xlabel="$x$", ylabel="$x'$", title="cycles")
left.legend()
right.plot(mu, period, color="#1b1b1e", label="found")
right.plot(mu, 2.0 * np.pi * (1.0 + mu**2 / 16.0), "--", color="#0072b2", label="small $\\mu$: $2\\pi(1 + \\mu^2/16)$")
right.plot(mu, large, "--", color="#d55e00", label="large $\\mu$: Dorodnitsyn")
right.set(xlabel="$\\mu$", ylabel="period", ylim=(5, 25), title="from the circle to relaxation")
right.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "van_der_pol.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
