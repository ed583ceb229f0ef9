"""Newton's method of a branch of orbits in compiled calls, against the one for any zero problem."""

from __future__ import annotations

import numpy as np
import pytest

import saltus
from saltus import HybridSystem, Mode, Transition
from saltus.continuation.core.interest import Interest
from saltus.continuation.core.zero_problem import Unsolved, correct, start_point
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.orbits.problem import OrbitProblem


class Plain(OrbitZeroProblem):
    """Equations of orbits that leave Newton's method to the core."""

    def corrected(self, *_):
        return None


def impacting():
    field = {"x": "v", "v": "A*cos(s) - c*v - x"}
    wall = Transition("free", "free", "x - d", 1, {"v": "-e*v"})
    parameters = {"c": 0.1, "d": 1.0, "e": 0.8, "w": 0.7, "A": 0.6}
    system = HybridSystem(("x", "v"), parameters, {"free": Mode(field)}, [wall], phase=("s", "w"))
    return saltus.find_orbit(system, {}, [0.0, 0.0]), "A"


def pressing():
    """A tip on an elastic sample, whose force bends like the root of the depth."""
    fields = ("free", "0"), ("pressed", "k*(x - d)**(3/2)")
    modes = {name: Mode({"x": "v", "v": f"A*cos(s) - c*v - x - {force}"}) for name, force in fields}
    ends = Transition("free", "pressed", "x - d", 1), Transition("pressed", "free", "x - d", -1)
    parameters = {"c": 0.1, "d": 1.0, "k": 30.0, "w": 0.9, "A": 0.6}
    system = HybridSystem(("x", "v"), parameters, modes, ends, phase=("s", "w"))
    return saltus.find_orbit(system, {}, [0.0, 0.0]), "A"


def relaxing():
    system = HybridSystem.smooth({"x": "y", "y": "mu*(1 - x**2)*y - x"}, {"mu": 2.0})
    return saltus.find_orbit(system, {}, [2.0, 0.0]), "mu"


def belt():
    fields = {"above": {"x": "v", "v": "cos(s) - x - F"}, "below": {"x": "v", "v": "cos(s) - x + F"}}
    system = saltus.filippov(("x", "v"), {"F": 0.4, "u": 0.3, "w": 0.6}, surface="v - u", phase=("s", "w"), **fields)
    return saltus.find_orbit(system, {}, [1.0, 0.0]), "w"


def branch_of(kind, orbit, name):
    index = orbit.system.parameter_names.index(name)
    problem = OrbitProblem(
        orbit.system, orbit.form, orbit.system.parameter_vector(orbit.parameters), [index], np.ones(1)
    )
    u = np.append(orbit.unknowns, orbit.parameters[name])
    problem.start(u)
    return kind(problem, u, Interest(-10.0, 10.0, 1.0))


@pytest.fixture(scope="module", params=[impacting, pressing, relaxing, belt])
def started(request):
    return request.param()


def points(started, step, iterations):
    for kind in (OrbitZeroProblem, Plain):
        branch = branch_of(kind, *started)
        first = start_point(branch, np.append(started[0].unknowns, started[0].parameters[started[1]]))
        found = correct(branch, first.u + step * first.tangent, first.tangent, first.weights, iterations)
        yield branch, found


@pytest.mark.parametrize("step", [1e-6, 1e-3, 0.05])
def test_compiled_calls_find_the_point_and_the_meshes_of_newton_s_method(started, step):
    """Where meshes are too coarse at the guess they are moved on the way, between two calls."""
    (compiled, here), (plain, there) = points(started, step, 7)
    assert here.iterations == there.iterations
    assert compiled.problem.steps == plain.problem.steps
    for name in ("u", "J", "tangent"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name))
    assert (here.sign, here.log, here.residual) == (there.sign, there.log, there.residual)


@pytest.mark.parametrize(("step", "iterations"), [(1e-3, 1), (3.0, 7), (1e9, 7)])
def test_compiled_calls_tell_why_there_is_no_point_as_newton_s_method_does(started, step, iterations):
    told = [found for _, found in points(started, step, iterations)]
    assert told[0] == told[1]
    assert iterations > 1 or told[0] == Unsolved.LATE


@pytest.mark.parametrize("kind", [OrbitZeroProblem, Plain])
def test_meshes_stay_where_only_the_guess_is_off_the_surface(kind):
    """Beside its surface the field bends within the first step, whose error says nothing of the orbit that is found."""
    orbit, name = pressing()
    branch = branch_of(kind, orbit, name)
    first = start_point(branch, np.append(orbit.unknowns, orbit.parameters[name]))
    guess, (before, _) = first.u + 0.05 * first.tangent, branch.problem.mesh
    branch.evaluate(guess)
    assert branch.problem._worst > 1e3
    found = correct(branch, guess, first.tangent, first.weights, 7)
    assert branch.problem.mesh[0] is before
    assert branch.problem._worst < 5.0
    parameters = {**orbit.parameters, name: found.parameter}
    known = saltus.find_orbit(orbit.system, parameters, orbit.x0)
    np.testing.assert_allclose(found.u[:-1], known.unknowns, rtol=1e-10)
