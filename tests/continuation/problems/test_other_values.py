"""Loci on which other values become critical at known places: each is found, however close two of them lie.

A system of blocks rests at 0. One block is critical along the locus, the growth of each other one is a polynomial of q.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import saltus
from saltus import HybridSystem, Map, Mode, StepControl
from saltus.continuation.problems.other_values import multipliers_beside, without_critical
from selection import guarding

WINDOW = {"p": (-1.0, 1.0), "q": (-0.5, 2.0)}
STEPS = (0.03, 0.1, 0.3)
CRITICAL = {"HB": "pair", "TR": "pair", "PD": "flip", "SN": "bend", "LP": "bend"}
RESTS = ("HB", "LP")  # loci of equilibria, LP one of saddle-nodes; the others are of maps
MET = {
    "HB": {"pair": "HH", "fold": "ZH"},
    "TR": {"pair": "NSNS", "fold": "FNS", "flip": "PDNS"},
    "PD": {"pair": "PDNS", "fold": "FF", "flip": "PDPD"},
    "SN": {"pair": "FNS", "fold": "SNSN", "flip": "FF"},
    "LP": {"pair": "ZH", "fold": "SNSN"},
}
Block = tuple[str, str]  # pair, fold or flip, and its growth


def line(place: float, slope: float = 0.2) -> str:
    return f"{slope!r}*(q - {place!r})"


def dip(place: float, half: float, slope: float = 0.2) -> str:
    return f"{slope!r}*((q - {place!r})**2 - {half * half!r})"


# blocks beside the critical one, and where they become critical
CASES: dict[str, tuple[list[Block], list[tuple[float, str]]]] = {
    "two pairs": ([("pair", line(0.5)), ("pair", line(0.503))], [(0.5, "pair"), (0.503, "pair")]),
    "pairs that change places": ([("pair", line(0.5)), ("pair", line(0.503, -0.2))], [(0.5, "pair"), (0.503, "pair")]),
    "a pair that comes back": ([("pair", dip(1.2, 1e-3))], [(1.199, "pair"), (1.201, "pair")]),
    "real ones that change places": (
        [("fold", line(0.5)), ("fold", line(0.503, -0.2))],
        [(0.5, "fold"), (0.503, "fold")],
    ),
    "a pair and a real one": ([("pair", line(0.5)), ("fold", line(0.503, -0.2))], [(0.5, "pair"), (0.503, "fold")]),
    "a real one that comes back": ([("fold", dip(1.2, 1e-3)), ("fold", "-0.3")], [(1.199, "fold"), (1.201, "fold")]),
}


def fields(kind: str, blocks: list[Block]) -> dict[str, str]:
    """Return the equations of an equilibrium for HB and LP, else the images of a map; all but a bend rest at 0."""
    found: dict[str, str] = {}
    for k, (what, growth) in enumerate([(CRITICAL[kind], "0.3*(p - 0.1*q)"), *blocks]):
        angle, x, y = 0.6 + 0.55 * k, f"x{k}", f"y{k}"
        if what == "bend":
            found[x] = f"p - 0.1*q - {x}**2" + (f" + {x}" if kind == "SN" else "")
            continue
        if what != "pair":
            sign = "-" if what == "flip" else ""
            found[x] = f"({growth})*{x} - {x}**3" if kind in RESTS else f"{sign}(1 + {growth})*{x} - {x}**3"
            continue
        rest = f"*({x}**2 + {y}**2)"
        if kind in RESTS:
            found[x], found[y] = (
                f"({growth})*{x} - {angle}*{y} - {x}{rest}",
                f"({growth})*{y} + {angle}*{x} - {y}{rest}",
            )
        else:
            c, s = math.cos(angle), math.sin(angle)
            found[x] = f"(1 + {growth})*({c}*{x} - {s}*{y}) - {x}{rest}"
            found[y] = f"(1 + {growth})*({s}*{x} + {c}*{y}) - {y}{rest}"
    return found


def locus(kind: str, blocks: list[Block], steps: float | None = None, axes: np.ndarray | None = None) -> Any:
    """Return the locus of the critical block, in turned axes where they are given."""
    found = fields(kind, blocks)
    if axes is not None:
        names = tuple(found)
        along = {
            n: " + ".join(f"({a})*w{j}" for j, a in enumerate(row)) for n, row in zip(names, axes.tolist(), strict=True)
        }
        turned = [expression(found[name], along) for name in names]
        found = {
            f"w{j}": " + ".join(f"({a})*({text})" for a, text in zip(column, turned, strict=True))
            for j, column in enumerate(axes.T.tolist())
        }
    start, at = {"p": -0.9, "q": 0.1}, np.zeros(len(found))
    if CRITICAL[kind] == "bend":
        start["p"], at[0] = 0.9, math.sqrt(0.89)
    if axes is not None:
        at = axes.T @ at
    if kind in RESTS:
        rest = saltus.find_equilibrium(HybridSystem(tuple(found), start, {"all": Mode(found)}), x0=at)
        branch: Any = saltus.continue_equilibrium(rest, "p", (-1.0, 1.0))
    else:
        branch = saltus.continue_orbit(
            saltus.solve_orbit(Map(tuple(found), start, found), x0=at, period=1), "p", (-1.0, 1.0)
        )
    control = None if steps is None else StepControl(largest=steps)
    return saltus.continue_locus(
        branch.special_points.of_type("SN" if kind == "LP" else kind)[0], ("p", "q"), WINDOW, steps=control
    )


def expression(text: str, along: dict[str, str]) -> str:
    """Return a text with other expressions in place of its states."""
    for name, other in along.items():
        text = text.replace(name, f"({other})")
    return text


def met(found: Any) -> list[tuple[float, str]]:
    """Return the points at which other values are critical."""
    known = {kind for types in MET.values() for kind in types.values()}
    return sorted((p.parameters["q"], p.type) for p in found.special_points if p.type in known)


@pytest.mark.parametrize(
    ("kind", "case", "steps"),
    guarding(
        [(kind, case, steps) for kind in MET for case in CASES for steps in STEPS],
        ("HB", "pairs that change places", 0.1),
        ("HB", "a pair and a real one", 0.3),
        ("TR", "two pairs", 0.1),
        ("TR", "real ones that change places", 0.03),
        ("PD", "a pair that comes back", 0.1),
        ("PD", "a real one that comes back", 0.3),
        ("SN", "real ones that change places", 0.1),
        ("LP", "a pair and a real one", 0.3),
    ),
)
def test_each_place_is_found(kind: str, case: str, steps: float) -> None:
    blocks, places = CASES[case]
    found = locus(kind, blocks, steps)
    assert [name for _, name in met(found)] == [MET[kind][what] for _, what in places]
    assert [q for q, _ in met(found)] == pytest.approx([q for q, _ in places], abs=2e-7)
    assert all(text.endswith("bound reached") for text in found.stopped)
    for point in found.special_points:
        assert saltus.verify(point).passed


@pytest.mark.parametrize("kind", ["TR", "SN"])
def test_orbits_of_flows(kind: str) -> None:
    """Multipliers of the rest are exp(2 pi (g +- i w)), of a driven fold 1 at a known place."""
    rest = {"x": "0.1*(q - 0.5)*x - 0.37*y - x*(x**2 + y**2)", "y": "0.1*(q - 0.5)*y + 0.37*x - y*(x**2 + y**2)"}
    if kind == "TR":
        own = {
            "u": "0.2*(p - 0.1*q)*u - 0.29*v - u*(u**2 + v**2)", "v": "0.2*(p - 0.1*q)*v + 0.29*u - v*(u**2 + v**2)",
            "s": "-0.1*(q - 0.503)*s - s**3",
        }  # fmt: skip
        x0, places = [0.0] * 5, [(0.5, "NSNS"), (0.503, "FNS")]
    else:
        own = {"u": "0.3*(p - 0.1*q) - u**2"}
        x0, places = [0.5, 0.0, 0.0], [(0.5, "FNS")]
    states = own | rest | {"d": "-d + cos(th)"}
    system = HybridSystem(tuple(states), {"p": 0.9, "q": 0.1, "w": 1.0}, {"all": Mode(states)}, phase=("th", "w"))
    branch = saltus.continue_orbit(saltus.solve_orbit(system, x0=[*x0, 0.5]), "p", (-1.0, 1.0))
    found = saltus.continue_locus(branch.special_points.of_type(kind)[0], ("p", "q"), WINDOW)
    assert met(found) == [(pytest.approx(q, abs=1e-8), name) for q, name in places]
    for point in found.special_points.of_type(places[0][1]):
        assert saltus.verify(point).passed


def test_other_multipliers_of_a_locus_of_branch_points() -> None:
    states = {
        "x": "(p - 0.1*q)*x - x**3", "y": "0.2*(q - 0.5)*y - y**3", "z": "0.2*(q - 0.503)*z - 0.3*w - z**3",
        "w": "0.2*(q - 0.503)*w + 0.3*z - w**3", "u": "cos(s) - u",
    }  # fmt: skip
    system = HybridSystem(tuple(states), {"p": -0.8, "q": 0.1, "w0": 1.0}, {"all": Mode(states)}, phase=("s", "w0"))
    branch = saltus.continue_orbit(saltus.solve_orbit(system, x0=[0.0, 0.0, 0.0, 0.0, 0.5]), "p", (-1.0, 1.0))
    found = saltus.continue_locus(branch.special_points.of_type("BP")[0], ("p", "q"), WINDOW)
    assert [(p.type, p.parameters["q"]) for p in found.special_points] == [
        ("SN", pytest.approx(0.5, abs=1e-9)), ("TR", pytest.approx(0.503, abs=1e-9)),
    ]  # fmt: skip


@pytest.mark.parametrize("steps", STEPS)
def test_a_locus_that_turns_where_a_second_part_folds(steps: float) -> None:
    """Both parameters turn where the second saddle-node is met: the locus goes on on its other sheet."""
    system = HybridSystem.smooth({"x": "p - x**2", "y": "q - y**2"}, {"p": 1.0, "q": 1.0})
    branch = saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=[1.0, 1.0]), "p", (-1.0, 2.0))
    found = saltus.continue_locus(branch["SN1"], ("p", "q"), WINDOW, steps=StepControl(largest=steps))
    assert [(p.type, p.parameters["q"]) for p in found.special_points if p.type != "TP"] == [
        ("SNSN", pytest.approx(0.0, abs=1e-9))
    ]
    assert sorted(found.column("y")[[0, -1]].tolist()) == pytest.approx([-(2.0**0.5), 2.0**0.5])


@pytest.mark.parametrize("steps", guarding(STEPS))
def test_a_double_value_is_no_further_one(steps: float) -> None:
    """From Bogdanov-Takens and 1:1 resonance points, too, whose second value is as critical as the first."""
    takens = HybridSystem.smooth({"x": "y", "y": "b1 + b2*x + x**2 - x*y"}, {"b1": -1.0, "b2": -1.0})
    rest = saltus.continue_equilibrium(saltus.find_equilibrium(takens, x0=[-0.6, 0.0]), "b1", (-2.0, 2.0))
    henon = Map(("x", "y"), {"a": 0.1, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"})
    orbits = saltus.continue_orbit(saltus.solve_orbit(henon, x0=[0.8, 0.2], period=1), "a", (-1.0, 2.0))
    control, window = (
        StepControl(largest=steps),
        {"b1": (-2.0, 2.0), "b2": (-2.0, 2.0), "a": (-3.0, 5.0), "b": (-2.0, 2.0)},
    )
    for first, names, double in (
        (rest["SN1"], ("b1", "b2"), "BT"),
        (orbits["SN1"], ("a", "b"), "R1"),
        (orbits["PD1"], ("a", "b"), "R2"),
    ):
        bounds = {name: window[name] for name in names}
        found = saltus.continue_locus(first, names, bounds, steps=control)
        again = saltus.continue_locus(
            found.special_points.of_type(double)[0], names, bounds, type=first.type, steps=control
        )
        for curve in (found, again):
            assert [p.type for p in curve.special_points if p.type != "TP"] == [double]


@pytest.mark.parametrize("fast", [1.0, 1e4, 1e8])
@pytest.mark.parametrize("slow", ["-5e-3", "-5e-9", "1e-3*(q - 0.5)"])
def test_a_slow_pair_beside_a_fast_value(slow: str, fast: float) -> None:
    """An eigenvalue of a size far from the others' neither hides a ZH nor shortens the steps."""
    states = {"x": "p - 0.1*q - x**2", "s": f"({slow})*s - z", "z": f"({slow})*z + s", "w": f"-{fast}*w"}
    system = HybridSystem(tuple(states), {"p": 0.5, "q": 0.1}, {"all": Mode(states)})
    branch = saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=[0.7, 0.0, 0.0, 0.0]), "p", (-1.0, 1.0))
    found = saltus.continue_locus(branch["SN1"], ("p", "q"), WINDOW)
    assert met(found) == ([(pytest.approx(0.5, abs=1e-6), "ZH")] if "q" in slow else [])
    assert all(text.endswith("bound reached") for text in found.stopped)
    assert len(found) < 60


@pytest.mark.parametrize("growth", ["-5e-9", "-3e-9*(1 + q**2)", "1e-8*(q - 0.5)"])
def test_a_multiplier_that_stays_next_to_the_circle(growth: str) -> None:
    found = locus("TR", [("fold", growth)])
    assert met(found) == ([(pytest.approx(0.5, abs=0.01), "FNS")] if "0.5" in growth else [])
    assert all(text.endswith("bound reached") for text in found.stopped)
    assert len(found) < 60


def test_a_locus_goes_through_the_point_from_which_it_starts() -> None:
    found = locus("TR", CASES["two pairs"][0])
    for label in ("NSNS1", "NSNS2"):
        again = saltus.continue_locus(found[label], ("p", "q"), WINDOW)
        assert again.type == "TR"
        assert label[:-1] in [point.type for point in again.special_points]
    assert found["NSNS1"].parameters["p"] == pytest.approx(0.05, abs=1e-9)


def test_tori_and_flips_are_found_where_a_quantity_keeps_its_value() -> None:
    """The fixed point x = a of the first block keeps its value; the pair turns with 1 + q - 0.5."""
    c, s = math.cos(1.1), math.sin(1.1)
    images = {
        "x": "0.5*x + 0.5*p",
        "y": f"(1 + 0.2*(q - 0.5))*({c}*y - {s}*z) - y*(y**2 + z**2)",
        "z": f"(1 + 0.2*(q - 0.5))*({s}*y + {c}*z) - z*(y**2 + z**2)",
        "f": "-(1 + 0.2*(q - 0.503))*f - f**3",
    }
    system = Map(tuple(images), {"p": -0.9, "q": 0.1}, images)
    orbit = saltus.solve_orbit(system, x0=[-0.9, 0.0, 0.0, 0.0], period=1)
    branch = saltus.continue_orbit(orbit, "p", (-1.0, 1.0), events={"x": 0.25})
    (place,) = branch.special_points.of_type("x")
    found = saltus.continue_locus(place, ("p", "q"), WINDOW)
    assert [(p.type, p.parameters["q"]) for p in found.special_points if p.type != "TP"] == [
        ("TR", pytest.approx(0.5, abs=1e-9)), ("PD", pytest.approx(0.503, abs=1e-9)),
    ]  # fmt: skip


def random_blocks(seed: int, kind: str) -> tuple[list[Block], list[tuple[float, str]], float, np.ndarray]:
    """Return blocks at random, where they are critical, a length of steps, and turned axes."""
    random = np.random.default_rng(seed)
    blocks: list[Block] = []
    places: list[tuple[float, str]] = []
    for _ in range(int(random.integers(1, 4))):
        what = str(random.choice([what for what in MET[kind] if what in ("pair", "fold", "flip")]))
        place, slope = float(random.uniform(-0.3, 1.7)), float(random.choice([-1, 1]) * random.uniform(0.1, 0.5))
        if places and random.random() < 0.4:
            place = places[-1][0] + float(random.choice([-1, 1]) * 10.0 ** random.uniform(-3.5, -1.5))
        half = float(10.0 ** random.uniform(-3.0, -0.5))
        shape = random.choice(["line", "dip", "steady"])
        if shape == "steady":
            blocks.append((what, repr(-abs(slope))))
            continue
        # growths above -2: a multiplier 1 + growth would be critical on the other side of the circle
        blocks.append((what, line(place, slope) if shape == "line" else dip(place, half, 0.6 * slope)))
        places += [
            (q, what) for q in ([place] if shape == "line" else [place - half, place + half]) if -0.45 < q < 1.95
        ]
    size = len(fields(kind, blocks))
    return blocks, sorted(places), float(random.choice(STEPS)), np.linalg.qr(random.normal(size=(size, size)))[0]


@pytest.mark.parametrize(
    ("kind", "seed"), guarding([(kind, seed) for seed in range(60) for kind in MET], ("SN", 9), campaign=10)
)
def test_random_blocks_in_turned_axes(kind: str, seed: int) -> None:
    blocks, places, steps, axes = random_blocks(seed, kind)
    if len(axes) > 5:
        axes = None  # SymPy takes long for the cubes of many states
    found = locus(kind, blocks, steps, axes)
    wanted = [MET[kind][what] for _, what in places]
    assert [name for _, name in met(found)] == wanted, (places, met(found))
    assert [q for q, _ in met(found)] == pytest.approx([q for q, _ in places], abs=1e-6)


def test_values_that_stay_on_the_circle_have_no_points() -> None:
    """Multipliers of a conservative block are on the circle all along: their rounding is no crossing."""
    beside = multipliers_beside("TR")
    free = np.exp(1j * np.array([0.7, -0.7])) * (1.0 + 1e-15)
    first = np.concatenate([free, [0.5]])
    assert list(beside.measured(first, None).values()) == [pytest.approx(-0.6)]
    assert list(beside.measured(np.concatenate([free * (1.0 - 1e-14), [1.5]]), None).values()) == [
        pytest.approx(5.0 / 13.0)
    ]


def test_critical_multipliers_are_left_out() -> None:
    pair = np.exp(1j * np.array([0.7, -0.7]))
    values = np.array([2.0, *pair, 0.5, -0.99])
    assert without_critical("TR", values, math.cos(0.7)).tolist() == [2.0, 0.5, -0.99]
    interleaved = np.array([np.inf, pair[0], pair[0], pair[1], pair[1]])  # two pairs at one place: conjugates go
    assert without_critical("TR", interleaved, math.cos(0.7)).tolist() == [np.inf, *pair]
    assert without_critical("PD", values, math.nan).tolist() == [2.0, *pair, 0.5]
    assert without_critical("GR", values, math.nan).tolist() == []
    double = np.array([-1.0 + 1e-8j, -1.0 - 1e-8j, -1.0 + 1e-6])  # twins, and another one
    assert without_critical("PD", double, math.nan).tolist() == [-1.0, -1.0 + 1e-6]


def coupled(kind: str, seed: int, steps: float) -> list[tuple[str, float, float]]:
    """Return the points on a locus of a linear part without structure, whose entries depend on p and q."""
    random = np.random.default_rng(seed)
    n = int(random.integers(4, 7))
    first = 1.0 if kind == "HB" else 0.9
    parts = [(random.normal(size=(n, n)) * size / math.sqrt(n)).tolist() for size in (first, 0.8, 0.8)]
    names = [f"x{i}" for i in range(n)]
    rows = [
        " + ".join(
            f"({parts[0][i][j]} + ({parts[1][i][j]})*p + ({parts[2][i][j]})*q)*{name}" for j, name in enumerate(names)
        )
        for i in range(n)
    ]
    images = {name: f"{row} - {name}**3" for name, row in zip(names, rows, strict=True)}
    start, ends = {"p": -1.5, "q": 0.0}, (-1.5, 1.5)
    if kind == "HB":
        rest = saltus.find_equilibrium(HybridSystem(tuple(names), start, {"all": Mode(images)}), x0=np.zeros(n))
        branch: Any = saltus.continue_equilibrium(rest, "p", ends)
    else:
        clocked = saltus.Transition("wait", "wait", "s - 1", 1, images | {"s": "0"}, name="map")
        wait = Mode(dict.fromkeys(names, "0") | {"s": "1"})
        system = HybridSystem((*names, "s"), start, {"wait": wait}, [clocked])
        orbit = saltus.solve_orbit(system, segments=[("wait", "map", np.zeros(n + 1), 1.0)])
        branch = saltus.continue_orbit(orbit, "p", ends)
    points = branch.special_points.of_type(kind)
    if not points:
        return []
    found = saltus.continue_locus(points[0], ("p", "q"), {"p": ends, "q": ends}, steps=StepControl(largest=steps))
    return sorted((p.type, *map(float, p.parameters.values())) for p in found.special_points if p.type != "TP")


@pytest.mark.parametrize("kind", ["HB", "TR", "PD"])
@pytest.mark.parametrize("seed", guarding(range(6), campaign=2))
def test_steps_of_any_length_find_the_same(kind: str, seed: int) -> None:
    fine, usual, long = (coupled(kind, seed, steps) for steps in (0.01, 0.1, 0.3))
    for found in (usual, long):
        assert [name for name, *_ in found] == [name for name, *_ in fine]
        for (_, *one), (_, *other) in zip(found, fine, strict=True):
            assert one == pytest.approx(other, abs=1e-6)
