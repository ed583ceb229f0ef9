"""Long-range laws: a meniscus of fixed volume, a voltage between a sphere or a whole tip and a sample, two dipoles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from saltus.afm.laws.law import Law
from saltus.afm.laws.regions import Crossing, Region
from saltus.afm.laws.tips import below_90
from saltus.errors import InputError

__all__ = ["Electrostatic", "ElectrostaticTip", "MagneticDipoles", "Meniscus"]

_EPS0 = "8.8541878128e-3"  # permittivity of the vacuum, in nN/V**2
_MU0 = "1256.63706212"  # permeability of the vacuum, in nN/A**2


@dataclass(frozen=True, kw_only=True)
class Meniscus(Law):
    """Pendular bridge of a liquid between a sphere and a flat, of fixed volume, which forms and breaks.

    With ``S = sqrt(s**2 + V/(pi R))``, s being the separation, ``F = -4 pi gamma R cos(phi) (1 - s/S)``. It is
    ``-4 pi gamma R cos(phi)`` where the surfaces touch, as of `Neck`. The bridge breaks at
    ``b = (1 + phi/2) V**(1/3)``, phi in radians. A bridge costs
    ``4 pi gamma R cos(phi) (b - on - sqrt(b**2 + V/(pi R)) + sqrt(on**2 + V/(pi R)))``.

    The formula is for bridges that are low and narrow against R.

    Parameters
    ----------
    gamma_N_m : float
        Surface tension of the liquid, in N/m.
    V_nm3 : float
        Volume of the bridge, in nm**3.
    on_nm : float
        Gap at which it forms, in nm.
    contact_angle_deg : float, optional
        Contact angle phi of the liquid on both surfaces, in degrees.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible; a bridge that forms beyond where it breaks.

    References
    ----------
    Y. I. Rabinovich, M. S. Esayanur, B. M. Moudgil, Langmuir 21, 10992 (2005): the force between sphere and plate;
    G. Lian, C. Thornton, M. J. Adams, J. Colloid Interface Sci. 161, 138 (1993): where the bridge breaks.

    Examples
    --------
    >>> law = Meniscus(gamma_N_m=0.072, V_nm3=50.0, on_nm=0.5)
    >>> round(float(law.force_nN(0.0, R_nm=20.0)), 6)  # -4 pi gamma R
    -18.095574
    """

    gamma_N_m: float
    V_nm3: float
    on_nm: float
    contact_angle_deg: float = 0.0

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        if self.contact_angle_deg >= 90.0:
            raise InputError("contact_angle_deg", self.contact_angle_deg, "below 90, where a liquid attracts")
        off = (1.0 + math.radians(self.contact_angle_deg) / 2.0) * self.V_nm3 ** (1.0 / 3.0)
        if self.on_nm >= off:
            raise InputError("on_nm", self.on_nm, f"below {off:.6g} nm, where a bridge of this volume breaks")

    @property
    def regions(self) -> dict[str, Region]:
        """Without and with a bridge."""
        far = "sqrt(separation_nm**2 + V_nm3/(pi*R_nm))"
        force = f"-4*pi*gamma_N_m*R_nm*cos(pi/180*contact_angle_deg)*(1 - separation_nm/{far})"
        return {"dry": Region(domain=f"{_OFF} - on_nm"), "wet": Region(force)}

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where the bridge forms and where it breaks."""
        return Crossing("dry", "wet", "on_nm", -1, "form"), Crossing("wet", "dry", _OFF, 1, "break")


_OFF = "(1 + pi/360*contact_angle_deg)*V_nm3**(1/3)"  # gap at which a meniscus breaks


@dataclass(frozen=True, kw_only=True)
class Electrostatic(Law):
    """Force of a voltage between a conducting sphere and a conducting flat.

    ``F = -pi eps0 R**2/(s (s + R)) (U - U_cpd)**2``, s being the separation: ``pi eps0 R U**2/s`` near by and
    ``pi eps0 R**2 U**2/s**2`` far away, as is exact, and up to 5.2 % more between. It vanishes where the bias is the
    contact potential difference. No energy is lost.

    Parameters
    ----------
    bias_V : float
        Voltage U of the sample against the tip, in V.
    cpd_V : float, optional
        Contact potential difference U_cpd, in V: the bias at which there is no field.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    S. Hudlet, M. Saint Jean, C. Guthmann, J. Berger, Eur. Phys. J. B 2, 5 (1998): the tip's apex, as a whole sphere.

    Examples
    --------
    >>> law = Electrostatic(bias_V=1.0, cpd_V=0.2)
    >>> round(float(law.force_nN(5.0, R_nm=20.0)), 6)
    -0.056968
    """

    bias_V: float
    cpd_V: float = 0.0

    @property
    def regions(self) -> dict[str, Region]:
        """One for all gaps."""
        s = "separation_nm"
        return {"everywhere": Region(f"-pi*{_EPS0}*R_nm**2*(bias_V - cpd_V)**2/({s}*({s} + R_nm))", domain=s)}


@dataclass(frozen=True, kw_only=True)
class ElectrostaticTip(Law):
    """Force of a voltage between a conducting cone with a rounded end and a conducting flat.

    With ``Z = s + R (1 - sin(alpha))``, the height at which the sphere meets the cone, and ``T = Z + cone_height_nm``,
    ``F = -pi eps0 (U - U_cpd)**2 (R**2 (1 - sin(alpha))/(s Z) + k**2 (log(T/Z) - 1 + Z/T + a (1/Z - 1/T)))``, where
    ``k = 1/log(tan(alpha/2))`` and ``a = R cos(alpha)**2/sin(alpha)``. The first term is the sphere's, the second one
    the flank's. No energy is lost.

    The source leaves out ``(Z - a)/T``, which counts where the gap is no longer small against the cone. A tip with a
    free upper edge has a further force from there, nearly constant along the gap. The slope of the force is exact
    within 12 % for half angles of 15 degrees and more. For 10 degrees it is within 18 %, for 5 degrees within 32 %.

    Parameters
    ----------
    bias_V : float
        Voltage U of the sample against the tip, in V.
    half_angle_deg : float
        Angle alpha between the cone's axis and its flank, in degrees.
    cone_height_nm : float
        Height of the cone above the place where it meets the sphere, in nm.
    cpd_V : float, optional
        Contact potential difference U_cpd, in V: the bias at which there is no field.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible; a half angle of 90 degrees or more.

    References
    ----------
    S. Hudlet, M. Saint Jean, C. Guthmann, J. Berger, Eur. Phys. J. B 2, 5 (1998): apex and cone.

    Examples
    --------
    >>> law = ElectrostaticTip(bias_V=1.0, half_angle_deg=15.0, cone_height_nm=1e4)
    >>> round(float(law.force_nN(20.0, R_nm=20.0)), 6)
    -0.057378
    """

    positive: ClassVar[tuple[str, ...]] = ("half_angle_deg",)

    bias_V: float
    half_angle_deg: float
    cone_height_nm: float
    cpd_V: float = 0.0

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        below_90(self.half_angle_deg)

    @property
    def regions(self) -> dict[str, Region]:
        """One for all gaps."""
        s, sine = "separation_nm", "sin(pi/180*half_angle_deg)"
        joint = f"({s} + R_nm*(1 - {sine}))"
        top = f"({joint} + cone_height_nm)"
        sphere = f"R_nm**2*(1 - {sine})/({s}*{joint})"
        arm = f"R_nm*(1 - {sine}**2)/{sine}"
        flank = f"(log({top}/{joint}) - 1 + {joint}/{top} + {arm}*(1/{joint} - 1/{top}))"
        force = f"{sphere} + {flank}/log(tan(pi/360*half_angle_deg))**2"
        return {"everywhere": Region(f"-pi*{_EPS0}*(bias_V - cpd_V)**2*({force})", domain=s)}


@dataclass(frozen=True, kw_only=True)
class MagneticDipoles(Law):
    """Force between two magnetic dipoles on one vertical line, both vertical, as of a magnetic tip over a particle.

    ``F = -3 mu0 m_t m_s/(2 pi (s + c)**4)``, s being the separation and c the distance of both dipoles where the
    surfaces touch. Moments of one sign attract. No energy is lost.

    Parameters
    ----------
    tip_A_nm2, sample_A_nm2 : float
        Moments of tip and sample, in A nm**2, which is 1e-18 A m**2 or 1e-15 emu.
    centres_nm : float
        Distance c, in nm: for two spheres the sum of their radii.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    J. D. Jackson, Classical Electrodynamics, 3rd edition (1998), Eqs. (5.56) and (5.69); U. Hartmann, Phys. Lett. A
    137, 475 (1989): a tip as a point dipole.

    Examples
    --------
    >>> law = MagneticDipoles(tip_A_nm2=100.0, sample_A_nm2=100.0, centres_nm=40.0)
    >>> round(float(law.force_nN(10.0)), 6)
    -0.96
    """

    tip_A_nm2: float
    sample_A_nm2: float
    centres_nm: float

    @property
    def regions(self) -> dict[str, Region]:
        """One for all gaps."""
        far = "(separation_nm + centres_nm)"
        return {"everywhere": Region(f"-3*{_MU0}*tip_A_nm2*sample_A_nm2/(2*pi*{far}**4)", domain=far)}
