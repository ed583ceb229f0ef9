"""Laws of attraction and of elastic contact with a continuous force: van der Waals, DMT, Hertz."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from saltus.afm.laws.law import Law
from saltus.afm.laws.regions import Crossing, Region

__all__ = ["DMT", "Hertz", "VanDerWaals", "touching"]


def touching(level: str) -> tuple[Crossing, ...]:
    """Return the crossings of a law whose contact begins and ends at one gap."""
    return Crossing("far", "contact", level, -1, "touch"), Crossing("contact", "far", level, 1, "release")


@dataclass(frozen=True, kw_only=True)
class VanDerWaals(Law):
    """Van der Waals force between a sphere and a flat, constant where the surfaces touch.

    ``F = -H R / (6 D**2)`` above the intermolecular distance `a0_nm`, ``-H R / (6 a0**2)`` below. No energy is lost. A
    spring of stiffness k is pulled in where its base comes nearer than ``1.5 (H R / (3 k))**(1/3)``.

    Parameters
    ----------
    H_aJ : float
        Hamaker constant, in aJ; negative where the medium makes the surfaces repel.
    a0_nm : float
        Intermolecular distance, in nm.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    J. Israelachvili, Intermolecular and Surface Forces, 3rd edition (2011), Table 13.1.

    Examples
    --------
    >>> float(VanDerWaals(H_aJ=0.2, a0_nm=0.2).force_nN(1.0, R_nm=12.0))
    -0.4
    """

    H_aJ: float
    a0_nm: float

    @property
    def regions(self) -> dict[str, Region]:
        """Above and below the intermolecular distance."""
        return {
            "far": Region("-H_aJ*R_nm/(6*D_nm**2)", domain="D_nm"),
            "contact": Region("-H_aJ*R_nm/(6*a0_nm**2)", separation="a0_nm", indentation="a0_nm - D_nm"),
        }

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """At the intermolecular distance."""
        return touching("a0_nm")


@dataclass(frozen=True, kw_only=True)
class DMT(Law):
    """Elastic contact of Derjaguin, Mueller and Toporov, without the attraction, which `VanDerWaals` adds.

    ``F = 4/3 E sqrt(R) (a0 - D)**1.5`` below the intermolecular distance. No energy is lost.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa.
    a0_nm : float, optional
        Gap at which contact begins, in nm; by default that of the other law.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    B. V. Derjaguin, V. M. Muller, Y. P. Toporov, J. Colloid Interface Sci. 53, 314 (1975).

    Examples
    --------
    >>> round(float(DMT(E_GPa=3.0, a0_nm=0.2).force_nN(-0.8, R_nm=16.0)), 9)
    16.0
    """

    contact: ClassVar[str] = "a0_nm"

    E_GPa: float
    a0_nm: float | None = None

    @property
    def regions(self) -> dict[str, Region]:
        """Without and with contact."""
        return _hertzian("a0_nm")

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """At the intermolecular distance."""
        return touching("a0_nm")


@dataclass(frozen=True, kw_only=True)
class Hertz(Law):
    """Elastic contact of a sphere and a flat.

    ``F = 4/3 E sqrt(R) (-D)**1.5`` below ``D = 0``. No energy is lost. A free motion grazes where its amplitude is
    `Zc_nm`.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    K. L. Johnson, Contact Mechanics (1985), Eq. (4.23).

    Examples
    --------
    >>> round(float(Hertz(E_GPa=3.0).force_nN(-1.0, R_nm=16.0)), 9)
    16.0
    """

    contact: ClassVar[str] = "0"

    E_GPa: float

    @property
    def regions(self) -> dict[str, Region]:
        """Without and with contact."""
        return _hertzian("0")

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where the gap is 0."""
        return touching("0")


def _hertzian(level: str) -> dict[str, Region]:
    depth = f"{level} - D_nm"
    force = f"4/3*E_GPa*sqrt(R_nm)*({depth})**(3/2)"
    return {"far": Region(), "contact": Region(force, separation=level, indentation=depth)}
