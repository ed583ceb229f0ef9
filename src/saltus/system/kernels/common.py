"""Generated functions that many systems have in common, compiled once for all: of no events, of no conditions."""

from __future__ import annotations

from saltus.system.numba_tools.machine_code import generated

__all__ = ["nothing", "one"]


@generated()
def nothing(k, m, x, p, out):
    """Write nothing: events where there are none, constants where none are needed."""


@generated()
def one(k, m, x, p, out):
    """Write 1: a condition that holds everywhere."""
    out[0] = 1.0
