"""The server of the explorer: pages and their sessions, on the loopback address unless told otherwise."""

from __future__ import annotations

import hmac
import logging
import secrets
import socket
import threading
import webbrowser
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from saltus.errors import InputError, SaltusError
from saltus.explorer import look
from saltus.explorer.desk import Desk
from saltus.explorer.session import Session, folder_of, new_folder, removed, sessions_in
from saltus.work import uncollected

if TYPE_CHECKING:
    from saltus.explorer.application import Application
    from saltus.explorer.page import Page
    from saltus.explorer.subjects import Subject

__all__ = ["LOOPBACK", "Address", "Office", "home_folder", "serve"]

LOOPBACK = ("127.0.0.1", "localhost")  # names of this machine for itself
_PORT = 8710  # tried first
_UPLOAD = 2**26  # bytes that a session's file may have
_COOKIE = "saltus_token"


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


def home_folder() -> Path:
    """Return the folder of all sessions of this user."""
    from platformdirs import user_data_path

    return user_data_path("saltus") / "explorer"


class Office:
    """All sessions of a server.

    Parameters
    ----------
    application : Application
        Whose models can be chosen.
    subject : Subject or None
        The system; None for a choice among the models.
    home : Path
        Folder of the sessions.
    """

    def __init__(self, application: Application, subject: Subject | None, home: Path) -> None:
        self.application, self.subject, self.home = application, subject, home
        self._desks: dict[str, Desk] = {}

    def desk(self, name: str | None, system: str | None = None) -> Desk:
        """Return the desk of a session, reopened if it exists, else that of a new session.

        Parameters
        ----------
        name : str or None
            What the session's folder is called.
        system : str, optional
            A model of the application, where the server has no system of its own.

        Raises
        ------
        SaltusError
            There is no such model, or the folder cannot be written.
        """
        if name is not None and name in self._desks:
            return self._desks[name]
        folder = folder_of(self.home, name)
        session = self._new(system) if folder is None else Session.reopened(folder)
        return self._opened(session)

    def _opened(self, session: Session) -> Desk:
        desk = Desk(self.application, session)
        self._desks[session.folder.name] = desk
        return desk

    def _new(self, system: str | None = None) -> Session:
        models = self.application
        subject = self.subject or models.subject(system or next(iter(models.titles)))
        session = Session(subject, new_folder(self.home))
        session.keep()
        return session

    def unpacked(self, file: Path) -> str:
        """Return the name of a new session with the content of a file.

        Raises
        ------
        InputError
            The file holds no session.
        """
        folder = new_folder(self.home)
        try:
            return self._opened(Session.unpacked(file, folder)).session.folder.name
        except SaltusError:
            removed(folder)
            raise

    def uploaded(self, content: bytes) -> str:
        """Return the name of a new session with an uploaded content, whatever its file was called.

        Raises
        ------
        InputError
            The content is no session, or too large.
        """
        if len(content) > _UPLOAD:
            raise InputError("file", f"{len(content)} bytes", f"one of at most {_UPLOAD} bytes")
        folder = new_folder(self.home)
        try:
            file = folder / "upload.nc"
            file.write_bytes(content)
            return self.unpacked(file)
        finally:
            removed(folder)

    def defined(self, subject: Subject) -> str:
        """Return the name of a new session of a system that was typed."""
        session = Session(subject, new_folder(self.home))
        session.keep()
        return self._opened(session).session.folder.name

    def unfinished(self) -> str | None:
        """Return the newest session of the same system that was not closed on purpose, if it has results."""
        for folder, notes in sessions_in(self.home):
            mine = self.subject is None or notes["subject"][0] == self.subject.key
            if mine and notes["entries"] and not notes.get("closed", True) and folder.name not in self._desks:
                return folder.name
        return None

    def leave(self, page: Page) -> None:
        """Close the desk of a page that is gone, unless another page has taken it over."""
        desk = page.desk
        if desk.listener is page:
            self._desks.pop(desk.session.folder.name, None)
            desk.close()
            if not desk.session.entries:
                removed(desk.session.folder)

    def close(self) -> None:
        """Close all sessions, on purpose."""
        for desk in self._desks.values():
            desk.close()
            if desk.session.entries:
                desk.session.keep(closed=True)
            else:
                removed(desk.session.folder)
        self._desks.clear()


def _template(office: Office, page: Page) -> Any:
    """Return the whole page."""
    import panel as pn

    class Whole(pn.Template):  # type: ignore[misc]  # Panel's declared types are not read
        def __repr__(self) -> str:
            """Return a short text: Panel asks for it after each part, and that of all parts takes 0.1 s."""
            return "the explorer's page"

    made = Whole(files(__package__).joinpath("page.html").read_text(encoding="utf-8"))
    for name, part in page.parts().items():
        made.add_panel(name, part)
    subject = page.session.subject
    made.add_variable("page_style", look.page_style())
    made.add_variable("session", page.session.folder.name)
    title = page.session.system.name or Path(subject.key).name
    made.add_variable("tab", f"{title} · saltus")
    made.add_variable("subject", escape(title))
    known = () if office.subject is not None else office.application.titles.items()
    made.add_variable("systems", [(escape(key), escape(title)) for key, title in known])
    made.add_variable("chosen", escape(subject.key))
    return made


def _page_of(office: Office) -> Callable[[], Any]:
    """Return the function that puts a page into the document of each visit."""

    def make() -> Any:
        import panel as pn

        asked = {key: values[0].decode(errors="replace") for key, values in pn.state.session_args.items() if values}
        try:
            desk = office.desk(asked.get("session"), asked.get("system"))
        except SaltusError as error:
            return pn.pane.HTML(f"<p>{escape(str(error))}</p>")
        with uncollected(), pn.state.curdoc.models.freeze():
            from saltus.explorer.page import Page

            page = Page(desk, office.uploaded, office.defined)
            pn.state.on_session_destroyed(lambda _: page.close())
            pn.state.on_session_destroyed(lambda _: office.leave(page))
            pn.state.onload(page.begin)
            _template(office, page).server_doc(pn.state.curdoc)
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


def free_port(host: str, wanted: int | None) -> int:
    """Return a port that is free: the wanted one, else the usual one, else any.

    Raises
    ------
    InputError
        The wanted port is taken, or the host is no address of this machine.
    """
    for port in (wanted,) if wanted is not None else (_PORT, 0):
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as tried:
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                tried.bind((host, port))
            except OSError as error:
                if wanted is None and port:
                    continue
                hint = "another program listens there: leave --port out for any free one" if wanted else ""
                raise InputError("address", f"{host}:{port}", "free", hint or str(error.strerror)) from None
            return int(tried.getsockname()[1])
    raise AssertionError


def _quieten(loop: Any) -> None:
    """Say nothing of pages that are closed while something is sent to them."""
    from tornado.websocket import WebSocketClosedError

    logging.getLogger("bokeh.server.views.ws").setLevel(logging.ERROR)

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
    """
    with uncollected():
        import panel as pn

        pn.extension(console_output="disable", loading_indicator=False)
    options: Mapping[str, Any] = {
        "address": address.host,
        "port": address.port,
        "websocket_origin": sorted(address.names),
        "auth_provider": _guard(address),
        "show": False,
        "start": False,
        "location": True,
        "verbose": False,
    }
    server = pn.serve({"/": _page_of(office)}, **options)
    url = f"http://{address.host}:{address.port}/?token={address.token}" + (f"&session={session}" if session else "")
    server.start()
    _quieten(server.io_loop)
    if opened is not None:
        opened(url)
    if browser:
        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
    try:
        server.io_loop.start()
    except KeyboardInterrupt:
        pass
    finally:
        server.stop()
        office.close()
