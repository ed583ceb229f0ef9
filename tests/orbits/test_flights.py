"""Flights up to events, cut by hand where nothing needs it: the orbit stays what it is, uncut and to SciPy."""

from __future__ import annotations

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, verify
from saltus.continuation.problems.margins import grazing_monitors
from saltus.errors import InputError
from saltus.orbits.cuts import in_shares, whole
from saltus.orbits.orbit import orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CUT_END, EVENT_END, MEAN_END, ONWARD_END, PHASE_END, Signature
from selection import guarding

SOFT = "F*cos(s) - x - 0.1*y"
SYSTEMS = {
    "impacts": HybridSystem(
        ("x", "y"),
        {"F": 1.0, "w": 0.9, "r": 0.8},
        {"free": Mode({"x": "y", "y": "F*cos(s) - x - 0.05*y"})},
        [Transition("free", "free", "x - 1", 1, {"y": "-r*y"}, name="hit")],
        phase=("s", "w"),
    ),
    "soft stop": HybridSystem(  # one segment starts on the surface on which it ends
        ("x", "y"),
        {"F": 1.0, "w": 0.7, "k": 4.0},
        {"free": Mode({"x": "y", "y": SOFT}), "stop": Mode({"x": "y", "y": f"{SOFT} - k*(x - 0.5)"})},
        [Transition("free", "stop", "x - 0.5", 1, name="in"), Transition("stop", "free", "x - 0.5", -1, name="out")],
        phase=("s", "w"),
    ),
    "relay": HybridSystem(
        ("x", "y", "z"),
        {"k": 2.0},
        {
            way: Mode({"x": "y", "y": "z", "z": f"-z - y - 0.5*x {sign} k"})
            for way, sign in (("down", "-"), ("up", "+"))
        },
        [
            Transition("down", "up", "x + 0.3", -1, name="low"),
            Transition("up", "down", "x - 0.3", 1, name="high"),
        ],
    ),
    "neuron": HybridSystem(
        ("v", "u"),
        {"a": 0.02, "b": 0.2, "c": -50.0, "d": 2.0, "I": 15.0},
        {"rest": Mode({"v": "0.04*v**2 + 5*v + 140 - u + I", "u": "a*(b*v - u)"})},
        [Transition("rest", "rest", "v - 30", 1, {"v": "c", "u": "u + d"}, name="spike")],
    ),
}
STARTS = {"impacts": [0.5, 0.0], "soft stop": [0.5, 0.0], "relay": [1.0, 0.0, 0.0], "neuron": [-50.0, -10.0]}
VARIED = {"impacts": "F", "soft stop": "w", "relay": "k", "neuron": "c"}


def halved(problem, u, pieces):
    """The equations and unknowns of an orbit with some pieces cut in two."""
    problem.survey(u)
    n, rows = problem.n, []
    for i, row in enumerate(u[: problem.size].reshape(problem.segments, n + 1)):
        half = [np.append(row[:n], 0.5 * row[n]), np.append(problem.state_on(i, 0.5), 0.5 * row[n])]
        rows += half if i in pieces else [row]
    cut = OrbitProblem(problem.system, problem.signature.halved(pieces), problem.parameters_at(u), tol=problem.tol)
    moved = np.concatenate(rows)
    assert cut.start(moved) is None
    return cut, moved


def cut_by_hand(orbit, rounds, pieces=None):
    problem, u = orbit.problem(), orbit.unknowns
    for _ in range(rounds):
        problem, u = halved(problem, u, range(problem.segments) if pieces is None else pieces)
    return problem, u


CASES = [(name, rounds, first) for name in SYSTEMS for rounds, first in ((1, None), (1, (0,)), (2, None))]


@pytest.mark.parametrize(
    ("name", "rounds", "pieces"), guarding(CASES, ("impacts", 2, None), ("soft stop", 1, None), ("relay", 1, (0,)))
)
def test_an_orbit_is_what_it_was_in_pieces(name, rounds, pieces):
    orbit = find_orbit(SYSTEMS[name], x0=STARTS[name])
    plain, u = orbit.problem(), orbit.unknowns
    problem, moved = cut_by_hand(orbit, rounds, pieces)
    assert problem.signature.whole == orbit.form
    cut = orbit_at(problem, moved, problem.resolve(moved)[1])
    assert cut.signature == orbit.signature
    assert cut.multipliers == pytest.approx(orbit.multipliers, rel=1e-9, abs=1e-10)
    assert cut.faults == orbit.faults == 0
    assert cut.highs == pytest.approx(orbit.highs, rel=1e-7)
    assert cut.x0 == pytest.approx(orbit.x0, rel=1e-9)
    assert verify(cut).passed
    before, after = plain.survey(u), problem.survey(moved)
    known = {monitor: value(before) for monitor, value in grazing_monitors(plain).items()}
    seen = {monitor: value(after) for monitor, value in grazing_monitors(problem).items()}
    assert seen == pytest.approx(known, rel=1e-6, abs=1e-8, nan_ok=True)
    joined, back = whole(problem, moved)
    assert back == pytest.approx(u)
    assert in_shares(joined, back, problem, moved) == pytest.approx(moved, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("name", guarding(SYSTEMS, "soft stop"))
def test_a_branch_is_what_it_was_in_pieces(name):
    orbit = find_orbit(SYSTEMS[name], x0=STARTS[name])
    problem, moved = cut_by_hand(orbit, 1)
    cut = orbit_at(problem, moved, problem.resolve(moved)[1])
    value = orbit.parameters[VARIED[name]]
    bounds = tuple(sorted((0.9 * value, 1.1 * value)))
    one, two = (continue_orbit(start, VARIED[name], bounds) for start in (orbit, cut))
    assert two.stopped == one.stopped
    assert [(p.type, p.parameters) for p in two.special_points] == [
        (p.type, pytest.approx(p.parameters, rel=1e-9)) for p in one.special_points
    ]
    assert not two.audit.breaches


def test_a_jacobian_of_flights_in_pieces_is_that_of_differences():
    problem, u = cut_by_hand(find_orbit(SYSTEMS["soft stop"], x0=STARTS["soft stop"]), 1)
    J, n = problem.resolve(u)[1], problem.size
    for k in range(n):
        step = 1e-6 * np.eye(n)[k]
        column = (problem.evaluate(u + step)[0] - problem.evaluate(u - step)[0]) / 2e-6
        assert column == pytest.approx(J[:, k], abs=1e-6)


def test_signatures_in_pieces_are_told_and_joined():
    flights = Signature((0, 1), (2, 3), (EVENT_END, MEAN_END), 1)
    cut = flights.halved((0, 1)).halved((1,))
    assert cut.kinds == (ONWARD_END, ONWARD_END, EVENT_END, ONWARD_END, MEAN_END)
    assert cut.transitions == (-1, -1, 2, -1, 3)
    assert (cut.heads, cut.tails) == ((0, 3), (2, 4))
    assert cut.rows[-1] == EVENT_END  # its piece does not start on the surface
    assert cut.whole == flights
    smooth = Signature((0,), (-1,), (PHASE_END,), 1)
    assert smooth.halved((0,)).kinds == (PHASE_END, CUT_END)
    assert smooth.halved((0,)).whole == smooth
    with pytest.raises(InputError, match="a piece of the same mode behind it"):
        Signature((0, 1), (-1, 1), (ONWARD_END, EVENT_END), 1).check(SYSTEMS["soft stop"])
