"""Count of labels that differ from those of motions followed more exactly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.ensemble.traps import UNDECIDED
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LabelError", "differing", "label_error_of"]

_LARGE = 0.01  # share of wrong labels beyond which basins are told to be rough


@dataclass(frozen=True)
class LabelError:
    """Count of labels that differ from those of motions followed more exactly; see `Basins.label_error`.

    Attributes
    ----------
    wrong, cells : int
        Count of labels that differ, and of all compared.
    bound : float
        Upper bound on the share of wrong labels, at 95 % confidence.
    tolerance : float
        Tolerance of a step of the motions followed anew.
    wrong_by_events, cells_by_events : int
        The two counts for the cells that the event-driven flow followed as well, or images of a map one by one.
    """

    wrong: int
    cells: int
    bound: float
    tolerance: float
    wrong_by_events: int = 0
    cells_by_events: int = 0

    def __str__(self) -> str:
        by_events = (
            f"; {self.wrong_by_events} of {self.cells_by_events} followed one by one" if self.wrong_by_events else ""
        )
        return f"{self.wrong} of {self.cells} followed again, < {self.bound:.2g} at 95 %{by_events}"

    @property
    def large(self) -> bool:
        """Whether more than one label in a hundred differs."""
        return self.wrong > _LARGE * self.cells or self.wrong_by_events > max(_LARGE * self.cells_by_events, 1)


def differing(labels: NDArray[np.uint8], others: NDArray[np.uint8]) -> tuple[int, int]:
    """Return the count of labels that differ from decided reference labels, and the count of those."""
    decided = others != UNDECIDED
    return int((decided & (labels != others)).sum()), int(decided.sum())


def label_error_of(kept: Any) -> LabelError:
    """Return the label error in a store's metadata."""
    wanted = {part.name for part in fields(LabelError)}
    if not isinstance(kept, Mapping) or set(kept) != wanted or not all(map(checks.is_real, kept.values())):
        raise InputError("attribute 'label_error'", kept, f"numbers by {', '.join(sorted(wanted))}")
    return LabelError(**kept)
