"""Threads of the linear algebra: small matrices are quicker without."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

__all__ = ["one_thread"]

# modules that are linked with NumPy's OpenBLAS and with SciPy's, and how the functions of each end
_LINKED = {"numpy.linalg._umath_linalg": "64_", "scipy.linalg._flapack": ""}

_FEW = 16  # states of an orbit, of which a matrix has some times as many rows


class _Library(NamedTuple):
    """How many threads a library uses."""

    read: Callable[[], int]
    write: Callable[[int], Any]


_lock = threading.Lock()
_users = 0
_before: list[tuple[_Library, int]] = []


@contextmanager
def one_thread(rows: int) -> Iterator[None]:
    """Let NumPy and SciPy use one thread each for the linear algebra in the block, where they are built on OpenBLAS.

    Matrices of some hundred rows take no less time on two threads. Where other work uses the processors, the threads
    wait for each other, and the same takes up to fifty times as long. The number holds for the whole process: the last
    block that ends puts back what was there before the first.

    Parameters
    ----------
    rows : int
        Rows of the matrices; OpenBLAS starts no threads for few.
    """
    global _users
    if rows < _FEW:
        yield
        return
    with _lock:
        _users += 1
        if _users == 1:
            _before[:] = [(library, library.read()) for library in _libraries()]
            for library, count in _before:
                if count > 1:
                    library.write(1)
    try:
        yield
    finally:
        with _lock:
            _users -= 1
            if _users == 0:
                for library, count in _before:
                    if count > 1:
                        library.write(count)


@cache
def _libraries() -> tuple[_Library, ...]:
    """Return the libraries whose threads can be set; none where they are other than OpenBLAS."""
    found = []
    for name, end in _LINKED.items():
        try:
            linked = ctypes.CDLL(import_module(name).__file__)
            read, write = (getattr(linked, f"scipy_openblas_{what}_num_threads{end}") for what in ("get", "set"))
        except (ImportError, OSError, AttributeError, TypeError):
            continue
        write.restype = None
        found.append(_Library(read, write))
    return tuple(found)
