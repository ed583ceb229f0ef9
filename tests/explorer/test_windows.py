"""Pages that come and go in a real browser: reloads while work goes on, two windows on one session."""

import pytest

from saltus.explorer.session import Session, new_folder
from screen import Screen, browser

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


def test_sessions_are_named_found_again_and_deleted(screen):
    first = screen.page.url.partition("session=")[2]
    screen.fill("session-name", "near the fold")
    screen.page.wait_for_timeout(300)
    screen.page.click(".new-session")
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
    screen.wait("orbit1")
    for _ in range(2):
        screen.page.click(f".delete-{first} button")
    screen.page.wait_for_selector(f".session-{first}", state="detached")
    assert screen.errors == []


def test_a_session_of_another_model_names_it(window, address, home, empty):
    folder = new_folder(home / "saltus" / "explorer")
    session = Session(empty.subject, folder)
    session.keep()
    screen = Screen(window.new_page(), address, f"&session={folder.name}")
    chosen = "() => document.querySelector('.systems select').selectedOptions[0].text"
    assert screen.page.evaluate(chosen) == "ball on a table"
    assert screen.errors == []


def test_a_script_that_may_not_be_copied_is_shown(screen, kept):
    screen.page.evaluate("() => { navigator.clipboard.writeText = () => Promise.reject() }")
    screen.page.click(".copy-python")
    screen.page.wait_for_selector("#script[open]")
    assert screen.page.input_value("#script textarea") == kept.script()
    screen.page.click("#script button")
    screen.page.wait_for_selector("#script", state="hidden")
