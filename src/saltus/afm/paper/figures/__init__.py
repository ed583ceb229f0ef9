"""The paper's figures: one module for each, with a function `run` that computes, draws and writes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Any

from saltus.errors import InputError, nearest

__all__ = ["FIGURES", "runner"]

# The figures that can be reproduced, each with one line of description.
FIGURES: Mapping[str, str] = MappingProxyType(
    {
        "fig2": "two orbits in the phase space, two modes: one in contact, one close to grazing",
        "fig3": "frequency response, one mode: both grazings, folds and period doublings, with two zooms",
        "fig4": "loci of saddle-nodes and period doublings over frequency and drive, one mode",
        "fig5": "influence of the damping in air and in contact on the response, one mode",
        "fig6": "saddle-node against the damping in air and in contact: isolines, and the cusp",
        "fig7": "brute-force diagram and phase portraits with two modes, with the responses of fig7a",
        "fig7a": "frequency responses with one mode and with two",
        "fig8": "basin of the repulsive motion in space, two modes: sections of 400^3 cells, with PyVista",
        "fig9": "basins of the repulsive motion with one mode and with two, in the plane of the first",
        "fig10": "six sections of the basins with two modes",
    }
)


def runner(name: str) -> Callable[..., dict[str, Any]]:
    """Return the function ``run(out: Path, progress=False) -> dict`` of a figure.

    Raises
    ------
    InputError
        There is no figure of that name.

    Examples
    --------
    >>> runner("fgi3")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: figure = 'fgi3': must be one of fig2, ...; did you mean 'fig3'?
    """
    if name not in FIGURES:
        raise InputError("figure", name, f"one of {', '.join(FIGURES)}", nearest(name, FIGURES))
    run: Callable[..., dict[str, Any]] = import_module(f"{__name__}.{name}").run
    return run
