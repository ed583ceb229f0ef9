"""Opening the explorer: a server until an interrupt, or a process beside a notebook's kernel and a frame in a cell."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from saltus import checks
from saltus.errors import InputError, SaltusError
from saltus.extras import check_installed_for_explorer
from saltus.work import leave_with_parent, starting, uncollected, unnoticed

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from saltus.explorer.application import Application
    from saltus.explorer.subjects import Subject

__all__ = ["frame_in_notebook", "open_explorer"]

_SHORTEST = 12  # characters of a token, at least
_HEIGHT = 860  # pixels of the page in a notebook


def open_explorer(
    application: Application,
    subject: Subject | None,
    file: Path | None = None,
    *,
    host: str = "127.0.0.1",
    token: str | None = None,
    port: int | None = None,
    browser: bool = True,
    told: Callable[[str], object] | None = None,
) -> None:
    """Serve the explorer until an interrupt.

    Parameters
    ----------
    application : Application
        What is known of tapping mode, say.
    subject : Subject or None
        The system; None for a choice among the models of the application.
    file : Path, optional
        A session's file.
    host : str, optional
        Address of this machine on which to listen; another than the loopback one needs a token.
    token : str, optional
        What a browser must know; by default a random one.
    port : int, optional
        The port.
    browser : bool, optional
        Whether a browser is opened.
    told : callable, optional
        Called with the page's address when the server listens.

    Raises
    ------
    InputError
        The file holds no session, the port is taken, or a host without a token.
    SaltusError
        ``saltus[app]`` is not installed.
    """
    check_installed_for_explorer()
    with uncollected():
        from saltus.explorer.office import Office, home_folder
        from saltus.explorer.server import LOOPBACK, Address, serve

    if host not in LOOPBACK and not token:
        raise InputError("--host", host, "127.0.0.1, or given with --token", "others could use the page otherwise")
    if token is not None and len(token) < _SHORTEST:
        raise InputError("--token", token, f"of at least {_SHORTEST} characters")
    number = 0 if port is None else checks.count("port", port, 1, 65535)
    office = Office(application, subject, home_folder())
    office.sweep()
    session = office.unfinished() if file is None else office.unpacked(file)
    given = {} if token is None else {"token": token}
    address = Address(host, number, **given)
    serve(office, address, opened=told, session=session, browser=browser)


def frame_in_notebook(application: Application, subject: Subject | None, file: Path | None, port: int | None) -> Any:
    """Return the page in a frame, as the output of a notebook's cell; a process beside the kernel serves it.

    Raises
    ------
    SaltusError
        As `open_explorer` does.
    """
    check_installed_for_explorer()
    from IPython.display import IFrame

    near, far = get_context("spawn").Pipe()
    with unnoticed(), starting():
        process = get_context("spawn").Process(target=_serve_beside, args=(far, application, subject, file, port))
        process.start()
    atexit.register(process.terminate)  # before Python waits for it
    far.close()
    try:
        told = near.recv()
    except EOFError:
        raise SaltusError("the process that serves the page has ended; its last words are on stderr") from None
    if isinstance(told, SaltusError):
        raise told
    return IFrame(told, width="100%", height=_HEIGHT, extras=['allow="clipboard-write"'])


def _serve_beside(
    pipe: Connection, application: Application, subject: Subject | None, file: Path | None, port: int | None
) -> None:
    """Serve the page until the kernel ends, and tell it the page's address, or what went wrong."""
    threading.Thread(target=leave_with_parent, daemon=True).start()
    try:
        open_explorer(application, subject, file, port=port, browser=False, told=pipe.send)
    except SaltusError as error:
        pipe.send(error)
