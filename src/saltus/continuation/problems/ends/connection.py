"""What is known of a homoclinic orbit: its saddle, the leading eigenvalues, whether chaos is near."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.equilibria import Equilibrium
from saltus.equilibria.spectrum import NEUTRAL

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Homoclinic"]


@dataclass(frozen=True, eq=False, repr=False)
class Homoclinic:
    """The equilibrium at which the period of cycles grows without bound.

    At a HOM it is the saddle of a homoclinic orbit, at a SNIC the saddle-node. At a BC it lies on an event of the
    cycle.

    Attributes
    ----------
    saddle : Equilibrium
        The equilibrium that the orbit leaves and comes back to, at the parameters of the homoclinic orbit.
    event : str
        Name of the transition on whose event the equilibrium lies, at a BC; empty elsewhere.
    """

    saddle: Equilibrium
    event: str = ""

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues of the saddle, the largest real part first."""
        return self.saddle.eigenvalues

    @property
    def slides(self) -> bool:
        """Whether the equilibrium is a pseudo-equilibrium, of a sliding mode."""
        return self.saddle.system.modes[self.saddle.mode].surface is not None

    @property
    def leading(self) -> tuple[complex, complex]:
        """The unstable and the stable eigenvalue nearest to the imaginary axis; NaN where one is missing.

        Of a pair it is the upper one. A motion that lands on a pseudo-saddle from beside the surface comes there in
        finite time, and no stable eigenvalue leads it.
        """
        values = self.eigenvalues
        rounding = NEUTRAL * float(np.abs(values).max())
        unstable, stable = values[values.real > rounding], values[values.real < -rounding]
        if np.any(np.abs(values.real) <= rounding) or not unstable.size or not stable.size:
            return complex(math.nan), complex(math.nan)
        slowest = unstable[np.argmin(unstable.real)], stable[np.argmax(stable.real)]
        first, second = (complex(value.real, abs(value.imag)) for value in slowest)
        return first, complex(math.nan) if self.slides else second

    @property
    def saddle_quantity(self) -> float:
        """Sum of the real parts of both leading eigenvalues; below 0 the cycle next to a planar saddle is stable."""
        return sum(value.real for value in self.leading)

    @property
    def saddle_focus(self) -> bool:
        """Whether a leading eigenvalue is complex, so that the orbit spirals at the saddle."""
        return any(value.imag > 0.0 for value in self.leading)

    @property
    def chaos(self) -> bool:
        """Whether Shilnikov's theorem gives infinitely many cycles nearby, as the leading spiral is the slower way."""
        unstable, stable = self.leading
        if unstable.imag > 0.0 and stable.imag > 0.0:
            return True
        return (stable.imag > 0.0 and self.saddle_quantity > 0.0) or (
            unstable.imag > 0.0 and self.saddle_quantity < 0.0
        )

    def __repr__(self) -> str:
        if self.event:
            return f"equilibrium on the event {self.event!r}, at\n{self.saddle!r}"
        unstable = self.leading[0]
        if self.slides and not cmath.isnan(unstable):
            return f"sliding homoclinic to a pseudo-saddle, leading eigenvalue {unstable.real:.6g}, at\n{self.saddle!r}"
        if math.isnan(self.saddle_quantity):
            return f"saddle-node on an invariant circle, at\n{self.saddle!r}"
        kind = "saddle-focus" if self.saddle_focus else "saddle"
        chaos = ", chaos by Shilnikov's theorem" if self.chaos else ""
        return f"homoclinic to a {kind}, saddle quantity {self.saddle_quantity:.6g}{chaos}, at\n{self.saddle!r}"
