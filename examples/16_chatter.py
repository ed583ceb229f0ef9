"""A ball on a vibrating table comes to rest: complete chatter, and a flight once a period.

The table is at a sin(theta). It throws the ball where a sin(theta) = g and the table slows down. The impacts that
follow accumulate, and the ball rests until the table throws it again. Known answer from exact parabolas in 60 digits:
for a = 1.2 and e = 0.5 it rests from theta = 4.13360620053988 on.

Field: Impacts.

    python 16_chatter.py [picture]
"""

import math
import sys
from pathlib import Path

from matplotlib import pyplot as plt

import saltus

table = "z - a*sin(theta)"
ball = saltus.HybridSystem(
    states=("z", "v"),
    parameters={"a": 1.2, "e": 0.5, "g": 1.0, "w": 1.0},
    modes={
        "flight": saltus.Mode({"z": "v", "v": "-g"}),
        "rest": saltus.Mode({"z": "a*w*cos(theta)", "v": "-a*w**2*sin(theta)"}, surface=table),
    },
    transitions=[
        saltus.Transition(
            "flight",
            "flight",
            event=table,
            direction=-1,
            reset={"v": "-e*v + (1 + e)*a*w*cos(theta)"},
            name="impact",
            rests="rest",
        ),
        saltus.Transition("rest", "flight", event="g - a*w**2*sin(theta)", direction=-1, name="leave"),
    ],
    phase=("theta", "w"),
    outputs={"gap": table},
    name="ball that comes to rest on a vibrating table",
)
orbit = saltus.find_orbit(ball, x0=[0.0, 5.0])
print(orbit)
rest = next(part for part in orbit.segments if part.mode == "rest")
rests, leaves = rest.state[-1] % (2.0 * math.pi), math.asin(1.0 / 1.2)
print(f"rests at theta = {rests:.11f}, 60 digits: {4.1336062005398752:.11f}, apart {rests - 4.1336062005398752:.0e}")

sample = orbit.sample(2000)
theta, gap, mode = sample["theta"].values, sample["gap"].values, sample["mode"].values
flying = mode == ball.mode_names.index("flight")
order = theta.argsort(kind="stable")
flight = order[flying[order]]
figure, ax = plt.subplots(figsize=(7.5, 4.6), layout="constrained")
orange, blue = "#d55e00", "#0072b2"
ax.plot(theta[flight], gap[flight], color=blue, label="flight")
for k, (begin, end) in enumerate(((0.0, leaves), (rests, 2.0 * math.pi))):
    ax.plot(
        [begin, end], [0.0, 0.0], color=orange, linewidth=4.0, label="rest" if k == 0 else "_", solid_capstyle="butt"
    )
for x, word in ((leaves, "leaves"), (rests, "rests")):
    ax.axvline(x, color="0.75", linewidth=0.8, zorder=0)
    ax.text(x - 0.06, 0.1, word, rotation=90, ha="right", va="center")
ax.set(
    xlabel="phase of the table $\\theta$ (rad)",
    ylabel="height over the table (units of $g/w^2$)",
    title=f"{ball.name}, $a = 1.2$, $e = 0.5$",
    xlim=(0.0, 2.0 * math.pi),
    ylim=(-0.008, 0.18),
)
ax.set_xticks([0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi, 2.0 * math.pi], ["0", "π/2", "π", "3π/2", "2π"])
ax.legend(loc="upper left", fontsize="small")
inset = ax.inset_axes((0.755, 0.4, 0.21, 0.5))
inset.plot(rests - theta[flight], gap[flight], color=blue)
inset.set(xscale="log", yscale="log", xlim=(1.0, 1e-4), ylim=(1e-10, 0.1))
inset.set_xlabel("time left $w\\,t$", fontsize="small")
inset.set_ylabel("height", fontsize="small")
inset.tick_params(labelsize="small")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "16_chatter.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
