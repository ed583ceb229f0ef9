"""The connection between a page and its server: a browser may be slow, a computer may sleep, a server may end."""

from __future__ import annotations

from typing import Any

__all__ = ["connect", "keep_order"]

_SLOWEST = 180.0  # seconds that a browser may take to load the page; after 15 Bokeh would drop it


def connect(document: Any) -> None:
    """Keep a page until its browser has loaded it, and let the browser say when the server is gone.

    Parameters
    ----------
    document : bokeh.document.Document
        The page, which is being made.
    """
    import panel as pn
    from bokeh.models import CustomJS
    from panel.io.resources import LOCAL_DIST

    # a page that is made by the connection itself, after a long pause, would ask another site for its styles
    document.template_variables.setdefault("dist_url", LOCAL_DIST)
    document.js_on_event("connection_lost", CustomJS(code="lost()"))
    held = _Held(document.session_context)
    document.add_next_tick_callback(held.hold)
    pn.state.onload(held.release)


def keep_order() -> None:
    """Let changes of a page reach its browser in the order in which they were made, in this process.

    While a browser is written to, Panel puts its changes off, and those that Bokeh sends overtake them.
    They may be of models that the browser does not know yet, and then it drops them.
    """
    from panel.io import document

    if not hasattr(document, "schedule_write_events"):
        raise RuntimeError("panel.io.document has no schedule_write_events in this version of Panel")
    document.schedule_write_events = _left_to_bokeh


def _left_to_bokeh(document: Any, connections: Any, events: list[Any]) -> None:
    """Hand changes that cannot be sent at once to Bokeh, which sends all when the document's lock is given back."""
    for event in events:
        document.callbacks.trigger_on_change(event)


class _Held:
    """A page that its server keeps although no browser is connected."""

    def __init__(self, context: Any) -> None:
        self._context, self._holds, self._loaded = context, False, False
        self._timer: Any = None

    def hold(self) -> None:
        """Keep the page, for a time."""
        from tornado.ioloop import IOLoop

        if not self._loaded:
            self._holds = True
            self._context.session.block_expiration()
            self._timer = IOLoop.current().call_later(_SLOWEST, self.release)

    def release(self) -> None:
        """Leave it to Bokeh when the page ends."""
        self._loaded = True
        if self._holds:
            from tornado.ioloop import IOLoop

            self._holds = False
            IOLoop.current().remove_timeout(self._timer)  # it keeps the page, which may be gone
            self._context.session.unblock_expiration()
