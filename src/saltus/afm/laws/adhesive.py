"""Laws with hysteresis: the contact of Johnson, Kendall and Roberts, Schwarz' transition, a liquid neck."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from saltus.afm.laws.law import Law
from saltus.afm.laws.regions import Crossing, Region
from saltus.errors import InputError

__all__ = ["JKR", "Neck", "Schwarz"]


@dataclass(frozen=True, kw_only=True)
class JKR(Law):
    """Adhesive contact of Johnson, Kendall and Roberts, with the jumps into and out of contact.

    With ``a_c**3 = pi R**2 w / (8 E)`` the contact's radius is ``x a_c``, where ``x**4 - 4 x = -D R / a_c**2``. The
    force is ``pi w R (x**6/6 - x**3)``. Contact begins at ``D = 0``, where the force jumps from 0 to ``-4/3 pi w R``.
    It ends at ``D = 3 a_c**2/R``, where x is 1 and the force jumps from ``-5/6 pi w R`` to 0. The force is
    ``-3/2 pi w R`` at least. A cycle loses ``(0.15 2**(8/3) + 0.1) pi**(5/3) (w**5 R**4/E**2)**(1/3)``.

    The slope of the force is infinite where contact ends. Formulas use the root of the distance from there, in which
    all is analytic: with ``q = x**4 - 4 x`` and the root m of ``m**3 + q m = 2``, ``r = sqrt(m/2)`` gives
    ``x = r + sqrt(q + 3) sqrt(r (1 + r + r**2)/(1 + r))/(1 + 2 r**2)``.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa.
    w_N_m : float
        Work of adhesion, in N/m.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    K. L. Johnson, K. Kendall, A. D. Roberts, Proc. R. Soc. A 324, 301 (1971).

    Examples
    --------
    >>> law = JKR(E_GPa=0.05, w_N_m=0.05)
    >>> round(float(law.force_nN(0.0, "contact", R_nm=20.0)), 9)
    -4.188790205
    >>> round(law.energy_per_cycle_eV(Zc_nm=8.0, A_nm=10.0, f_kHz=70.0, R_nm=20.0), 6)
    120.156425
    """

    positive: ClassVar[tuple[str, ...]] = ("E_GPa",)
    contact: ClassVar[str] = "0"

    E_GPa: float
    w_N_m: float

    @property
    def regions(self) -> dict[str, Region]:
        """Without and with contact."""
        return {"far": Region(), "contact": _adhering("w_N_m")}

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Jump in and jump out."""
        return _jumps("w_N_m")


@dataclass(frozen=True, kw_only=True)
class Schwarz(Law):
    """The transition from JKR to DMT of Schwarz: short forces as of JKR, long ones as of DMT.

    The work of adhesion is ``w1 + w2``. In contact the force is that of `JKR` with w1, less ``2 pi R w2``. Without
    contact it is ``-2 pi R w2 (a0/(a0 + D))**2``. A cycle loses what JKR's law loses with w1. Until contact ends, at a
    gap D, the surfaces pull with all of w2, which costs ``2 pi R w2 D**2/(a0 + D)`` more.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa.
    w1_N_m, w2_N_m : float
        Work of adhesion of forces within and outside of the contact, in N/m.
    a0_nm : float
        Range of the forces outside, in nm.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    U. D. Schwarz, J. Colloid Interface Sci. 261, 99 (2003).

    Examples
    --------
    >>> law = Schwarz(E_GPa=0.05, w1_N_m=0.05, w2_N_m=0.01, a0_nm=0.3)
    >>> round(float(law.force_nN(0.0, "far", R_nm=20.0)), 9)  # -2 pi R w2
    -1.256637061
    """

    positive: ClassVar[tuple[str, ...]] = ("E_GPa",)
    contact: ClassVar[str] = "0"

    E_GPa: float
    w1_N_m: float
    w2_N_m: float
    a0_nm: float

    @property
    def regions(self) -> dict[str, Region]:
        """Without and with contact."""
        far = Region("-2*pi*R_nm*w2_N_m*(a0_nm/(a0_nm + D_nm))**2", domain="a0_nm + D_nm")
        return {"far": far, "contact": _adhering("w1_N_m", "-2*pi*R_nm*w2_N_m")}

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Jump in and jump out."""
        return _jumps("w1_N_m")


@dataclass(frozen=True, kw_only=True)
class Neck(Law):
    """A liquid neck that forms at one gap and breaks at a larger one.

    ``F = -4 pi gamma R/(1 + s/h)**2`` while there is a neck, s being the separation: in contact it is that of the law
    of contact. A neck costs ``4 pi gamma R h (1/(1 + on/h) - 1/(1 + off/h))``.

    Parameters
    ----------
    gamma_N_m : float
        Surface tension of the liquid, in N/m.
    h_nm : float
        Thickness of the film, in nm.
    on_nm, off_nm : float
        Gaps at which the neck forms and breaks, in nm.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible; `off_nm` is not above `on_nm`.

    References
    ----------
    L. Zitzler, S. Herminghaus, F. Mugele, Phys. Rev. B 66, 155436 (2002).

    Examples
    --------
    >>> neck = Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.6, off_nm=1.5)
    >>> round(neck.energy_per_cycle_eV(Zc_nm=10.0, A_nm=9.5, f_kHz=70.0, R_nm=20.0), 9)
    3.208627482
    """

    gamma_N_m: float
    h_nm: float
    on_nm: float
    off_nm: float

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        if self.off_nm <= self.on_nm:
            raise InputError("off_nm", self.off_nm, f"above on_nm = {self.on_nm!r}, where the neck forms")

    @property
    def regions(self) -> dict[str, Region]:
        """Without and with a neck."""
        force = "-4*pi*gamma_N_m*R_nm/(1 + separation_nm/h_nm)**2"
        return {"dry": Region(domain="off_nm - on_nm"), "wet": Region(force, domain="separation_nm + h_nm")}

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where the neck forms and where it breaks."""
        return Crossing("dry", "wet", "on_nm", -1, "form"), Crossing("wet", "dry", "off_nm", 1, "break")


def _radius(w: str, power: int) -> str:
    """Text of a power of JKR's a_c for a work of adhesion."""
    return f"(pi*R_nm**2*{w}/(8*E_GPa))**({power}/3)"


def _pull_off(w: str) -> str:
    return f"3*{_radius(w, 2)}/R_nm"


def _jumps(w: str) -> tuple[Crossing, ...]:
    return Crossing("far", "contact", "0", -1, "touch"), Crossing("contact", "far", _pull_off(w), 1, "pull_off")


def _adhering(w: str, further: str = "0") -> Region:
    """Return JKR's region of contact, with a further force; see `JKR` for the names, and ``p = -q``."""
    p = f"(D_nm*R_nm*{_radius(w, -2)})"
    root = f"(3 - {p})**(1/2)"
    cube = f"(1 + {root}*sqrt(({p}**2 + 3*{p} + 9)/27))"
    inverse = f"({cube}**(2/3) - {p}/3 + {p}**2/9*{cube}**(-2/3))"  # of r**2
    r = f"{inverse}**(-1/2)"
    x = f"({r} + {root}*sqrt({r}*(1 + {r} + 1/{inverse})/(1 + {r}))/(1 + 2/{inverse}))"
    force = f"pi*{w}*R_nm*({x}**6/6 - {x}**3)"
    return Region(force if further == "0" else f"{force} + {further}", separation="0", indentation="-D_nm")
