"""Laws of one region, which depend on the separation alone and lose no energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from saltus.afm.laws.law import Law
from saltus.afm.laws.regions import Region

__all__ = ["DLVO", "Hydration", "LennardJones", "Morse"]

_VACUUM = "8854.1878128"  # permittivity of the vacuum, in (mC/m^2)^2 nm^2/nN


@dataclass(frozen=True, kw_only=True)
class LennardJones(Law):
    """Force between a sphere and a flat whose atoms attract and repel as Lennard-Jones' do.

    ``F = H R/6 (sigma**6/(30 s**8) - 1/s**2)``, least at ``s = (2/15)**(1/6) sigma``.

    Parameters
    ----------
    H_aJ : float
        Hamaker constant, in aJ.
    sigma_nm : float
        Diameter of the atoms, in nm.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    J. Israelachvili, Intermolecular and Surface Forces, 3rd edition (2011), Secs. 7.5 and 13.1: the pair potential is
    summed over both bodies.

    Examples
    --------
    >>> law = LennardJones(H_aJ=0.2, sigma_nm=0.34)
    >>> round(float(law.force_nN(10.0, R_nm=30.0)), 9)  # far away -H R/(6 D**2)
    -0.01
    """

    H_aJ: float
    sigma_nm: float

    @property
    def regions(self) -> dict[str, Region]:
        """One for all gaps."""
        s = "separation_nm"
        force = f"H_aJ*R_nm/6*(sigma_nm**6/(30*{s}**8) - 1/{s}**2)"
        return {"everywhere": Region(force, domain="separation_nm")}


@dataclass(frozen=True, kw_only=True)
class Hydration(Law):
    """An exponential force, as of the layers of water at a surface: ``F = F0 exp(-s/l)``.

    Parameters
    ----------
    F_nN : float
        Force at contact, in nN; negative where it attracts.
    l_nm : float
        Decay length, in nm.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    J. Israelachvili, Intermolecular and Surface Forces, 3rd edition (2011), Sec. 15.8.

    Examples
    --------
    >>> round(float(Hydration(F_nN=2.0, l_nm=0.3).force_nN(0.3)), 6)  # 2/e
    0.735759
    """

    own: ClassVar[tuple[str, ...]] = ("F_nN", "l_nm")

    F_nN: float
    l_nm: float

    @property
    def regions(self) -> dict[str, Region]:
        """One for all gaps."""
        return {"everywhere": Region("F_nN*exp(-separation_nm/l_nm)")}


@dataclass(frozen=True, kw_only=True)
class DLVO(Law):
    """Forces in an electrolyte: of the charged double layers, and of van der Waals.

    ``F = 4 pi R l/(eps eps0) sigma_t sigma_s exp(-s/l) - H R/(6 s**2)``, for weak charges, l being Debye's length.

    Parameters
    ----------
    tip_mC_m2, sample_mC_m2 : float
        Charges of both surfaces, in mC/m**2.
    debye_nm : float
        Debye's length, in nm.
    H_aJ : float
        Hamaker constant, in aJ.
    permittivity : float, optional
        Relative permittivity; by default that of water at 25 degrees Celsius.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    H.-J. Butt, Biophys. J. 60, 1438 (1991), with both charges given.

    Examples
    --------
    >>> law = DLVO(tip_mC_m2=-20.0, sample_mC_m2=-30.0, debye_nm=3.0, H_aJ=0.01)
    >>> float(law.force_nN(9.0, R_nm=10.0).round(6)) > 0.0
    True
    """

    tip_mC_m2: float
    sample_mC_m2: float
    debye_nm: float
    H_aJ: float
    permittivity: float = 78.36

    @property
    def regions(self) -> dict[str, Region]:
        """One for all gaps."""
        strength = f"4*pi*R_nm*debye_nm*tip_mC_m2*sample_mC_m2/({_VACUUM}*permittivity)"
        force = f"{strength}*exp(-separation_nm/debye_nm) - H_aJ*R_nm/(6*separation_nm**2)"
        return {"everywhere": Region(force, domain="separation_nm")}


@dataclass(frozen=True, kw_only=True)
class Morse(Law):
    """A chemical bond between two atoms: the force of the potential ``U (exp(-2 u) - 2 exp(-u))``, ``u = (s - D0)/l``.

    ``F = 2 U/l (exp(-2 u) - exp(-u))``, least with ``-U/(2 l)`` at ``u = log(2)``.

    Parameters
    ----------
    U_aJ : float
        Energy of the bond, in aJ.
    l_nm : float
        Its range, in nm.
    D0_nm : float
        Separation without force, in nm.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    F. J. Giessibl, Rev. Mod. Phys. 75, 949 (2003), Eq. (3).

    Examples
    --------
    >>> float(Morse(U_aJ=0.4, l_nm=0.1, D0_nm=0.3).force_nN(0.3))
    0.0
    """

    own: ClassVar[tuple[str, ...]] = ("U_aJ", "l_nm", "D0_nm")

    U_aJ: float
    l_nm: float
    D0_nm: float

    @property
    def regions(self) -> dict[str, Region]:
        """One for all gaps."""
        u = "(separation_nm - D0_nm)/l_nm"
        return {"everywhere": Region(f"2*U_aJ/l_nm*(exp(-2*{u}) - exp(-{u}))")}
