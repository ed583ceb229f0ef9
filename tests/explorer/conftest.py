"""Sessions of a ball on a table and of a chemical oscillator, and an application that is no saltus.afm."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Iterator
from functools import cache
from pathlib import Path

import pytest

import saltus
from saltus import companion
from saltus.afm.explorer_models import TAPPING
from saltus.explorer.application import Application
from saltus.explorer.session import Session, new_folder
from saltus.explorer.steps import Continue, FindEquilibrium, FindOrbit, Follow, Move, Place, Sweep, Switch
from saltus.explorer.subjects import Subject, of_system
from screen import Screen, SharedPage, Window, browser, served
from systems import ball_on_table as table


def make(key: str) -> Subject:
    """Return the model of the toy application."""
    return of_system(table(), key)


def readings(orbit) -> dict[str, float]:
    """Return what a clock beside the table shows."""
    return {"beats": 1.0 / orbit.period}


def films(system) -> bool:
    """Return whether it is the ball."""
    return system.states == ("z", "v")


def film(orbit, path: str, progress) -> Path:
    """Write down what would be filmed."""
    Path(path).write_text(f"{orbit.period:.6f}")
    return Path(path)


def _at_once(called: Callable[[], Coroutine]) -> None:
    with pytest.raises(StopIteration):  # it has ended, and waits for nothing
        called().send(None)


@pytest.fixture
def heard(monkeypatch) -> None:
    """Call at once what listens to widgets: without a server Panel makes a loop for each call, and leaves it open."""
    monkeypatch.setattr("param.parameterized.async_executor", _at_once)


@pytest.fixture(autouse=True, scope="module")
def none_left():
    """End processes that sessions leave to the next ones: other tests count processes."""
    yield
    while companion._LEFT:
        companion._ended(companion._LEFT.pop()[1][0])


@pytest.fixture(scope="session")
def toys() -> Application:
    return Application({"table": "A ball on a table", "bench": "The same"}, make, readings, films, film)


@pytest.fixture(scope="session")
def taken_steps(ball_on_table):
    """Return steps of a session with the ball, and their results: an orbit, its branch, a locus, a sweep, a motion."""
    steps = {
        "orbit1": FindOrbit(parameters={"a": 1.2}, x0=(0.6, 3.1, 0.5)),
        "branch1": Continue(place=Place(of="orbit1"), parameter="a", bounds=(0.9, 1.8)),
        "locus1": Follow(
            place=Place(of="branch1", label="SN1"), parameters=("a", "e"), bounds=((0.1, 3.0), (0.3, 0.7))
        ),
        "sweep1": Sweep(parameter="a", bounds=(1.15, 1.2), count=2, x0=(0.6, 3.1)),
        "motion1": Move(parameters={"a": 1.1}, x0=(0.6, 3.1, 0.5), periods=3),
    }
    results: dict = {}
    for name, step in steps.items():
        results[name] = step.run(ball_on_table, results, False)
    return steps, results


@pytest.fixture(scope="session")
def results(taken_steps):
    return taken_steps[1]


@pytest.fixture(scope="session")
def rests():
    """Return a chemical oscillator's equilibrium, its branch through a Hopf point, and the cycles that begin there."""
    field = {"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}
    system = saltus.HybridSystem(("x", "y"), {"A": 1.0, "B": 1.5}, {"reaction": saltus.Mode(field)})
    steps = {
        "equilibrium1": FindEquilibrium(x0=(1.0, 1.5)),
        "branch1": Continue(place=Place(of="equilibrium1"), parameter="B", bounds=(1.0, 3.0), of="equilibrium"),
        "branch2": Switch(place=Place(of="branch1", label="HB1"), parameter="B", bounds=(1.5, 3.0), of="orbit"),
    }
    found: dict = {}
    for name, step in steps.items():
        found[name] = step.run(system, found, False)
    return steps, found


def _session(folder, steps, results) -> Session:
    made = Session(of_system(next(iter(results.values())).system), new_folder(folder))
    for name, step in steps.items():
        assert made.add(step, results[name]).name == name
    return made


@pytest.fixture
def session(tmp_path, taken_steps) -> Session:
    """Return a session with all results of the ball, not yet written."""
    return _session(tmp_path, *taken_steps)


@pytest.fixture
def still(tmp_path, rests) -> Session:
    """Return a session with equilibria, not yet written."""
    return _session(tmp_path, *rests)


@pytest.fixture
def empty(tmp_path, ball_on_table) -> Session:
    """Return a session of the ball without a result."""
    return Session(of_system(ball_on_table), new_folder(tmp_path))


@pytest.fixture(scope="session")
def home(tmp_path_factory) -> Path:
    """Return the folder of the server that all tests in a browser share."""
    return tmp_path_factory.mktemp("home")


@pytest.fixture(scope="session")
def server(home):
    """Serve pages for all tests in a browser: the address and the process."""
    with served(home) as found:
        yield found


@pytest.fixture(scope="session")
def address(server) -> str:
    """Return the address of the server that all tests in a browser share."""
    return server[0]


@pytest.fixture(scope="session")
def chromium():
    """Start the browser that all tests share."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        started = play.chromium.launch(executable_path=browser(), args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="session")
def kept(home) -> Session:
    """Return the session of Fig. 3: an orbit and its branch."""
    session = Session(TAPPING.subject("tapping-mode-1"), new_folder(home / "saltus" / "explorer"))
    session.settings.axes = ("Omega", "min_z")
    orbit = FindOrbit(parameters={"Omega": 1.05}, x0=(-0.67, 0.75))
    session.write(session.add(orbit, orbit.run(session.system, {}, False)))
    branch = Continue(place=Place(of="orbit1"), parameter="Omega", bounds=(0.8, 1.4))
    session.write(session.add(branch, branch.run(session.system, session.results, False)))
    return session


@pytest.fixture(scope="session")
def windows(chromium):
    """Return a function that gives the window of a size, the same for all tests."""
    context = chromium.new_context()
    return cache(lambda width, height: Window(context, width, height))


@pytest.fixture(scope="session")
def shared(address) -> SharedPage:
    """Return the page that tests share."""
    return SharedPage(address)


@pytest.fixture
def window(windows, shared):
    """Return a window of a desk."""
    yield windows(1500, 900)
    windows(1500, 900).tidy(shared.screen)


@pytest.fixture
def own_page(shared) -> Iterator[None]:
    """Let a test have a page that no other has changed, nor sees later."""
    shared.close()
    yield
    shared.close()


@pytest.fixture
def screen(request, window, shared, kept) -> Iterator[Screen]:
    """Return a page that shows a copy of Fig. 3's session."""
    failed = request.session.testsfailed
    yield shared.shown(window, kept.folder)
    if request.session.testsfailed > failed:
        shared.close()
