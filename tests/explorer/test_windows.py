"""Pages that come and go in a real browser: reloads while work goes on, two windows on one session."""

import os
import re
import signal

import pytest

import saltus
from saltus.explorer.session import Session, new_folder
from saltus.explorer.session_lock import SessionLock
from saltus.explorer.subjects import of_system
from screen import TOKEN, Screen, browser

pytestmark = [
    pytest.mark.skipif(browser() is None, reason="no Chromium: pages of the explorer are not tested"),
    pytest.mark.campaign,
]


def begin_sweep(screen, count: int) -> None:
    """Start a sweep, and wait until it is under way."""
    screen.fill("sweep-values", str(count))
    screen.page.click(".sweep")
    screen.until("work", f" of {count}")


def test_a_page_that_is_loaded_again_takes_over_work_and_result(screen):
    begin_sweep(screen, 2000)
    screen.page.click(".find-orbit")  # it waits behind the sweep
    screen.until("work", "1 more waits: orbit")
    screen.page.reload()
    screen.until("work", " of 2000")
    screen.until("work", "1 more waits: orbit")
    assert screen.page.is_visible(".stop")
    assert screen.page.is_visible(".result-branch1")
    screen.page.click(".stop")
    assert "interrupted" in screen.wait("sweep1")
    screen.page.wait_for_selector(".stop", state="hidden")
    assert screen.errors == []


def test_end_now_lives_as_long_as_its_job(screen):
    begin_sweep(screen, 10_000)
    screen.page.click(".stop")
    screen.wait("sweep1")
    screen.page.wait_for_selector(".stop", state="hidden")
    begin_sweep(screen, 10_000)
    assert screen.page.inner_text(".stop button") == "Stop"
    screen.page.click(".stop")
    assert "interrupted" in screen.wait("sweep2")


def test_two_windows_on_one_session_show_the_same(screen, window, address, home):
    other = Screen(window.new_page(), address, "&" + screen.page.url.partition("?")[2])
    other.wait("branch1")
    screen.page.click(".find-orbit")
    for page in (screen, other):
        page.wait("orbit2")
    other.fill("parameter-ybar", "0.11")
    screen.until_value(".parameter-ybar input", 0.11, within=1e-12)
    screen.fill("axis-y", "max_z")
    other.eventually(lambda: other.page.input_value(".axis-y input") == "max_z")
    other.page.click(".undo")
    screen.page.wait_for_selector(".result-orbit2", state="detached")
    begin_sweep(other, 2000)
    screen.until("work", " of 2000")
    screen.page.click(".stop")
    for page in (screen, other):
        page.wait("sweep1")
    assert screen.errors == other.errors == []
    assert "Traceback" not in (home / "server.log").read_text()


def test_undo_drops_no_result_that_the_page_has_not_shown(screen, window, address):
    page, held, holding = window.new_page(), [], []

    def passed(browsers) -> None:
        server = browsers.connect_to_server()
        server.on_message(lambda said: held.append((browsers, said)) if holding else browsers.send(said))

    page.route_web_socket(re.compile("/ws"), passed)
    slow = Screen(page, address, "&" + screen.page.url.partition("?")[2])
    slow.wait("branch1")
    holding.append(True)
    screen.page.click(".find-orbit")
    screen.wait("orbit2")
    slow.page.click(".undo")  # the last result that it shows is a branch
    screen.heard()
    holding.clear()
    for browsers, said in held:
        browsers.send(said)
    slow.until("message", "that is orbit2 now")
    slow.eventually(lambda: slow.results == screen.results == ["orbit1", "branch1", "orbit2"])  # rows come one by one
    slow.page.click(".undo")
    screen.page.wait_for_selector(".result-orbit2", state="detached")
    page.close()


def test_sessions_are_named_found_again_and_deleted(screen, home):
    first = screen.page.url.partition("session=")[2]
    notes = home / "saltus" / "explorer" / first / "session.json"
    screen.fill("session-name", "near the fold")
    screen.page.click(".new-session")  # at once: what was typed reaches the server before the page is left
    screen.eventually(lambda: first not in screen.page.url)
    screen.wait("orbit1")
    assert not screen.page.locator(".result-branch1").count()
    assert "near the fold" in screen.text(f"session-{first}")
    screen.page.click(f".session-{first} a")
    screen.wait("branch1")
    assert first in screen.page.url
    assert screen.page.input_value(".session-name input") == "near the fold"
    screen.page.wait_for_function("() => document.title == 'near the fold · saltus'")
    screen.page.click(".new-session")
    screen.page.click(f".delete-{first} button")
    screen.until(f"delete-{first}", "Delete?")  # the button is made anew: a click meanwhile would go to the old one
    screen.page.click(f".delete-{first} button")
    screen.page.wait_for_selector(f".session-{first}", state="detached")
    assert not notes.exists()
    assert screen.errors == []


# keeps the connections of a page, to be cut
_SOCKETS = """
  window.sockets = []
  const Socket = window.WebSocket
  window.WebSocket = class extends Socket { constructor(...given) { super(...given); window.sockets.push(this) } }
"""


def test_a_page_whose_server_is_gone_says_so_and_comes_back(window, address, screen):
    page = window.new_page()
    page.add_init_script(_SOCKETS)
    other = Screen(page, address, "&" + screen.page.url.partition("?")[2])
    other.wait("branch1")
    assert not page.is_visible("#lost")
    page.route("**/metadata*", lambda route: route.abort())
    page.evaluate("() => window.sockets.forEach(socket => socket.close())")
    page.wait_for_selector("#lost", state="visible")
    assert "does not answer" in page.inner_text("#lost")
    page.unroute("**/metadata*")
    page.wait_for_selector("#lost", state="hidden")
    other.wait("branch1")
    page.click(".find-orbit")
    for shown in (screen, other):
        shown.wait("orbit2")


def test_pages_that_are_left_are_no_burden(window, server, home):
    address, process = server
    screen = Screen(window.new_page(), address)
    log, counts = home / "server.log", []

    def told():  # lines that are written to their ends
        return [int(count) for count in re.findall(r"pages: *(\d+)\n", log.read_text())]

    for loads in range(1, 9):
        screen.page.reload()
        screen.page.wait_for_selector(".find-orbit")
        os.kill(process.pid, signal.SIGUSR2)
        screen.eventually(lambda loads=loads: len(told()) == loads)
        counts.append(told()[-1])
    assert max(counts) <= 5, counts


def test_a_session_that_another_server_has_open_says_so(window, address, home):
    folder = new_folder(home / "saltus" / "explorer")
    Session(of_system(saltus.HybridSystem.smooth({"x": "-x"})), folder).keep()
    lock = SessionLock(folder)  # of this process
    lock.take()
    page = window.new_page()
    page.goto(f"{address}?token={TOKEN}&session={folder.name}")
    page.wait_for_selector(".refused")
    assert f"process {os.getpid()} has it open" in page.inner_text(".refused")
    lock.release()
    page.reload()
    page.wait_for_selector(".find-orbit")


def test_a_session_of_another_model_names_it(window, address, home, empty):
    folder = new_folder(home / "saltus" / "explorer")
    session = Session(empty.subject, folder)
    session.keep()
    screen = Screen(window.new_page(), address, f"&session={folder.name}")
    chosen = "() => document.querySelector('.systems select').selectedOptions[0].text"
    assert screen.page.evaluate(chosen) == "ball on a table"
    assert screen.errors == []


def shown(window, address, home, system, **settings) -> Screen:
    """Return a page of a new session of a system."""
    folder = new_folder(home / "saltus" / "explorer")
    session = Session(of_system(system), folder)
    for name, value in settings.items():
        setattr(session.settings, name, value)
    session.keep()
    return Screen(window.new_page(), address, f"&session={folder.name}")


def test_a_chaotic_motion_is_shown_and_swept_on_a_section(window, address, home):
    field = {"x": "sigma*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"}
    lorenz = saltus.HybridSystem.smooth(field, {"sigma": 10.0, "r": 28.0, "b": 8.0 / 3.0})
    screen = shown(window, address, home, lorenz, x0=(1.0, 1.0, 20.0), axes=("r", "z"))
    screen.wait("equilibrium1")
    screen.page.click(".find-orbit")
    assert "200" in screen.wait("motion1")
    assert "periodic attractor" in screen.text("message")
    screen.page.click(".fold .card-header")
    screen.fill("numerics-discard", "20")
    screen.fill("section", "max(z)")
    screen.page.select_option(".select-sweep select", "r")
    screen.fill("sweep-values", "5")
    screen.page.click(".sweep")
    assert "sweep1" in screen.wait("sweep1")
    screen.eventually(lambda: len(screen.column("diagram", "dots", "x")) > 100)
    assert "saltus.Section('x*y - b*z', -1)" in screen.page.get_attribute(".result-sweep1 .result", "title")
    assert screen.errors == []


@pytest.mark.usefixtures("own_page")
def test_a_branch_is_followed_with_steps_of_ones_own_and_extended(screen):
    screen.page.click(".fold .card-header")
    screen.fill("numerics-max_points", "15")
    first = screen.column("diagram", "points", "of").index("branch1")
    screen.click_at("diagram", *[screen.column("diagram", "points", axis)[first] for axis in "xy"])
    screen.until("selected", "branch1 point 0")
    screen.page.click(".extend")
    screen.wait("branch2")
    title = screen.page.get_attribute(".result-branch2 .result", "title")
    assert "directions='down', steps=saltus.StepControl(max_points=15)" in title
    assert screen.errors == []
