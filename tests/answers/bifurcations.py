"""Known bifurcations of orbits, equilibria and maps, in one parameter and in two."""

from __future__ import annotations

import math
from functools import cache

import fields
import known_maps
import saltus
import sliding
import systems
from answers.answer import Answer
from answers.orbits import BALANCE, BELT, IMPACTS, SMOOTH, duffing
from oracles.closed_forms import CUSP, DELAYED, HENON, LOGISTIC, ImpactOrbit, TableJump, henon_two_cycle, logistic_cycle
from oracles.textbook import TEXTBOOK

FEIGENBAUM = "Feigenbaum, J. Stat. Phys. 19 (1978) 25, on the cascade; Newton's method in 40 digits"
BAZYKIN = "Kuznetsov, Elements (2004), sec. 8.5, has the diagram; two root searches in extended precision"
SLIDING_ORBITS = "closed form; SciPy"
TABLE = "closed form of Gamma = a w^2/g"


def only(points, kind):
    """Return the one special point of a type."""
    (point,) = points.of_type(kind)
    return point


@cache
def impact_branch(w, m=1):
    form = ImpactOrbit(w, m)
    U = 1.5 * max(0.3, form.U_fold)
    guess = [("free", "impact", form.after_impact(U), form.period)]
    start = saltus.solve_orbit(systems.impact_oscillator(), {"w": w, "A": form.amplitude(U)}, guess)
    return saltus.continue_orbit(
        start, "A", (0.01, 1.1 * max(form.amplitude(form.U_doubling), form.A_grazing, form.amplitude(U)))
    )


def of_one_impact(w, kind, m=1):
    """Return the amplitude at a special point of the orbits with one impact a period."""
    (found,) = [p for p in impact_branch(w, m).special_points if p.type == kind and len(p.orbit.signature) == 1]
    return found.parameters["A"]


@cache
def table_branch():
    form = TableJump(0.5)
    guess = [("flight", "impact", form.after_impact(1.15), 2.0 * math.pi)]
    return saltus.continue_orbit(saltus.solve_orbit(systems.ball_on_table(), {"a": 1.15}, guess), "a", (0.6, 1.8))


@cache
def grazing_locus():
    point = next(p for p in impact_branch(1.1).special_points if p.type == "GR" and len(p.orbit.signature) == 1)
    return saltus.continue_locus(point, ("w", "A"), {"w": (0.9, 2.3), "A": (0.005, 15.0)})


def meeting(w):
    """Return where saddle-nodes meet the locus of grazings, next to a frequency."""
    points = grazing_locus().special_points.of_type("SN")
    near = min(points, key=lambda point: abs(point.parameters["w"] - w))
    return near.parameters["w"], near.parameters["A"]


@cache
def belt_branch():
    return saltus.continue_orbit(saltus.find_orbit(sliding.belt(), {"w": 0.6}, [1.0, 0.0]), "w", (0.4385, 0.7))


def sliding_point(system, parameters, x0, name, bounds, kind):
    branch = saltus.continue_orbit(saltus.find_orbit(system, parameters, x0), name, bounds)
    return only(branch.special_points, kind).value(name)


def den_hartog():
    start = saltus.find_orbit(sliding.belt(), {"w": 0.6, "u": 0.0, "F": 0.5}, [1.0, 0.1])
    branch = saltus.continue_orbit(start, "F", (0.47, 0.56))
    return only(branch.special_points, "CS").value("F")


@cache
def duffing_folds():
    found = saltus.continue_orbit(duffing(), "w", (0.3, 3.0)).special_points.of_type("SN")
    return tuple(sorted((point.parameters["w"] for point in found), reverse=True))


BELT_POINTS = [
    Answer(f"dry friction on a belt: w of the {name}", BELT, printed,
           lambda kind=kind: only(belt_branch().special_points, kind).value("w"))
    for kind, name, printed in (
        ("CS", "crossing-sliding", "0.6449777688"), ("GS", "grazing-sliding", "0.5039586192"),
        ("SS", "switching-sliding", "0.4494622418"), ("AS", "adding-sliding", "0.4399119913"),
    )
]  # fmt: skip

OF_ORBITS = [
    Answer("linear oscillator with a stop, w = 1: grazing", IMPACTS, "0.1000000000", lambda: of_one_impact(1.0, "GR"),
           "1/10"),
    Answer("the same: saddle-node beside the grazing", IMPACTS, "0.09997075363", lambda: of_one_impact(1.0, "SN")),
    Answer("linear oscillator with a stop, w = 1.1: saddle-node", IMPACTS, "0.1164430069",
           lambda: of_one_impact(1.1, "SN")),
    Answer("the same: period doubling", IMPACTS, "4.2445655745", lambda: of_one_impact(1.1, "PD")),
    Answer("linear oscillator with a stop, an impact each second period, w = 2.5: saddle-node", IMPACTS,
           "0.8324886906", lambda: of_one_impact(2.5, "SN", 2), campaign=True),
    Answer("the same: period doubling", IMPACTS, "2.1363797554", lambda: of_one_impact(2.5, "PD", 2), campaign=True),
    Answer("linear oscillator with a stop: where saddle-nodes meet grazings, (w, A)", IMPACTS,
           "(1.9974984, 2.9966648)", lambda: meeting(2.0), campaign=True),
    Answer("ball on a table, e = 0.5, a jump a period: saddle-node", TABLE, "1.0471975512",
           lambda: table_branch()["SN1"].parameters["a"], "pi/3"),
    Answer("the same: period doubling", TABLE, "1.5268237005", lambda: table_branch()["PD1"].parameters["a"],
           "sqrt(pi**2/9 + 100/81)"),
    *BELT_POINTS,
    Answer("dry friction without a belt, w = 0.6: friction at which motions begin to stick",
           "Den Hartog, Trans. ASME 53 (1931) 107; closed form", "0.5315125402", den_hartog,
           "9/16/sqrt(1 + 9/25*tan(5*pi/6)**2)"),
    Answer("relay control: crossing-sliding of both halves at once", "matrix exponentials in extended precision; SciPy",
           "1.2130256058",
           lambda: sliding_point(sliding.relay(), {}, [0.5, 0.2, 1.0], "r", (0.7, 1.3), "CS")),
    Answer("planar Filippov system: grazing-sliding", SLIDING_ORBITS, "1.0000000000",
           lambda: sliding_point(sliding.planar(), {"mu": 1.1}, [1.0, 0.2], "mu", (0.8, 1.3), "GS"), "1"),
    Answer("predators harvested above a threshold: grazing-sliding",
           "after Kuznetsov, Rinaldi, Gragnani 2003, sec. 5; SciPy", "2.44070781",
           lambda: sliding_point(sliding.harvested(), {}, [0.3, 1.0], "P", (1.4, 2.7), "GS")),
    Answer("Duffing's oscillator: w of both saddle-nodes", BALANCE, "(2.21193532, 1.43867015)", duffing_folds,
           campaign=True),
]  # fmt: skip


@cache
def lorenz_hopf():
    rest = saltus.find_equilibrium(fields.lorenz(), x0=[8.0, 8.0, 23.0])
    return saltus.continue_equilibrium(rest, "r", (15.0, 30.0))["HB1"]


@cache
def lorenz_cycle(r):
    return saltus.continue_orbit(saltus.switch_branch(lorenz_hopf()), "r", (r, 26.0)).solution(0)


@cache
def lorenz_homoclinic():
    rest = saltus.find_equilibrium(fields.lorenz(), {"r": 15.0}, [6.0, 6.0, 14.0])
    hopf = saltus.continue_equilibrium(rest, "r", (0.0, 30.0))["HB1"]
    return saltus.continue_orbit(saltus.switch_branch(hopf), "r", (0.0, 30.0))["HOM1"]


def homoclinic_of_sandstede():
    field = {
        "x": "a*x + b*y - a*x**2 + mut*x*(2 - 3*x)",
        "y": "b*x + a*y - 1.5*b*x**2 - 1.5*a*x*y - 2*mut*y",
        "z": "c*z",
    }
    system = fields.system(field, {"a": -0.3, "b": 1.0, "c": -2.0, "mut": 0.1})
    hopf = saltus.continue_equilibrium(saltus.find_equilibrium(system, {}, [0.7, 0.0, 0.0]), "mut", (-0.5, 0.5))["HB1"]
    orbit = saltus.continue_orbit(saltus.switch_branch(hopf), "mut", (-0.5, 0.5))["HOM1"].orbit
    return orbit.max["x"], orbit.max["y"]


@cache
def textbook(name):
    item = TEXTBOOK[name]
    start = saltus.find_equilibrium(
        fields.system(item.field, item.parameters), {item.parameter: item.value}, item.start
    )
    return saltus.continue_equilibrium(start, item.parameter, item.bounds)


def of_textbook(name, kind):
    """Return the parameters at special points of a type, from the least on."""
    item = TEXTBOOK[name]
    return tuple(sorted(point.parameters[item.parameter] for point in textbook(name).special_points.of_type(kind)))


def textbook_answer(name, kind, what, printed):
    source = f"{TEXTBOOK[name].source}; mpmath in 30 digits"
    return Answer(f"{name}: {what} in {TEXTBOOK[name].parameter}", source, printed, lambda: of_textbook(name, kind))


@cache
def harvested_rests():
    start = saltus.find_equilibrium(sliding.harvested(), {"P": 1.1}, [0.6, 1.1], mode="sliding")
    return saltus.continue_equilibrium(start, "P", (0.5, 2.0)).special_points


def boundary(kind):
    (point,) = [p for p in harvested_rests().of_type("BE") if p.kind == kind]
    return point.value("P")


def pseudo_fold():
    start = saltus.find_equilibrium(sliding.planar(), {"mu": 1.2, "c": -3.2}, [-0.8, -1.0], mode="sliding")
    return only(saltus.continue_equilibrium(start, "c", (-4.2, -1.2)).special_points, "SN").value("c")


@cache
def bazykin_folds():
    start = saltus.find_equilibrium(fields.system(fields.BAZYKIN, {"al": 0.35, "de": 0.01}), x0=[3.0, 3.0])
    fold = saltus.continue_equilibrium(start, "al", (0.1, 1.1))["SN1"]
    return saltus.continue_locus(fold, ("al", "de"), {"al": (0.01, 1.2), "de": (1e-5, 5.0)})


def of_bazykin(kind, which):
    """Return (al, de) of one of the points of a type, in the order of al."""
    found = sorted(bazykin_folds().special_points.of_type(kind), key=lambda point: point.parameters["al"])
    return found[which].parameters["al"], found[which].parameters["de"]


def generalised_hopf():
    second = max(bazykin_folds().special_points.of_type("BT"), key=lambda point: point.parameters["al"])
    locus = saltus.continue_locus(second, ("al", "de"), {"al": (0.01, 1.2), "de": (1e-5, 5.0)}, type="HB")
    point = only(locus.special_points, "GH")
    return point.parameters["al"], point.parameters["de"]


def chua_boundary():
    rest = saltus.find_equilibrium(fields.chua(), mode="inner")
    branch = saltus.continue_equilibrium(rest, "d", (-1.0, 1.0))
    return tuple(sorted(point.parameters["d"] for point in branch.special_points.of_type("BE")))


def chua_hopf():
    start = saltus.find_equilibrium(fields.chua(), mode="plus", x0=[1.5, 0.0, -1.5])
    return saltus.continue_equilibrium(start, "be", (15.0, 30.0))["HB1"].parameters["be"]


def bautin_cycle_fold():
    start = saltus.find_equilibrium(fields.system(fields.BAUTIN, {"b1": -0.5, "b2": 0.3}), x0=[0.01, 0.0])
    hopf = saltus.continue_equilibrium(start, "b1", (-1.0, 1.0))["HB1"]
    return saltus.continue_orbit(saltus.switch_branch(hopf), "b1", (-0.2, 0.2))["SN1"].parameters["b1"]


OF_EQUILIBRIA = [
    Answer("Lorenz equations: Hopf point in r", "Lorenz, J. Atmos. Sci. 20 (1963) 130; closed form",
           "24.7368421053", lambda: lorenz_hopf().parameters["r"], "470/19"),
    Answer("the same: frequency there", "closed form", "9.6245300637",
           lambda: float(lorenz_hopf().equilibrium.eigenvalues.imag.max()), "sqrt(8/3*(10 + 470/19))"),
    Answer("the same: first Lyapunov coefficient, subcritical", "Kuznetsov's (5.39) in extended precision",
           "2.655189726e-4", lambda: lorenz_hopf().normal_form.coefficient),
    Answer("Lorenz equations, r = 24: period of the unstable cycle", SMOOTH,
           "0.6793367642", lambda: lorenz_cycle(24.0).period),
    Answer("Lorenz equations: homoclinic orbit in r", "in the literature", "13.9265574075",
           lambda: lorenz_homoclinic().parameters["r"], campaign=True),
    Answer("Sandstede's system: reach of its homoclinic orbit in x and y",
           "the curve x^2 (1 - x) = y^2", "(1.00000000, 0.38490018)", homoclinic_of_sandstede,
           "1, 2/sqrt(27)"),
    textbook_answer("Morris-Lecar, SNIC", "SN", "both saddle-nodes", "(-9.949039323, 39.963153093)"),
    textbook_answer("Morris-Lecar, Hopf", "HB", "both Hopf points", "(93.857618374, 212.018816100)"),
    textbook_answer("Hodgkin-Huxley", "HB", "both Hopf points", "(9.779337995, 154.526333666)"),
    textbook_answer("FitzHugh-Nagumo", "HB", "both Hopf points", "(0.33128134, 1.41871866)"),
    textbook_answer("toggle switch, unequal", "SN", "both saddle-nodes", "(2.700793638, 3.542407440)"),
    textbook_answer("thermohaline circulation", "SN", "both saddle-nodes", "(0.95563349, 1.29621836)"),
    Answer("Bazykin's predator and prey: Bogdanov-Takens point, (al, de)", BAZYKIN, "(0.45362432778, 0.17512759295)",
           lambda: of_bazykin("BT", 0), campaign=True),
    Answer("the same: cusp", BAZYKIN, "(0.90123269194, 0.00356841936)", lambda: of_bazykin("CP", -1), campaign=True),
    Answer("the same: generalised Hopf point", BAZYKIN, "(0.956623198, 0.000950448)", generalised_hopf, campaign=True),
    Answer("Bautin normal form, b2 = 0.3: saddle-node of cycles", "closed form", "-0.0225000000", bautin_cycle_fold,
           "-0.3**2/4", campaign=True),
    Answer("planar Filippov system, mu = 1.2: saddle-node of pseudo-equilibria in c", SLIDING_ORBITS, "-2.2318132820",
           pseudo_fold),
    Answer("predators harvested above a threshold: saddle-node of pseudo-equilibria", "closed form", "1.2436023622",
           lambda: only(harvested_rests(), "SN").value("P"), "1.33**2/(4*0.3556)"),
    Answer("the same: boundary equilibrium, persistence", "closed form", "0.6538504155",
           lambda: boundary("persistence"),
           "(1 - 0.33*0.2511/0.1045)*(0.33 + 0.33*0.2511/0.1045)/0.3556"),
    Answer("the same: boundary equilibrium, nonsmooth fold", "closed form", "1.010484748",
           lambda: boundary("nonsmooth fold"),
           "(1 - 0.33*0.0444/0.3112)*(0.33 + 0.33*0.0444/0.3112)/0.3556"),
    Answer("Chua's circuit with a bias: boundary equilibria", "closed form", "(-0.1428571429, 0.1428571429)",
           chua_boundary, "-1/7, 1/7"),
    Answer("Chua's circuit, a = 9: Hopf point of the outer region in be", "closed form", "22.9591836735", chua_hopf,
           "1125/49"),
]  # fmt: skip


def doubling(period):
    """Return where an orbit of the logistic map doubles, the one special point of its branch."""
    a, low = {1: (2.5, 1.5), 2: (3.2, 3.05), 4: (3.5, 3.46), 8: (3.55, 3.5445)}[period]
    points = [("carry", "map", [x, 0.0], 1.0) for x in logistic_cycle(a, period)]
    start = saltus.solve_orbit(systems.carried_map(("x",), {"a": a}, LOGISTIC), {}, points)
    (point,) = saltus.continue_orbit(start, "a", (low, 3.9)).special_points
    return point.parameters["a"] if point.type == "PD" else math.nan


def window():
    start = saltus.solve_orbit(known_maps.logistic(), {"r": 3.835}, x0=[[x] for x in logistic_cycle(3.835, 3)])
    return only(saltus.continue_orbit(start, "r", (3.8, 3.9)).special_points, "SN").parameters["r"]


@cache
def carried(kind):
    """Return special points of a map that a hybrid system carries."""
    image, parameters, points, name, bounds = {
        "Henon": (HENON, {"a": 0.2, "b": 0.3}, [(0.2, 0.2)], "a", (-1.0, 1.5)),
        "Henon, period 2": (HENON, {"a": 0.4675, "b": 0.3}, None, "a", (0.3875, 2.0)),
        "cusp": (CUSP, {"r": 0.0, "h": 1.5}, [(math.sqrt(0.5),)], "r", (-0.2, 0.2)),
        "delayed": (DELAYED, {"a": 1.5, "c": 1.2}, [(1 / 3, 1 / 3)], "a", (1.2, 4.0)),
    }[kind]
    if points is None:
        x, y = henon_two_cycle(0.4675, 0.3)
        points = [(x, y), (y, x)]
    system = systems.carried_map(tuple(image), parameters, image)
    start = saltus.solve_orbit(system, {}, [("carry", "map", [*point, 0.0], 1.0) for point in points])
    return saltus.continue_orbit(start, name, bounds).special_points


def of_carried(kind, type_, name):
    found = tuple(sorted(point.parameters[name] for point in carried(kind).of_type(type_)))
    return found[0] if len(found) == 1 else found


@cache
def torus_locus():
    (point,) = carried("delayed").of_type("TR")
    return saltus.continue_locus(point, ("a", "c"), {"a": (0.5, 8.0), "c": (-3.0, 5.0)})


def resonance(name):
    point = only(torus_locus().special_points, name)
    return point.parameters["a"], point.parameters["c"]


@cache
def cusp_locus():
    branch = saltus.continue_orbit(saltus.solve_orbit(known_maps.cusp(), x0=[0.9]), "r", (-1.0, 1.0))
    return saltus.continue_locus(branch["PD1"], ("r", "h"), {"r": (-2.0, 2.0), "h": (-3.0, 2.0)})


def generalised_doubling():
    point = cusp_locus().special_points.of_type("GPD")[0]
    return abs(point.parameters["r"]), point.parameters["h"]


def tongue():
    system = saltus.Map(("x",), {"w": 0.1, "K": 0.5}, {"x": "x + w + K*sin(x)"}, angles=("x",), name="circle map")
    branch = saltus.continue_orbit(saltus.find_orbit(system, x0=[0.3]), "w", (-0.9, 1.1))
    return tuple(sorted(point.parameters["w"] for point in branch.special_points))


OF_MAPS = [
    Answer("logistic map as a hybrid system: period doubling of the fixed point", "closed form", "3.0000000000",
           lambda: doubling(1), "3"),
    Answer("the same: of the orbit of period 2", "closed form", "3.4494897428",
           lambda: doubling(2), "1 + sqrt(6)"),
    Answer("the same: of the orbit of period 4", FEIGENBAUM, "3.5440903596",
           lambda: doubling(4)),
    Answer("the same: of the orbit of period 8", FEIGENBAUM, "3.5644072661",
           lambda: doubling(8)),
    Answer("logistic map: saddle-node of the orbit of period 3", "closed form", "3.828427125", window,
           "1 + sqrt(8)"),
    Answer("Henon's map as a hybrid system, b = 0.3: saddle-node", "closed form", "-0.1225000000",
           lambda: of_carried("Henon", "SN", "a"), "-0.7**2/4"),
    Answer("the same: period doubling", "closed form", "0.3675000000", lambda: of_carried("Henon", "PD", "a"),
           "3*0.7**2/4"),
    Answer("the same: period doubling of the orbit of period 2", "closed form", "0.9125000000",
           lambda: of_carried("Henon, period 2", "PD", "a"), "0.7**2 + 1.3**2/4"),
    Answer("cusp family, h = 1.5: both saddle-nodes", "closed form", "(-0.1360827635, 0.1360827635)",
           lambda: of_carried("cusp", "SN", "r"), "-2*(1/6)**(3/2), 2*(1/6)**(3/2)"),
    Answer("delayed map, c = 1.2: torus bifurcation", "closed form", "3.200000000",
           lambda: of_carried("delayed", "TR", "a"), "2 + 1.2"),
    Answer("the same: strong resonance 1:4 in (a, c)", "closed form", "(3.0000000, 1.0000000)",
           lambda: resonance("R4"), "3, 1", campaign=True),
    Answer("the same: strong resonance 1:3", "closed form", "(4.0000000, 2.0000000)", lambda: resonance("R3"), "4, 2",
           campaign=True),
    Answer("cusp map: generalised period doubling in (|r|, h)", "closed form", "(0.5925926, -0.6666667)",
           generalised_doubling, "16/27, -2/3"),
    Answer("circle map, K = 0.5: edges of the first tongue", "closed form", "(-0.500000000, 0.500000000)", tongue,
           "-1/2, 1/2"),
]  # fmt: skip
