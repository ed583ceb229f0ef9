"""Known periodic orbits: periods, durations, multipliers, extremes, and how they depend on parameters."""

from __future__ import annotations

import math
import warnings
from functools import cache

import numpy as np
import pytest

import fields
import saltus
import sliding
import systems
from answers.answer import Answer
from own_states import belt as belt_of_own_states, wall
from saltus.errors import ChatteringError

RECIPES = "Dankowicz and Schilder, Recipes for Continuation, SIAM 2013, ex."
POLAR = f"{RECIPES} 9.2; integrated in polar coordinates by hand"
IMPACTS = f"{RECIPES} 15.2; closed form"
BELT = "closed-form segments, solved in 30 digits; SciPy"
SMOOTH = "SciPy's DOP853 with Newton's method; Fourier collocation"
TWO_SLOPES = "closed-form segments; SciPy"
PARABOLAS = "exact parabolas, summed in 60 digits"
WALL = "matrix exponentials; SciPy"
BALANCE = "harmonic balance of 16 odd harmonics; SciPy"


@cache
def two_fields():
    guess = [("left", "to_right", [0.0, 1.9], 3.0), ("right", "to_left", [0.0, -1.0], 1.7)]
    return saltus.solve_orbit(systems.two_fields(), {"al": 1.0, "be": 2.0}, guess)


@cache
def impacts():
    guess = [("free", "impact", [1.0, -1.3, 0.08], 2.0 * math.pi)]
    return saltus.solve_orbit(systems.impact_oscillator(), {"A": 1.0}, guess)


@cache
def stick_slip():
    guess = [("slip", "catch", [0.9, 0.3], 4.0), ("stick", "release", [-0.05, 0.3], 3.0)]
    return saltus.solve_orbit(systems.stick_slip(), {}, guess)


@cache
def relay():
    guess = [("down", "switch_up", [0.72, 0.29, 0.0], 1.84), ("up", "switch_down", [-0.72, -0.29, 0.0], 1.84)]
    return saltus.solve_orbit(systems.relay(), {}, guess)


@cache
def brusselator(B):
    return saltus.find_orbit(fields.system(fields.BRUSSELATOR, {"A": 1.0, "B": B}), {}, [1.0, B + 0.2])


@cache
def van_der_pol():
    system = fields.system({"x": "y", "y": "mu*(1 - x**2)*y - x"}, {"mu": 1.0}, "van der Pol")
    return saltus.find_orbit(system, {}, [2.0, 0.0])


@cache
def two_slopes():
    return saltus.find_orbit(fields.two_slopes(), {"m": 1.0}, [0.0, -2.0])


@cache
def belt(w):
    return saltus.find_orbit(sliding.belt(), {"w": w}, [1.0, 0.0])


@cache
def planar():
    return saltus.find_orbit(sliding.planar(), {"mu": 1.1}, [1.0, 0.2])


@cache
def sliding_relay():
    return saltus.find_orbit(sliding.relay(), {"r": 0.8}, [0.5, 0.2, 1.0])


@cache
def harvested():
    return saltus.find_orbit(sliding.harvested(), {"P": 1.6}, [0.3, 1.0])


@cache
def table():
    return saltus.find_orbit(sliding.table(), {"e": 0.5}, [0.0, 5.0])


def rest_on_table():
    (rest,) = [part for part in table().segments if part.mode == "rest"]
    return rest.state[-1] % (2.0 * math.pi), (rest.state[-1] + rest.duration) % (2.0 * math.pi)


def chatter():
    with pytest.raises(ChatteringError) as told:
        saltus.simulate(systems.ball(), {}, [1.0, 0.0], t_end=10.0)
    return told.value.time


@cache
def soft_wall():
    with warnings.catch_warnings(action="ignore"):  # its release lands beyond the touch
        return saltus.find_orbit(wall(), {}, [0.0, 0.0], mode="free")


@cache
def linear():
    field = {"x": "v", "v": "A*cos(s) - c*v - k*x"}
    system = saltus.HybridSystem.smooth(field, {"k": 1.0, "c": 0.1, "A": 1.0, "w": 1.1}, phase=("s", "w"))
    return saltus.solve_orbit(system, x0=[1.0, 0.0])


def pendulum():
    system = saltus.HybridSystem.smooth({"x": "v", "v": "-sin(x)"}, name="pendulum")
    return saltus.solve_orbit(system, x0=[1.8, 0.0], period=8.0, fix={"max_x": 2.0}).period


def resonance():
    start = saltus.solve_orbit(linear().system, x0=[1.1, 0.0], fix={"max_x": 4.3}, free="w")
    (top,) = saltus.continue_orbit(start, "max_x", (4.2, 12.0)).special_points
    return top.value("max_x"), top.parameters["w"]


@cache
def duffing():
    return saltus.find_orbit(systems.duffing(), {"w": 1.2}, [1.1, 0.0])


def lasting(orbit, mode):
    """Return how long the first segment in a mode lasts."""
    return next(part.duration for part in orbit.segments if part.mode == mode)


def least(orbit):
    """Return the multiplier next to 0."""
    return float(np.abs(orbit.multipliers).min())


def slope(orbit, quantity, parameter):
    return float(orbit.sensitivity([quantity])[quantity].sel(parameter=parameter))


def slopes_of_linear():
    found = linear().sensitivity(["max(x)"])["max(x)"]
    return tuple(float(found.sel(parameter=name)) for name in ("A", "k", "c", "w"))


ORBITS = [
    Answer("two planar fields that meet on a line, al = 1, be = 2: period", POLAR, "4.8102716060",
           lambda: two_fields().period),
    Answer("the same: multiplier", POLAR, "0.0024305114", lambda: float(two_fields().multipliers[0].real)),
    Answer("linear oscillator with a stop, one impact a period, A = 1: state just after the impact", IMPACTS,
           "(1.00000000, -1.35658635, 0.07595216)", lambda: tuple(impacts().segments[0].state)),
    Answer("the same: multipliers, a complex pair", IMPACTS, "-0.58429531 + 0.00560035i",
           lambda: (impacts().multipliers[0].real, abs(impacts().multipliers[0].imag))),
    Answer("block on a belt, stick-slip: time of slip", "closed form", "4.2224316541",
           lambda: lasting(stick_slip(), "slip"), "2*pi - 2*atan(5/3)"),
    Answer("the same: least and greatest displacement", "closed form", "(-0.0830951895, 1.0830951895)",
           lambda: (stick_slip().min["x"], stick_slip().max["x"]), "1/2 - sqrt(17/50), 1/2 + sqrt(17/50)"),
    Answer("block on a belt whose velocity is no state while it sticks, v0 = 0.2: period", "closed form",
           "8.9026054078", lambda: saltus.find_orbit(belt_of_own_states(), {}, [0.0], mode="stick").period,
           "2*pi - 2*atan(5/2) + 5"),
    Answer("relay feedback on 1/(s + 1)^3: period", "matrix exponentials", "3.6797506709", lambda: relay().period),
    Answer("the same: multipliers", "matrix exponentials", "(0.147448764, 1.0891122e-4)",
           lambda: tuple(sorted(relay().multipliers.real)[1::-1])),
    Answer("Brusselator, A = 1, B = 3: period of its cycle", SMOOTH, "7.1569199212", lambda: brusselator(3.0).period),
    Answer("the same: multiplier", SMOOTH, "2.5163758e-4", lambda: least(brusselator(3.0))),
    Answer("Brusselator, A = 1, B = 2.1: period and multiplier", SMOOTH, "(6.3220656694, 0.5298829044)",
           lambda: (brusselator(2.1).period, least(brusselator(2.1)))),
    Answer("van der Pol's oscillator, mu = 1: period", SMOOTH, "6.6632868593", lambda: van_der_pol().period),
    Answer("the same: multiplier and greatest displacement", SMOOTH, "(8.596950636e-4, 2.00861986)",
           lambda: (least(van_der_pol()), van_der_pol().max["x"])),
    Answer("focus that passes a switching line, m = 1: period and multiplier", TWO_SLOPES,
           "(6.355799581, 0.625775114)", lambda: (two_slopes().period, least(two_slopes()))),
    Answer("pendulum without friction, amplitude 2: period", "closed form", "8.3497529269", pendulum,
           "4*elliptic_k(sin(1)**2)"),
    Answer("wall that is a standard linear solid, w = 1.2: times in contact and in flight", WALL,
           "(0.7577372023, 4.4782505537)",
           lambda: (lasting(soft_wall(), "contact"), lasting(soft_wall(), "free"))),
]  # fmt: skip

SLIDING = [
    Answer("dry friction on a belt, w = 0.6: times below, above and at the belt's speed", BELT,
           "(5.465404127, 4.183504304, 0.823067081)",
           lambda: tuple(lasting(belt(0.6), mode) for mode in ("below", "above", "sliding"))),
    Answer("the same: multiplier", BELT, "-0.5803268690", lambda: float(belt(0.6).multipliers[0].real)),
    Answer("dry friction on a belt, w = 0.48, five segments: multiplier", BELT, "-0.612377898",
           lambda: float(belt(0.48).multipliers[0].real)),
    Answer("dry friction on a belt, w = 0.439: multiplier", BELT, "0.833233043",
           lambda: float(belt(0.439).multipliers[0].real)),
    Answer("planar Filippov system, mu = 1.1: times above and sliding", TWO_SLOPES, "(5.885555278, 0.486330276)",
           lambda: (lasting(planar(), "above"), lasting(planar(), "sliding"))),
    Answer("relay control that slides in both halves, r = 0.8: period and multiplier",
           "matrix exponentials in extended precision; SciPy", "(7.766189092, 0.132909670)",
           lambda: (sliding_relay().period, float(sliding_relay().multipliers[0].real))),
    Answer("predators harvested above a threshold, P = 1.6: period",
           "after Kuznetsov, Rinaldi, Gragnani 2003, sec. 5; SciPy and quadrature", "48.579118436",
           lambda: harvested().period),
    Answer("ball on a table, a = 1.2, e = 0.5: phases at which it comes to rest and leaves", PARABOLAS,
           "(4.13360620, 0.98511078)", rest_on_table),
    Answer("ball dropped from 1, e = 0.5: time at which its impacts accumulate", "closed form", "4.2426406871",
           chatter, "3*sqrt(2)"),
]  # fmt: skip

SENSITIVITIES = [
    Answer("linear oscillator, w = 1.1: amplitude", "closed form", "4.2182454061", lambda: linear().max["x"],
           "1/sqrt((1 - 1.21)**2 + 0.0121)"),
    Answer("the same: its derivatives in A, k, c and w", "closed form",
           "(4.21824541, 15.76212696, -9.08198744, -35.50231454)", slopes_of_linear,
           "1/sqrt(0.0562), 0.21*0.0562**(-1.5), -0.121*0.0562**(-1.5), "
           "-1.1*(0.01 + 0.42)*0.0562**(-1.5)"),
    Answer("the same: greatest amplitude over the frequency, and where it is", "closed form",
           "(10.0125234864, 0.99749687)", resonance, "10/sqrt(1 - 0.0025), sqrt(1 - 0.005)"),
    Answer("block on a belt: derivatives of the period in Fs, Fk and v0", "closed form",
           "(4.9019607843, -4.9019607843, -8.1699346405)",
           lambda: tuple(slope(stick_slip(), "period", name) for name in ("Fs", "Fk", "v0")),
           "250/51, -250/51, -1250/153"),
    Answer("block on a belt: derivatives of its reach in Fs, Fk and v0", "closed form",
           "(0.8574929257, 0.1425070743, 0.5144957554)",
           lambda: tuple(slope(stick_slip(), "max(x)", name) for name in ("Fs", "Fk", "v0")),
           "5/sqrt(34), 1 - 5/sqrt(34), 3/sqrt(34)"),
    Answer("dry friction on a belt, w = 0.6: reach", BELT, "1.59048268184", lambda: belt(0.6).max["x"]),
    Answer("the same: its derivatives in w, F and u", BELT, "(1.799731290, 0.107947633, 1.010884203)",
           lambda: tuple(slope(belt(0.6), "max(x)", name) for name in ("w", "F", "u"))),
    Answer("Duffing's oscillator, w = 1.2: reach", BALANCE, "1.10446241958", lambda: duffing().max["x"]),
    Answer("the same: its derivatives in w, c and A", BALANCE, "(1.1648355, -0.1649331, 0.4888856)",
           lambda: tuple(slope(duffing(), "max(x)", name) for name in ("w", "c", "A"))),
]  # fmt: skip
