"""Record of the finished values of a sweep: kept, saved to a file at intervals, and reported."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.errors import InputError
from saltus.progress import Reporter, ended
from saltus.sweeps.sweep import Sweep
from saltus.sweeps.task import Row, Task
from saltus.sweeps.workers import Piece
from saltus.work import interrupt_waits

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Record"]

_SAVED_EVERY = 3.0  # seconds between two savings, more where a saving takes long


@dataclass
class Record:
    """Record of the finished values of a sweep."""

    task: Task
    sweep: dict[str, Any]
    path: Path | None
    reporter: Reporter
    saved: float = field(default_factory=monotonic)
    pause: float = _SAVED_EVERY
    fresh: int = 0

    @classmethod
    def begun(
        cls,
        task: Task,
        values: NDArray[np.float64],
        directions: Sequence[str],
        path: str | os.PathLike[str] | None,
        reporter: Reporter,
    ) -> Record:
        """Return the record of a new sweep, or of one whose file exists."""
        shape = (len(directions), values.size)
        sweep: dict[str, Any] = {
            "system": task.system,
            "parameter": task.parameter,
            "values": values,
            "parameters": task.system.resolve({**task.parameters, task.parameter: float(values[0])}),
            "directions": tuple(directions),
            "quantities": task.quantities,
            "points": np.full((*shape, task.keep, len(task.quantities)), np.nan),
            "labels": np.full(shape, "", dtype=object),
            "periods": np.zeros(shape, np.int64),
            "rotations": np.full(shape, np.nan),
            "curves": np.zeros(shape, np.int64),
            "exponents": np.full((*shape, task.exponents), np.nan),
            "errors": np.full((*shape, task.exponents), np.nan),
            "return_times": np.full(shape, np.nan),
            "observables": task.observables,
            "observed": np.full((*shape, len(task.observables)), np.nan),
            "reasons": np.full(shape, "", dtype=object),
            "states": np.full((*shape, len(task.system.all_states)), np.nan),
            "modes": np.full(shape, -1, np.int64),
            "settings": dict(task.settings),
        }
        file = None if path is None else checks.path("path", path)
        if file is not None and file.exists():
            _resume(sweep, Sweep.load(file), file)
        elif file is not None and not (file.parent.is_dir() and os.access(file.parent, os.W_OK)):
            raise InputError("path", str(path), "in a folder that exists and can be written")
        record = cls(task, sweep, file, reporter)
        reporter.expect(record.total, record.done)
        return record

    @property
    def done(self) -> int:
        """Count of the finished values."""
        return int(np.sum(self.sweep["labels"] != ""))

    @property
    def total(self) -> int:
        """Count of all values, those of both directions."""
        return int(self.sweep["labels"].size)

    def left(self, pieces: list[Piece]) -> list[Piece]:
        """Return the unfinished rest of each piece, with the end of its last finished motion."""
        labels, states, modes = (self.sweep[name] for name in ("labels", "states", "modes"))
        left = []
        for piece in pieces:
            undone = [k for k in piece.order if not labels[piece.row, k]]
            before = piece.order[: len(piece.order) - len(undone)]
            end = None
            if before and modes[piece.row, before[-1]] >= 0:
                end = (states[piece.row, before[-1]].copy(), int(modes[piece.row, before[-1]]))
            if undone:
                left.append(Piece(piece.row, undone, end))
        return left

    def keep(self, place: tuple[int, int], row: Row) -> None:
        """Keep a value's row, report it, and save where the last saving is long enough ago."""
        sweep = self.sweep
        found: dict[str, Any] = {"reasons": row.reason, "modes": row.mode, "return_times": row.return_time}
        if row.points is not None:
            found |= {"points": row.points, "states": row.state}
        if row.kind is not None:
            found |= {"periods": row.kind.period, "rotations": row.kind.rotation, "curves": row.kind.curves}
            found |= {"exponents": row.exponents, "errors": row.errors, "observed": row.observed}
        with interrupt_waits():  # a row is in the file as a whole or not at all
            for name, value in (found | {"labels": row.label}).items():
                sweep[name][place] = value
        self.fresh += 1
        if self.path is not None and monotonic() - self.saved > self.pause:
            self.save()
        value, direction = sweep["values"][place[1]], sweep["directions"][place[0]]
        self.reporter.step(1, f"{self.task.parameter} = {value:.6g} {direction}: {row.label}")

    def save(self) -> None:
        """Write the finished values to the file."""
        if self.path is None:
            return
        began = monotonic()
        self.as_sweep().save(self.path)
        self.saved = monotonic()
        self.pause = max(_SAVED_EVERY, 20.0 * (self.saved - began))

    def as_sweep(self) -> Sweep:
        """Return the finished values as a result."""
        return Sweep(**self.sweep, stopped=ended(self.done, self.total, "values"))


def _resume(sweep: dict[str, Any], before: Sweep, path: Path) -> None:
    """Take over the values of a file whose sweep has the same input."""
    for name, wanted, was in _inputs(sweep, before):
        if wanted != was:
            raise InputError("path", str(path), "the file of a sweep of the same input", f"its {name} is {was!r}")
    for name in (
        *("points", "periods", "rotations", "curves", "exponents", "errors", "return_times", "observed"),
        *("states", "modes"),
    ):
        sweep[name] = np.array(getattr(before, name))
    for name in ("labels", "reasons"):
        sweep[name] = getattr(before, name).astype(object)


def _inputs(sweep: Mapping[str, Any], before: Sweep) -> Iterator[tuple[str, Any, Any]]:
    """Go through all input: its name, its value here, and its value in the file."""
    yield "system", sweep["system"].definition(), before.system.definition()
    for name in ("parameter", "quantities", "observables", "parameters"):
        yield name, _plain(sweep[name]), _plain(getattr(before, name))
    yield "values", sweep["values"].tolist(), before.values.tolist()
    for name, value in sweep["settings"].items():
        yield name, _plain(value), before.settings.get(name)


def _plain(value: Any) -> Any:
    return dict(value) if isinstance(value, Mapping) else value
