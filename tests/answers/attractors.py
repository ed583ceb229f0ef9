"""Known exponents of motions, words for attractors, fractions of basins and measures of them."""

from __future__ import annotations

from functools import cache

import numpy as np

import saltus
import systems
import wells
from answers.answer import Answer
from discrete import HENON, LOGISTIC, NEWTON, TENT
from oracles import known_basins as kb
from oracles.closed_forms import ImpactOrbit, TableJump
from saltus.basins.measures.entropy import basin_entropy
from saltus.basins.measures.integrity import global_integrity, integrity_factor, local_integrity
from saltus.basins.measures.uncertainty import uncertainty_by_neighbours
from saltus.options import SweepOptions

PAPER = "ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 7"
FIGURE_7C = 1.02295987  # value of the figure's sweep that is nearest to its 1.023
SETTLED = "SciPy's DOP853: differences after 10 periods fall by 0.7576 in 10 periods; in print quasi-periodic"
SPROTT = "Sprott, Chaos and Time-Series Analysis, Oxford 2003"
COUNTED = "a count by a program of its own"
FORCED = "closed form of both multipliers"
STEADY = saltus.Average(periods=60, discard=200)


def largest(system, parameters, x0, average):
    return float(saltus.lyapunov_spectrum(system, parameters, x0, average=average).exponents[0])


def skew_tent():
    pieces = {
        "left": saltus.Piece({"x": "x/c"}, "c - x"),
        "right": saltus.Piece({"x": "(1 - x)/(1 - c)"}, "x - c"),
    }
    system = saltus.Map(("x",), {"c": 0.2}, pieces=pieces)
    return largest(system, {}, [0.1234], saltus.Average(periods=400_000))


def impacts():
    orbit = ImpactOrbit(w=1.1)
    parameters = {"w": 1.1, "A": orbit.amplitude(3.7)}
    return tuple(
        saltus.lyapunov_spectrum(
            systems.impact_oscillator(), parameters, orbit.after_impact(3.7), average=STEADY
        ).exponents
    )


def table():
    start = TableJump(0.5).after_impact(1.46)
    return tuple(saltus.lyapunov_spectrum(systems.ball_on_table(), {"a": 1.46}, start, average=STEADY).per_period)


@cache
def henon():
    return saltus.lyapunov_spectrum(HENON, {}, [0.1, 0.1], average=saltus.Average(periods=3_000_000))


@cache
def tapping():
    """Return the labels of the two-mode cantilever's motions from rest, by frequency."""
    values = [1.0, 1.02, FIGURE_7C, 1.046]
    options = SweepOptions(discard=600, keep=100, follow="restart")
    labels = saltus.run_sweep(systems.afm(2), "Omega", values, options=options).labels[0]
    return dict(zip(values, labels.tolist(), strict=True))


def logistic_label(r):
    return str(saltus.run_sweep(LOGISTIC, "r", [r], x0=[0.3], options=SweepOptions(discard=5000)).labels[0, 0])


EXPONENTS = [
    Answer("logistic map at r = 4: Lyapunov exponent", "closed form", "0.693",
           lambda: largest(LOGISTIC, {"r": 4.0}, [0.3], saltus.Average(periods=1_000_000)), "log(2)"),
    Answer("tent map of slope 1.5: Lyapunov exponent", "closed form", "0.405465108108",
           lambda: largest(TENT, {"a": 1.5}, [0.3], saltus.Average(periods=10_000)), "log(3/2)"),
    Answer("skew tent map, c = 0.2: Lyapunov exponent", "closed form", "0.50", skew_tent,
           "-log(0.2)/5 - 4*log(0.8)/5"),
    Answer("Henon's map: sum of both exponents", "closed form", "-1.203972804326", lambda: henon().sum, "log(0.3)",
           campaign=True),
    Answer("the same: larger exponent", SPROTT, "0.419", lambda: float(henon().exponents[0]), campaign=True),
    Answer("the same: Kaplan-Yorke dimension", SPROTT, "1.258", lambda: henon().kaplan_yorke, campaign=True),
    Answer("linear oscillator with a stop, w = 1.1, U = 3.7: exponents", FORCED, "(-0.03906145, -0.13907023)", impacts,
           campaign=True),
    Answer("ball on a table, e = 0.5, a = 1.46: exponents, a period", FORCED, "(-0.41472227, -0.97157209)", table),
]  # fmt: skip

WORDS = [
    Answer("logistic map at r = 3.54: motion", "period doublings at 3.4495 and 3.5441", "period-4",
           lambda: logistic_label(3.54)),
    Answer("logistic map at r = 3.83: motion", "the window from 1 + sqrt(8) on", "period-3",
           lambda: logistic_label(3.83)),
    *(
        Answer(f"tapping cantilever of two modes, Omega = {omega}: motion", PAPER, word,
               lambda omega=omega: tapping()[omega])
        for omega, word in ((1.0, "period-2"), (1.02, "period-4"), (FIGURE_7C, "chaotic"))
    ),
    Answer("tapping cantilever of two modes, Omega = 1.046: motion", SETTLED, "locked-10", lambda: tapping()[1.046]),
]  # fmt: skip


@cache
def mapped(name, half, count):
    """Return the basins of a map of the plane in a square."""
    system = {"Newton": NEWTON, "Henon": HENON}[name]
    attractors = saltus.find_attractors(system, {}, {"x": (-2.0, 2.0), "y": (-2.0, 2.0)})
    return saltus.map_basins(system, {}, {"x": (-half, half, count), "y": (-half, half, count)}, attractors)


def newton_shares():
    shares = mapped("Newton", 1.0, 1000).fractions()
    return tuple(sorted((shares[name] for name in mapped("Newton", 1.0, 1000).attractors.names), reverse=True))


@cache
def double_well():
    """Return the shares of both wells of a damped motion in them."""
    system, still = wells.double_well(), {"A": 0.0}
    attractors = saltus.find_attractors(system, still, {"x": (-2.0, 2.0), "v": (-2.0, 2.0)})
    shares = saltus.map_basins(system, still, {"x": (-2.0, 2.0, 60), "v": (-2.0, 2.0, 60)}, attractors).fractions()
    return tuple(shares[name] for name in attractors.names)


@cache
def disc():
    return kb.sampled(lambda x, y: x**2 + y**2 > 0.36, (1500, 1500), 1.0, {"a": [[0.25, 0.0]]})


@cache
def ellipse():
    return kb.sampled(lambda x, y: (x / 0.8) ** 2 + (y / 0.4) ** 2 > 1.0, (1500, 1500), 1.0, {"a": [[0.0, 0.0]]})


def half_plane():
    labels = np.repeat((np.arange(100) >= 43)[:, None], 100, axis=1)
    return basin_entropy(kb.basins(labels), 10).boundary


BASINS = [
    Answer("damped motion in a double well: share of each well", "closed form, by symmetry", "(0.500, 0.500)",
           double_well, "1/2, 1/2", campaign=True),
    Answer("Newton's method for z^3 = 1 on [-1, 1]^2, 1000^2 cells: shares of the roots", COUNTED,
           "(0.33598, 0.33201, 0.33201)", newton_shares, campaign=True),
    Answer("the same: basin entropy in boxes of 5 cells, of all and of the boundary", COUNTED, "(0.05673, 0.72690)",
           lambda: (basin_entropy(mapped("Newton", 1.0, 1000), 5).value,
                    basin_entropy(mapped("Newton", 1.0, 1000), 5).boundary), campaign=True),
    Answer("the same on [-2, 2]^2: uncertainty exponent", COUNTED, "0.56",
           lambda: uncertainty_by_neighbours(mapped("Newton", 2.0, 1000)).value, campaign=True),
    Answer("Henon's map on [-2, 2]^2, 2000^2 cells: share of bounded motions", COUNTED, "0.43249",
           lambda: 1.0 - mapped("Henon", 2.0, 2000).fractions()["diverged"], campaign=True),
    Answer("half plane that cuts its boxes 3 to 7: boundary basin entropy", "closed form", "0.610864302055", half_plane,
           "-0.3*log(0.3) - 0.7*log(0.7)"),
    Answer("disc of radius 0.6: area (global integrity measure)", "closed form", "1.131",
           lambda: global_integrity(disc(), "a").value, "0.36*pi"),
    Answer("the same, attractor 0.25 off the centre: local integrity measure", "closed form", "0.35",
           lambda: local_integrity(disc(), "a").value, "0.6 - 0.25"),
    Answer("ellipse of semi-axes 0.8 and 0.4: integrity factor", "closed form", "0.40",
           lambda: integrity_factor(ellipse(), "a").value, "0.4"),
]  # fmt: skip
