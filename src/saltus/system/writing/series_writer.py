"""Writers of the Taylor series of a system's motions, and of the linear parts of its modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from saltus.system.writing.linear_split import split_of_mode
from saltus.system.writing.regularise import regularised
from saltus.system.writing.taylor import series_of_mode
from saltus.system.writing.writer import Writer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from saltus.system.derivatives import Symbolic
    from saltus.system.writing.linear_split import Split
    from saltus.system.writing.regularise import Regularised

__all__ = ["LinearWriter", "SeriesWriter"]


class SeriesWriter(Writer):
    """Text of the Taylor series of every mode."""

    def __init__(self, system: Symbolic, order: int) -> None:
        super().__init__(system)
        self.order = order

    def functions(self) -> Iterator[str]:
        """Text of the series."""
        modes = range(len(self.system.field))
        forms = [regularised(self.system, k) for k in modes]
        wanted: dict[int, Regularised | None] = dict.fromkeys(modes)
        wanted |= {len(modes) + k: form for k, form in enumerate(forms) if form is not None}
        first_event = len(self.system.system.states) + 2
        stride = first_event + max(self.system.source.count(k) for k in modes)
        series = {
            k: series_of_mode(self.system, k % len(modes), self.order, lambda e: self._text(self._hoist(e)), form)
            for k, form in wanted.items()
        }
        ways = stride if any(one.ways for one in series.values()) else -1
        stride += ways >= 0
        self.numbers = {
            "ORDER": self.order,
            "STRIDE": stride,
            "WAYS": ways,
            "FORMS": [(-1, 1) if form is None else (form.transition, form.sign) for form in forms],
        }
        branches = {}
        for k, one in series.items():
            places = [*range(first_event - (2 if wanted[k] is None else 0)), *range(first_event, stride)]
            branches[k] = one.constants + one.lines
            branches[k] += [
                f"out[{stride * i + place}] = {name}_{i}"
                for i in range(self.order + 1)
                for place, name in zip(places, one.columns, strict=False)
            ]
            if ways >= 0:
                sums = [" + ".join(terms) for terms in one.ways] or ["0.0"] * self.order
                branches[k] += [f"out[{stride * (i + 1) + ways}] = {total}" for i, total in enumerate(sums)]
        yield self._function("series", branches, "fast=True")


class LinearWriter(Writer):
    """Text of the linear parts of the modes."""

    def functions(self) -> Iterator[str]:
        """Text of the linear parts."""
        splits = _splits(self.system)
        self.numbers["SPLITS"] = [None if split is None else split.layout() for split in splits]
        entries = {
            k: [entry for row in (*split.matrix, *split.events) for entry in row]
            for k, split in enumerate(splits)
            if split is not None
        }
        yield self._function("linear", {k: self._assign(rows) for k, rows in entries.items()})


def _splits(system: Symbolic) -> list[Split | None]:
    """The linear part of each mode that is not regularised and has one."""
    modes = range(len(system.field))
    return [split_of_mode(system, k) if regularised(system, k) is None else None for k in modes]
