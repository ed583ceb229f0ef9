"""A relay in a loop: a cycle with Tsypkin's closed form, and the damping from which on it slides.

A plant with the transfer function (s^2 + 2 sigma rho s + rho^2)/((s^2 + 2 zeta s + 1)(s + lambda)) gets u = -sgn(y) of
its output y, as in di Bernardo, Johansson and Vasca (Int. J. Bifurcation Chaos 11 (2001) 1121). Known answers, by
matrix exponentials: after half a period h the state is turned round, x = (I + E)^-1 (E - I) A^-1 B with E = exp(A h),
and C x = 0; the multipliers are squares of those of W = (I - v C/(C v)) E, with v the field before the switch; and
sliding begins where C A x = C B.

Field: Electronics and control.

    python relay_control.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.linalg import expm
from scipy.optimize import brentq

import saltus

sigma, rho, lag = -1.0, 1.0, 0.05


def plant(u):
    """Field of the plant with the input u, y = x its output."""
    return {
        "x": f"y - (2*zeta + lag)*x + ({u})",
        "y": f"z - (2*zeta*lag + 1)*x + ({u})*2*sigma*rho",
        "z": f"-lag*x + ({u})*rho**2",
    }


relay = saltus.filippov(
    states=("x", "y", "z"),
    parameters={"zeta": 0.05, "lag": lag, "sigma": sigma, "rho": rho},
    surface="x",
    above=plant("-1"),
    below=plant("1"),
    name="relay control",
)
orbit = saltus.find_orbit(relay, x0=[0.5, 0.5, 0.5])
branch = saltus.continue_orbit(orbit, "zeta", bounds=(0.02, 0.5))
print(branch)

B = np.array([1.0, 2.0 * sigma * rho, rho**2])


def half(zeta, h):
    """State at the switch, field before it and flow of half a period h, without sliding."""
    A = np.array([[-(2.0 * zeta + lag), 1.0, 0.0], [-(2.0 * zeta * lag + 1.0), 0.0, 1.0], [-lag, 0.0, 0.0]])
    E = expm(A * h)
    x = np.linalg.solve(np.eye(3) + E, (E - np.eye(3)) @ np.linalg.solve(A, B))
    return x, A @ x + B, E


def exact(zeta):
    """Half a period by Tsypkin's condition, and the field's rate of x behind the switch."""
    h = brentq(lambda h: half(zeta, h)[0][0], 3.0, 6.5, xtol=1e-14)
    return h, half(zeta, h)[1][0] - 2.0 * B[0]


for zeta in (0.05, 0.1, 0.2, 0.3):
    (found,) = branch.at(zeta)
    h = exact(zeta)[0]
    _, v, E = half(zeta, h)
    squares = np.linalg.eigvals((np.eye(3) - np.outer(v, [1.0, 0.0, 0.0]) / v[0]) @ E) ** 2
    greatest = np.sort(np.abs(found.multipliers))[1]  # beside the 1 of a shift in time
    print(f"zeta = {zeta}: period {found.period:.10f}, exact {2.0 * h:.10f}, multiplier {greatest:.10f}")
    assert abs(found.period - 2.0 * h) < 1e-8
    assert abs(greatest - np.abs(squares).max()) < 1e-8
slides = brentq(lambda zeta: exact(zeta)[1], 0.2, 0.45, xtol=1e-13)
print(f"slides from zeta = {branch['CS1'].parameters['zeta']:.12f}, closed form {slides:.12f}")
assert abs(branch["CS1"].parameters["zeta"] - slides) < 1e-9

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
branch.plot("zeta", "period", ax=left)
damping = np.linspace(0.03, slides, 12)
left.plot(damping, [2.0 * exact(zeta)[0] for zeta in damping], "o", mfc="none", color="#d55e00", label="Tsypkin")
left.set(xlabel=r"damping $\zeta$", ylabel="period", title="the cycle over the damping of the plant")
left.legend()
for zeta, colour in ((0.05, "#0072b2"), (0.2, "#009e73"), (0.5, "#d55e00")):
    sample = branch.at(zeta)[0].sample()
    right.plot(sample["x"], sample["y"], color=colour, label=rf"$\zeta = {zeta:g}$")
right.axvline(0.0, color="0.6", linewidth=1.0, zorder=0)
right.set(xlabel="output $x$", ylabel="state $y$", title="the relay switches at $x = 0$, and at last slides there")
right.legend(loc="upper left", fontsize="small")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "relay_control.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
