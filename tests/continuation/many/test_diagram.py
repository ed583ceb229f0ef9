"""Whole diagrams: which branches are found, each special point once, how the search ends, files."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from explained import unexplained
from saltus import HybridSystem, InputError, Mode, StepControl, diagram
from saltus.options import DiagramOptions
from saltus.results import Diagram, EquilibriumBranch
from selection import guarding


def smooth(field, parameters, name=""):
    return HybridSystem(tuple(field), parameters, {"flow": Mode(field)}, name=name)


@pytest.fixture(scope="module")
def lure():
    return smooth({"x": "y", "y": "z", "z": "-al*z - be*y - x + x**2"}, {"al": 1.2, "be": 1.0}, "Lur'e")


@pytest.fixture(scope="module")
def nagumo():
    field = {"v": "v - v**3/3 - w + I0", "w": "tau*(v + a - b*w)"}
    return smooth(field, {"I0": 0.0, "a": 0.7, "b": 0.8, "tau": 0.08}, "FitzHugh-Nagumo")


@pytest.fixture(scope="module")
def lorenz():
    field = {"x": "sigma*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"}
    return smooth(field, {"sigma": 10.0, "r": 0.5, "b": 8.0 / 3.0}, "Lorenz")


@pytest.fixture(scope="module")
def of_lure(lure):
    return diagram(lure, "al", (0.5, 1.5), x0=[0.0, 0.0, 0.0])


def kinds(found):
    return ["equilibria" if isinstance(branch, EquilibriumBranch) else "orbits" for branch in found]


def test_equilibria_lead_to_cycles_and_these_to_doubled_ones(of_lure):
    assert kinds(of_lure) == ["equilibria", "orbits", "orbits"]
    assert [(origin.parent, origin.label, origin.depth) for origin in of_lure.origins] == [
        (-1, "", 0), (0, "HB1", 1), (1, "PD1", 2),
    ]  # fmt: skip
    # lambda^3 + al lambda^2 + be lambda + 1 has an imaginary pair where al be = 1
    assert of_lure.special_points[0].parameters["al"] == pytest.approx(1.0, abs=1e-12)
    doubled, single = of_lure[2].solution(0), of_lure[1]
    assert doubled.period == pytest.approx(2.0 * single["PD1"].orbit.period, rel=0.05)
    assert of_lure.stopped == "all branches to depth 2"
    assert of_lure.failures == ()


def test_a_doubling_is_told_once_though_two_branches_share_it(of_lure):
    places = [point.parameters["al"] for point in of_lure.special_points]
    assert len(places) == len({round(place, 6) for place in places})
    assert [point.label for point in of_lure.special_points] == ["HB1", "PD1", "PD2"]


@pytest.mark.campaign
def test_cycles_between_two_hopf_points_are_followed_once(nagumo):
    found = diagram(nagumo, "I0", (-1.0, 3.0), x0=[-1.2, -0.6])
    assert kinds(found) == ["equilibria", "orbits"]
    v = math.sqrt(1.0 - 0.8 * 0.08)
    exact = sorted((u + 0.7) / 0.8 - u + u**3 / 3.0 for u in (-v, v))
    hopf = sorted(point.parameters["I0"] for point in found.special_points if point.type == "HB")
    assert hopf == pytest.approx(exact, abs=1e-12)


def test_branches_of_a_pitchfork_are_found_from_the_origin(lorenz):
    found = diagram(lorenz, "r", (0.0, 30.0), options=DiagramOptions(depth=1))
    assert kinds(found) == ["equilibria", "equilibria"]
    table = found.table()
    assert table["type"].tolist() == ["BP", "HB", "HB"]
    assert table["r"].to_numpy() == pytest.approx([1.0, 470.0 / 19.0, 470.0 / 19.0], abs=1e-10)
    ends = [found[1].states[i, 0] for i in (0, -1)]
    assert ends[0] == pytest.approx(-ends[1], rel=1e-9)


def test_several_starts_on_one_branch_are_one_branch(lorenz):
    starts = [[0.0, 0.0, 0.0], [8.0, 8.0, 23.0], [-8.0, -8.0, 23.0]]
    found = diagram(lorenz, "r", (0.0, 30.0), x0=starts, parameters={"r": 24.0}, options=DiagramOptions(depth=0))
    assert kinds(found) == ["equilibria", "equilibria"]


def test_the_most_branches_are_kept_to_and_the_rest_is_told(lorenz):
    found = diagram(lorenz, "r", (0.0, 30.0), options=DiagramOptions(max_branches=2))
    assert len(found) == 2
    assert found.stopped == "2 branches: 2 special points are left"


def test_an_interrupt_keeps_what_is_done(lure):
    def interrupt(progress):
        if progress.done > 30:
            raise KeyboardInterrupt

    found = diagram(lure, "al", (0.5, 1.5), progress=interrupt)
    assert found.stopped == "interrupted"
    assert kinds(found) == ["equilibria", "orbits"]
    assert len(found[1]) > 5


def test_progress_tells_the_search_at_a_point_and_an_interrupt_there_keeps_the_branches(lure):
    seen = []

    def interrupt(progress):
        seen.append((progress.done, progress.text))
        if progress.text == "branches at HB1 of branch 0":
            raise KeyboardInterrupt

    found = diagram(lure, "al", (0.5, 1.5), progress=interrupt)
    assert seen[-1][0] == seen[-2][0]
    assert found.stopped == "interrupted"
    assert kinds(found) == ["equilibria"]


def test_progress_tells_branch_and_parameter(nagumo):
    seen = []
    diagram(nagumo, "I0", (-1.0, 0.0), x0=[-1.2, -0.6], progress=lambda told: seen.append((told.done, told.text)))
    assert seen[0][0] == 1
    assert seen[-1][1].startswith("branch 0, I0 = ")


@pytest.mark.campaign
def test_a_file_holds_all_branches(of_lure, tmp_path):
    of_lure.save(tmp_path / "a.nc")
    assert unexplained(of_lure.to_xarray()) == []
    again = saltus.load(tmp_path / "a.nc")
    assert isinstance(again, Diagram)
    assert again == of_lure
    assert repr(again) == repr(of_lure)
    assert again[1]["PD1"].orbit.period == of_lure[1]["PD1"].orbit.period


def test_ranges_are_those_of_all_branches(of_lure):
    highs = max(branch.highs[:, 0].max() for branch in of_lure.branches[1:])
    lows = min(branch.lows[:, 0].min() for branch in of_lure.branches[1:])
    assert of_lure.ranges[0] == pytest.approx(highs - lows)
    assert np.all(of_lure.ranges > 0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameter": "c"}, "parameter = 'c'"),
        ({"bounds": (1.0, 0.0)}, "bounds"),
        ({"x0": [0.0]}, "x0"),
        ({"options": 3}, "options = 3"),
    ],
)
def test_bad_input_is_told(lure, change, message):
    given = {"system": lure, "parameter": "al", "bounds": (0.5, 1.5), "x0": None} | change
    with pytest.raises(InputError, match=message):
        diagram(**given)


@pytest.mark.parametrize("field", ["depth", "max_branches", "equilibria"])
def test_bad_options_are_told(field):
    with pytest.raises(InputError, match=rf"DiagramOptions\.{field}"):
        DiagramOptions(**{field: "much"})


def test_a_forced_system_has_no_diagram():
    forced = HybridSystem(("x",), {"a": 1.0}, {"flow": Mode({"x": "-x + a*cos(s)"})}, phase=("s", "1"))
    with pytest.raises(InputError, match="autonomous"):
        diagram(forced, "a", (0.0, 1.0))


def test_steps_are_those_of_the_options(nagumo):
    few = DiagramOptions(depth=0, equilibria=StepControl(max_points=5))
    assert len(diagram(nagumo, "I0", (-1.0, 3.0), x0=[-1.2, -0.6], options=few)[0]) <= 11


def test_a_hopf_point_at_a_saddle_node_is_tried_and_its_failure_told():
    field = {"x": "-y - z", "y": "x + y/5", "z": "1/5 + z*(x - c)"}  # Roessler's two equilibria meet at c = 0.4
    found = diagram(HybridSystem.smooth(field, {"c": 5.7}), "c", (0.3, 6.0), x0=[5.7, -28.0, 28.0])
    assert sorted(point.type for point in found.special_points) == ["HB", "SN"]
    (failure,) = found.failures
    assert failure.startswith("HB1 of branch 0: ")
    assert "it is a zero-Hopf point" in failure


STARTS = [[[0.0, 0.0]], [[0.0, 0.0], [0.7, 0.0]], [[0.7, 0.0], [0.0, 0.0]], [[0.577, 0.577], [0.0, 0.0]]]


@pytest.mark.parametrize("starts", guarding(STARTS, STARTS[2]))
def test_all_branches_of_a_square_are_found_once_from_any_starts(starts):
    square = HybridSystem.smooth({"x": "a*x - x**3 - b*x*y**2", "y": "a*y - y**3 - b*y*x**2"}, {"a": 0.5, "b": 0.5})
    found = saltus.diagram(square, "a", (-1.0, 1.0), x0=starts)
    axis, diagonal = 1.0, math.sqrt(1.0 / 1.5)
    ends = sorted(tuple(np.abs(branch.states[-1]).round(6) + 0.0) for branch in found.branches)
    assert ends == sorted(
        tuple(np.round(end, 6))
        for end in ((0.0, 0.0), (axis, 0.0), (0.0, axis), (diagonal, diagonal), (diagonal, diagonal))
    )
    for branch in found.branches:
        leaning = np.abs(branch.states).min(axis=1) > 0.0
        assert np.all(branch.stable[branch.values > 0.1] == leaning[branch.values > 0.1])
    assert found.failures == ()
