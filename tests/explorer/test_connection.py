"""Pages whose browser is slow, and whose connection breaks."""

from types import SimpleNamespace

import panel.models.reactive_html  # noqa: F401  # a class of models on the page
import pytest
from bokeh.client import pull_session

from saltus.explorer.connection import _Held
from screen import TOKEN, apart, served


class Kept:
    """A session of Bokeh that counts who keeps it."""

    count = 0

    def block_expiration(self) -> None:
        self.count += 1

    def unblock_expiration(self) -> None:
        self.count -= 1


@pytest.fixture
def later(monkeypatch):
    """Return what is to be done later, unless it is taken back."""
    found: list = []

    def call_later(seconds: float, work):
        found.append(work)
        return work

    loop = SimpleNamespace(call_later=call_later, remove_timeout=found.remove)
    monkeypatch.setattr("tornado.ioloop.IOLoop.current", lambda: loop)
    return found


@pytest.mark.parametrize("loaded", [True, False])
def test_a_page_is_kept_until_its_browser_has_loaded_it_or_gave_up(later, loaded):
    session = Kept()
    held = _Held(SimpleNamespace(session=session))
    held.hold()
    assert session.count == 1
    (gave_up,) = later
    if loaded:
        held.release()
        assert later == []  # nothing keeps the page's memory
    else:
        gave_up()
    assert session.count == 0


def test_a_page_that_is_loaded_at_once_is_not_kept(later):
    session = Kept()
    held = _Held(SimpleNamespace(session=session))
    held.release()
    held.hold()
    assert session.count == 0
    assert later == []


@pytest.mark.campaign
def test_a_page_that_its_connection_makes_asks_no_other_site(tmp_path):
    def page() -> str:
        session = pull_session(url=address, arguments={"token": TOKEN})  # no page was asked before
        try:
            return str(session.document.to_json())
        finally:
            session.close()

    with served(tmp_path, "tapping-mode-1") as (address, _):
        made = apart(page)
    assert "static/extensions/panel/" in made
    assert "cdn.holoviz" not in made
