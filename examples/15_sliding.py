"""A block on a belt: orbits that stick, the four sliding bifurcations between them, and their loci.

The oscillator x'' + x = cos(theta) - F sgn(x' - u) with theta' = w is driven, with dry friction on a belt of speed u.
An orbit is a word: P where the block is faster than the belt, M where it is slower, S where it sticks. Known answers,
in 30 digits, are the four values of w at F = 0.4 and u = 0.3.

Field: Friction and sliding.

    python 15_sliding.py [picture]
"""

import sys
from pathlib import Path

from matplotlib import pyplot as plt

import saltus
from saltus.plotting import style

belt = saltus.filippov(
    states=("x", "v"),
    parameters={"F": 0.4, "u": 0.3, "w": 0.6},
    surface="v - u",
    above={"x": "v", "v": "cos(theta) - x - F"},
    below={"x": "v", "v": "cos(theta) - x + F"},
    phase=("theta", "w"),
    name="block on a belt",
)
branch = saltus.continue_orbit(saltus.find_orbit(belt, x0=[1.0, 0.0]), "w", (0.4385, 0.7))
print(branch)
known = {"AS": 0.4399119912593270, "SS": 0.4494622418330982, "GS": 0.5039586191752079, "CS": 0.6449777687859365}
for kind, w in known.items():
    found = branch[f"{kind}1"].parameters["w"]
    print(f"{kind} at w = {found:.12f}, 30 digits: {w:.12f}, apart {found - w:.0e}")
bounds = {"w": (0.3, 0.8), "F": (0.26, 0.6)}
fine = saltus.StepControl(largest=0.02)
loci = {kind: saltus.continue_locus(branch[f"{kind}1"], ("w", "F"), bounds, steps=fine) for kind in known}
for locus in loci.values():
    print(locus)

figure = plt.figure(figsize=(11.0, 8.0), layout="constrained")
top, bottom = figure.subfigures(2, 1, height_ratios=[1.0, 1.45])
portraits = top.subplots(1, 5, sharex=True, sharey=True)
words = {"MS": 0.439, "MSPS": 0.445, "MPSPS": 0.48, "MPS": 0.6, "MP": 0.69}
portraits[0].set_xticks([-1.5, 0.0, 1.5])
for ax, (word, w) in zip(portraits, words.items(), strict=True):
    orbit = saltus.find_orbit(belt, {"w": w}, x0=[1.0, 0.0])
    assert len(orbit.segments) == len(word)
    orbit.plot("x", "v", ax=ax, legend=False)
    ax.axhline(0.3, color="0.75", linewidth=0.8, zorder=0)
    ax.set(title=f"{word}, $w = {w:g}$", xlabel="position $x$", ylabel="velocity $v$" if ax is portraits[0] else "")
named = {label: line for ax in portraits for line, label in zip(*ax.get_legend_handles_labels(), strict=True)}
top.legend(named.values(), named, loc="outside lower center", ncols=4)

chart = bottom.subplots()
colours = {"AS": "#0072b2", "SS": "#d55e00", "GS": "#009e73", "CS": "#cc79a7"}
for kind, locus in loci.items():
    w, F = (locus.column(name) for name in ("w", "F"))
    chart.plot(w, F, color=colours[kind], label=f"{kind}, {style.SPECIAL[kind].meaning}")
    at = branch[f"{kind}1"].parameters["w"]
    chart.plot(at, 0.4, "o", color=colours[kind], markersize=5.0)
for w in words.values():
    chart.plot(w, 0.4, "|", color="0.35", markersize=8.0)
meeting = loci["AS"]["SS1"].parameters
chart.plot(meeting["w"], meeting["F"], "ko", markersize=6.0, label="AS and SS meet", zorder=5)
chart.axhline(0.4, color="0.8", linewidth=0.8, zorder=0)
places = {
    "MS": (0.4415, 0.55),
    "MSPS": (0.475, 0.55),
    "MPSPS": (0.476, 0.365),
    "MPS": (0.575, 0.43),
    "MP": (0.69, 0.45),
}
for word, place in places.items():
    chart.text(*place, word, ha="center", va="center")
chart.set(xlabel="frequency of the drive $w$", ylabel="friction $F$", xlim=(0.434, 0.72), ylim=(0.3, 0.6))
chart.set(title="loci of the four sliding bifurcations, $u = 0.3$; ticks: orbits shown above")
chart.legend(loc="lower right")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "15_sliding.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=130)
print("written", picture)
