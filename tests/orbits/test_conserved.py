"""Orbits of systems with linear first integrals: isolated, stable and critical at the totals of their start."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import networks
import saltus
from saltus import HybridSystem, Mode, Transition
from saltus.errors import InputError
from selection import guarding

FIELD = {"u1": "i", "u2": "i/2", "i": "sin(th)-u1-u2-0.5*i"}
SERIES = HybridSystem(("u1", "u2", "i"), {"w": 1.1}, {"m": Mode(FIELD)}, phase=("th", "w"))
# current of the series circuit: 1 / abs(0.5 + i w + 1.5 / (i w)) at w = 1.1
CURRENT = 1.0 / abs(0.5 + 1j * 1.1 + 1.5 / (1j * 1.1))
PARTS = {"w": 1.1, "C1": 1.0, "C2": 2.0, "R": 0.1, "A": 3.0}
CHARGED = HybridSystem(
    ("u1", "u2", "i"),
    PARTS,
    {"m": Mode({"u1": "i/C1", "u2": "i/C2", "i": "A*sin(th)-u1-u2-R*i-0.3*u1**3"})},
    phase=("th", "w"),
)
BY_HAND = HybridSystem(
    ("u1", "i"),
    {**PARTS, "q": 0.1},
    {"m": Mode({"u1": "i/C1", "i": "A*sin(th)-u1-(C1*u1-q)/C2-R*i-0.3*u1**3"})},
    phase=("th", "w"),
)
MASSES = {"k": 1.0, "e": 0.7, "m1": 1.0, "m2": 2.0, "d": 0.1, "A": 0.5, "w": 1.3, "g": 0.3}
FREE = HybridSystem(
    ("y", "v1", "v2"),
    MASSES,
    {"f": Mode({"y": "v2-v1", "v1": "(k*y+d*(v2-v1)+A*cos(th))/m1", "v2": "(-k*y-d*(v2-v1)-A*cos(th))/m2"})},
    [
        Transition(
            "f",
            "f",
            "y+g",
            -1,
            {"v1": "v1+(1+e)*m2/(m1+m2)*(v2-v1)", "v2": "v2-(1+e)*m1/(m1+m2)*(v2-v1)"},
            name="hit",
        )
    ],
    phase=("th", "w"),
)
RELATIVE = HybridSystem(
    ("y", "u"),
    MASSES,
    {"f": Mode({"y": "u", "u": "(-k*y-d*u-A*cos(th))*(1/m2+1/m1)"})},
    [Transition("f", "f", "y+g", -1, {"u": "-e*u"}, name="hit")],
    phase=("th", "w"),
)


def _points(curve: Any, *names: str) -> list[tuple[Any, ...]]:
    return [(p.type, *(round(p.solution.parameters[name], 8) for name in names)) for p in curve.special_points]


@pytest.mark.parametrize("x0", [[0.0, 0.0, 0.0], [0.5, 0.2, 0.1]])
def test_a_series_circuit_keeps_its_charge(x0: list[float]) -> None:
    found = saltus.find_orbit(SERIES, x0=x0)
    assert found.max["i"] == pytest.approx(CURRENT, rel=1e-11)
    assert found.conserved == {"u1 - 2*u2": pytest.approx(x0[0] - 2.0 * x0[1], abs=1e-13)}
    # the other two are those of i' + i/2 + 1.5 q, q' = i over the period
    np.testing.assert_allclose(np.abs(found.multipliers), math.exp(-0.25 * found.period), rtol=1e-9)
    assert found.stable
    again = saltus.solve_orbit(SERIES, x0=x0)
    np.testing.assert_allclose(again.x0, found.x0, rtol=1e-9)


def test_a_branch_of_orbits_keeps_the_charge() -> None:
    branch = saltus.continue_orbit(saltus.find_orbit(SERIES, x0=[0.5, 0.2, 0.1]), "w", (0.5, 2.0))
    assert branch.stopped == ("w = 0.5: bound reached", "w = 2: bound reached")
    assert not branch.special_points
    assert not branch.audit.lines()
    np.testing.assert_allclose(branch.x0 @ [1.0, -2.0, 0.0], 0.1, rtol=1e-12)
    at = branch.values
    np.testing.assert_allclose(branch.column("max_i"), 1.0 / np.abs(0.5 + 1j * at + 1.5 / (1j * at)), rtol=1e-8)


def test_the_period_of_a_drive_may_be_named() -> None:
    period = 2.0 * math.pi / 1.1
    found = saltus.solve_orbit(SERIES, x0=[0.5, 0.2, 0.1], fix={"period": period})
    assert found.max["i"] == pytest.approx(CURRENT, rel=1e-11)
    with pytest.raises(InputError, match=r"fix\['period'\] = 5.7: must be 5.711986.*a parameter to free"):
        saltus.solve_orbit(SERIES, x0=[0.5, 0.2, 0.1], fix={"period": 5.7})


@pytest.mark.parametrize(("name", "value"), [("mean(u1-2*u2)", 0.0), ("mean(2*u1-4*u2)", 0.0), ("mean(u1)", 0.0)])
def test_a_quantity_that_is_fixed_frees_the_total(name: str, value: float) -> None:
    found = saltus.solve_orbit(SERIES, x0=[0.5, 0.2, 0.1], fix={name: value})
    assert found.observe(name)[name] == pytest.approx(value, abs=1e-10)
    assert found.max["i"] == pytest.approx(CURRENT, rel=1e-10)
    along = saltus.continue_orbit(
        saltus.solve_orbit(SERIES, x0=[0.5, 0.2, 0.1], fix={"max_u1": 2.0}), "max_u1", (1.8, 2.2)
    )
    assert along.stopped == ("max_u1 = 1.8: bound reached", "max_u1 = 2.2: bound reached")
    np.testing.assert_allclose(along.column("max_u1"), along.values, rtol=1e-10)
    assert "conserved" not in repr(along)


def test_one_of_several_totals_is_named_to_be_freed() -> None:
    both = HybridSystem(
        ("u1", "u2", "u3", "i"),
        {"w": 1.1},
        {"m": Mode({"u1": "i", "u2": "i/2", "u3": "i/3", "i": "sin(th)-u1-u2-u3-0.5*i"})},
        phase=("th", "w"),
    )
    assert len(both.conserved) == 2
    start = saltus.find_orbit(both, x0=[0.5, 0.2, 0.1, 0.0])
    first, second = both.conserved
    found = saltus.solve_orbit(both, x0=[0.5, 0.2, 0.1, 0.0], fix={f"mean({first})": 0.3})
    assert found.conserved[first] == pytest.approx(0.3, abs=1e-11)
    assert found.conserved[second] == pytest.approx(start.conserved[second], abs=1e-12)
    with pytest.raises(InputError, match="a conserved total, or with a parameter to free"):
        saltus.solve_orbit(both, x0=[0.5, 0.2, 0.1, 0.0], fix={"max_u1": 2.0})


def test_folds_and_their_locus_are_those_of_the_circuit_by_hand() -> None:
    found = []
    for system, x0 in ((CHARGED, [0.5, 0.2, 0.0]), (BY_HAND, [0.5, 0.0])):
        branch = saltus.continue_orbit(saltus.find_orbit(system, x0=x0), "w", (0.8, 4.0))
        assert not branch.audit.lines()
        locus = saltus.continue_locus(branch.special_points[0], ("w", "C1"), {"w": (0.5, 4.5), "C1": (0.8, 1.3)})
        found.append((_points(branch, "w"), [row.tolist() for row in (locus.values[0], locus.values[-1])]))
    assert found[0][0] == found[1][0]
    np.testing.assert_allclose(found[0][1], found[1][1], rtol=1e-8)


def test_colliding_masses_keep_their_momentum() -> None:
    whole, by_hand = saltus.find_orbit(FREE, x0=[0.0, 0.3, 0.1]), saltus.find_orbit(RELATIVE, x0=[0.0, -0.2])
    assert whole.signature == by_hand.signature
    assert whole.period == pytest.approx(by_hand.period, rel=1e-12)
    np.testing.assert_allclose(whole.multipliers, by_hand.multipliers, rtol=1e-8)
    assert whole.conserved == {"m1*v1 + m2*v2": pytest.approx(0.5, rel=1e-12)}
    branch = saltus.continue_orbit(whole, "m1", (0.7, 1.5))
    np.testing.assert_allclose(branch.x0[:, 1] * branch.values + 2.0 * branch.x0[:, 2], 0.5, rtol=1e-10)


CYCLES = [(seed, tolerance) for seed in (2, 7, 4, 5) for tolerance in (1e-12, 1e-8)]


@pytest.mark.parametrize(("seed", "tolerance"), guarding(CYCLES))
def test_cycles_of_a_network_are_those_with_species_eliminated(seed: int, tolerance: float) -> None:
    network, found = networks.oscillating(seed), []
    start = network.near()
    for system, x0 in ((network.system, start), (network.reduced, network.kept(start))):
        rests = saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=x0), "k", (0.02, 3.0))
        hopf = next(point for point in rests.special_points if point.type == "HB")
        branch = saltus.continue_orbit(saltus.switch_branch(hopf), "k", (0.3, 3.0))
        assert not branch.audit.lines()
        last = saltus.solve_orbit(system, {"k": 0.3}, x0=branch.x0[-1], period=branch.period[-1], tolerance=tolerance)
        found.append((_points(branch, "k"), last.period, np.sort(np.abs(last.multipliers))))
    types, wanted = ([point[0] for point in points] for points, *_ in found)
    assert types == wanted
    np.testing.assert_allclose(*([point[1] for point in points] for points, *_ in found), rtol=1e-6)
    assert found[0][1] == pytest.approx(found[1][1], rel=100.0 * tolerance + 1e-11)
    np.testing.assert_allclose(found[0][2], found[1][2], rtol=1e-5, atol=1e-5)
