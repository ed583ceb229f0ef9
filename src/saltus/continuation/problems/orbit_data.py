"""What is known of a point of a branch, or of a locus, of orbits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from saltus.continuation.core.monitor import Monitor
from saltus.scales import FINEST

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from saltus.orbits.signature import Survey

__all__ = ["LocusData", "OrbitData"]


@dataclass(frozen=True)
class OrbitData:
    """Data of a point of a branch."""

    survey: Survey  # dense survey of the orbit
    multipliers: NDArray[np.complex128]  # shape (states,): Floquet multipliers, largest first
    unstable: int  # number of unstable multipliers
    # multipliers without the trivial one, each at the index of its predecessor at the point before
    followed: tuple[complex, ...] = ()
    behind: tuple[float, tuple[complex, ...]] | None = None  # arclength from the point before, and its own of these
    # the same at a place nearby: the arclength to there, and the values, in any order
    beside: tuple[float, NDArray[np.complex128]] | None = None
    twice: bool = False  # whether the orbit goes round a shorter one twice
    tolerance: float = FINEST  # relative tolerance of the flow that it was solved with
    # multipliers, NaN or their critical place where they are rounding; None where none is
    known: NDArray[np.complex128] | None = None

    @property
    def told(self) -> NDArray[np.complex128]:
        """Multipliers as results have them.

        They are NaN where an event is met more slowly than its own speed is known. One that passes its critical place
        faster than rounding tells is there.
        """
        return self.multipliers if self.known is None else self.known

    @property
    def coincident(self) -> dict[Monitor, float]:
        """Monitors of durations between events of one instant: none of them is a border."""
        return {Monitor("duration", i): math.nan for i in self.survey.together}


@dataclass(frozen=True)
class LocusData:
    """Data of a point of a locus."""

    survey: Survey  # dense survey of the orbit
    multipliers: NDArray[np.complex128]  # shape (states,): Floquet multipliers, largest first
    unstable: int  # number of unstable multipliers, the critical ones left out
    others: NDArray[np.complex128]  # multipliers that are not critical; none on a locus of grazings or branch points
    angle: float  # angle of the critical multipliers in radians; NaN on a GR or BP locus
    coefficient: float  # test function of CP, GPD or CH, over its size at the start; NaN on other loci
    behind: tuple[float, NDArray[np.complex128]] | None = None  # arclength from the point before, and its other values

    @property
    def told(self) -> NDArray[np.complex128]:
        """Multipliers as results have them."""
        return self.multipliers
