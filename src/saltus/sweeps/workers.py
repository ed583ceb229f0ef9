"""Rows of a sweep, computed by this thread, by several threads, or by a Dask cluster, in any order."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from saltus.work import Cluster, Here, Job, Threads, Workers, handed_out, processors

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["End", "Ended", "Piece", "rows_of"]

End: TypeAlias = "tuple[NDArray[np.float64], int] | None"  # state and mode where a motion ended; None: no motion


class Ended(Protocol):
    """Results at a value, with the end of the motion."""

    @property
    def end(self) -> End:
        """State and mode from which the motion at the next value starts."""


@dataclass(frozen=True)
class Piece:
    """Values of which each starts from the end of the one before.

    Attributes
    ----------
    row : int
        Which pass.
    order : sequence of int
        Indices of the values.
    end : (ndarray, int) or None
        State and mode from which the first value starts; None for the sweep's start.
    """

    row: int
    order: Sequence[int]
    end: End = None


def rows_of(
    compute: Callable[[float, End], Any], values: NDArray[np.float64], pieces: Sequence[Piece], workers: int | None,
    client: Any,
) -> Generator[tuple[tuple[int, int], Any], None, None]:  # fmt: skip
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
        No client.
    """
    count = len(pieces)
    if client is not None:
        those: Workers = Cluster(client, "SweepOptions.client")
    else:
        count = min(processors() if workers is None else workers, count)
        those = Threads(count, "SweepOptions(workers=1)") if count > 1 else Here()
    return _rows(compute, values, pieces, those, count)


def _rows(
    compute: Callable[[float, End], Any], values: NDArray[np.float64], pieces: Sequence[Piece], those: Workers,
    at_once: int,
) -> Generator[tuple[tuple[int, int], Any], None, None]:  # fmt: skip
    """Yield the rows of `at_once` pieces at a time, the values of each piece in order."""

    def job(piece: Piece, position: int, end: End) -> Job:
        return (piece, position), compute, float(values[piece.order[position]]), end

    def after(key: tuple[Piece, int], row: Ended) -> Job | None:
        piece, position = key
        return job(piece, position + 1, row.end) if position + 1 < len(piece.order) else None

    first = [job(piece, 0, piece.end) for piece in pieces]
    with closing(handed_out(those, first, lambda: at_once, after)) as found:
        for (piece, position), row in found:
            yield (piece.row, piece.order[position]), row
