"""A map in a real browser: its orbit, its branch, another one from a special point, a sweep, the script of all."""

import matplotlib
import pytest

import known_maps
from saltus.explorer.session import Session, new_folder
from saltus.explorer.subjects import of_system
from screen import Screen, browser

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(browser() is None, reason="no Chromium: pages of the explorer are not tested"),
]


def test_a_map_is_explored_and_its_script_makes_the_same(window, address, home, tmp_path, monkeypatch):
    session = Session(of_system(known_maps.logistic()), new_folder(home / "saltus" / "explorer"))
    session.settings.parameters["r"] = 2.8
    session.settings.x0 = (0.1,)
    session.keep()
    window.context.grant_permissions(["clipboard-read", "clipboard-write"])
    screen = Screen(window.new_page(), address, f"&session={session.folder.name}")
    assert "stable" in screen.wait("orbit1")
    screen.fill("parameter-from", "2.5")
    screen.fill("parameter-to", "3.4")
    screen.page.click(".continue")
    screen.wait("branch1")
    screen.eventually(lambda: "PD1" in screen.column("diagram", "marks", "told"))
    screen.click_mark("PD1")
    screen.page.click(".switch")
    screen.wait("branch2")
    screen.fill("sweep-values", "20")
    screen.page.click(".sweep")
    screen.wait("sweep1")
    screen.eventually(lambda: screen.column("diagram", "dots", "x"))
    screen.page.click(".copy-python")
    screen.eventually(lambda: "sweep1" in screen.page.evaluate("() => navigator.clipboard.readText()"))
    assert screen.errors == []
    matplotlib.use("agg")
    monkeypatch.chdir(tmp_path)
    told: dict = {}
    exec(screen.page.evaluate("() => navigator.clipboard.readText()"), told)
    assert {name: told[name] for name in screen.results} == Session.reopened(session.folder).results
    assert told["branch1"]["PD1"].parameters["r"] == pytest.approx(3.0, abs=1e-9)
    assert (tmp_path / "diagram.png").is_file()
