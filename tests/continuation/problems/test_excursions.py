"""Grazings into modes that are left transversally, by a timer, or over a further mode: the branch goes on."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, solve_orbit
from selection import guarding

WAYS = ("timer", "place", "two modes")


def values(way: str, seed: int) -> dict[str, float]:
    """Return random parameters: the mode behind the wall pushes with F, and lasts for `last` times the hit's speed."""
    draw = np.random.default_rng([seed, WAYS.index(way)])
    return {"c": draw.uniform(0.08, 0.3), "e": draw.uniform(0.6, 0.9), "w": draw.uniform(0.9, 1.3),
            "F": draw.uniform(-0.5, 0.5), "last": draw.uniform(0.5, 2.0)}  # fmt: skip


def oscillator(way: str, given: dict[str, float], unit: float) -> HybridSystem:
    """Return an oscillator whose wall at x = 1 switches a force on, which stays on for a while."""
    free = {"x": "v", "v": "A*cos(th) - c*v - x"}
    push = {"x": "v", "v": "A*cos(th) - c*v - x + F*U"}
    modes = {"free": Mode(free, states=("x", "v")), "push": Mode({**push, "s": "-U"}, states=("x", "v", "s"))}
    hit = Transition("free", "push", "x - U", 1, {"v": "-e*v", "s": "last*v"}, name="hit")
    rest = [Transition("push", "free", "s", -1, name="done")]
    if way == "place":  # a place that runs away from the wall, and is met with a clear speed
        modes["push"] = Mode({**push, "s": "2*U"}, states=("x", "v", "s"))
        hit = Transition("free", "push", "x - U", 1, {"v": "-e*v", "s": "3*U - 2*last*v"}, name="hit")
        rest = [Transition("push", "free", "s - 3*U", 1, name="done")]
    if way == "two modes":  # 0.4 of the time in one mode, 0.6 in another
        modes["later"] = Mode({**push, "q": "-2*U"}, states=("x", "v", "q"))
        hit = Transition("free", "push", "x - U", 1, {"v": "-e*v", "s": "0.4*last*v", "q": "1.2*last*v"}, name="hit")
        rest = [Transition("push", "later", "s", -1, name="next"), Transition("later", "free", "q", -1, name="done")]
    states = ("x", "v", "s", "q") if way == "two modes" else ("x", "v", "s")
    if way == "two modes":
        modes["push"] = Mode({**push, "s": "-U", "q": "0"})
    return HybridSystem(states, {"A": 0.0, "U": unit, **given}, modes, [hit, *rest], phase=("th", "w"))


def grazing_amplitude(given: dict[str, float]) -> float:
    """Return the amplitude at which the response of x'' + c x' + x = A cos(w t) reaches 1."""
    return math.hypot(1.0 - given["w"] ** 2, given["c"] * given["w"])


def amplitude_of(given: dict[str, float], speed: float) -> float:
    """Return the amplitude of the orbit that hits the wall once in a period with a speed, by SciPy; NaN without one."""
    c, e, w, F = (given[name] for name in ("c", "e", "w", "F"))
    push, period = given["last"] * speed, 2.0 * math.pi / given["w"]

    def motion(q):
        def run(t, z, force):
            return z[1], q[1] * math.cos(q[0] + w * t) - c * z[1] - z[0] + force

        ran = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
        first = solve_ivp(run, (0.0, push), [1.0, -e * speed], args=(F,), **ran).y
        return np.hstack([first, solve_ivp(run, (push, period), first[:, -1], args=(0.0,), max_step=0.05, **ran).y])

    lag = math.atan2(c * w, 1.0 - w * w)
    start = [lag, grazing_amplitude(given)]
    found, _, told, _ = fsolve(lambda q: motion(q)[:, -1] - (1.0, speed), start, xtol=1e-13, full_output=True)
    return float(found[1]) if told == 1 and motion(found)[0, 1:-1].max() < 1.0 else math.nan


@pytest.mark.parametrize("unit", [1e-9, 1.0])
@pytest.mark.parametrize(
    ("way", "seed"),
    guarding(
        [(way, seed) for seed in range(8) for way in WAYS], ("place", 1), ("two modes", 1), campaign=8, spread=True
    ),
)
def test_the_branch_goes_on_behind_the_grazing_and_has_the_same_points_from_either_end(way, seed, unit):
    given = values(way, seed)
    system, grazes = oscillator(way, given, unit), grazing_amplitude(given)
    least, most = 0.5 * grazes * unit, 1.5 * grazes * unit
    lag = math.atan2(given["c"] * given["w"], 1.0 - given["w"] ** 2)  # the response 0.8 cos(th - lag), free of the wall
    start = [
        0.8 * unit * math.cos(lag),
        0.8 * unit * given["w"] * math.sin(lag),
        *[0.0] * (len(system.states) - 2),
        0.0,
    ]
    free = solve_orbit(system, {"A": 0.8 * grazes * unit}, [("free", "th", start, 2.0 * math.pi / given["w"])])
    branch = continue_orbit(free, "A", (least, most))
    assert branch.special_points[0].type == "GR"
    assert branch["GR1"].parameters["A"] == pytest.approx(grazes * unit, rel=1e-9)
    hitting = []
    for speed in (0.01, 0.05):
        amplitude = amplitude_of(given, speed) * unit
        if least < amplitude < most:
            found = [one for one in branch.at(amplitude) if len(one.segments) > 1]
            speeds = [
                -part.state[1] / given["e"] / unit for one in found for part in one.segments if part.mode == "push"
            ]
            assert np.abs(np.array(speeds) - speed).min() < 1e-7
            hitting.append(found[int(np.abs(np.array(speeds) - speed).argmin())])
    if hitting:
        back = continue_orbit(hitting[-1], "A", (least, most))
        own, other = (sorted((p.type, p.parameters["A"] / unit) for p in one.special_points) for one in (branch, back))
        assert [name for name, _ in own] == [name for name, _ in other]
        np.testing.assert_allclose([a for _, a in own], [a for _, a in other], rtol=1e-7)


def test_a_mode_that_lasts_after_a_touch_ends_the_branch_and_says_so():
    given = values("timer", 0)
    free = {"x": "v", "v": "A*cos(th) - c*v - x"}
    modes = {"free": Mode(free, states=("x", "v")), "push": Mode({**free, "s": "-1"})}
    hit = Transition("free", "push", "x - 1", 1, {"v": "-e*v", "s": "0.3"}, name="hit")
    done = Transition("push", "free", "s", -1, name="done")
    system = HybridSystem(("x", "v", "s"), {**given, "A": 0.0}, modes, [hit, done], phase=("th", "w"))
    orbit = find_orbit(system, {"A": 0.8 * grazing_amplitude(given)}, [0.0, 0.0, 0.0])
    branch = continue_orbit(orbit, "A", (0.1, 0.5))
    told = "motions that pass the surface do not come back from 'push' at once, so no orbit near it goes on"
    assert branch.stopped[1].endswith(told)
