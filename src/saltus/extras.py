"""Packages that only parts of saltus need, and the extra of saltus that installs each."""

from __future__ import annotations

import importlib
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from saltus.errors import SaltusError

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["check_installed", "check_installed_for_explorer", "pd", "xr"]

# Extra that installs each package, by the package's name where it is imported.
EXTRAS = {
    "h5netcdf": "data",
    "h5py": "data",
    "pandas": "data",
    "xarray": "data",
    "matplotlib": "plot",
    "PIL": "plot",
    "zarr": "store",
    "pydantic": "cli",
    "rich": "cli",
    "typer": "cli",
    "bokeh": "app",
    "panel": "app",
    "distributed": "cluster",
    "igor2": "files",
    "lmfit": "fit",
}

# What a package serves, to be read before "needs".
_SERVES = {
    "data": "a result as a dataset, table or file",
    "plot": "a picture",
    "store": "a Zarr store",
    "cli": "the command saltus, or a bar of progress,",
    "app": "the explorer",
    "cluster": "a Dask cluster",
    "files": "an Igor binary wave",
    "fit": "a result of lmfit",
}

_OF_EXPLORER = ("panel", "bokeh", "matplotlib", "pydantic", "xarray")  # all brought by the extra app

_SHORT = {"pd": "pandas", "xr": "xarray"}  # customary names of modules


def check_installed(*packages: str) -> None:
    """Look for packages without importing them; raise `SaltusError` with the extra that installs the first one missing.

    Examples
    --------
    >>> check_installed("xarray", "matplotlib")
    """
    for package in packages:
        _check(package, EXTRAS[package])


def check_installed_for_explorer() -> None:
    """Look for the packages of the explorer without importing them; raise `SaltusError` where one is missing.

    Examples
    --------
    >>> check_installed_for_explorer()
    """
    for package in _OF_EXPLORER:
        _check(package, "app")


def _check(package: str, extra: str) -> None:
    """Raise where a package is missing."""
    if find_spec(package) is None:
        raise SaltusError(f"{_SERVES[extra]} needs {package}: pip install 'saltus[{extra}]'")


def __getattr__(name: str) -> Any:
    """Import pandas or xarray, so that ``from saltus.extras import xr`` says how to install what is missing."""
    if name not in _SHORT:
        raise AttributeError(f"No {__name__} attribute {name}")
    check_installed(_SHORT[name])
    return importlib.import_module(_SHORT[name])
