"""No point has a name that it owes to rounding, where equations degenerate: closed forms say which points there are."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import (
    HybridSystem,
    Map,
    Mode,
    Transition,
    continue_equilibrium,
    continue_locus,
    continue_orbit,
    filippov,
    find_equilibrium,
    find_orbit,
    load,
    solve_orbit,
    switch_branch,
)
from selection import guarding


def _embedded(field, seed, beside=2):
    """Return a system in random coordinates: x' = field of x, and stable directions beside it that x drives."""
    rng = np.random.default_rng(seed)
    n = 1 + beside
    A = np.linalg.qr(rng.normal(size=(n, n)))[0] @ np.diag(rng.uniform(0.5, 2.0, n))
    inverse = np.linalg.inv(A)
    names = [f"q{i}" for i in range(n)]
    z = [f"({' + '.join(f'({float(c)!r})*{name}' for c, name in zip(row, names, strict=True))})" for row in inverse]
    rates = [field.replace("x", z[0]), *(f"-{i}*{z[i]} + 0.3*{z[0]}**2" for i in range(1, n))]
    system = HybridSystem.smooth(
        {q: " + ".join(f"({float(c)!r})*({rate})" for c, rate in zip(row, rates, strict=True))
         for q, row in zip(names, A, strict=True)},
        {"r": -0.3, "K": 0.5},
    )  # fmt: skip
    return system, A


def _fold_locus(field, seed, start):
    system, A = _embedded(field, seed)
    rest = find_equilibrium(system, x0=(A @ [start, 0.3 * start**2, 0.15 * start**2]).tolist())
    branch = continue_equilibrium(rest, "r", (-2.0, 2.0))
    return continue_locus(branch["SN1"], ("r", "K"), {"r": (-2.0, 2.0), "K": (-1.0, 1.0)})


# fields whose quadratic coefficient vanishes at K = 0, and with it all that unfolds a cusp
FIELDS = ["K*(r + x**2)", "K*(r + x**2 + x**3)", "r + K*x**2", "K*(r + 2*x**2 - x**4)"]


@pytest.mark.parametrize(
    ("field", "seed"), guarding([(f, s) for f in FIELDS for s in range(4)], *[(f, 0) for f in FIELDS], campaign=4)
)
def test_a_coefficient_that_vanishes_with_the_whole_field_is_no_cusp(field, seed):
    locus = _fold_locus(
        field, seed, (0.3 if "r + K" not in field else 0.6) ** 0.5 / (2.0**0.5 if "2*x" in field else 1)
    )
    assert not [point.label for point in locus.special_points if point.type != "TP"]
    assert len(locus.audit.remarks) == 1
    assert "no CP" in locus.audit.remarks[0]
    assert locus.audit.passed


@pytest.mark.parametrize(("seed"), guarding(range(4), 0, campaign=1))
def test_a_cusp_that_is_one_keeps_its_name(seed):
    system, A = _embedded("r + K*x - x**3", seed)
    rest = find_equilibrium(system, x0=(A @ [-0.8437, 0.2, 0.1]).tolist())
    branch = continue_equilibrium(rest, "r", (-2.0, 2.0))
    locus = continue_locus(branch["SN1"], ("r", "K"), {"r": (-2.0, 2.0), "K": (-1.0, 1.0)})
    (cusp,) = [point for point in locus.special_points if point.type == "CP"]
    assert abs(cusp.parameters["r"]) < 1e-9
    assert abs(cusp.parameters["K"]) < 1e-9
    assert not locus.audit.remarks


def test_a_laser_without_injection_has_a_circle_of_rests_and_no_cusp(tmp_path):
    laser = HybridSystem.smooth(
        {
            "x": "K + (x*n - 2*y*n)/2 + w*y",
            "y": "(y*n + 2*x*n)/2 - w*x",
            "n": "-0.07*n - (1 + 0.03*n)*(x**2 + y**2 - 1)",
        },
        {"K": 0.3, "w": -0.1},
    )
    branch = continue_equilibrium(find_equilibrium(laser, x0=[1.0, 0.0, -0.1]), "w", (-4.0, 4.0))
    locus = continue_locus(branch["SN1"], ("w", "K"), {"w": (-6.0, 6.0), "K": (0.0, 2.0)})
    assert not [point for point in locus.special_points if point.type == "CP"]
    assert "degenerate" in repr(locus)
    path = tmp_path / "locus.nc"
    locus.save(path)
    assert load(path).audit == locus.audit


@pytest.mark.parametrize(
    ("b", "unit"), guarding([(b, u) for u in (1.0, 1e9, 1e-9) for b in (0.6, 0.55, 0.7)], (0.6, 1.0), campaign=2)
)
def test_three_species_have_a_family_of_cycles_and_no_fold(b, unit):
    names = ("x", "y", "z")
    field = {
        one: f"{one}*(1 - ({one} + a*{other} + {b}*{third})/{unit!r})"
        for one, other, third in (names, names[1:] + names[:1], names[2:] + names[:2])
    }
    system = HybridSystem.smooth(field, {"a": 0.8})
    rest = find_equilibrium(system, x0=[0.4 * unit] * 3)
    hopf = continue_equilibrium(rest, "a", (-0.3, 3.0))["HB1"]
    assert hopf.parameters["a"] == pytest.approx(2.0 - b, abs=1e-9)  # a + b = 2: May and Leonard, Eq. (14)
    cycles = continue_orbit(switch_branch(hopf), "a", (0.5, 2.0))
    assert [point.type for point in cycles.special_points] == ["HB"]
    assert np.ptp(cycles.values) < 1e-9
    assert any("a rests at" in remark for remark in cycles.audit.remarks)
    assert not cycles.audit.breaches


@pytest.mark.parametrize(
    ("k", "unit"), guarding([(k, u) for u in (1.0, 1e6, 1e-6) for k in (0.8, 0.9, 0.7)], (0.8, 1.0), campaign=2)
)
def test_sliding_at_two_folds_that_meet_has_no_branch_point(k, unit):
    # rests slide where S = T/(2 - T) in units: one curve, which crosses eps = 0 where the sliding field is 0/0
    system = filippov(
        ("T", "S"),
        {"eps": 0.01 * unit},
        surface=f"S - {k}*T - eps",
        above={"T": f"{unit!r} - 2*T", "S": f"0.5*({unit!r} - S) - S"},
        below={"T": f"{unit!r} - T", "S": f"0.5*({unit!r} - S)"},
    )
    T = 0.94 * (2.0 - 1.0 / k)
    start = find_equilibrium(
        system, {"eps": (T / (2.0 - T) - k * T) * unit}, x0=[T * unit, T / (2.0 - T) * unit], mode="sliding"
    )
    branch = continue_equilibrium(start, "eps", (-0.3 * unit, 0.31 * unit))
    # at 0 two boundaries are met at once
    borders = sorted([1.0 / 3.0 - k / 2.0, 0.0, 1.0 - k])
    fold = 2.0 - (2.0 / k) ** 0.5
    met = sorted(point.parameters["eps"] / unit for point in branch.special_points if point.type == "BE")
    np.testing.assert_allclose(met, borders, atol=1e-9)
    turns = [point.parameters["eps"] / unit for point in branch.special_points if point.type == "SN"]
    np.testing.assert_allclose(turns, [fold / (2.0 - fold) - k * fold] if fold > 0.5 else [], atol=1e-9)
    assert {point.type for point in branch.special_points} <= {"BE", "SN"}
    assert not branch.audit.breaches


@pytest.mark.parametrize("tolerance", guarding((1e-12, 1e-10, 1e-8, 1e-6, 1e-5), 1e-10))
@pytest.mark.parametrize(("offset", "directions"), guarding(
    [(0.01, "both"), (0.3, "up"), (-0.2, "both"), (-0.2, "down")], (0.01, "both"), (-0.2, "both")))  # fmt: skip
def test_a_closed_branch_that_starts_at_a_fold_has_it_once(tolerance, offset, directions):
    """At I = A = w = 1 the motion p = t + pi/2 is exact, its multiplier exp(-int cos p dt) = 1."""
    junction = HybridSystem.smooth(
        {"p": "I - sin(p) + A*cos(th)"}, {"I": 1.0, "A": 1.0, "w": 1.0}, phase=("th", "w"), angles=("p",)
    )
    start = solve_orbit(junction, {}, x0=[math.pi / 2 + offset], tolerance=tolerance)
    branch = continue_orbit(start, "I", (0.0, 3.0), directions=directions)
    assert branch.stopped == ("the branch is closed",) * 2
    folds = sorted(point.value("I") for point in branch.special_points)
    assert folds == [pytest.approx(1.0, abs=1e-9), pytest.approx(1.6537152, abs=1e-5)]
    assert branch.special_points.of_type("SN") == list(branch.special_points)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("kind", ["map", "kicks"])
def test_a_period_doubling_without_a_cubic_term_is_degenerate_and_its_doubled_orbits_are_found(kind, sign):
    """x goes to -(1 + r) x + x**5, or - x**5: of the orbits that double at r = 0, r = x**4 holds exactly, or -x**4."""
    image = f"-(1 + r)*x + {sign!r}*x**5"
    if kind == "map":
        system = Map(("x",), {"r": -0.2}, {"x": image})
        rest = find_orbit(system, x0=[0.0])
    else:
        kick = Transition("f", "f", at_phase=0, reset={"x": image}, name="kick")
        system = HybridSystem(("x",), {"r": -0.2}, {"f": Mode({"x": "0"})}, [kick], phase=("th", 1.0))
        rest = find_orbit(system, x0=[0.01])
    branch = continue_orbit(rest, "r", (-0.25, 0.3))
    assert [point.type for point in branch.special_points] == ["PD"]
    assert branch["PD1"].normal_form.criticality == "degenerate"
    doubled = continue_orbit(switch_branch(branch["PD1"]), "r", (-0.25, 0.3))
    moving = np.array([solution.extremes[1][0] for solution in doubled])
    assert moving.max() > 0.7
    np.testing.assert_allclose(doubled.values, sign * moving**4, atol=1e-9)
