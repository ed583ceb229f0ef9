"""The function `explore`: the explorer's page with the models of `saltus.afm`, from a script or in a notebook."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from saltus import checks
from saltus.progress import in_notebook

if TYPE_CHECKING:
    from saltus.system import HybridSystem, Map

__all__ = ["explore"]


def explore(
    system: HybridSystem | Map | None = None,
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
    system : HybridSystem or Map, optional
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
        The system is neither a `HybridSystem` nor a `Map`, the file holds no session, or the port is taken.
    SaltusError
        ``saltus[app]`` is not installed.

    Examples
    --------
    >>> explore("pendulum")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: system = 'str': must be a HybridSystem or a Map
    """
    from saltus.explorer.opening import check_installed, frame_in_notebook, open_explorer

    check_installed()  # before imports that need what may be missing
    from saltus.afm.explorer_models import TAPPING
    from saltus.explorer.subjects import of_system

    subject = None if system is None else of_system(system)
    file = None if load is None else checks.path("load", load)
    if in_notebook():
        return frame_in_notebook(TAPPING, subject, file, port)
    open_explorer(TAPPING, subject, file, port=port, browser=browser, told=_tell)
    return None


def _tell(url: str) -> None:
    print(f"saltus explorer at {url}")
