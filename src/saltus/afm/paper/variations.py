"""Tapping mode for configuration files: the paper's set-up with some values changed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from saltus.afm.paper.table1 import table1
from saltus.afm.paper.tapping import StaticTerm, tapping_mode
from saltus.afm.probe.cantilever import Cantilever
from saltus.errors import InputError, nearest

if TYPE_CHECKING:
    from saltus.afm.paper.tapping import Setup
    from saltus.system import HybridSystem

__all__ = ["tapping_mode_with", "varied"]

_GEOMETRY = ("length", "width", "thickness", "density", "young")  # values of a cantilever by its geometry
_MEASURED = ("k", "f0", "Q")  # values of a measured cantilever
_SAMPLE = ("R", "H", "E_star", "a0")  # values of the sample
VALUES = ("eta", *_SAMPLE, *_GEOMETRY, *_MEASURED)  # names of all values that can be changed


def tapping_mode_with(modes: int = 1, static_term: StaticTerm = "consistent", **values: float) -> HybridSystem:
    """Return tapping mode on the paper's set-up with some values changed; see `tapping_mode` and `varied`.

    Raises
    ------
    InputError
        As `tapping_mode` and `varied` do.

    Examples
    --------
    >>> system = tapping_mode_with(modes=2, H=1e-19)
    >>> system.name, system.parameters["H"]
    ('tapping-mode AFM, 2 modes', 1e-19)
    """
    for name in values:
        if name not in VALUES:
            known = ("modes", "static_term", *VALUES)
            raise InputError("key", name, f"one of {', '.join(known)}", nearest(name, known))
    return tapping_mode(varied(table1(), **values), modes, static_term=static_term)


def varied(setup: Setup, **values: float) -> Setup:
    """Return a set-up with some values changed.

    Parameters
    ----------
    setup : Setup
        The set-up that is changed.
    **values : float, in SI units
        ``eta``; of the sample ``R, H, E_star, a0``; of the cantilever either ``length, width, thickness, density,
        young``, or all of ``k, f0, Q``, measured, in their place.

    Raises
    ------
    InputError
        A value of another name or that is not allowed, or only some of ``k, f0, Q``.

    Examples
    --------
    >>> from saltus.afm import table1
    >>> varied(table1(), eta=80e-9, k=2.0, f0=70e3, Q=200.0)
    Setup(cantilever=Cantilever.from_measured(k=2.0, f0=70000.0, Q=200.0), sample=DMTSample(...), eta=8e-08)
    """
    for name in values:
        if name not in VALUES:
            raise InputError("value", name, f"one of {', '.join(VALUES)}", nearest(name, VALUES))
    chosen = {
        group: {name: values[name] for name in group if name in values} for group in (_GEOMETRY, _MEASURED, _SAMPLE)
    }
    cantilever = replace(setup.cantilever, **chosen[_GEOMETRY]) if chosen[_GEOMETRY] else setup.cantilever
    if measured := chosen[_MEASURED]:
        if chosen[_GEOMETRY] or len(measured) < len(_MEASURED):
            raise InputError("values", sorted(values), f"all of {', '.join(_MEASURED)}, and no geometry beside them")
        cantilever = Cantilever.from_measured(**measured)
    return replace(
        setup, cantilever=cantilever, sample=replace(setup.sample, **chosen[_SAMPLE]), eta=values.get("eta", setup.eta)
    )
