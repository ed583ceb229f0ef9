"""Laws of losses in contact that depend on the rate: a dashpot, Kelvin and Voigt's sphere, a standard linear solid."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from saltus import checks
from saltus.afm.laws.contact import touching
from saltus.afm.laws.law import Law
from saltus.afm.laws.regions import Crossing, Region

__all__ = ["SLS", "Dashpot", "KelvinVoigt"]

_SURFACE = "contact_nm - D_nm"


@dataclass(frozen=True, kw_only=True)
class Dashpot(Law):
    """Constant damping in contact: ``F = -c V``, which jumps by ``c V`` at the surface.

    A period contracts areas of one mode's phase plane by ``exp(-(c_a t_a + c_i t_i) / m)``, with the times without and
    in contact and the damping there (Liouville).

    Contact with hysteresis (`JKR`, `Schwarz`) begins at a gap of 0 and lasts to the pull-off, farther out. On the way
    out the dashpot acts until the gap is 0 again, or until the pull-off: `until` says which.

    Parameters
    ----------
    c_uNs_m : float
        Damping, in uN s/m.
    until : {"surface", "pull_off"}, optional
        Where the dashpot ends on the way out: where contact has begun, or where contact ends. Both are the same gap but
        for contact with hysteresis.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    R. Garcia, Amplitude Modulation Atomic Force Microscopy (2010), Sec. 4.4.

    Examples
    --------
    >>> float(Dashpot(c_uNs_m=2.0).force_nN(-1.0, V_nm_us=-3.0))
    6.0
    """

    c_uNs_m: float
    until: str = "surface"

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        checks.chosen("until", self.until, ("surface", "pull_off"))

    @property
    def regions(self) -> dict[str, Region]:
        """Without and with contact."""
        return {"far": Region(), "contact": Region("-c_uNs_m*V_nm_us", elastic="0", indentation=_SURFACE)}

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where contact begins, and where it ends or the surface is passed again."""
        touch, release = touching("contact_nm")
        return touch, replace(release, level="release_nm") if self.until == "pull_off" else release


@dataclass(frozen=True, kw_only=True)
class KelvinVoigt(Law):
    """Viscous losses of a sphere in contact: ``F = -eta sqrt(R h) V``, h being the depth of indentation.

    The root makes the derivative of the force infinite at the surface. By default the law is given by its impulse
    ``G = 2/3 eta sqrt(R) h**1.5``: with ``z' = v + G/m`` all is once differentiable, and the motion is the same.
    A prescribed motion of amplitude A that indents by d loses
    ``sqrt(2) pi/4 eta omega sqrt(R A) d**2 (1 - d/(8 A) + ...)`` a cycle.

    Parameters
    ----------
    eta_Pa_s : float
        Viscosity, in Pa s.
    form : {"impulse", "raw"}, optional
        Whether the model's velocities are those without the impulse, or the tip's own. Only ``"impulse"`` has loci.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    R. Garcia, C. J. Gomez, N. F. Martinez, S. Patil, C. Dietz, R. Magerle, Phys. Rev. Lett. 97, 016103 (2006).

    Examples
    --------
    >>> law = KelvinVoigt(eta_Pa_s=10.0)
    >>> round(law.energy_per_cycle_eV(Zc_nm=19.0, A_nm=20.0, f_kHz=70.0, R_nm=20.0), 6)
    0.605995
    """

    eta_Pa_s: float
    form: str = "impulse"

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        checks.chosen("form", self.form, ("impulse", "raw"))

    @property
    def regions(self) -> dict[str, Region]:
        """Without and with contact."""
        force = f"-1e-3*eta_Pa_s*sqrt(R_nm)*({_SURFACE})**(1/2)*V_nm_us"
        if self.form == "raw":
            return {"far": Region(), "contact": Region(force, elastic="0", indentation=_SURFACE)}
        impulse = f"2e-3/3*eta_Pa_s*sqrt(R_nm)*({_SURFACE})**(3/2)"
        return {"far": Region(), "contact": Region(impulse=impulse, impulse_force=force, indentation=_SURFACE)}

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where contact begins and ends."""
        return touching("contact_nm")


@dataclass(frozen=True, kw_only=True)
class SLS(Law):
    """Standard linear solid under a flat punch: a spring beside a spring and a dashpot in series.

    With the depth ``h = -D`` and the dashpot's state y, ``F = k1 h + k2 (h - y)`` and ``y' = k2 (h - y)/c`` in contact.
    Contact ends where F is 0, and begins where the tip meets the surface that has not recovered: both at
    ``(k1 + k2) h = k2 y``. Without contact ``y' = -k1 k2/(k1 + k2) y/c``. A cycle loses what the dashpot takes, in
    contact and in recovery.

    Parameters
    ----------
    k1_N_m, k2_N_m : float
        Springs, in N/m: alone, and in series with the dashpot.
    c_uNs_m : float
        Dashpot, in uN s/m.
    check : bool, optional
        Whether implausible values are refused.

    References
    ----------
    S. D. Solares, Beilstein J. Nanotechnol. 5, 1649 (2014): the surface recovers freely.

    Examples
    --------
    >>> SLS(k1_N_m=2.0, k2_N_m=4.0, c_uNs_m=1.0).regions["contact"].states
    {'y_nm': 'k2_N_m*(-D_nm - y_nm)/c_uNs_m'}
    """

    positive: ClassVar[tuple[str, ...]] = ("c_uNs_m",)
    contact: ClassVar[str] = "-k2_N_m*y_nm/(k1_N_m + k2_N_m)"

    k1_N_m: float
    k2_N_m: float
    c_uNs_m: float

    @property
    def regions(self) -> dict[str, Region]:
        """In recovery and in contact."""
        recovery = "-k1_N_m*k2_N_m/(k1_N_m + k2_N_m)*y_nm/c_uNs_m"
        return {
            "far": Region(states={"y_nm": recovery}),
            "contact": Region(
                "-k1_N_m*D_nm + k2_N_m*(-D_nm - y_nm)",
                states={"y_nm": "k2_N_m*(-D_nm - y_nm)/c_uNs_m"},
                separation=self.contact,
                indentation="-D_nm",
            ),
        }

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where the tip meets and leaves the surface."""
        return touching(self.contact)
