"""How special points move with other parameters: closed forms, and differences of points located anew."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
import systems
from saltus import (
    HybridSystem,
    Map,
    Mode,
    Piece,
    Transition,
    continue_equilibrium,
    continue_orbit,
    find_equilibrium,
    find_orbit,
)
from saltus.errors import InputError


def moved(point, name):
    return float(point.sensitivity()[point.varied[0]].sel(parameter=name))


# normal forms


@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_folds_of_equilibria_at_two_thirds_of_the_root(unit):
    system = HybridSystem.smooth({"x": f"r + h*x - x**3/{unit}**2"}, {"r": unit, "h": 2.0})
    branch = continue_equilibrium(find_equilibrium(system, {}, [1.7 * unit]), "r", (-4.0 * unit, 4.0 * unit))
    for label, sign in (("SN1", 1.0), ("SN2", -1.0)):  # r = 2 (h / 3)^(3/2) on either side
        assert branch[label].parameters["r"] == pytest.approx(sign * 2.0 * (2.0 / 3.0) ** 1.5 * unit, rel=1e-9)
        assert moved(branch[label], "h") == pytest.approx(sign * math.sqrt(2.0 / 3.0) * unit, rel=1e-9)


def test_the_hopf_point_of_the_brusselator():
    system = HybridSystem.smooth({"x": "a - (b + 1)*x + x**2*y", "y": "b*x - x**2*y"}, {"a": 1.3, "b": 1.0})
    branch = continue_equilibrium(find_equilibrium(system, {}, [1.3, 0.8]), "b", (1.0, 4.0))
    assert moved(branch["HB1"], "a") == pytest.approx(2.6, rel=1e-9)  # b = 1 + a^2


def test_an_equilibrium_on_the_boundary_of_its_mode():
    system = HybridSystem(
        ("x",),
        {"a": 0.5, "d": 1.5, "q": 2.0},
        {"low": Mode({"x": "a - x/q"}), "high": Mode({"x": "a - 2*x + d"})},
        [Transition("low", "high", "x - d", 1), Transition("high", "low", "x - d", -1)],
    )
    branch = continue_equilibrium(find_equilibrium(system, {}, [0.9], mode="low"), "a", (0.1, 2.0))
    point = branch.special_points.of_type("BE")[0]
    assert moved(point, "d") == pytest.approx(0.5, rel=1e-9)  # a q = d
    assert moved(point, "q") == pytest.approx(-0.375, rel=1e-9)


def carried(parameters, image, start, along, bounds):
    system = systems.carried_map(("x",), parameters, {"x": image})
    orbit = saltus.solve_orbit(system, {}, [("carry", "map", [start, 0.0], 1.0)])
    return continue_orbit(orbit, along, bounds)


def test_folds_and_doublings_of_maps_in_closed_form():
    point = carried({"r": 2.8, "c": 0.0}, "r*x*(1 - x) + c", 1.0 - 1.0 / 2.8, "r", (2.5, 3.5))["PD1"]
    assert moved(point, "c") == pytest.approx(-3.0, rel=1e-9)  # c = (1 + 1/r)/2 - (r - 1/r)/4
    point = carried({"r": 0.2, "h": 1.0}, "x + r - h*x**2", math.sqrt(0.2), "r", (-0.5, 0.5))["SN1"]
    assert moved(point, "h") == pytest.approx(0.0, abs=1e-9)
    point = carried({"r": 1.0, "h": 1.5}, "r + h*x - x**3", 1.2, "r", (-1.0, 1.5))["SN1"]
    side = math.copysign(1.0, point.parameters["r"])
    assert moved(point, "h") == pytest.approx(side * math.sqrt(1.0 / 6.0), rel=1e-9)  # r = 2 ((h - 1)/3)^(3/2)


def test_special_points_of_maps_in_closed_form():
    def branch(image, parameters, start, along, bounds):
        system = image if isinstance(image, Map) else Map(tuple(image), parameters, image)
        return continue_orbit(saltus.solve_orbit(system, x0=start), along, bounds)

    doubled = branch({"x": "r*x*(1 - x) + c"}, {"r": 2.8, "c": 0.0}, [1.0 - 1.0 / 2.8], "r", (2.5, 3.5))["PD1"]
    assert moved(doubled, "c") == pytest.approx(-3.0, rel=1e-9)
    fold = branch({"x": "r + h*x - x**3"}, {"r": 1.0, "h": 1.5}, [1.2], "r", (-1.0, 1.5))["SN1"]
    side = math.copysign(1.0, fold.parameters["r"])
    assert moved(fold, "h") == pytest.approx(side * math.sqrt(1.0 / 6.0), rel=1e-9)
    image = {"x": "y", "y": "a*y*(1 - x) - c*(y - x)"}
    torus = branch(image, {"a": 1.9, "c": 0.1}, [1.0 - 1.0 / 1.9] * 2, "a", (1.5, 2.5))["TR1"]
    assert moved(torus, "c") == pytest.approx(1.0, rel=1e-9)
    pieces = {"low": Piece({"x": "a*x + m"}, ["d - x"]), "high": Piece({"x": "b*x + m"}, ["x - d"])}
    tent = Map(("x",), {"a": 0.5, "b": -0.4, "d": 0.2, "m": 0.0}, pieces=pieces)
    border = branch(tent, {}, [0.0], "m", (-1.0, 1.0)).special_points.of_type("BC")[0]
    assert moved(border, "d") == pytest.approx(0.5, rel=1e-9)  # m = (1 - a) d
    assert moved(border, "a") == pytest.approx(-0.2, rel=1e-9)


def test_a_torus_bifurcation_in_closed_form():
    system = HybridSystem(
        ("x", "y", "s"),
        {"a": 1.9, "c": 0.1},
        {"carry": Mode({"x": "0", "y": "0", "s": "1"})},
        [Transition("carry", "carry", "s - 1", 1, {"x": "y", "y": "a*y*(1 - x) - c*(y - x)", "s": "0"}, name="map")],
    )
    rest = 1.0 - 1.0 / 1.9
    orbit = saltus.solve_orbit(system, {}, [("carry", "map", [rest, rest, 0.0], 1.0)])
    assert moved(continue_orbit(orbit, "a", (1.5, 2.5))["TR1"], "c") == pytest.approx(1.0, rel=1e-9)  # a = 2 + c


def test_a_pitchfork_persists_only_where_its_symmetry_or_its_trivial_branch_does():
    values = {"r": -0.3, "h": 0.0, "g": 0.0, "q": 0.1}
    point = carried(values, "x + (r - q**2)*x - x**3 + h + g*x**2", 0.0, "r", (-0.5, 0.6))["BP1"]
    found = point.sensitivity()["r"]
    assert np.isnan(found.sel(parameter="h"))
    assert "does not persist" in found.attrs["note"]
    assert float(found.sel(parameter="g")) == pytest.approx(0.0, abs=1e-9)
    assert float(found.sel(parameter="q")) == pytest.approx(0.2, rel=1e-9)
    assert "note" not in point.sensitivity(["q"])["r"].attrs


# grazing: the free amplitude is the distance of the stop


def soft_stop():
    free = "A*cos(s) - c*v - k*x"
    return HybridSystem(
        ("x", "v"),
        {"k": 1.0, "c": 0.1, "d": 12.0, "e": 0.8, "w": 1.0, "A": 1.0},
        {"free": Mode({"x": "v", "v": free}), "stop": Mode({"x": "v", "v": f"{free} - e*(x - d)"})},
        [Transition("free", "stop", "x - d", 1), Transition("stop", "free", "x - d", -1)],
        phase=("s", "w"),
    )


@pytest.mark.parametrize("w", [0.9, 1.15])
@pytest.mark.parametrize("make", [systems.impact_oscillator, soft_stop])
def test_a_grazing_moves_as_the_free_amplitude(make, w):
    orbit = find_orbit(make(), {"w": w, "d": 12.0}, x0=[0.0, 0.0])
    point = continue_orbit(orbit, "d", (1.0, 13.0))["GR1"]
    D = (1.0 - w * w) ** 2 + 0.01 * w * w
    a = 1.0 / math.sqrt(D)
    wanted = {"k": -a * (1.0 - w * w) / D, "c": -0.1 * a * w * w / D, "A": a, "e": 0.0}
    wanted["w"] = -a * w * (0.01 - 2.0 * (1.0 - w * w)) / D
    assert point.parameters["d"] == pytest.approx(a, rel=1e-10)
    for name, slope in wanted.items():
        assert moved(point, name) == pytest.approx(slope, rel=1e-7, abs=1e-7)


# points located anew


def differences(system, start, along, bounds, label, parameter, step):
    def located(value):
        orbit = start(system, {parameter: value})
        return continue_orbit(orbit, along, bounds)[label].parameters[along]

    at = system.parameters[parameter]
    near, far = (located(at + k * step) - located(at - k * step) for k in (1, 2))
    return (8.0 * near - far) / (12.0 * step)


@pytest.mark.campaign
def test_the_folds_of_duffings_oscillator_against_differences():
    system = HybridSystem.smooth(
        {"x": "v", "v": "A*cos(s) - c*v - x - x**3"}, {"c": 0.1, "A": 0.5, "w": 1.2}, phase=("s", "w")
    )

    def start(system, change):
        return saltus.solve_orbit(system, change, x0=[1.1, 0.0])

    branch = continue_orbit(start(system, {}), "w", (0.3, 3.0))
    for label in ("SN1", "SN2"):
        for parameter in ("c", "A"):
            step = 1e-3 * system.parameters[parameter]
            wanted = differences(system, start, "w", (0.3, 3.0), label, parameter, step)
            assert moved(branch[label], parameter) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("parameter", ["c", "e", "k"])
def test_a_doubling_of_the_impact_oscillator_against_differences(parameter):
    system = systems.impact_oscillator()

    def start(system, change):
        return find_orbit(system, {"w": 0.9, "d": 6.0, **change}, x0=[0.0, 0.0])

    point = continue_orbit(start(system, {}), "d", (1.0, 13.0))["PD1"]
    wanted = differences(system, start, "d", (1.0, 13.0), "PD1", parameter, 1e-4)
    assert moved(point, parameter) == pytest.approx(wanted, rel=1e-6)


# what does not move is told


def test_points_of_other_kinds_are_refused():
    system = HybridSystem.smooth({"x": "r + h*x - x**3"}, {"r": 1.0, "h": 2.0})
    branch = continue_equilibrium(find_equilibrium(system, {}, [1.7]), "r", (-4.0, 4.0))
    with pytest.raises(InputError, match="parameters = 'r'"):
        branch["SN1"].sensitivity(["r"])
    locus = saltus.continue_locus(branch["SN1"], ("r", "h"), {"r": (-4.0, 4.0), "h": (-1.0, 4.0)})
    with pytest.raises(InputError, match="one parameter"):
        locus["CP1"].sensitivity()
    pitchfork = HybridSystem.smooth({"x": "r*x - x**3 + h"}, {"r": -1.0, "h": 0.0})
    branch = continue_equilibrium(find_equilibrium(pitchfork, {}, [0.0]), "r", (-2.0, 2.0))
    with pytest.raises(InputError, match="one of SN, HB, BE"):
        branch["BP1"].sensitivity()


# along a curve


def test_derivatives_along_a_branch_are_those_of_its_orbits():
    oscillator = systems.impact_oscillator()
    branch = continue_orbit(find_orbit(oscillator, {"w": 0.9}, x0=[0.0, 0.0]), "d", (0.5, 5.0))
    found = branch.sensitivity(["max(v)", "phase(x, 1)"], ["c", "d", "w"])
    assert found["max(v)"].dims == ("point", "parameter")
    np.testing.assert_array_equal(found["d"], branch.values)
    for i in (0, 3, len(branch) // 2):
        own = branch.solution(i).sensitivity(["max(v)", "phase(x, 1)"], ["c", "d", "w"])
        for name in ("max(v)", "phase(x, 1)"):
            np.testing.assert_allclose(found[name].isel(point=i), own[name], rtol=1e-7)
    told = found["note"].values != ""
    np.testing.assert_array_equal(np.isnan(found["max(v)"]).any("parameter"), told)
    assert 0 < told.sum() < len(branch) // 4  # the grazing
    assert all("grazing" in note for note in found["note"].values[told])
    with pytest.raises(InputError, match="observable"):
        branch.sensitivity(["best(x)"])
