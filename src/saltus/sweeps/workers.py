"""Rows of a sweep from this thread, from threads, or from a Dask cluster: the same rows, in whatever order."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from saltus import checks
from saltus.errors import InputError
from saltus.work import starting

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["End", "Ended", "Piece", "rows_of"]

End: TypeAlias = "tuple[NDArray[np.float64], int] | None"
"""State and mode where a motion ended, None where there was none."""

_Rows: TypeAlias = Generator[tuple[tuple[int, int], Any], None, None]


class Ended(Protocol):
    """What is found at a value, with the end of the motion."""

    @property
    def end(self) -> End:
        """Where the motion goes on from."""


@dataclass(frozen=True)
class Piece:
    """Values that are followed one after the other.

    Attributes
    ----------
    row : int
        Which pass.
    order : sequence of int
        Indices of the values.
    end : (ndarray, int) or None
        State and mode where the motion starts, if not anew.
    """

    row: int
    order: Sequence[int]
    end: End = None


def rows_of(
    compute: Callable[[float, End], Any], values: NDArray[np.float64], pieces: Sequence[Piece], workers: object,
    client: Any,
) -> _Rows:  # fmt: skip
    """Return an iterator over ((pass, value), row) as rows are done; closing it ends the work.

    Parameters
    ----------
    compute : callable
        Makes a row from a value and the end of the motion at the value before.
    values : ndarray, shape (value,)
        The values.
    pieces : sequence of Piece
        What is computed.
    workers : int, optional
        Threads.
    client : dask.distributed.Client, optional
        A cluster in their place.

    Raises
    ------
    InputError
        No count of threads, or no client; both.
    """
    if client is not None:
        if workers is not None:
            raise InputError("workers", workers, "left out where a client is given")
        if not callable(getattr(client, "submit", None)):
            raise InputError("client", client, "a dask.distributed.Client")
        return _on_cluster(compute, values, pieces, client)
    if workers is None:
        workers = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    threads = min(checks.count("workers", workers), len(pieces))
    return _here(compute, values, pieces) if threads <= 1 else _in_threads(compute, values, pieces, threads)


def _here(compute: Callable[[float, End], Any], values: NDArray[np.float64], pieces: Sequence[Piece]) -> _Rows:
    for piece in pieces:
        end = piece.end
        for k in piece.order:
            row = compute(float(values[k]), end)
            end = row.end
            yield (piece.row, k), row


def _in_threads(
    compute: Callable[[float, End], Any], values: NDArray[np.float64], pieces: Sequence[Piece], workers: int
) -> _Rows:
    """The kernels run without the interpreter's lock; a value under way is computed to its end."""
    ready: SimpleQueue[tuple[tuple[int, int], Any] | BaseException] = SimpleQueue()
    stop = threading.Event()

    def follow(piece: Piece) -> None:
        try:
            for found in _here(compute, values, [piece]):
                ready.put(found)
                if stop.is_set():
                    return
        except BaseException as error:  # it is raised again where the rows are asked for
            ready.put(error)

    executor = ThreadPoolExecutor(workers, "sweep")
    try:
        with starting("workers=1"):
            for piece in pieces:
                executor.submit(follow, piece)
        for _ in range(sum(len(piece.order) for piece in pieces)):
            found = _next(ready)
            if isinstance(found, BaseException):
                raise found
            yield found
    finally:
        stop.set()
        executor.shutdown(wait=True, cancel_futures=True)


def _next(ready: SimpleQueue[Any]) -> Any:
    while True:
        try:
            return ready.get(timeout=0.2)  # so that Ctrl-C is heard everywhere
        except Empty:
            pass


def _on_cluster(
    compute: Callable[[float, End], Any], values: NDArray[np.float64], pieces: Sequence[Piece], client: Any
) -> _Rows:
    """Each value is a task that waits for the one before, so that rows come one by one."""
    futures: dict[Any, tuple[int, int]] = {}
    for piece in pieces:
        before: Any = None
        for k in piece.order:
            if before is None:
                before = client.submit(compute, float(values[k]), piece.end, pure=False)
            else:
                before = client.submit(_compute_after, compute, float(values[k]), before, pure=False)
            futures[before] = (piece.row, k)
    try:
        for future in import_module("distributed").as_completed(list(futures), loop=client.loop):
            yield futures[future], future.result()
    finally:
        client.cancel([future for future in futures if not future.done()])


def _compute_after(compute: Callable[[float, End], Any], value: float, before: Ended) -> Any:
    return compute(value, before.end)
