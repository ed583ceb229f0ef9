"""A relief valve begins to flutter, touches its seat, and doubles its period.

Lift x, velocity v and pressure p of a single-stage valve that is fed by a flow q: x'' = p - kappa x' - x - delta, p' =
beta (q - x sqrt(p)), and v := -r v on the seat x = 0, after Licsko, Champneys and Hos (IAENG Int. J. Appl. Math. 39:4,
2009). Known answer: by Routh and Hurwitz the valve at rest, x = p - delta, loses stability where (kappa + a)(1 + kappa
a) = a + b, with a = beta x/(2 sqrt(p)) and b = beta sqrt(p). SciPy integrates the cycle that touches the seat.

Field: Machines and valves.

    python relief_valve.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import saltus

kappa, beta, delta = 1.25, 20.0, 10.0
valve = saltus.HybridSystem(
    states=("x", "v", "p"),
    parameters={"q": 9.0, "kappa": kappa, "beta": beta, "delta": delta, "r": 0.8},
    modes={"open": saltus.Mode({"x": "v", "v": "p - kappa*v - x - delta", "p": "beta*(q - x*sqrt(p))"})},
    transitions=[saltus.Transition("open", "open", event="x", direction=-1, reset={"v": "-r*v"}, name="seat")],
    name="relief valve",
)
rest = saltus.continue_equilibrium(saltus.find_equilibrium(valve, x0=[2.5, 0.0, 12.5]), "q", bounds=(4.5, 10.0))
cycles = saltus.continue_orbit(saltus.switch_branch(rest["HB1"]), "q", bounds=(4.5, 10.0))
doubled = saltus.continue_orbit(
    saltus.switch_branch(cycles["PD1"]), "q", bounds=(4.5, 10.0), directions="down", stop_at="PD"
)
maxima = saltus.options.SweepOptions(discard=80, keep=40, section=saltus.Section("v", direction=-1), quantities=["x"])
sweep = saltus.run_sweep(valve, "q", np.linspace(4.5, 8.4, 79), x0=[2.0, 0.0, 12.0], options=maxima)
print(rest, cycles, doubled, sweep, sep="\n")


def excess(x):
    """Routh and Hurwitz's condition at the lift x; it vanishes at the Hopf point."""
    a, b = beta * x / (2.0 * np.sqrt(x + delta)), beta * np.sqrt(x + delta)
    return (kappa + a) * (1.0 + kappa * a) - a - b


lift = brentq(excess, 0.1, 10.0, xtol=1e-14)
flow = lift * np.sqrt(lift + delta)
print(f"flutter from q = {rest['HB1'].parameters['q']:.12f}, Routh and Hurwitz {flow:.12f}")
assert abs(rest["HB1"].parameters["q"] - flow) < 1e-9
touch = cycles["GR1"].orbit
q = touch.parameters["q"]


def field(t, y):
    return [y[1], y[2] - kappa * y[1] - y[0] - delta, beta * (q - y[0] * np.sqrt(y[2]))]


start = touch.sample()
start = [float(start[name][0]) for name in valve.states]
again = solve_ivp(field, (0.0, touch.period), start, method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True)
least = again.sol(np.linspace(0.0, touch.period, 20001))[0].min()
print(f"the seat is touched from q = {q:.9f}; SciPy: it returns within", np.abs(again.y[:, -1] - start).max())
assert np.abs(again.y[:, -1] - start).max() < 1e-8
assert abs(least) < 1e-7

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
flows = np.broadcast_to(sweep.values[:, None], sweep.column("x")[0].shape)
left.plot(flows.ravel(), sweep.column("x")[0].ravel(), ".", color="#56b4e9", markersize=2.0, label="simulated")
rest.plot("q", "x", ax=left, legend=False)
cycles.plot("q", "max_x", ax=left)
doubled.plot("q", "max_x", ax=left, legend=False)
left.set(xlabel="flow $q$", ylabel="lift $x$ at rest, or its maxima", xlim=(4.2, 12.0))
named = {label: line for line, label in zip(*left.get_legend_handles_labels(), strict=True)}
left.legend(named.values(), named, loc="upper right", fontsize="small")
left.set_title("flutter, touch and period doubling")
for orbit, colour, label in (
    (touch, "#009e73", f"touch, $q = {q:.3f}$"),
    (doubled.at(6.5)[0], "#d55e00", "two periods, $q = 6.5$"),
    (cycles.at(5.0)[0], "#0072b2", "one period, $q = 5$"),
):
    sample = orbit.sample()
    right.plot(sample["x"], sample["v"], color=colour, label=label)
right.axvline(0.0, color="0.6", linewidth=1.0)
right.set(xlabel="lift $x$", ylabel="velocity $v$", title="the seat at $x = 0$ turns the velocity back")
right.set_ylim(-10.0, 23.0)
right.legend(loc="upper right", fontsize="small")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "relief_valve.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
