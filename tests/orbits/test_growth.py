"""How far a change grows over a flight does not depend on where a state has its 0."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from saltus.orbits.maps import flight_growth, most_grown
from saltus.orbits.problem import OrbitProblem
from selection import guarding


def neuron(shift: float, unit: float, rate: float, supply: float) -> saltus.HybridSystem:
    """A potential that grows by itself from its reset, at `shift`, to its threshold one unit above; a slow variable."""
    above = f"(V - {shift!r})" if shift else "V"
    field = {"V": f"{rate!r}*({above} + I*{unit!r})", "w": f"-w + 0.5*{above}/{unit!r}"}
    reset = {"V": repr(shift), "w": "w + 0.3"}
    spike = saltus.Transition("f", "f", f"{above} - {unit!r}", 1, reset, name="spike")
    return saltus.HybridSystem(("V", "w"), {"I": supply}, {"f": saltus.Mode(field)}, [spike])


def in_one_piece(
    system: saltus.HybridSystem, segments: list[tuple[str, str, list[float], float]]
) -> tuple[OrbitProblem, np.ndarray]:
    """The equations of an orbit with its flights uncut, and their solution."""
    orbit = saltus.solve_orbit(system, segments=segments)
    problem = OrbitProblem(system, orbit.form.whole, system.parameter_vector(None))
    u = np.concatenate([[*part.state, part.duration] for part in orbit.segments])
    assert problem.start(u) is None
    return problem, u


CASES = [
    (shift, unit, rate, supply)
    for shift in (0.0, 0.25, -3.0)
    for unit in (1.0, 1e-9, 1e9)
    for rate in (1.0, 40.0)
    for supply in (1e-3, 1e-6)
]


@pytest.mark.parametrize(
    ("shift", "unit", "rate", "supply"),
    guarding(CASES, (0.0, 1.0, 1.0, 1e-3), (0.25, 1.0, 1.0, 1e-3), (0.0, 1e-9, 40.0, 1e-6), (0.0, 1e9, 1.0, 1e-6)),
)
def test_a_flight_grows_as_its_field_whatever_its_reset_is(
    shift: float, unit: float, rate: float, supply: float
) -> None:
    system = neuron(shift * unit, unit, rate, supply)
    duration = math.log(1.0 + 1.0 / supply) / rate
    problem, u = in_one_piece(system, [("f", "spike", [shift * unit, 0.3], duration)])
    assert 1.0 + 0.999 / supply <= flight_growth(problem, u)[0] <= 2.0 / supply  # of V by V; w has a share of it
    landing = most_grown(problem, u, problem.resolve(u)[1])
    assert landing >= 0.9 / supply / (1.0 + supply) / math.log(1.0 / supply) / 1.1  # dT/dV = 1/(rate supply), over T


def test_a_place_on_a_wall_and_a_phase_at_zero_count() -> None:
    """A mass that a force pushes away from its rest, at which it is hit: from x = 0, at phase 0, both as any start."""
    modes = {"f": saltus.Mode({"x": "v", "v": "9*x - F*cos(th)"})}
    kick = saltus.Transition("f", "f", at_phase=0, reset={"x": "0", "v": "1"}, name="kick")
    system = saltus.HybridSystem(("x", "v"), {"F": 0.1}, modes, [kick], phase=("th", 1.0))
    problem, u = in_one_piece(system, [("f", "kick", [0.0, 1.0, 0.0], 2.0 * math.pi)])
    grown = math.cosh(3.0 * 2.0 * math.pi)  # of x by x; of v by x it is 3 sinh
    scale = problem.common_scale
    assert flight_growth(problem, u)[0] >= 0.99 * grown * min(1.0, 3.0 * scale[0] / scale[1])


def test_what_grows_across_an_invariant_plane_magnifies_nothing() -> None:
    field = {"S": "0.02 - 1800*S*I - 0.02*S", "I": "1800*S*I - 100*I"}
    pulse = saltus.Transition("f", "f", at_phase=0, reset={"S": "S/2"}, name="vaccination")
    system = saltus.HybridSystem(("S", "I"), {"T": 3.0}, {"f": saltus.Mode(field)}, [pulse], phase=("th", "2*pi/T"))
    away = math.exp(-0.06)
    start = 0.5 * (1.0 - away) / (1.0 - 0.5 * away)
    problem, u = in_one_piece(system, [("f", "vaccination", [start, 0.0, 0.0], 3.0)])
    assert flight_growth(problem, u)[0] <= 1.0 + 1e-9
