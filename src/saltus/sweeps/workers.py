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

__all__ = ["End", "Ended", "Piece", "Together", "rows_of"]

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


@dataclass(frozen=True)
class Together:
    """Stretches whose motions begin side by side, one value of each at a time.

    Attributes
    ----------
    begin : callable
        Makes what `compute` takes further at each value, from their list and that of the ends of the motions before.
    most : int
        Most stretches side by side.
    """

    begin: Callable[[Sequence[float], Sequence[End]], Sequence[Any]]
    most: int


def rows_of(
    compute: Callable[..., Any], values: NDArray[np.float64], pieces: Sequence[Piece], workers: int | None, client: Any,
    together: Together | None = None,
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
    together : Together, optional
        How motions begin side by side; by default each is computed alone.

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
    if together is None:
        return _rows(compute, values, pieces, those, count)
    groups = max(count, 1) if client is None else 1
    groups = max(groups, -(-len(pieces) // together.most))
    shared = [pieces[i::groups] for i in range(groups)]
    return _rows_together(compute, values, [group for group in shared if group], those, together)


def _rows(
    compute: Callable[[float, End], Any], values: NDArray[np.float64], pieces: Sequence[Piece], those: Workers,
    at_once: int,
) -> Generator[tuple[tuple[int, int], Any], None, None]:  # fmt: skip
    """Yield the rows of `at_once` pieces at a time, the values of each piece in order."""

    def job(piece: Piece, position: int, end: End) -> Job:
        return (piece, position), compute, float(values[piece.order[position]]), end

    def after(key: tuple[Piece, int], row: Ended) -> list[Job]:
        piece, position = key
        return [job(piece, position + 1, row.end)] if position + 1 < len(piece.order) else []

    first = [job(piece, 0, piece.end) for piece in pieces]
    with closing(handed_out(those, first, lambda: at_once, after)) as found:
        for (piece, position), row in found:
            yield (piece.row, piece.order[position]), row


@dataclass(eq=False)
class _Round:
    """One value of each piece of a group, at the same position: its pieces, ends of the motions, rows still missing."""

    pieces: Sequence[Piece]
    position: int
    ends: list[End]
    missing: int = 0


def _rows_together(
    compute: Callable[..., Any], values: NDArray[np.float64], groups: Sequence[Sequence[Piece]], those: Workers,
    together: Together,
) -> Generator[tuple[tuple[int, int], Any], None, None]:  # fmt: skip
    """Yield the rows of groups of pieces whose motions begin together; a round waits for the rows of the one before."""

    def value(piece: Piece, position: int) -> float:
        return float(values[piece.order[position]])

    def begun(round_: _Round) -> Job:
        at = [value(piece, round_.position) for piece in round_.pieces]
        return (round_, None), together.begin, at, list(round_.ends)

    def after(key: tuple[_Round, int | None], result: Any) -> list[Job]:
        round_, i = key
        if i is None:
            round_.missing = len(round_.pieces)
            starts = zip(round_.pieces, round_.ends, result, strict=True)
            return [
                ((round_, i), compute, value(piece, round_.position), end, found)
                for i, (piece, end, found) in enumerate(starts)
            ]
        round_.ends[i] = result.end
        round_.missing -= 1
        position = round_.position + 1
        left = [i for i, piece in enumerate(round_.pieces) if position < len(piece.order)]
        if round_.missing or not left:
            return []
        return [begun(_Round([round_.pieces[i] for i in left], position, [round_.ends[i] for i in left]))]

    first = [begun(_Round(group, 0, [piece.end for piece in group])) for group in groups]
    with closing(handed_out(those, first, lambda: len(groups), after)) as found:
        for (round_, i), row in found:
            if i is not None:
                piece = round_.pieces[i]
                yield (piece.row, piece.order[round_.position]), row
