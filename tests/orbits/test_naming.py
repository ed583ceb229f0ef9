"""What `find_orbit` says of motions on which it finds no orbit: chaos, tori, long periods, slow and stiff ones."""

from __future__ import annotations

import math
import re

import pytest

from saltus import ConvergenceError, HybridSystem, Mode, Transition, find_orbit
from saltus.errors import StiffnessError
from selection import guarding

LORENZ = {"x": "10*(y - x)", "y": "28*x - y - x*z", "z": "x*y - 8*z/3"}
LORENZ_EXPONENT = 0.9056  # Sprott, Chaos and Time-Series Analysis, Oxford 2003, appendix A.4


def forced(field, w=1.0):
    return HybridSystem(tuple(field), {"w": w}, {"m": Mode(field)}, phase=("s", "w"))


def driven_lorenz(w):
    return forced(LORENZ | {"y": LORENZ["y"] + " + 0.01*cos(s)"}, w)


def ticking(r):
    """One iteration of the logistic map at each tick of a clock."""
    return HybridSystem(
        ("v", "t"),
        {},
        {"on": Mode({"v": "0", "t": "1"})},
        [Transition("on", "on", "t - 1", 1, {"v": f"{r}*v*(1 - v)", "t": "0"}, name="tick")],
    )


def said(system, x0, **options):
    with pytest.raises(ConvergenceError) as caught:
        find_orbit(system, {}, x0, **options)
    return str(caught.value)


def exponent_in(text):
    found = re.search(r"is chaotic: its leading Lyapunov exponent is (\S+) \+- (\S+) a", text)
    assert found, text
    return float(found[1]), float(found[2])


CHAOTIC = {
    "Duffing": (forced({"x": "v", "v": "0.5*cos(s) - 0.3*v + x - x**3"}, 1.2), [0.1, 0.0]),
    "Ueda": (forced({"x": "v", "v": "7.5*cos(s) - 0.05*v - x**3"}), [0.0, 0.0]),
    "Ueda beside a fast decay": (
        forced({"x": "v", "v": "7.5*cos(s) - 0.05*v - x**3", "y": "-300*y*(1 + x**2)"}),
        [0.0, 0.0, 1.0],
    ),
    "Ueda beside a stiff state": (
        forced({"x": "v", "v": "7.5*cos(s) - 0.05*v - x**3", "y": "-1e5*(y - x)"}),
        [0.0, 0.0, 1.0],
    ),
    "Roessler": (HybridSystem.smooth({"x": "-y - z", "y": "x + 0.2*y", "z": "0.2 + z*(x - 5.7)"}, {}), [1.0, 1.0, 0.0]),
}


@pytest.mark.parametrize("name", guarding(CHAOTIC, "Duffing"))
def test_chaos_is_told_as_chaos_with_its_exponent(name):
    exponent, error = exponent_in(said(*CHAOTIC[name]))
    assert exponent > error


def test_the_exponent_told_of_the_logistic_map_is_the_logarithm_of_two():
    exponent, error = exponent_in(said(ticking(4), [0.3, 0.0]))
    assert abs(exponent - math.log(2.0)) <= 2.0 * error


@pytest.mark.parametrize(
    ("w", "settle"),
    guarding([(1.0, 3000.0), (0.05, 400.0), (0.05, 30.0), (0.005, 3000.0)], (1.0, 3000.0), (0.05, 30.0)),
)
def test_chaos_that_takes_more_steps_than_settle_allows_is_chaos(w, settle):
    """In a slow drive's period the Lorenz system needs up to 60 000 steps, and settle= allows 1000 of them."""
    exponent, error = exponent_in(said(driven_lorenz(w), [1.0, 1.0, 20.0], settle=settle))
    assert abs(exponent - LORENZ_EXPONENT * 2.0 * math.pi / w) <= 3.0 * error


@pytest.mark.campaign
@pytest.mark.parametrize(("rate", "size"), [(1.0, 1.0), (1e6, 1e-9), (1e-6, 1e9)])
def test_chaos_is_told_in_any_units(rate, size):
    field = {
        "x": f"{rate}*10*(y - x)", "y": f"{rate}*(28*x - y - x*z/{size})", "z": f"{rate}*(x*y/{size} - 8*z/3)",
    }  # fmt: skip
    exponent_in(said(HybridSystem.smooth(field, {}), [size, size, 20.0 * size]))


def test_a_torus_is_told_as_quasi_periodic():
    van_der_pol = forced({"x": "v", "v": "(1 - x**2)*v - x + 0.1*cos(s)"}, 0.618)
    assert "the motion is quasi-periodic: its leading Lyapunov exponent is" in said(van_der_pol, [1.0, 0.0])


def test_a_period_beyond_those_sought_is_told():
    assert "the motion recurs after 32 returns" in said(ticking(3.5688), [0.3, 0.0])


@pytest.mark.parametrize("rate", [1e-5, 1e-4])
def test_a_motion_that_settles_slowly_is_told_to_need_more_periods(rate):
    text = said(forced({"x": f"-{rate}*x + cos(s)"}), [1e3], settle=200)
    assert "settle= allows more periods" in text
    assert "chaotic" not in text


def test_a_fast_oscillation_is_a_limit_of_work_and_not_stiff():
    fast = forced({"x": "v", "v": "-1e8*x - 0.1*v + cos(s)"})
    with pytest.raises(StiffnessError, match="a limit of work: .*; settle= allows 1000 steps") as caught:
        find_orbit(fast, {}, [1.0, 0.0], settle=100)
    assert not caught.value.stiff


def test_a_decay_that_holds_explicit_steps_is_stiff():
    """Implicit steps may not follow y, whose zeros are an invariant plane: x keeps it from dying out."""
    field = {"x": "v", "v": "cos(s) - x - v", "y": "1e7*y*(2 + x - y)"}
    with pytest.raises(StiffnessError, match="it is stiff there: stability holds its steps") as caught:
        find_orbit(forced(field), {}, [0.0, 0.0, 2.0], settle=100)
    assert caught.value.stiff


@pytest.mark.parametrize("modes", guarding([4, 5], campaign=2))
def test_chaos_of_a_cantilever_with_many_modes_is_told(modes):
    """Over 4000 periods the exponents are 0.077 and 0.070 a period, with errors of 0.007."""
    from saltus import afm

    system = afm.tapping_mode(afm.table1(), modes=modes)
    with pytest.raises(ConvergenceError) as caught:
        find_orbit(system, {"Omega": 1.05}, [0.0] * (2 * modes))
    exponent, error = exponent_in(str(caught.value))
    assert abs(exponent - 0.0735) <= error + 0.01


FAR_APART = [(1.0, 1.0, 1.0), (1e-9, 1e9, 1e-9), (1e9, 1.0, 1e-9), (1.0, 1e-9, 1e9)]


def in_units(names: str, sizes: tuple[float, ...], field: dict[str, str]) -> dict[str, str]:
    """Return formulas in capital letters for states in units of one, as those of states in other units."""
    for name, size in zip(names, sizes, strict=True):
        field = {x: row.replace(name.upper(), f"({name}/{size!r})") for x, row in field.items()}
    return {x: f"{size!r}*({row})" for (x, row), size in zip(field.items(), sizes, strict=True)}


@pytest.mark.parametrize(("u", "v", "w"), guarding(FAR_APART, FAR_APART[1]))
def test_a_torus_is_named_with_its_turns_in_units_that_are_far_apart(u, v, w):
    sizes = u, v, w
    field = in_units("xvy", sizes, {"x": "V", "v": "0.3*cos(s) + (1 - X**2)*V - X", "y": "X - Y"})
    text = said(forced(field, 1.788), [0.5 * sizes[0], 0.0, 0.0])
    assert "the motion is quasi-periodic" in text
    assert "it winds by 0.472474 turns" in text


@pytest.mark.parametrize(("u", "v", "w"), guarding(FAR_APART, FAR_APART[2]))
def test_a_strange_motion_is_named_in_units_that_are_far_apart(u, v, w):
    sizes = u, v, w
    # Grebogi, Ott, Pelikan and Yorke, Physica D 13 (1984) 261
    turn = math.pi * (math.sqrt(5.0) - 1.0)
    c, d = math.cos(turn), math.sin(turn)
    images = in_units("xab", sizes, {"x": "3*A*tanh(X)", "a": f"{c!r}*A - {d!r}*B", "b": f"{d!r}*A + {c!r}*B"})
    kick = Transition("m", "m", at_phase=0, reset=images, name="kick")
    system = HybridSystem(("x", "a", "b"), {}, {"m": Mode(dict.fromkeys("xab", "0"))}, [kick], phase=("s", 1.0))
    assert "the motion is strange nonchaotic" in said(system, [0.3 * sizes[0], sizes[1], 0.0])


@pytest.mark.parametrize("rate", guarding([0.001, 0.01, 0.5], 0.001))
def test_a_state_that_fades_beside_a_torus_changes_no_words(rate):
    field = {"x": "v", "v": "0.3*cos(s) + (1 - x**2)*v - x", "z": f"-{rate}*z"}
    assert "it winds by 0.472474 turns" in said(forced(field, 1.788), [0.5, 0.0, 1.0])
