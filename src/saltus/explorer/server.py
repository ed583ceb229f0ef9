"""The server of the explorer: pages and their sessions, on the loopback address unless told otherwise."""

from __future__ import annotations

import gc
import hmac
import logging
import secrets
import socket
import threading
import webbrowser
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from errno import EADDRINUSE
from html import escape
from importlib.resources import files
from pathlib import Path
from traceback import walk_tb
from typing import TYPE_CHECKING, Any

from saltus.errors import InputError, SaltusError
from saltus.explorer import look
from saltus.explorer.connection import connect, keep_order
from saltus.explorer.desk import start_ahead
from saltus.explorer.figures.defaults import remember_defaults
from saltus.explorer.tasks import expect_results
from saltus.work import uncollected

if TYPE_CHECKING:
    from saltus.explorer.office import Office
    from saltus.explorer.page import Page
    from saltus.explorer.views.session_view import SessionView

__all__ = ["LEFT", "LOOPBACK", "Address", "listening", "serve"]

LOOPBACK = ("127.0.0.1", "localhost")  # names of this machine for itself
_PORT = 8710  # tried first
_TRIES = 5  # free ports that are tried after it: another program may be faster
_COOKIE = "saltus_token"
LEFT = "a page was left before the server had heard all of it: its last change is lost"
_PACE = 40  # milliseconds between two looks at what processes say
_LINGERS = 2000  # milliseconds that a page without a browser is kept: one that comes back is loaded again anyway
_LOOKS = 1000  # milliseconds between two looks for such pages
_RESTS = 0.05  # seconds from the end of a page to the collection of its memory


@dataclass(frozen=True)
class Address:
    """Where the server listens."""

    host: str = "127.0.0.1"  # an address of this machine
    port: int = 0  # the port; 0 for a free one
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))  # what a browser must know

    @property
    def names(self) -> frozenset[str]:
        """What browsers may call the server: other names are those of other sites."""
        hosts = {self.host, *LOOPBACK} if self.host in LOOPBACK else {self.host, socket.gethostname()}
        return frozenset(f"{name}:{self.port}" for name in hosts)


def _template(office: Office, page: Page, sessions: SessionView) -> Any:
    """Return the whole page."""
    import panel as pn

    class Whole(pn.Template):  # type: ignore[misc]  # Panel's declared types are not read
        def __repr__(self) -> str:
            """Return a short text: Panel asks for it after each part, and that of all parts takes 0.1 s."""
            return "the explorer's page"

    made = Whole(files(__package__).joinpath("page.html").read_text(encoding="utf-8"))
    for name, part in page.parts().items():
        made.add_panel(name, part)
    made.add_panel("sessions", sessions.panel)
    subject = page.session.subject
    made.add_variable("page_style", look.page_style())
    made.add_variable("page_script", look.page_script())
    made.add_variable("session", page.session.folder.name)
    title = page.session.system.name or Path(subject.key).name
    made.add_variable("tab", f"{page.session.name or title} · saltus")
    made.add_variable("subject", escape(title))
    known = {} if office.subject is not None else {**office.application.titles}
    if known and subject.key not in known:  # of a session's file, which a new session does not have
        known |= {subject.key: title}
    made.add_variable("systems", [(escape(key), escape(told)) for key, told in known.items()])
    made.add_variable("chosen", escape(subject.key))
    return made


def _load() -> None:
    """Import what pages need, and keep the garbage collector from these modules for good: it is faster then."""
    with uncollected():
        import saltus.explorer.page
        import saltus.explorer.views.session_view  # noqa: F401
    gc.freeze()


def _collect_soon(context: Any) -> None:
    """Collect garbage once a page is gone: it refers to itself, and Panel waits until no page goes for 5 s."""
    from tornado.ioloop import IOLoop

    IOLoop.current().call_later(_RESTS, gc.collect)


def _page_of(office: Office) -> Callable[[], Any]:
    """Return the function that puts a page into the document of each visit."""

    def make() -> Any:
        import panel as pn

        asked = {key: values[0].decode(errors="replace") for key, values in pn.state.session_args.items() if values}
        try:
            desk = office.desk(asked.get("session"), asked.get("system"))
        except SaltusError as error:
            return pn.pane.HTML(f'<p class="refused">{escape(str(error))}</p><p><a href="?">New session</a></p>')
        connect(pn.state.curdoc)
        with uncollected(), pn.state.curdoc.models.freeze():
            from saltus.explorer.page import Page
            from saltus.explorer.views.session_view import SessionView

            page, sessions = Page(desk, office.uploaded, office.defined), SessionView(desk, office)
            pn.state.on_session_destroyed(lambda _: page.close())
            for listener in (page, sessions):
                pn.state.on_session_destroyed(lambda _, listener=listener: desk.leave(listener))
            pn.state.on_session_destroyed(_collect_soon)
            pn.state.onload(page.begin)
            _template(office, page, sessions).server_doc(pn.state.curdoc)
        desk.start()
        # beside the browser, which loads the page: the first result is read at once then
        threading.Thread(target=expect_results, daemon=True).start()
        return None

    return make


def _guard(address: Address) -> Any:
    """Return who lets requests in: those that name this server, and know the token."""
    from bokeh.server.auth_provider import AuthProvider
    from tornado.web import HTTPError

    class Guard(AuthProvider):  # type: ignore[misc]  # Bokeh's declared types are not read
        @property
        def get_user(self) -> Any:
            def user(handler: Any) -> str:
                if handler.request.host not in address.names:
                    raise HTTPError(403, reason="this server is not called so")
                given = handler.get_argument("token", "") or handler.get_cookie(_COOKIE, "")
                if not hmac.compare_digest(given.encode(), address.token.encode()):
                    raise HTTPError(403, reason="the address needs the token that saltus printed")
                if handler.get_cookie(_COOKIE, "") != given and not handler._headers_written:
                    handler.set_cookie(_COOKIE, given, httponly=True, samesite="Strict")
                return "user"

            return user

        login_url = "/"
        get_user_async = get_login_url = login_handler = logout_url = logout_handler = None

    return Guard()


def _looked(host: str, port: int) -> int:
    """Return a port that is free now, any for 0; raise `OSError` where it is taken."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as tried:
        tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        tried.bind((host, port))
        return int(tried.getsockname()[1])


def listening(office: Office, address: Address) -> tuple[Any, Address]:
    """Return a server that has its port, and where it listens; where no port is wanted, others are tried.

    Parameters
    ----------
    office : Office
        The sessions.
    address : Address
        Where to listen.

    Raises
    ------
    InputError
        The wanted port is taken, or the host is no address of this machine.
    """
    import panel as pn

    for number in (address.port,) if address.port else (_PORT, *[0] * _TRIES):
        try:
            found = replace(address, port=_looked(address.host, number))
            options: Mapping[str, Any] = {
                "address": found.host,
                "port": found.port,
                "websocket_origin": sorted(found.names),
                "auth_provider": _guard(found),
                "show": False,
                "start": False,
                "location": True,
                "verbose": False,
                "unused_session_lifetime_milliseconds": _LINGERS,
                "check_unused_sessions_milliseconds": _LOOKS,
            }
            return pn.serve({"/": _page_of(office)}, **options), found  # another program may have been faster
        except OSError as error:
            why = error
    hint = "another program listens there: leave --port out for any free one"
    told = hint if why.errno == EADDRINUSE else str(why.strerror)
    raise InputError("address", f"{address.host}:{number}", "free", told)


def _is_gone(record: logging.LogRecord) -> bool:
    """Return whether a message is of a page that is gone: Bokeh has taken its session away before."""
    from bokeh.server.connection import ServerConnection

    error = record.exc_info[1] if record.exc_info else None
    if not isinstance(error, AssertionError) or error.__traceback__ is None:
        return False
    *_, (frame, _) = walk_tb(error.__traceback__)
    return frame.f_code is ServerConnection.session.fget.__code__


def _told_shortly(record: logging.LogRecord) -> bool:
    """Let each message pass; that a page has said something and was left is told in a line."""
    if _is_gone(record):
        record.msg, record.args, record.exc_info = LEFT, (), None
    return True


def _quieten(loop: Any) -> None:
    """Say little of pages that are closed while something is sent to them, or while they say something."""
    from tornado.websocket import WebSocketClosedError

    for name in ("bokeh.server.views.ws", "panel.io.document"):
        logging.getLogger(name).setLevel(logging.ERROR)
    logging.getLogger("bokeh.server.protocol_handler").addFilter(_told_shortly)
    logging.getLogger("tornado.application").addFilter(lambda record: not _is_gone(record))  # closed twice

    def handle(own: Any, context: dict[str, Any]) -> None:
        if not isinstance(context.get("exception"), WebSocketClosedError):
            own.default_exception_handler(context)

    loop.asyncio_loop.set_exception_handler(handle)


def serve(
    office: Office,
    address: Address,
    *,
    opened: Callable[[str], object] | None = None,
    session: str | None = None,
    browser: bool = True,
) -> None:
    """Serve pages until an interrupt.

    Parameters
    ----------
    office : Office
        The sessions.
    address : Address
        Where to listen.
    opened : callable, optional
        Called with the address of the page when the server listens.
    session : str, optional
        The session that the first page shows.
    browser : bool, optional
        Whether a browser is opened.

    Raises
    ------
    InputError
        The wanted port is taken, or the host is no address of this machine.
    """
    with suppress(SaltusError):  # the first desk tries again, and tells it
        start_ahead()  # while this process imports what pages need
    with uncollected():
        import panel as pn
        from tornado.ioloop import PeriodicCallback

        pn.extension(console_output="disable", loading_indicator=False)
    remember_defaults()
    keep_order()
    server, at = listening(office, address)
    url = f"http://{at.host}:{at.port}/?token={at.token}" + (f"&session={session}" if session else "")
    server.start()
    _quieten(server.io_loop)
    PeriodicCallback(office.attend, _PACE).start()
    if opened is not None:
        opened(url)
    if browser:
        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
    _load()  # while the browser starts
    try:
        server.io_loop.start()
    except KeyboardInterrupt:
        pass
    finally:
        server.stop()
        office.close()
