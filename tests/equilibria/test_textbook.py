"""Textbook systems: equilibria, special points and normal forms against values that mpmath computed apart.

`oracles/textbook.py` lists the systems with their sources, `oracles/textbook_values.py` says how the values were found.
"""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from oracles.textbook import TEXTBOOK, Textbook
from saltus import (
    HybridSystem,
    Mode,
    StepControl,
    Transition,
    continue_equilibrium,
    continue_orbit,
    find_equilibrium,
    switch_branch,
)
from saltus.results import EquilibriumBranch
from selection import guarding

VALUES = json.loads((Path(__file__).parents[1] / "oracles" / "textbook.json").read_text(encoding="utf-8"))
ACCURATE = 1e-10
KEPT = {
    *("Brusselator", "Morris-Lecar, SNIC", "Bazykin", "Lorenz, convection", "Hindmarsh-Rose", "Rucklidge"),
    *("two coupled Brusselators", "Goodwin", "toggle switch", "Hodgkin-Huxley"),
}
SOME = 12
"""Further systems that the campaign runs; all run before a release."""

HOPF = [(name, i) for name in TEXTBOOK for i, entry in enumerate(VALUES[name]["special"]) if entry["type"] == "HB"]


def some(names: Iterable[str]) -> list[Any]:
    """Return the names of systems as parameters; of those not kept the campaign runs some."""
    names = list(names)
    return guarding(names, *(name for name in names if name in KEPT), campaign=SOME)


@functools.cache
def system(name: str) -> HybridSystem:
    item = TEXTBOOK[name]
    return HybridSystem(item.states, item.parameters, {"flow": Mode(item.field)}, name=name)


@functools.cache
def branch(name: str) -> EquilibriumBranch:
    item = TEXTBOOK[name]
    return continue_equilibrium(start(item, system(name)), item.parameter, item.bounds)


def start(item: Textbook, of: HybridSystem, x0: Any = None) -> Any:
    return find_equilibrium(of, {item.parameter: item.value}, item.start if x0 is None else x0)


def sizes(found: EquilibriumBranch) -> NDArray[np.float64]:
    """Return sizes of the states; one that rests at zero has the size of the others."""
    largest = np.abs(found.states).max(axis=0)
    top = float(largest.max()) or 1.0
    return np.where(largest > 1e-9 * top, largest, top)


def expected(name: str) -> list[dict[str, Any]]:
    return sorted(VALUES[name]["special"], key=lambda e: (e["type"], round(e["p"], 7), np.round(e["x"], 4).tolist()))


def found_points(name: str) -> list[Any]:
    points = branch(name).special_points
    values = {id(point): point.parameters[TEXTBOOK[name].parameter] for point in points}
    return sorted(points, key=lambda q: (q.type, round(values[id(q)], 7), np.round(q.equilibrium.state, 4).tolist()))


def hopf_point(name: str, entry: dict[str, Any]) -> Any:
    return found_points(name)[expected(name).index(entry)]


@pytest.mark.parametrize("name", some(TEXTBOOK))
def test_newton_finds_the_equilibria_that_mpmath_finds(name: str) -> None:
    item, size = TEXTBOOK[name], sizes(branch(name))
    signs = np.where(np.arange(size.size) % 2, 1.0, -1.0)
    for value, states in VALUES[name]["equilibria"].items():
        for state in np.array(states):
            for share in (1e-4, -1e-3):
                found = find_equilibrium(system(name), {item.parameter: float(value)}, state + share * signs * size)
                assert np.all(np.abs(found.state - state) <= ACCURATE * np.maximum(np.abs(state), 1e-6 * size))


@pytest.mark.parametrize("name", some(TEXTBOOK))
def test_special_points_are_those_of_a_dense_scan(name: str) -> None:
    item, points = TEXTBOOK[name], found_points(name)
    assert [point.type for point in points] == [entry["type"] for entry in expected(name)]
    for point, entry in zip(points, expected(name), strict=True):
        unit = abs(entry["p"]) or item.bounds[1] - item.bounds[0]
        assert abs(point.parameters[item.parameter] - entry["p"]) <= ACCURATE * unit
        assert np.all(np.abs(point.equilibrium.state - entry["x"]) <= ACCURATE * sizes(branch(name)))


@pytest.mark.parametrize(("name", "index"), guarding(HOPF, *(row for row in HOPF if row[0] in KEPT), campaign=SOME))
def test_first_lyapunov_coefficient_is_that_of_the_centre_manifold(name: str, index: int) -> None:
    entry = VALUES[name]["special"][index]
    form = hopf_point(name, entry).normal_form
    assert form.frequency == pytest.approx(entry["frequency"], rel=1e-9)
    assert form.coefficient == pytest.approx(entry["l1"], rel=1e-6, abs=0.0)
    kinds = {-1.0: "supercritical", 0.0: "degenerate", 1.0: "subcritical"}
    assert form.criticality == kinds[float(np.sign(entry["l1"]))]


@pytest.mark.parametrize(("name", "index"), guarding(HOPF, *(row for row in HOPF if row[0] in KEPT), campaign=SOME))
def test_cycles_are_born_on_the_side_and_with_the_stability_that_l1_tells(name: str, index: int) -> None:
    entry, parameter = VALUES[name]["special"][index], TEXTBOOK[name].parameter
    cycle = switch_branch(hopf_point(name, entry))
    shift = cycle.parameters[parameter] - entry["p"]
    assert cycle.period == pytest.approx(2.0 * np.pi / entry["frequency"], rel=1e-2)
    if entry["l1"] == 0.0:
        assert abs(shift) < 1e-9 * (TEXTBOOK[name].bounds[1] - TEXTBOOK[name].bounds[0])
    else:
        assert np.sign(shift) == -np.sign(entry["l1"] * entry["speed"])
        assert cycle.stable == (entry["l1"] < 0.0 and entry["attracting"])


ENDS = {
    "Brusselator": ("shrinks", "bound"),
    "Rayleigh": ("shrinks", "bound"),
    "Rosenzweig-MacArthur": ("shrinks", "bound"),
    "Holling-Tanner": ("bound", "shrinks"),
    "Sel'kov": ("shrinks", "shrinks"),
    "Schnakenberg": ("shrinks", "shrinks"),
    "stirred tank, two Hopf points": ("shrinks", "shrinks"),
    "Higgins": ("shrinks", "shrinks"),
    "autocatalator": ("shrinks", "shrinks"),
    "Goodwin": ("bound", "shrinks"),
    "repressilator": ("shrinks", "bound"),
    "Lur'e feedback": ("bound", "shrinks"),
    "Chua, cubic": ("shrinks", "bound"),
    "Roessler, a": ("shrinks", "bound"),
    "Sprott H": ("shrinks", "bound"),
    "Genesio-Tesi": ("shrinks", "bound"),
    "Colpitts oscillator": ("shrinks", "bound"),
    "Langford": ("shrinks", "bound"),
    "prey with Allee effect": ("period grows", "shrinks"),
    "Rucklidge": ("shrinks", "period grows"),
    "laser with saturable absorber": ("shrinks", "period grows"),
}


@pytest.mark.campaign
@pytest.mark.parametrize("name", some(ENDS))
def test_cycles_are_followed_from_their_birth_to_a_stated_end(name: str) -> None:
    item = TEXTBOOK[name]
    cycle = switch_branch(branch(name)["HB1"])
    cycles = continue_orbit(cycle, item.parameter, item.bounds, steps=StepControl(max_points=150))
    for end, words in zip(cycles.stopped, ENDS[name], strict=True):
        assert words in end


def test_cycles_of_a_linear_field_at_one_value_have_no_saddle_nodes_before_they_graze() -> None:
    # Chua's piecewise-linear circuit, Matsumoto, IEEE Trans. Circuits Syst. 31 (1984) 1055: beside its outer
    # equilibrium the field is linear, and at the Hopf point a plane is full of cycles up to the one that touches x = 1
    outer = {"x": "a*(y - x - m*x - n + m)", "y": "x - y + z", "z": "-b*y"}
    circuit = HybridSystem(
        ("x", "y", "z"),
        {"a": 6.0, "b": 14.0, "m": -0.2, "n": -1.27},
        {"outer": Mode(outer), "inner": Mode(outer | {"x": "a*(y - x - n*x)"})},
        [Transition("outer", "inner", "x - 1", -1, {}), Transition("inner", "outer", "x - 1", 1, {})],
    )
    found = continue_equilibrium(find_equilibrium(circuit, x0=[1.3, 0.0, -1.3], mode="outer"), "a", (4.0, 12.0))
    cycle = switch_branch(found["HB1"])
    for steps in (StepControl(), StepControl(initial=0.003, largest=0.02), StepControl(initial=0.1, largest=0.3)):
        cycles = continue_orbit(cycle, "a", (4.0, 12.0), steps=steps)
        resting = [q.type for q in cycles.special_points if abs(q.parameters["a"] - 8.75) < 1e-6]
        assert resting == ["HB", "GR"]
        assert "bound" in cycles.stopped[1]


BRANCHING = [name for name in TEXTBOOK if any(entry["type"] == "BP" for entry in VALUES[name]["special"])]


@pytest.mark.parametrize("name", some(BRANCHING))
def test_the_other_branch_at_a_branch_point_begins_there_and_is_not_the_own_one(name: str) -> None:
    item, own = TEXTBOOK[name], branch(name)
    unit = np.append(sizes(own), item.bounds[1] - item.bounds[0])
    line = np.column_stack([own.states, own.values]) / unit
    for point in (q for q in own.special_points if q.type == "BP"):
        other = switch_branch(point)
        there = np.append(other.state, other.parameters[item.parameter]) / unit
        crossing = np.append(point.equilibrium.state, point.parameters[item.parameter]) / unit
        assert other.residual < 1e-9
        away = np.linalg.norm(there - crossing)
        assert 0.0 < away < 0.1
        ends = np.vstack([line, crossing])[np.argsort(np.append(own.arclength, point.arclength))]
        chords = np.diff(ends, axis=0)
        shares = np.clip(np.sum((there - ends[:-1]) * chords, axis=1) / np.sum(chords**2, axis=1), 0.0, 1.0)
        assert np.linalg.norm(there - ends[:-1] - shares[:, None] * chords, axis=1).min() > 0.02 * away


RESCALED = [
    *("Lorenz, convection", "Roessler, a", "Brusselator", "Morris-Lecar, SNIC", "Bazykin", "Rosenzweig-MacArthur"),
    *("stirred tank, hysteresis", "Chen", "Gray-Scott", "toggle switch", "Hindmarsh-Rose", "two coupled Brusselators"),
    *("SIRS, nonlinear incidence", "pendulum with torque", "Rucklidge", "Leslie-Gower, modified", "Hodgkin-Huxley"),
]


@functools.cache
def movable(name: str) -> HybridSystem:
    """Return a system in the states X = unit x + offset, whose units and origin are parameters."""
    item = TEXTBOOK[name]
    units = {state: f"unit{i}" for i, state in enumerate(item.states)}
    old = {state: f"((({state}) - offset)/{unit})" for state, unit in units.items()}
    word = re.compile(rf"\b({'|'.join(item.states)})\b")
    field = {
        state: f"{unit}*({word.sub(lambda found: old[found[1]], item.field[state])})" for state, unit in units.items()
    }
    parameters = {**item.parameters, **dict.fromkeys(units.values(), 1.0), "offset": 0.0}
    return HybridSystem(item.states, parameters, {"flow": Mode(field)}, name=item.name)


def same_points(name: str, found: EquilibriumBranch, accuracy: float) -> None:
    item = TEXTBOOK[name]
    points = sorted((point.type, point.parameters[item.parameter]) for point in found.special_points)
    wanted = sorted((entry["type"], entry["p"]) for entry in VALUES[name]["special"])
    assert [kind for kind, _ in points] == [kind for kind, _ in wanted]
    width = item.bounds[1] - item.bounds[0]
    for (_, value), (_, exact) in zip(points, wanted, strict=True):
        assert abs(value - exact) <= accuracy * width


@pytest.mark.parametrize("name", some(RESCALED))
@pytest.mark.parametrize("kind", guarding(["tiny", "mixed", "offset"], "mixed"))
def test_special_points_do_not_depend_on_units_and_origin_of_the_states(name: str, kind: str) -> None:
    item, n = TEXTBOOK[name], len(TEXTBOOK[name].states)
    units = (
        [1e-9] * n if kind == "tiny" else [1e-9 if i % 2 else 1e6 for i in range(n)] if kind == "mixed" else [1.0] * n
    )
    offset = 300.0 if kind == "offset" else 0.0
    place = {item.parameter: item.value, "offset": offset} | {f"unit{i}": unit for i, unit in enumerate(units)}
    first = find_equilibrium(movable(name), place, np.array(units) * np.array(item.start) + offset)
    same_points(name, continue_equilibrium(first, item.parameter, item.bounds), 1e-9)


STEPS = {
    "long": StepControl(initial=0.1, largest=0.5),
    "short": StepControl(initial=1e-3, largest=0.02),
    "loose": StepControl(initial=0.05, largest=1.0, angle=1.0, deviation=3e-3),
}


@pytest.mark.parametrize("name", some(TEXTBOOK))
@pytest.mark.parametrize("length", STEPS)
def test_special_points_do_not_depend_on_the_steps(name: str, length: str) -> None:
    item = TEXTBOOK[name]
    first = start(item, system(name))
    same_points(name, continue_equilibrium(first, item.parameter, item.bounds, steps=STEPS[length]), ACCURATE)


@pytest.mark.parametrize("name", some(RESCALED))
def test_both_directions_together_find_the_special_points(name: str) -> None:
    item = TEXTBOOK[name]
    first = start(item, system(name))
    halves = [continue_equilibrium(first, item.parameter, item.bounds, directions=way) for way in ("up", "down")]
    closed = any("closed" in end for half in halves for end in half.stopped)
    points = [point.type for half in halves[: 1 if closed else 2] for point in half.special_points]
    assert sorted(points) == sorted(entry["type"] for entry in VALUES[name]["special"])
