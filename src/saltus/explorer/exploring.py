"""The function `explore`: check arguments, then a page in a notebook or a server."""

from __future__ import annotations

import atexit
import os
import sys
import threading
from collections.abc import Callable
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from saltus import checks
from saltus.errors import InputError, SaltusError
from saltus.work import leave_with_parent, starting, uncollected, unnoticed

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from saltus.explorer.subjects import Subject
    from saltus.system import HybridSystem

__all__ = ["explore", "open_explorer", "subject_of"]

_SHORTEST = 12  # characters of a token, at least
_HEIGHT = 860  # pixels of the page in a notebook


def explore(
    system: HybridSystem | None = None,
    *,
    load: str | os.PathLike[str] | None = None,
    port: int | None = None,
    browser: bool = True,
) -> Any:
    """Open a page that shows diagrams, orbits and basins of a system, and goes on from a click.

    A server listens on the loopback address until an interrupt (Ctrl-C). In a notebook it is a process that ends with
    the kernel, and a frame below the cell shows the page; the browser must be on the kernel's machine. ``saltus
    explore`` does the same from the shell. Needs ``saltus[app]``.

    Parameters
    ----------
    system : HybridSystem, optional
        The system; by default a choice among the models of `saltus.afm`.
    load : path-like, optional
        A session that was downloaded as NetCDF.
    port : int, optional
        Port of the server; by default 8710, or any free one.
    browser : bool, optional
        Whether a browser is opened; none is from a notebook.

    Returns
    -------
    IPython.display.IFrame or None
        The page in a notebook, else None.

    Raises
    ------
    InputError
        The system is no `HybridSystem`, the file holds no session, or the port is taken.
    SaltusError
        ``saltus[app]`` is not installed.

    Examples
    --------
    >>> explore("pendulum")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: system = 'str': must be a HybridSystem; a Map has `diagram` and `plot`
    """
    from saltus.explorer.subjects import of_system

    subject = None if system is None else of_system(system)
    file = None if load is None else checks.path("load", load)
    if _in_notebook():
        _check_installed()
        return _cell(subject, file, port)
    open_explorer(subject, file, port=port, browser=browser, told=lambda url: print(f"saltus explorer at {url}"))
    return None


def subject_of(text: str) -> Subject:
    """Return the system that an argument of ``saltus explore`` names.

    Parameters
    ----------
    text : str
        ``FILE.py:NAME`` or ``MODULE:NAME``, whose code is run, or the key of a model of this package.

    Raises
    ------
    InputError
        There is no such system.

    Examples
    --------
    >>> subject_of("lever-s").ranges["Zc_nm"]
    (0.5, 14.0)
    """
    from saltus.explorer.subjects import built_in, of_file

    return of_file(text, Path.cwd()) if ":" in text or text.endswith(".py") else built_in(text)


def open_explorer(
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
    subject : Subject or None
        The system; None for a choice among the models of this package.
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
    _check_installed()
    with uncollected():
        from saltus.explorer.server import LOOPBACK, Address, Office, free_port, home_folder, serve

    if host not in LOOPBACK and not token:
        raise InputError("--host", host, "127.0.0.1, or given with --token", "others could use the page otherwise")
    if token is not None and len(token) < _SHORTEST:
        raise InputError("--token", token, f"of at least {_SHORTEST} characters")
    number = None if port is None else checks.count("port", port, 1, 65535)
    office = Office(subject, home_folder())
    session = office.unfinished() if file is None else office.unpacked(file)
    given = {} if token is None else {"token": token}
    address = Address(host, free_port(host, number), **given)
    serve(office, address, opened=told, session=session, browser=browser)


def _check_installed() -> None:
    missing = [name for name in ("panel", "bokeh") if find_spec(name) is None]
    if missing:
        raise SaltusError(f"the explorer needs {' and '.join(missing)}: pip install 'saltus[app]'")


def _in_notebook() -> bool:
    """Return whether this runs in the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    return shell is not None and "IPKernelApp" in getattr(shell.get_ipython(), "config", {})


def _cell(subject: Subject | None, file: Path | None, port: int | None) -> Any:
    """Return the page in a frame, as the output of a notebook's cell; a process beside the kernel serves it."""
    from IPython.display import IFrame

    near, far = get_context("spawn").Pipe()
    with unnoticed(), starting():
        process = get_context("spawn").Process(target=_serve_beside, args=(far, subject, file, port))
        process.start()
    atexit.register(process.terminate)  # before Python waits for it
    far.close()
    try:
        told = near.recv()
    except EOFError:
        raise SaltusError("the process that serves the page has ended; its last words are on stderr") from None
    if isinstance(told, SaltusError):
        raise told
    return IFrame(told, width="100%", height=_HEIGHT)


def _serve_beside(pipe: Connection, subject: Subject | None, file: Path | None, port: int | None) -> None:
    """Serve the page until the kernel ends, and tell it the page's address, or what went wrong."""
    threading.Thread(target=leave_with_parent, daemon=True).start()
    try:
        open_explorer(subject, file, port=port, browser=False, told=pipe.send)
    except SaltusError as error:
        pipe.send(error)
