"""Generated functions that many systems have in common, compiled once for all: of no events, of no conditions."""

from __future__ import annotations

from numba import float64, int64, types, void

from saltus.system.numba_tools.machine_code import cfunc

__all__ = ["nothing", "one"]

_P = types.CPointer(float64)
_SIGNATURE = void(int64, int64, _P, _P, _P)


@cfunc(_SIGNATURE)
def nothing(k, m, x, p, out):
    """Write nothing: events where there are none, constants where none are needed."""


@cfunc(_SIGNATURE)
def one(k, m, x, p, out):
    """Write 1: a condition that holds everywhere."""
    out[0] = 1.0
