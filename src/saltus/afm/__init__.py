"""Floor 6: tapping-mode atomic force microscopy. Names load on first use, so that importing it costs nothing.

Examples
--------
>>> from saltus import afm
>>> afm.table1().eta
6e-08
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

# Not deferred: the first import of the module `table1` would put the module in the place of the function.
from saltus.afm.paper import table1

if TYPE_CHECKING:
    from saltus.afm.animation import animate
    from saltus.afm.cantilever import Cantilever
    from saltus.afm.regimes import settled_orbit
    from saltus.afm.sample import DMTSample, tip_force
    from saltus.afm.tapping import Setup, tapping_mode

__all__ = [
    "Cantilever",
    "DMTSample",
    "Setup",
    "animate",
    "settled_orbit",
    "table1",
    "tapping_mode",
    "tip_force",
]

_HOMES = {
    "Cantilever": "saltus.afm.cantilever",
    "DMTSample": "saltus.afm.sample",
    "Setup": "saltus.afm.tapping",
    "animate": "saltus.afm.animation",
    "settled_orbit": "saltus.afm.regimes",
    "tapping_mode": "saltus.afm.tapping",
    "tip_force": "saltus.afm.sample",
}


def __getattr__(name: str) -> object:
    """Return a public name from its home, and keep it here."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, loaded or not."""
    return sorted({*globals(), *__all__})
