"""A ball on a vibrating table: the orbit that jumps once a period, its saddle-node and its period doubling.

Known answer, with Gamma = a w^2 / g and restitution e: SN at pi (1 - e) / (1 + e), and PD at
sqrt(SN^2 + (2 (1 + e^2) / (1 + e)^2)^2).

Field: Impacts.

    python 01_bouncing_ball.py [picture]
"""

import math
import sys
from pathlib import Path

import saltus

ball = saltus.HybridSystem(
    states=("z", "v"),
    parameters={"g": 1.0, "e": 0.5, "a": 1.2, "w": 1.0},
    modes={"flight": saltus.Mode({"z": "v", "v": "-g"})},
    transitions=[
        saltus.Transition(
            "flight",
            "flight",
            event="z - a*sin(theta)",
            direction=-1,
            reset={"v": "-e*v + (1 + e)*a*w*cos(theta)"},
            name="impact",
        )
    ],
    phase=("theta", "w"),
    outputs={"gap": "z - a*sin(theta)"},
    name="ball on a vibrating table",
)

orbit = saltus.find_orbit(ball, {"a": 1.2}, x0=[0.6, 3.1, 0.5])  # just after a jump: z, v and the table's phase
branch = saltus.continue_orbit(orbit, "a", bounds=(0.9, 1.8))

e = 0.5
fold = math.pi * (1.0 - e) / (1.0 + e)
doubling = math.hypot(fold, 2.0 * (1.0 + e**2) / (1.0 + e) ** 2)
print(branch)
for label, exact in (("SN1", fold), ("PD1", doubling)):
    found = branch[label].parameters["a"]
    print(f"{label}  a = {found:.12f}, closed form {exact:.12f}, difference {found - exact:.1e}")
    assert abs(found - exact) < 1e-10

ax = branch.plot("a", "max_gap")
for exact in (fold, doubling):
    ax.axvline(exact, color="0.7", linewidth=0.8, zorder=0)
ax.set(xlabel="$a\\,w^2/g$", ylabel="highest jump over the table (units of $g/w^2$)", title=ball.name)

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "01_bouncing_ball.png")
picture.parent.mkdir(parents=True, exist_ok=True)
ax.figure.savefig(picture, dpi=150)
print("written", picture)
