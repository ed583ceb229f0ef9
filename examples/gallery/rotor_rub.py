"""A rotor rubs on its stator: whirl that follows the unbalance, a Hopf point, and bouncing whirl beside both.

A Jeffcott rotor with a shaft of stiffness 1, unbalance e and a stator at r = 1 of stiffness K and dry friction mu, as
in Jiang and Ulbrich (Nonlinear Dyn. 24 (2001) 269). The shaft's surface slides forwards at the contact. In coordinates
that turn with the rotor, at the rate W, whirl at the rate of the rotor is an equilibrium. Known answers: its radius
solves ((1 - W^2 + K) r - K)^2 + ((2 zeta W + K mu) r - K mu)^2 = e^2 W^4, a quadratic whose discriminant vanishes at
the fold; contact begins at r = 1 on the free resonance curve; Routh and Hurwitz's condition holds at the Hopf point.

Field: Machines and valves.

    python rotor_rub.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.optimize import brentq

import saltus

e, zeta, K, mu = 0.5, 0.05, 4.0, 0.1
inertia = {"u": "e*W**2 - 2*zeta*(u - W*y) + 2*W*v + W**2*x - x", "v": "-2*zeta*(v + W*x) - 2*W*u + W**2*y - y"}
push = {"u": "-K*(1 - 1/sqrt(x**2 + y**2))*(x - mu*y)", "v": "-K*(1 - 1/sqrt(x**2 + y**2))*(y + mu*x)"}
rotor = saltus.HybridSystem(
    states=("x", "y", "u", "v"),
    parameters={"W": 0.6, "e": e, "zeta": zeta, "K": K, "mu": mu},
    modes={
        "free": saltus.Mode({"x": "u", "y": "v", **inertia}),
        "rub": saltus.Mode({"x": "u", "y": "v", **{name: inertia[name] + push[name] for name in push}}),
    },
    transitions=[
        saltus.Transition("free", "rub", event="x**2 + y**2 - 1", direction=1),
        saltus.Transition("rub", "free", event="x**2 + y**2 - 1", direction=-1),
    ],
    outputs={"r": "sqrt(x**2 + y**2)"},
    name="rotor",
)
still = saltus.find_equilibrium(rotor, x0=[0.3, 0.0, 0.0, 0.0], mode="free")
whirl = saltus.continue_equilibrium(still, "W", bounds=(0.6, 2.4))
bouncing = saltus.continue_orbit(saltus.switch_branch(whirl["HB1"]), "W", bounds=(0.8, 2.4))
print(whirl, bouncing, sep="\n")


def quadratic(W):
    """Coefficients of A r^2 - 2 B r + C = 0, whose roots are the radii of whirl in contact."""
    stiff, turn = 1.0 - W**2 + K, 2.0 * zeta * W + K * mu
    return stiff**2 + turn**2, K * stiff + K * mu * turn, K**2 * (1.0 + mu**2) - e**2 * W**4


def discriminant(W):
    """It vanishes where whirl in contact folds."""
    A, B, C = quadratic(W)
    return B**2 - A * C


for one in whirl:
    W, r = one.parameters["W"], np.hypot(*one.state[:2])
    A, B, C = quadratic(W)
    exact = e * W**2 / np.hypot(1.0 - W**2, 2.0 * zeta * W)
    assert abs(A * r**2 - 2.0 * B * r + C if one.mode == "rub" else r - exact) < 1e-8
fold = brentq(discriminant, 1.9, 2.2, xtol=1e-14)
print(f"fold at W = {whirl['SN1'].parameters['W']:.12f}, closed form {fold:.12f}")
assert abs(whirl["SN1"].parameters["W"] - fold) < 1e-9
for label in ("BE1", "BE2"):
    W = whirl[label].parameters["W"]
    assert abs(e * W**2 - np.hypot(1.0 - W**2, 2.0 * zeta * W)) < 1e-9


def routh(W):
    """Routh and Hurwitz's condition of whirl in contact, by radial and tangential deviations; 0 at the Hopf point."""
    A, B, _ = quadratic(W)
    give = 1.0 - A / (B + np.sqrt(discriminant(W)))  # 1 - 1/r
    stiffness = np.array([[1.0 - W**2, -2.0 * zeta * W], [2.0 * zeta * W, 1.0 - W**2]])
    stiffness += K * np.array([[1.0, -mu * give], [mu, give]])
    damping = 2.0 * np.array([[zeta, -W], [W, zeta]])
    a = np.poly(np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]]))
    return a[1] * a[2] * a[3] - a[3] ** 2 - a[1] ** 2 * a[4]


hopf = brentq(routh, 0.83, 1.0, xtol=1e-14)
print(f"Hopf at W = {whirl['HB1'].parameters['W']:.12f}, Routh and Hurwitz {hopf:.12f}")
assert abs(whirl["HB1"].parameters["W"] - hopf) < 1e-9

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.6), layout="constrained", width_ratios=[1.25, 1.0])
whirl.plot("W", "r", ax=left)
bouncing.plot("W", "max_r", ax=left, legend=False)
left.axhline(1.0, color="0.6", linewidth=1.0, zorder=0)
left.set(xlabel="rate of the rotor $W$", ylabel="radius of whirl, greatest (units of the gap)")
left.set_title("lower curves: whirl at the rate $W$; upper ones: it bounces")
angle = np.linspace(0.0, 2.0 * np.pi, 200)
right.plot(np.cos(angle), np.sin(angle), color="0.6", linewidth=1.0, label="stator")
one = next(one for one in bouncing.at(1.2) if one.stable)
motion = saltus.simulate(rotor, {"W": 1.2}, x0=one.segments[0].state, mode=one.segments[0].mode, t_end=8.0 * one.period)
t = np.linspace(0.0, 8.0 * one.period, 4000)
x, y = motion(t)[:, :2].T
path = (x + 1j * y) * np.exp(1.2j * t)
right.plot(path.real, path.imag, color="#d55e00", linewidth=0.9, label="bouncing whirl")
right.set(xlabel="across (units of the gap)", ylabel="upwards (units of the gap)", aspect="equal", ylim=(-2.0, 2.6))
right.set_title("$W = 1.2$, seen at rest")
right.legend(loc="upper right", fontsize="small")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "rotor_rub.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
