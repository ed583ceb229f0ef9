"""Maps as subjects of the page: every step that is offered, sessions kept, scripts that make the same."""

import numpy as np
import pytest

import known_maps
import saltus
from saltus.explorer.choices import Choices, choices_at
from saltus.explorer.desk import Desk
from saltus.explorer.drawing import default_axes, drawn, extent_of, quantities_of
from saltus.explorer.numerics import Numerics, with_numerics
from saltus.explorer.page import Page
from saltus.explorer.session import Session, new_folder
from saltus.explorer.solutions import path_of, quantity_of, readings_of, traits_of
from saltus.explorer.steps import (
    Cascade,
    Continue,
    FindOrbit,
    Follow,
    Iterate,
    Place,
    SolveOrbit,
    Sweep,
    Switch,
    step_from,
)
from saltus.explorer.subjects import of_system

LOGISTIC = {
    "orbit1": FindOrbit(parameters={"r": 2.8}, x0=(0.1,)),
    "branch1": Continue(place=Place(of="orbit1"), parameter="r", bounds=(2.5, 3.4), of="map_orbit"),
    "branch2": Switch(place=Place(of="branch1", label="PD1"), parameter="r", bounds=(2.5, 3.5), of="map_orbit"),
    "cascade1": Cascade(place=Place(of="branch1", label="PD1"), bounds=(2.5, 4.0), doublings=2),
    "sweep1": Sweep(parameter="r", bounds=(2.9, 3.3), count=5, x0=(0.1,)),
    "orbit2": SolveOrbit(parameters={"r": 3.9}, x0=(0.3,), period=2),
    "motion1": Iterate(parameters={"r": 3.9}, x0=(0.1,), n=30),
}
HENON = {
    "orbit1": FindOrbit(parameters={"a": 0.1}, x0=(0.1, 0.1)),
    "branch1": Continue(place=Place(of="orbit1"), parameter="a", bounds=(-1.0, 1.0), of="map_orbit"),
    "locus1": Follow(place=Place(of="branch1", label="PD1"), parameters=("a", "b"), bounds=((-1.0, 4.0), (-1.5, 0.9))),
}


def taken_all(system, steps) -> dict:
    results: dict = {}
    for name, step in steps.items():
        results[name] = step.run(system, results, False)
    return results


@pytest.fixture(scope="module")
def logistic():
    """Return results of all steps that the logistic map allows."""
    return taken_all(known_maps.logistic(), LOGISTIC)


@pytest.fixture(scope="module")
def henon():
    """Return an orbit of the Henon map, its branch and a locus."""
    return taken_all(known_maps.henon(), HENON)


def session_of(folder, steps, results) -> Session:
    made = Session(of_system(results["orbit1"].system), new_folder(folder))
    for name, step in steps.items():
        made.write(made.add(step, results[name]))
    made.settings.axes = default_axes(made.system, made.system.parameter_names[0])
    made.keep()
    return made


def test_steps_find_what_is_known_in_closed_form(logistic, henon):
    assert logistic["orbit1"].x0 == pytest.approx([1.0 - 1.0 / 2.8])
    assert logistic["branch1"]["PD1"].parameters["r"] == pytest.approx(3.0, abs=1e-9)
    assert logistic["branch2"]["PD1"].parameters["r"] == pytest.approx(1.0 + np.sqrt(6.0), abs=1e-9)
    assert logistic["orbit2"].period == 2
    assert not logistic["orbit2"].stable
    assert henon["branch1"]["PD1"].parameters["a"] == pytest.approx(0.75 * 0.7**2, abs=1e-9)  # b = 0.3


@pytest.mark.campaign
def test_a_session_of_a_map_comes_back_and_its_script_makes_the_same(logistic, tmp_path, monkeypatch):
    import matplotlib

    matplotlib.use("agg")
    session = session_of(tmp_path, LOGISTIC, logistic)
    assert [step_from(entry.step.model_dump()) for entry in session.entries] == [*LOGISTIC.values()]
    assert Session.reopened(session.folder).results == logistic
    monkeypatch.chdir(tmp_path)
    told: dict = {}
    exec(session.script(), told)
    assert {name: told[name] for name in logistic} == logistic
    assert (tmp_path / "diagram.png").is_file()


def test_only_what_a_map_allows_is_offered(logistic, henon):
    def at(results, of, **where):
        return choices_at(Place(of=of, **where), results, lambda system: False)

    assert at(logistic, "orbit1") == Choices("map_orbit", resume=True)
    assert at(logistic, "branch1", label="PD1") == Choices("map_orbit", True, "map_orbit", follow=True, cascade=True)
    assert at(logistic, "branch2", label="BP1") == Choices("map_orbit", True, "map_orbit")
    assert at(henon, "branch1", label="SN1") == Choices("map_orbit", resume=True, follow=True)
    assert at(logistic, "motion1") == Choices()


def test_a_border_collision_has_a_locus_and_no_other_branch():
    orbit = saltus.solve_orbit(known_maps.tent(), x0=[-0.4])
    results = {"branch1": saltus.continue_orbit(orbit, "mu", (-1.0, 1.0))}
    found = choices_at(Place(of="branch1", label="BC1"), results, lambda system: False)
    assert found == Choices("map_orbit", follow=True)


def test_an_orbit_is_seen_at_all_its_points(logistic):
    branch = logistic["branch2"]
    found = drawn(branch, ("r", "x"))
    assert len(found.points) == 2 * len(branch) == 2 * found.count
    assert np.array_equal(found.points[found.count :, 1], branch.iteration("x", 1))
    assert drawn(logistic["cascade1"], ("r", "x")).marks[0].x == pytest.approx(3.0, abs=1e-9)
    assert len(drawn(logistic["sweep1"], ("r", "x")).dots) == 5 * 100
    assert quantities_of(branch.system) == ["r", "x"]


def test_where_a_branch_runs_to_infinity_the_axis_ends_before():
    orbit = saltus.solve_orbit(known_maps.logistic(), {"r": 2.8}, x0=[0.6])
    branch = saltus.continue_orbit(orbit, "r", (0.0, 4.0))  # x = 1 - 1/r
    assert branch.column("x").min() < -1e3
    seen = extent_of(drawn(branch, ("r", "x")))
    assert seen[:, 1].min() > -10.0
    assert seen[:, 1].max() == pytest.approx(0.75)


def test_multipliers_observables_and_points_are_told(logistic):
    orbit = logistic["orbit2"]
    traits = traits_of(orbit)
    assert (traits.spectrum, traits.circle) == ("Multipliers", True)
    assert traits.values == pytest.approx([-(3.9**2) + 2 * 3.9 + 4])  # of the orbit of period 2
    assert quantity_of(orbit, "x") == orbit.x0[0]
    assert readings_of(orbit, dict)["period"] == 2
    assert readings_of(logistic["motion1"], dict)["max(x)"] == logistic["motion1"].states.max()
    assert len(path_of(logistic["motion1"], ("n", "x")).events) == 31


def test_numbers_of_flows_are_not_asked_of_a_map():
    sweep = with_numerics(LOGISTIC["sweep1"], Numerics(keep=3), known_maps.logistic())
    assert (sweep.keep, sweep.section, sweep.tolerance) == (3, None, None)


@pytest.fixture
def opened(toys, monkeypatch):
    """Return a function that opens a page of a session, and the steps that it wants."""
    wanted: list = []

    def opened(session) -> Page:
        desk = Desk(toys, session)
        monkeypatch.setattr(desk, "start", lambda: None)
        monkeypatch.setattr(desk, "run", lambda step, done, replaces: wanted.append(step))
        return Page(desk, lambda content: "0123456789ab", lambda subject: "ba9876543210")

    opened.wanted = wanted
    return opened


@pytest.mark.usefixtures("heard")
def test_the_page_of_a_map_offers_what_a_map_has(logistic, henon, tmp_path, opened):
    page = opened(session_of(tmp_path, LOGISTIC, logistic))
    assert page.plane._boxes == {}
    assert not page.live.busy
    assert not page.numerics._section.visible
    assert "Basins" not in page.orbit.tabs._names  # of one state
    page.plane.start((0.2,))
    page.starts._solve()
    page.begin()
    assert opened.wanted == [Iterate(x0=(0.2,), n=100), SolveOrbit(x0=(0.2,))]
    page.select(Place(of="branch1", label="PD1"))
    shown = [name for name, button in page.actions._buttons.items() if button.visible]
    assert shown == ["resume", "switch", "cascade"]  # one parameter: no locus
    assert page.session.settings.planes == ("x", "next x", "x")
    assert len(page.orbit._sources["portrait"][1].data["x"]) == 1
    assert "Basins" in opened(session_of(tmp_path, HENON, henon)).orbit.tabs._names
