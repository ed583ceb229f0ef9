"""Pages that come and go in a real browser: reloads while work goes on, two windows on one session."""

import pytest

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
