"""The phase plane in a real browser: what moves with a slider, starts by a click, layers."""

import pytest

import saltus
from saltus.explorer.session import Session, new_folder
from saltus.explorer.subjects import of_system
from screen import _PLACE, TOKEN, Screen, browser

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(browser() is None, reason="no Chromium: pages of the explorer are not tested"),
]

RELAY = saltus.HybridSystem(
    ("x", "v"),
    {"a": 0.5, "c": 0.4},
    {"plus": saltus.Mode({"x": "v", "v": "a - c*v - x"}), "minus": saltus.Mode({"x": "v", "v": "-a - c*v - x"})},
    [saltus.Transition("plus", "minus", "x - 0.2*v", 1), saltus.Transition("minus", "plus", "x - 0.2*v", -1)],
)

# counts what the portrait draws while a slider moves, and the frames in the right order of values
_COUNT = """() => {
  window.drawn = []
  const document = Bokeh.documents.find(d => d.get_model_by_name('portrait-figure') != null)
  for (const part of ['live', 'carried']) {
    const glyph = document.get_model_by_name('portrait-figure').renderers.find(r => r.name == part)
    glyph.data_source.properties.data.change.connect(() => window.drawn.push(part))
  }
}"""

# opens a further diagram, and selects a solution at once: the server draws a ring in the diagram that it has just added
_OPEN_AND_TAKE = """(button, name) => {
  button.click()
  wish(['take', name, null])
}"""


@pytest.fixture(scope="module")
def screen(windows, address, home):
    folder = new_folder(home / "saltus" / "explorer")
    session = Session(of_system(RELAY), folder)
    session.settings.x0 = (0.8, 0.0)  # at 0 it would be on the surface
    session.keep()
    shown = Screen(windows(1500, 900).new_page(), address, f"&session={folder.name}")
    shown.wait("orbit1")
    yield shown
    windows(1500, 900).tidy()


def test_motion_and_orbit_follow_a_slider(screen):
    page = screen.page
    screen.fill("start-x", "0.7")
    screen.eventually(lambda: screen.column("portrait", "carried", "x"))  # the process that draws is ready
    page.evaluate(_COUNT)
    screen.drag("a", 30, -2.0, frames=2)
    screen.eventually(lambda: len(page.evaluate("() => window.drawn")) >= 4)
    assert page.input_value(".parameter-a input") == "0.5"  # nothing is taken before it is let go
    page.mouse.up()
    screen.eventually(lambda: float(page.input_value(".parameter-a input")) < 0.4)
    screen.until("live-text", "the orbit is carried, stable")
    size = float(page.input_value(".parameter-a input")) / 0.5  # the relay's orbits are those of a = 0.5, as large as a
    screen.eventually(
        lambda: (
            max(screen.column("portrait", "carried", "x"), key=lambda v: v or 0.0)
            == pytest.approx(size * max(map(max, screen.column("portrait", "curves", "xs"))), rel=1e-3)
        )
    )
    drawn = page.evaluate("() => window.drawn")
    assert {"live", "carried"} == {*drawn}
    assert screen.errors == []


def test_a_click_starts_a_motion_and_several_are_kept(screen):
    for number, place in enumerate([(0.3, 0.1), (-0.2, -0.1)], 1):
        screen.click_at("portrait", *place)
        assert "Trajectory" in screen.wait(f"motion{number}")
    screen.eventually(lambda: {*screen.column("portrait", "motions", "name")} == {"motion1"})
    assert float(screen.page.input_value(".start-x input")) == pytest.approx(-0.2, abs=0.01)
    screen.page.click(".simulate")
    screen.wait("motion3")
    screen.eventually(lambda: {*screen.column("portrait", "motions", "name")} == {"motion1", "motion2"})
    screen.page.click(".show-motion1 input")
    screen.eventually(lambda: {*screen.column("portrait", "motions", "name")} == {"motion2"})
    assert screen.errors == []


def test_layers_are_ticked(screen):
    for name, least in (("field", 300), ("nullclines", 2), ("surfaces", 1)):
        screen.page.click(f".tick-{name} input")
        screen.eventually(lambda name=name, least=least: len(screen.column("portrait", name, "xs")) >= least)
    screen.until("plane-text", "v′ = 0")
    assert TOKEN not in screen.page.url
    assert screen.errors == []


def test_diagrams_stand_side_by_side_and_space_is_turned_by_a_drag(screen):
    page = screen.page
    page.click(".more-diagrams")
    page.wait_for_selector(".fewer-diagrams", state="visible")
    screen.eventually(lambda: screen.column("diagram2", "points", "x") == screen.column("diagram", "points", "x"))
    page.click(".find-orbit")  # motions were shown before
    screen.wait("orbit2")
    page.click(".continue")
    screen.wait("branch1")
    page.click("text=3-D")
    screen.drawn("space")
    screen.eventually(lambda: screen.column("space", "curves", "u"))
    before = screen.column("space", "curves", "u")[0][:3]
    x, y = page.evaluate(_PLACE, ["space-figure", 0.0, 0.0])
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60.0, y, steps=5)
    page.mouse.up()
    screen.eventually(lambda: screen.column("space", "curves", "u")[0][:3] != before)
    page.locator(".side .whole-screen").click()
    screen.eventually(lambda: page.evaluate("() => document.fullscreenElement?.className == 'side'"))
    page.locator(".side .whole-screen").click()
    assert screen.errors == []


def test_a_diagram_is_on_the_page_before_it_is_drawn_on(screen):
    screen.page.click(".find-orbit")
    screen.wait("orbit2")
    screen.until("selected", "orbit2")
    number = screen.page.locator(".axis-y").count() + 1
    screen.page.locator(".more-diagrams button").evaluate(_OPEN_AND_TAKE, "orbit1")
    screen.eventually(lambda: screen.errors or screen.page.locator(".axis-y").count() == number)
    screen.until("selected", "orbit1")
    diagrams = "diagram", f"diagram{number}"
    screen.eventually(lambda: [screen.column(name, "chosen", "x") for name in diagrams] == [[0.5], [0.5]])
    assert screen.errors == []


def test_equations_are_changed_and_open_a_session(screen):
    page = screen.page
    page.click("text=Equations")
    field = page.locator(".equations textarea")
    screen.eventually(lambda: "x - 0.2*v rises through 0" in field.input_value())
    field.fill("parameters a = 0.5\nx' = v\nv' = -a*x - vv")
    field.blur()
    page.click(".use-equations")
    screen.until("equations-told", "line 3, v'")
    field.fill("parameters a = 0.5\nx' = v\nv' = -a*x - v")
    field.blur()
    page.click(".use-equations")
    page.click(".equations-told a")
    assert "Equilibrium" in screen.wait("equilibrium1")
    assert screen.errors == []
