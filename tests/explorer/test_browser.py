"""The explorer in a real browser: each test in a window of a desk and in one of 1024 pixels."""

import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from saltus.explorer.session import Session, new_folder
from screen import PATIENCE, TOKEN, Screen, browser, served
from selection import guarding

pytestmark = pytest.mark.skipif(browser() is None, reason="no Chromium: pages of the explorer are not tested")

WINDOWS = {"desk": (1500, 900), "small": (1024, 768)}

desk_alone = pytest.mark.parametrize("window", ["desk"], indirect=True)


@pytest.fixture(params=guarding(WINDOWS, "desk", campaign=0))
def window(request, windows, shared):
    shown = windows(*WINDOWS[request.param])
    yield shown
    shown.tidy(shared.screen)


def test_a_first_page_finds_an_orbit_and_asks_nothing_from_outside(window, address):
    screen = Screen(window.new_page(), address)
    assert "stable" in screen.wait("orbit1")
    screen.page.click(".continue")
    assert "Omega from 0.8 to 1.4" in screen.wait("branch1")
    assert screen.errors == []
    assert "session=" in screen.page.url
    assert "token" not in screen.page.url
    screen.page.wait_for_function("() => document.title == 'tapping-mode AFM, 1 mode · saltus'")


@pytest.mark.campaign
def test_a_fold_is_selected_by_a_click_and_its_frequency_read(screen, kept):
    screen.click_mark("SN4")
    exact = kept.results["branch1"]["SN4"].parameters["Omega"]
    assert f"SN4, saddle-node · Ω = {exact:.12g}" in screen.text("selected")
    screen.page.wait_for_selector(".follow", state="visible")
    assert not screen.page.is_visible(".switch")
    screen.page.click("text=Multipliers")
    assert len(screen.column("multipliers", "values", "x")) == 2
    screen.page.click("text=Observables")
    assert f"{kept.results['branch1']['SN4'].orbit.period:.9g}" in screen.text("readings")
    assert screen.errors == []


def test_a_slider_moves_a_parameter(screen):
    handle = screen.page.locator(".slider-ybar .noUi-handle")
    handle.focus()
    for k in range(1, 6):
        handle.press("ArrowRight")
        screen.until_value(".parameter-ybar input", 0.108 + 0.0014 * k, within=1e-3)
    screen.page.click(".find-orbit")
    screen.wait("orbit2")
    value = float(screen.page.input_value(".parameter-ybar input"))
    assert value == pytest.approx(0.108 + 5.0 * 0.0014, abs=1e-3)  # five of 200 steps from 0.02 to 0.3
    assert f"'ybar': {value!r}" in screen.page.get_attribute(".result-orbit2 .result", "title")


@pytest.mark.campaign
def test_another_branch_and_a_cascade_start_at_a_period_doubling(screen):
    screen.click_mark("PD2")
    screen.page.click(".switch")
    assert "Branch" in screen.wait("branch2")
    screen.until("selected", "branch1 PD2")  # what was selected stays so while results come
    screen.page.click(".cascade")
    assert "Cascade" in screen.wait("cascade1")
    screen.page.click(".undo")
    screen.page.wait_for_selector(".result-cascade1", state="detached")
    assert screen.errors == []


@pytest.mark.campaign
def test_a_locus_is_followed_and_shown_in_its_plane(screen):
    screen.click_mark("SN4")
    screen.page.click(".follow")
    assert "SN locus" in screen.wait("locus1")
    screen.eventually(lambda: screen.page.input_value(".axis-y input") == "ybar")
    assert screen.errors == []


@pytest.mark.campaign
def test_basins_are_mapped_and_a_cell_is_followed(screen):
    screen.page.click("text=Basins")
    screen.page.click(".map-basins")
    screen.until("basin-legend", "100 x 100 cells")
    assert "100 x 100 cells" in screen.wait("basins1")
    assert "repulsive" in screen.text("basin-legend")
    screen.click_at("basins", 0.1, 0.2)
    assert "60 periods" in screen.wait("motion1")
    assert screen.errors == []


@pytest.mark.campaign
def test_a_sweep_is_stopped_and_what_is_done_is_kept(screen):
    screen.fill("sweep-values", "2000")
    screen.page.click(".sweep")
    screen.page.wait_for_selector(".stop", state="visible")
    screen.until("work", " of 2000")
    screen.page.click(".stop")
    assert "interrupted" in screen.wait("sweep1")
    screen.page.wait_for_selector(".stop", state="hidden")
    screen.page.click(".find-orbit")
    screen.wait("orbit2")


@pytest.mark.campaign
@desk_alone
def test_a_click_right_after_a_change_is_not_lost(screen):
    screen.page.locator(".axis-y input").fill("max_z")
    both = [screen.page.locator(place).element_handle() for place in (".axis-y input", ".find-orbit button")]
    screen.page.evaluate("([field, button]) => { field.dispatchEvent(new Event('change')); button.click() }", both)
    screen.wait("orbit2")
    assert screen.column("diagram", "points", "y") != []
    assert screen.page.input_value(".axis-y input") == "max_z"


@pytest.mark.campaign
def test_a_page_that_is_loaded_again_finds_its_session(screen):
    screen.fill("axis-y", "max_z")
    screen.page.click(".find-orbit")
    screen.wait("orbit2")
    screen.heard()
    screen.page.reload()
    screen.wait("orbit2")
    screen.eventually(lambda: screen.page.input_value(".axis-y input") == "max_z")
    assert screen.errors == []


@pytest.mark.campaign
def test_a_wrong_expression_is_told_in_the_page_and_never_run(screen, kept):
    screen.fill("axis-y", "__import__('os').getcwd()")
    screen.page.wait_for_selector(".message.error")
    assert "__import__" in screen.text("message")
    screen.fill("axis-y", "-2*amplitude(z, 1)")
    screen.page.wait_for_selector(".message.error", state="detached")
    lowest = min(kept.results["branch1"].column("-2*amplitude(z, 1)"))
    screen.eventually(lambda: min(screen.column("diagram", "points", "y"), default=0.0) == pytest.approx(lowest))
    assert screen.errors == []


@pytest.mark.campaign
@desk_alone
def test_what_a_field_for_a_number_does_not_take_is_told(screen):
    page, before = screen.page, screen.fields()
    for name, texts in {
        "start-q1": {
            "nan": "'nan': must be a number",
            "": "'empty': must be a finite number",
            "-": "'-': must be a number",
        },
        "sweep-values": {"1": "'1': must be a whole number from 2 to 10000", "2.5": "'2.5': must be a whole number"},
        "parameter-Omega": {"1e999": "inf: must be a finite number", "-1": "-1"},
    }.items():
        for text, told in texts.items():
            screen.fill(name, text)
            screen.until("message", told)
            screen.eventually(lambda: screen.fields() == before)
            screen.fill(name, before[name])
    screen.fill("start-q1", "0.25")
    assert float(page.input_value(".start-q1 input")) == 0.25
    assert screen.errors == []


@pytest.mark.campaign
def test_two_pages_do_not_disturb_each_other(screen, window, address):
    other = Screen(window.new_page(), address)
    other.wait("orbit1")
    screen.page.click(".find-orbit")
    screen.wait("orbit2")
    other.page.click(".continue")
    other.wait("branch1")
    screen.page.click(".undo")
    screen.page.wait_for_selector(".result-orbit2", state="detached")
    other.page.click(".undo")
    other.page.wait_for_selector(".result-branch1", state="detached")
    screen.eventually(lambda: screen.results == ["orbit1", "branch1"])
    other.eventually(lambda: other.results == ["orbit1"])
    assert screen.errors == other.errors == []


@pytest.mark.campaign
@pytest.mark.thorough
@desk_alone
def test_a_page_in_a_frame_of_another_site_works_without_cookies(window, address):
    framing = f"<iframe width=1000 height=800 src='{address}?token={TOKEN}'></iframe>".encode()

    class Other(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.end_headers()
            self.wfile.write(framing)

    page = window.new_page()
    page.set_default_timeout(PATIENCE)
    with HTTPServer(("127.0.0.1", 0), Other) as other:
        threading.Thread(target=other.serve_forever, daemon=True).start()
        page.goto(f"http://localhost:{other.server_port}/")  # to a browser another site than 127.0.0.1
        other.shutdown()
    frame = page.frame_locator("iframe")
    frame.locator(".result-orbit1 .result").wait_for()
    frame.locator(".continue").click()
    frame.locator(".result-branch1 .result").wait_for()


@pytest.mark.campaign
@desk_alone
def test_an_error_of_the_library_is_a_line_in_the_page(screen):
    screen.fill("start-q1", "1e300")
    screen.page.click(".find-orbit")
    screen.page.wait_for_selector(".message.error")
    assert screen.text("message")
    assert "Traceback" not in screen.text("message")


@pytest.mark.campaign
@desk_alone
def test_sets_of_values_are_saved_by_name(screen):
    screen.fill("parameter-Omega", "1.11")
    screen.page.locator(".set-name input").fill("near the fold")
    screen.page.click(".save-set")
    screen.fill("parameter-Omega", "0.9")
    screen.page.select_option(".sets select", "near the fold")
    screen.eventually(lambda: float(screen.page.input_value(".parameter-Omega input")) == 1.11)


@pytest.mark.campaign
@desk_alone
@pytest.mark.usefixtures("own_page")
def test_script_and_files_leave_the_page(screen, window, tmp_path, kept):
    window.context.grant_permissions(["clipboard-read", "clipboard-write"])
    screen.page.click(".copy-python")
    screen.eventually(lambda: screen.page.evaluate("() => navigator.clipboard.readText()") == kept.script())
    for kind, least in {"py": 250, "nc": 20_000, "png": 20_000, "svg": 20_000}.items():
        screen.page.mouse.move(0, 0)  # away from a button whose tip may cover the next one
        with screen.page.expect_download() as waiting:
            screen.page.click(f".download-{kind} .bk-btn, .download-{kind} a, .download-{kind} button")
        path = tmp_path / f"file.{kind}"
        waiting.value.save_as(path)
        assert path.stat().st_size > least
    assert (tmp_path / "file.py").read_text() == kept.script()
    again = Session.unpacked(tmp_path / "file.nc", new_folder(tmp_path))
    assert again.results == kept.results
    screen.page.evaluate("() => { navigator.clipboard.writeText = () => Promise.reject() }")
    screen.page.click(".copy-python")
    screen.page.wait_for_selector("#script[open]")
    assert screen.page.input_value("#script textarea") == kept.script()
    screen.page.click("#script button")
    screen.page.wait_for_selector("#script", state="hidden")


@pytest.mark.campaign
@desk_alone
def test_a_session_is_uploaded_whatever_its_file_is_called(screen, tmp_path, kept, home):
    copy = kept.packed(tmp_path / "session.nc")
    for name in ("..%2f..%2fevil.nc", "branch1.nc"):
        screen.page.locator(".open-session input").set_input_files(
            {"name": name, "mimeType": "application/x-netcdf", "buffer": copy.read_bytes()}
        )
        before = screen.page.url
        screen.page.click(".message a")
        screen.eventually(lambda before=before: screen.page.url != before)
        screen.wait("branch1")
    assert not [*home.rglob("*evil*")]
    screen.page.locator(".open-session input").set_input_files(
        {"name": "x.nc", "mimeType": "application/x-netcdf", "buffer": b"no NetCDF"}
    )
    screen.page.wait_for_selector(".message.error")
    assert "NetCDF" in screen.text("message")


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_session_comes_back_after_its_server_was_killed(tmp_path, chromium):
    context = chromium.new_context()
    with served(tmp_path, "tapping-mode-1") as (address, server):
        screen = Screen(context.new_page(), address)
        screen.wait("orbit1")
        screen.page.click(".continue")
        screen.wait("branch1")
        folder = tmp_path / "saltus" / "explorer"
        screen.eventually(lambda: any('"branch1"' in notes.read_text() for notes in folder.glob("*/session.json")))
        server.kill()
    with served(tmp_path, "tapping-mode-1") as (address, _):
        begun = (tmp_path / "server.log").read_text()
        assert "&session=" in begun
        again = Screen(context.new_page(), address, "&" + begun.split("&")[1].split()[0])
        again.wait("branch1")
    context.close()
