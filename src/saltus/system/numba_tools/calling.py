"""Generated functions called from Python, on the entries of contiguous arrays."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["call", "callable_at", "with_constants"]

_buffer: Any = (ctypes.c_char * 0).from_buffer


def callable_at(function: Any) -> Any:
    """Return a generated function as one of integers and addresses, which are converted faster than pointers."""
    integer, address = ctypes.c_int64, ctypes.c_void_p
    return ctypes.CFUNCTYPE(None, integer, integer, address, address, address)(function.address)


def call(
    function: Any, k: int, m: int, x: NDArray[np.float64], p: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    """Call a generated function; `p` is extended, arrays are contiguous."""
    function(k, m, _entries(x), _entries(p), _entries(out))


def _entries(array: NDArray[np.float64]) -> Any:
    """Return where the entries of a contiguous array begin; a buffer is asked four times faster than `array.ctypes`."""
    return _buffer(array) if array.flags.writeable else array.ctypes.data


def with_constants(derive: Any, p: NDArray[np.float64], n_constants: int) -> NDArray[np.float64]:
    """Return parameters with the constants behind them that a generated ``derive`` makes."""
    out = np.empty(p.size + n_constants)
    out[: p.size] = p
    if n_constants:
        call(derive, 0, 0, out, out, out)
    return out
