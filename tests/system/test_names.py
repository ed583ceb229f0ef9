"""Whatever the parts of a definition are called, results are the same: x' = A cos(theta) - k x, theta' = w."""

import math

import matplotlib.pyplot as plt
import numpy as np
import pytest

import saltus
from saltus import HybridSystem, Mode
from saltus.sweeps import Section

SETS = [
    ("E", "I", "N", "S", "gamma", "zeta"),  # constants and functions of SymPy
    ("sin", "exp", "pi", "log", "sqrt", "abs"),  # functions and the constant of expressions
    ("mode", "period", "stable", "form", "t", "x0"),  # what datasets call something else
    ("\u00b5", "\u03a9", "min_x", "_", "u0", "p"),  # letters that Python respells, names of generated text
]


def relaxation(x, k, w, A, theta, power):
    return HybridSystem(
        (x,),
        {k: 1.0, w: 2.0, A: 3.0},
        {"free": Mode({x: f"{A}*cos({theta}) - {k}*{x}"})},
        phase=(theta, w),
        outputs={power: f"{k}*{x}**2"},
    )


@pytest.fixture(scope="module", params=SETS, ids=lambda names: names[0])
def named(request):
    return request.param, relaxation(*request.param)


def test_names_reach_fields_trajectories_and_observables(named):
    (x, k, _, a, _, power), system = named
    assert system.field("free", [0.5, 0.0])[0] == 2.5
    motion = saltus.simulate(system, {}, [0.5], t_end=20.0 * math.pi)
    assert motion.output(f"{power} + {a}*{x}", 0.0) == pytest.approx(0.25 + 1.5, abs=1e-15)
    found = motion.observe(f"amplitude({x}, 1)", f"max({power}/{k})")
    assert found[f"amplitude({x}, 1)"] == pytest.approx(3.0 / math.sqrt(5.0), rel=1e-2)  # the start dies out


@pytest.mark.campaign
def test_names_reach_orbits_branches_their_files_and_pictures(named, tmp_path):
    (x, k, w, a, theta, power), system = named
    orbit = saltus.find_orbit(system, {}, [0.5])
    assert orbit.max[power] == pytest.approx(9.0 / 5.0, rel=1e-7)
    branch = saltus.continue_orbit(orbit, k, (0.9, 1.1), events={f"max_{x}": 1.34})
    assert branch.special_points[0].parameters[k] == pytest.approx(math.sqrt((3.0 / 1.34) ** 2 - 4.0), rel=1e-7)
    peak = branch.column(f"max({x})")
    np.testing.assert_allclose(peak, 3.0 / np.hypot(branch.column(k), 2.0), rtol=1e-7)
    np.testing.assert_allclose(branch.column(k), branch.values, rtol=0)
    for result in (orbit, branch):
        again = saltus.load(result.save(tmp_path / "result.nc"))
        assert again == result
        assert again.system == system
    for result, axes in ((orbit, {"x": x, "y": power}), (branch, {"y": f"max({power})"})):
        result.plot(**axes)
        plt.close("all")
    section = Section(f"{power} - {a}/3")
    on_section, (index,) = saltus.sweeps.section.on_section(system, section)
    assert on_section.transitions[index].event == f"({k}*{x}**2) - {a}/3"
    assert {theta, w} < {*on_section.all_states, *on_section.parameters}
