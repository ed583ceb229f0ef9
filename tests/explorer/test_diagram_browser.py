"""The diagram, its list of points and its table in a real browser: axes, marks, pictures, keys, small windows."""

import json
from pathlib import Path

import pytest
from PIL import Image

from saltus.explorer import colours
from saltus.explorer.session import Session, new_folder
from saltus.explorer.steps import Place
from saltus.explorer.subjects import of_system
from screen import _PLACE, Screen, browser

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(browser() is None, reason="no Chromium: pages of the explorer are not tested"),
]

DESK, PHONE, TABLET = (1500, 900), (390, 844), (768, 1024)

# texts that do not fit into what holds them, and parts beyond the right edge of the window
_CUT = """() => {
  const found = []
  const look = root => {
    for (const node of root.querySelectorAll('*')) {
      if (node.closest('.scroll') != null && !node.classList.contains('scroll')) continue // it is scrolled to
      const box = node.getBoundingClientRect()
      const drawn = box.width > 0 && getComputedStyle(node).visibility != 'hidden'
      if (drawn && box.right > innerWidth + 1 && !['STYLE', 'SCRIPT', 'LINK'].includes(node.tagName))
        found.push(`${node.tagName}.${node.className} ends at ${Math.round(box.right)}`)
      if (node.shadowRoot && !node.classList.contains('bk-Figure')) look(node.shadowRoot) // a figure clips its own
    }
  }
  look(document.body)
  return found
}"""

# what has the focus, through all shadow trees
_FOCUS = """() => {
  let at = document.activeElement
  const names = []
  while (at) {
    names.push(at.className || at.tagName)
    if (!at.shadowRoot?.activeElement) break
    at = at.shadowRoot.activeElement
  }
  return [names.join(' '), at?.tagName, at?.innerText ?? '']
}"""

# what figures ask style sheets for while all are painted anew
_ASKED = """async () => {
  const asked = [], own = CSSStyleDeclaration.prototype, ask = own.getPropertyValue
  own.getPropertyValue = function(name) { asked.push(name); return ask.call(this, name) }
  for (const view of Bokeh.index.query(view => view.model.type.endsWith('Figure'))) view.request_repaint()
  await new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))
  own.getPropertyValue = ask
  return asked.filter(name => name.startsWith('--bk'))
}"""


def _kept(home: Path, steps, results, axes: tuple[str, str]) -> Path:
    """Return the folder of a session in which steps were taken."""
    session = Session(of_system(next(iter(results.values())).system), new_folder(home / "saltus" / "explorer"))
    session.settings.axes = axes
    for name, step in steps.items():
        session.write(session.add(step, results[name]))
    return session.folder


@pytest.fixture(scope="session")
def ball(home, taken_steps) -> Path:
    return _kept(home, *taken_steps, ("a", "max_z"))


@pytest.fixture(scope="session")
def oscillator(home, rests) -> Path:
    return _kept(home, *rests, ("B", "max_x"))


@pytest.fixture
def opened(request, windows, shared):
    """Return a function that shows a copy of a session in a window."""
    used, failed = [], request.session.testsfailed

    def show(folder: Path, size: tuple[int, int] = DESK) -> Screen:
        used.append(windows(*size))
        used[-1].context.grant_permissions(["clipboard-read", "clipboard-write"])
        return shared.shown(used[-1], folder)

    yield show
    if request.session.testsfailed > failed:
        shared.close()
    for window in used:
        window.tidy(shared.screen)


def axis(screen: Screen, letter: str) -> str:
    return screen.page.input_value(f".axis-{letter} input")


def at_mark(screen: Screen, of: str, label: str) -> list[float]:
    """Return where a special point is on the screen."""
    told = [*zip(screen.column("diagram", "marks", "of"), screen.column("diagram", "marks", "told"), strict=True)]
    number = told.index((of, label))
    place = [screen.column("diagram", "marks", letter)[number] for letter in "xy"]
    return screen.page.evaluate(_PLACE, ["diagram-figure", *place])


def along(screen: Screen, of: str) -> float:
    """Return how far the points of a result reach along the abscissa."""
    columns = (screen.column("diagram", "points", key) for key in ("x", "of"))
    mine = [x for x, name in zip(*columns, strict=False) if name == of]
    return max(mine, default=0.0) - min(mine, default=0.0)


def tip(screen: Screen) -> str | None:
    """Return what is told at the pointer."""
    return screen.page.evaluate(
        """() => {
          const found = Bokeh.documents.map(d => d.get_model_by_name('diagram-figure-tip')).find(tip => tip != null)
          return found.visible ? found.text : null
        }"""
    )


@pytest.mark.usefixtures("own_page")
def test_continued_in_another_parameter_the_abscissa_is_this_parameter(opened, oscillator):
    screen = opened(oscillator)
    screen.page.select_option(".select-parameter select", "A")
    screen.page.click(".continue")
    screen.wait("branch3")
    screen.eventually(lambda: axis(screen, "x") == "A")
    screen.eventually(lambda: along(screen, "branch3") > 0.5)
    screen.page.click(".undo")  # what is left goes along B
    screen.eventually(lambda: axis(screen, "x") == "B")
    screen.fill("axis-x", "A")  # now the user has chosen
    screen.page.select_option(".select-parameter select", "B")
    screen.page.click(".continue")
    screen.wait("branch3")
    screen.until("message", "goes along B, and the axis to the right is fixed at A")
    assert axis(screen, "x") == "A"
    screen.fill("axis-x", "")
    screen.eventually(lambda: axis(screen, "x") == "B")
    assert screen.errors == []


def test_marks_that_coincide_are_told_apart_and_chosen(opened, oscillator):
    screen = opened(oscillator)
    assert "branch1 HB1, branch2 HB1" in screen.column("diagram", "marks", "label")
    screen.page.mouse.click(*at_mark(screen, "branch1", "HB1"))
    screen.page.wait_for_selector(".mark-entry")
    assert screen.page.locator(".mark-entry").count() == 2
    screen.page.locator(".mark-entry", has_text="branch2 HB1").click()
    screen.until("selected", "branch2 HB1, Hopf point")
    screen.page.wait_for_selector(".mark-entry", state="hidden")
    screen.page.mouse.click(*at_mark(screen, "branch1", "HB1"))
    screen.page.locator(".mark-entry", has_text="branch1 HB1").click()
    screen.until("selected", "branch1 HB1, Hopf point")
    assert screen.errors == []


def test_what_is_told_at_the_pointer_is_told_once_and_goes(opened, oscillator):
    screen = opened(oscillator)
    x, y = at_mark(screen, "branch1", "HB1")
    screen.page.mouse.move(x + 1, y + 1)
    screen.eventually(lambda: tip(screen) is not None)
    assert tip(screen).splitlines()[:2] == ["branch1 HB1, Hopf point", "branch2 HB1, Hopf point"]
    assert tip(screen).splitlines()[2:] == ["B = 2", "max x = 1"]
    assert screen.page.locator(".bk-Tooltip, .bk-tooltip").count() == 0
    screen.page.mouse.move(x + 1, y - 120)
    screen.eventually(lambda: tip(screen) is None)
    screen.page.mouse.move(x + 1, y + 1)
    screen.eventually(lambda: tip(screen) is not None)
    screen.fill("axis-y", "y")  # what was told is not there any more
    screen.eventually(lambda: tip(screen) is None)


def test_the_unit_circle_is_round_and_a_far_multiplier_is_an_arrow(opened, ball):
    screen = opened(ball)
    screen.page.click("text=Multipliers")
    screen.drawn("multipliers")
    screen.eventually(lambda: screen.column("multipliers", "values", "x") != [])
    figure = "Bokeh.documents.map(d => d.get_model_by_name('multipliers-figure')).find(f => f != null)"
    wide, high = screen.page.evaluate(f"[{figure}.inner_width, {figure}.inner_height]")
    assert wide == pytest.approx(high, abs=4)
    labels = screen.page.evaluate(f"[{figure}.outer_width - {figure}.inner_width, {figure}.outer_height]")
    assert labels[0] > 60  # room for the numbers of the axis
    grazing = next(p.label for p in Session.reopened(ball).results["branch1"].special_points if p.type in ("GR", "PD"))
    screen.page.mouse.click(*at_mark(screen, "branch1", grazing))
    screen.until("selected", grazing)
    half = screen.page.evaluate(f"{figure}.x_range.end")
    assert max(map(abs, screen.column("multipliers", "values", "x")), default=0.0) < half
    assert max(map(abs, screen.column("multipliers", "arrows", "x")), default=0.0) < half


@pytest.mark.usefixtures("own_page")
def test_two_lists_never_name_one_parameter_and_an_emptied_bound_is_refused(opened, ball):
    screen = opened(ball)
    screen.page.mouse.click(*at_mark(screen, "branch1", "SN1"))
    screen.page.wait_for_selector(".follow", state="visible")
    second = ".select-and select"
    for name in ("e", "a", "g"):
        screen.page.select_option(".select-parameter select", name)
        screen.eventually(lambda name=name: name not in screen.page.locator(f"{second} option").all_inner_texts())
    screen.fill("parameter-to", "")
    screen.page.click(".continue")
    screen.page.wait_for_selector(".message.error")
    assert "upper bound of g = 'empty': must be a finite number" in screen.text("message")
    assert screen.page.locator(".result-branch2").count() == 0


@pytest.mark.usefixtures("own_page")
def test_a_reload_keeps_parameters_and_bounds(opened, ball):
    screen = opened(ball)
    screen.page.select_option(".select-parameter select", "e")
    screen.eventually(lambda: float(screen.page.input_value(".parameter-to input")) == 1.0)
    screen.fill("parameter-to", "0.75")
    screen.page.select_option(".select-sweep select", "a")
    screen.heard()
    screen.page.reload()
    screen.wait("branch1")
    screen.eventually(lambda: float(screen.page.input_value(".parameter-to input")) == 0.75)
    assert screen.page.locator(".select-parameter select").evaluate("s => s.selectedOptions[0].innerText") == "e"
    assert screen.page.locator(".select-sweep select").evaluate("s => s.selectedOptions[0].innerText") == "a"


@pytest.mark.usefixtures("own_page")
def test_what_the_server_has_heard_is_kept(opened, ball):
    screen = opened(ball)
    notes = ball.with_name(screen.page.evaluate("new URL(location).searchParams.get('session')")) / "session.json"
    for parameter, sweep in zip("aegae", "egaga", strict=True):
        screen.page.select_option(".select-sweep select", sweep)
        screen.page.select_option(".select-parameter select", parameter)
        screen.heard()
        chosen = json.loads(notes.read_text())["chosen"]
        assert (chosen["parameter"], chosen["sweep"]) == (parameter, sweep)
        assert chosen["and"] != parameter


def test_list_page_and_picture_have_the_same_colours(opened, ball, tmp_path):
    screen = opened(ball)
    screen.fill("axis-y", "z")
    screen.eventually(lambda: screen.column("diagram", "dots", "x") != [])
    session = Session.reopened(ball)
    with screen.page.expect_download() as waiting:
        screen.page.click(".download-png .bk-btn, .download-png a, .download-png button")
    waiting.value.save_as(tmp_path / "diagram.png")
    seen = {colour for _, colour in Image.open(tmp_path / "diagram.png").convert("RGB").getcolors(2**22)}
    for number, entry in enumerate(session.entries):
        if entry.step.noun in ("branch", "locus", "sweep"):
            colour = colours.colour_of(number, entry.result)
            rgb = tuple(int(colour[i : i + 2], 16) for i in (1, 3, 5))
            swatch = screen.page.locator(f".result-{entry.name} .swatch")
            assert swatch.evaluate("s => getComputedStyle(s).backgroundColor") == f"rgb{rgb}"
            glyph = "dots" if entry.step.noun == "sweep" else "strands"
            assert colour in screen.column("diagram", glyph, "colour")
            assert rgb in seen
    assert min(screen.column("diagram", "dots", "size")) > 2.0 * 2.0  # beneath curves 2 pixels wide, they are seen


def test_the_table_is_sorted_selects_and_is_copied(opened, ball):
    screen = opened(ball)
    session = Session.reopened(ball)
    screen.page.click("text=Special points")
    screen.page.wait_for_selector("table.points tbody tr")
    screen.until("point-table", "nondegenerate")  # normal forms come from the process beside the page
    rows = screen.page.locator("table.points tbody tr")
    assert rows.count() == sum(len(session.results[name].special_points) for name in ("branch1", "locus1"))
    screen.page.locator("table.points th button", has_text="max z").click()
    screen.page.wait_for_selector("table.points th[aria-sort=ascending] >> text=max z")
    column = [float(text.replace("−", "-")) for text in screen.page.locator("td.number:nth-child(5)").all_inner_texts()]
    assert column == sorted(column)
    screen.page.locator("button.point", has_text="PD1").first.click()
    screen.until("selected", "PD1, period doubling")
    screen.page.wait_for_selector("table.points tr[aria-selected] >> text=PD1")
    screen.page.click(".copy-points")
    screen.eventually(lambda: "\t" in screen.page.evaluate("() => navigator.clipboard.readText()"))
    lines = screen.page.evaluate("() => navigator.clipboard.readText()").splitlines()
    assert lines[0].split("\t") == ["result", "point", "meaning", "a", "max_z", "normal form"]
    places = {line.split("\t")[3] for line in lines if line.startswith("branch1\tPD1")}
    assert places == {repr(session.results["branch1"]["PD1"].parameters["a"])}
    assert screen.errors == []


def test_arrow_keys_step_along_the_branch(opened, ball):
    screen = opened(ball)
    branch = Session.reopened(ball).results["branch1"]
    screen.page.locator("div.diagram").focus()
    screen.page.keyboard.press("Home")
    screen.until("selected", "branch1 point 0 ")
    for _ in range(3):
        screen.page.keyboard.press("ArrowRight")
    screen.until("selected", "branch1 point 3 ")
    screen.page.keyboard.press("ArrowLeft")
    screen.until("selected", "branch1 point 2 ")
    screen.page.keyboard.press("ArrowUp")
    first = min((point for point in branch.special_points if point.position > 2), key=lambda point: point.position)
    screen.until("selected", f"branch1 {first.label}, ")
    screen.page.keyboard.press("End")
    screen.until("selected", f"branch1 point {len(branch) - 1} ")
    before = [branch.values[-1]]
    screen.eventually(lambda: screen.column("diagram", "chosen", "x") == before)
    figure = "Bokeh.documents.map(d => d.get_model_by_name('diagram-figure')).find(f => f != null)"
    wide = screen.page.evaluate(f"{figure}.x_range.end - {figure}.x_range.start")
    screen.page.keyboard.press("+")
    screen.eventually(lambda: screen.page.evaluate(f"{figure}.x_range.end - {figure}.x_range.start") < 0.9 * wide)
    screen.page.locator(".axis-y input").focus()
    screen.page.keyboard.press("Home")  # in a field it is the field's
    screen.heard()
    assert screen.column("diagram", "chosen", "x") == before


def test_everything_is_reached_by_the_keyboard(opened, ball):
    screen = opened(ball)
    screen.page.click("text=Special points")
    screen.page.wait_for_selector("button.point")
    wanted = {
        "find-orbit", "sweep", "parameter-a", "slider-a", "start-z", "axis-x", "axis-y", "diagram", "continue",
        "parameter-from", "undo", "copy-python", "download-png", "copy-points", "point", "Special points",
        "Multipliers", "Observables", "Basins",
    }  # fmt: skip
    met = ""
    for _ in range(160):
        screen.page.keyboard.press("Tab")
        met += " ".join(map(str, screen.page.evaluate(_FOCUS))) + "\n"
        if not (missing := {name for name in wanted if name not in met}):
            break
    assert missing == set()
    button = screen.page.locator("button.point")
    button.first.focus()
    screen.page.keyboard.press("ArrowDown")
    screen.page.keyboard.press("Enter")
    screen.until("selected", button.nth(1).inner_text())
    tab = screen.page.locator(".bk-tab", has_text="Multipliers")
    tab.focus()
    screen.page.keyboard.press("Enter")
    screen.page.wait_for_selector(".multiplier-table", state="visible")


@pytest.mark.parametrize("size", [PHONE, TABLET], ids=["phone", "tablet"])
def test_small_windows_show_the_diagram_first_and_cut_nothing(opened, ball, size):
    screen = opened(ball, size)
    screen.eventually(lambda: screen.page.evaluate(_CUT) == [])
    assert screen.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    tops = [screen.page.locator(f"main > .{part}").bounding_box()["y"] for part in ("centre", "side", "controls")]
    assert tops == sorted(tops)
    assert tops[0] < 0.3 * size[1]
    for tab in ("Multipliers", "Observables", "Basins", "Special points"):
        screen.page.click(f"text={tab}")
        screen.heard()
        screen.eventually(lambda: screen.page.evaluate(_CUT) == [])
    assert screen.errors == []


@pytest.mark.usefixtures("own_page")
def test_notes_of_the_session_know_what_was_chosen(opened, ball, home):
    screen = opened(ball)
    screen.fill("axis-x", "e")
    file = home / "saltus" / "explorer" / screen.page.url.partition("session=")[2] / "session.json"
    screen.eventually(lambda: json.loads(file.read_text())["fixed"] == ["x"])
    notes = json.loads(file.read_text())
    assert notes["axes"][0] == "e"
    assert Place.model_validate(notes["selected"]) == Place(of="orbit1")


def test_figures_are_painted_without_a_look_into_style_sheets(screen):
    """Each look makes the browser work out the styles of the whole page: a fifth of the time of a picture."""
    assert screen.page.evaluate("() => [...Bokeh.index.query(v => v.model.type.endsWith('Figure'))].length") >= 3
    assert screen.page.evaluate(_ASKED) == []


def test_what_a_click_changes_comes_in_one_message(window, address, kept):
    page = window.new_page()
    came = []
    page.on("websocket", lambda socket: socket.on("framereceived", lambda sent: came.append(sent)))
    screen = Screen(page, address, f"&session={kept.folder.name}")
    screen.wait("branch1")
    screen.rest()
    x, y = (screen.column("diagram", "points", axis) for axis in "xy")
    came.clear()
    before = screen.text("orbit-title")
    screen.click_at("diagram", x[30], y[30])
    screen.eventually(lambda: screen.text("orbit-title") != before)
    screen.rest()
    changes = [text for text in came if isinstance(text, str) and '"msgtype":"PATCH-DOC"' in text.replace(" ", "")]
    assert len(changes) <= 3, len(changes)
