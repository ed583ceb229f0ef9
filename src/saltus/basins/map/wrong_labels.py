"""Count of labels that differ from those of motions followed more exactly.

A labelled motion that comes near no attractor, followed long enough, ends on something that the search has not found.
So its label counts as wrong, and a search that starts from it tells on what it ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.attractors.missed import KnownAttractor, missed_by
from saltus.basins.attractors.pace import approach
from saltus.basins.map.patience import NEARER
from saltus.basins.wilson import wilson
from saltus.ensemble.traps import UNDECIDED
from saltus.errors import InputError, StiffnessError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.basins.map.grid import Grid
    from saltus.basins.map.labelling import Labelling

__all__ = ["LabelError", "compared", "label_error_of"]

_LARGE = 0.01  # share of wrong labels beyond which basins are told to be rough

_LATER = ("nowhere", "untold", "missed")  # parts of an error that earlier versions did not write

_STARTS = 64  # motions that end nowhere known from which a search starts, at most


@dataclass(frozen=True)
class LabelError:
    """Count of labels that differ from those of motions followed more exactly; see `Basins.label_error`.

    Attributes
    ----------
    wrong, cells : int
        Count of labels that differ, and of all compared. A labelled motion that ends nowhere known is wrong.
    bound : float
        Upper bound on the share of wrong labels, at 95 % confidence.
    tolerance : float
        Tolerance of a step of the motions followed anew.
    wrong_by_events, cells_by_events : int
        The two counts for the cells that the event-driven flow followed as well, or images of a map one by one.
    nowhere : int
        Count of the wrong ones that come near no attractor, however long they are followed.
    untold : int
        Count of the motions that creep so slowly that they cannot be told from those: no cells that are compared.
    missed : str
        The attractors on which motions end that end nowhere known, in words; empty where none was found.
    """

    wrong: int
    cells: int
    bound: float
    tolerance: float
    wrong_by_events: int = 0
    cells_by_events: int = 0
    nowhere: int = 0
    untold: int = 0
    missed: str = ""

    def __str__(self) -> str:
        told = [f"{self.wrong} of {self.cells} followed again, < {self.bound:.2g} at 95 %"]
        if self.nowhere:
            told.append(f"{self.nowhere} of them end on no known attractor")
        if self.missed:
            told.append(f"missed by the search: {self.missed}")
        if self.untold:
            told.append(f"{self.untold} more creep too slowly to be told")
        if self.wrong_by_events:
            told.append(f"{self.wrong_by_events} of {self.cells_by_events} followed one by one")
        return "; ".join(told)

    def as_data(self) -> dict[str, Any]:
        """Return it as plain data, without the later parts where they are empty, as earlier versions wrote it."""
        parts = {part.name: getattr(self, part.name) for part in fields(self)}
        return {name: value for name, value in parts.items() if value or name not in _LATER}

    @property
    def large(self) -> bool:
        """Whether more than one label in a hundred differs, or an attractor was missed."""
        return (
            bool(self.missed)
            or self.wrong > _LARGE * self.cells
            or self.wrong_by_events > max(_LARGE * self.cells_by_events, 1)
        )

    @property
    def hint(self) -> str:
        """What wrong labels come from, and what helps, in words."""
        if self.missed:
            return "find attractors with more starts, or from these states too: AttractorOptions(also=[...])"
        if self.nowhere > _LARGE * self.cells:
            return "what these motions end on is no attractor, or is found from more starts"
        causes = "motions are chaotic for long before they settle, or a trapping region is wrong"
        return f"{causes}: trust no single cell, only shares of many"


def compared(
    labels: NDArray[np.uint8],
    points: NDArray[np.float64],
    by_events: int,
    tolerance: float,
    labelling: Labelling,
    attractors: Any,
    grid: Grid,
) -> LabelError:
    """Return the error of labels, shape (m,), of motions from points, shape (m, n), which are followed anew.

    Parameters
    ----------
    by_events : int
        Count of the motions that are followed one by one as well.
    tolerance : float
        Tolerance of a step.
    labelling : Labelling
        With which the labels were made.
    attractors : Attractors or Outcomes
        Meanings of the labels.
    grid : Grid
        Whose box is searched, where no region is known.
    """
    known, held = attractors.labels, attractors.points
    decays = {known[name]: decay for name, decay in getattr(attractors, "decays", {}).items()}
    strict = labelling.stricter(tolerance, {known[name]: held[name] for name in held}, decays)
    others = _again(strict, labels, points, lambda labelling, x: labelling.of(x))
    creeping = {label for label, decay in decays.items() if approach(decay, NEARER) > strict.longest}
    lost = others == UNDECIDED
    untold = lost & np.isin(labels, list(creeping))
    nowhere = lost & ~untold
    wrong, cells = int((~untold & (labels != others)).sum()), int((~untold).sum())
    few = np.flatnonzero(~lost[:by_events])
    singly = _again(strict, labels[few], points[few], lambda labelling, x: labelling.by_events(x))
    by_hand = _differing(labels[few], singly)
    box = getattr(attractors, "region", None) or grid.box
    missed = _missed(strict, attractors, box, points[nowhere][:_STARTS]) if nowhere.any() else ""
    bound = wilson(wrong, cells)[1] if cells else 1.0
    return LabelError(wrong, cells, bound, tolerance, *by_hand, int(nowhere.sum()), int(untold.sum()), missed)


def _again(
    strict: Labelling,
    labels: NDArray[np.uint8],
    points: NDArray[np.float64],
    follow: Callable[[Labelling, NDArray[np.float64]], NDArray[np.uint8]],
) -> NDArray[np.uint8]:
    """Return the labels of motions that are followed again.

    One that was labelled by a region without boxes is followed to such a region first. On its slow way to the innermost
    part of it a motion may be in the boxes of another attractor for long.
    """
    if (cells := strict.traps.cells) is None:
        return follow(strict, points)
    others = np.full(len(points), UNDECIDED, np.uint8)
    sure = ~np.isin(labels, cells.labels)
    others[sure] = follow(replace(strict, traps=replace(strict.traps, cells=None)), points[sure])
    left = others == UNDECIDED
    others[left] = follow(strict, points[left])
    return others


def _missed(
    labelling: Labelling, attractors: Any, box: Mapping[str, tuple[float, float]], starts: NDArray[np.float64]
) -> str:
    """Return the attractors other than the known ones on which motions from some states end, in words."""
    known = [
        KnownAttractor(
            getattr(attractors, "kinds", {}).get(name, ""), points, getattr(attractors, "orbits", {}).get(name),
            labelling.traps.ellipsoids, attractors.labels[name],
        )
        for name, points in attractors.points.items()
    ]  # fmt: skip
    try:
        return ", ".join(missed_by(labelling.system, labelling.parameters, box, known, starts, labelling.interval))
    except StiffnessError:  # `nowhere` counts them; on what they end takes more steps than a search may
        return ""


def _differing(labels: NDArray[np.uint8], others: NDArray[np.uint8]) -> tuple[int, int]:
    """Return the count of labels that differ from decided reference labels, and the count of those."""
    decided = others != UNDECIDED
    return int((decided & (labels != others)).sum()), int(decided.sum())


def label_error_of(kept: Any) -> LabelError:
    """Return the label error in a store's metadata; files of earlier versions lack its later parts."""
    parts = {part.name for part in fields(LabelError)}
    if (
        not isinstance(kept, Mapping)
        or not parts.difference(_LATER) <= set(kept) <= parts
        or not all(
            isinstance(value, str) if name == "missed" else checks.is_real(value) for name, value in kept.items()
        )
    ):
        raise InputError("attribute 'label_error'", kept, f"numbers by {', '.join(sorted(parts))}")
    return LabelError(**kept)
