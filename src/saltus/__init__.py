"""Dynamics of hybrid (piecewise-smooth) systems: orbits, stability, bifurcations, with tapping-mode AFM built in.

The public names stand in `__init__.pyi`, for editors and type checkers too; each is imported on first use.
"""

import importlib
import sys
from typing import Any

import lazy_loader

from saltus.doors import unknown

_imported, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

# Modules of public names, where a name that stood here up to version 0.1 is now.
_DOORS = ("errors", "options", "results")

# Names of these modules, of which an earlier version had others.
_RENAMED = {"Limits": "SimulationOptions"}


def __getattr__(name: str) -> Any:
    """Import a public name, or say where it is now."""
    if name not in __all__:
        known = _RENAMED.get(name, name)
        for door in _DOORS:
            if known in importlib.import_module(f"{__name__}.{door}").__all__:
                # `from saltus import name` drops an AttributeError and its words, so it gets an ImportError
                imported = sys._getframe(1).f_code.co_name == "_handle_fromlist"
                raise (ImportError if imported else AttributeError)(f"saltus.{name} is now saltus.{door}.{known}")
        raise AttributeError(unknown(__name__, name, __all__))
    return _imported(name)
