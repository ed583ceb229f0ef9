"""The base of all laws of force, and their sums; `saltus.afm.laws.regions` says what formulas may contain."""

from __future__ import annotations

from dataclasses import InitVar, dataclass, fields
from typing import TYPE_CHECKING, ClassVar

from saltus import checks
from saltus.afm.laws.common_regions import product, shared_parameters
from saltus.afm.laws.prescribed import energy_per_cycle_eV, force_nN
from saltus.afm.laws.regions import Crossing, Region
from saltus.afm.probe.named_arguments import NamedArguments
from saltus.afm.probe.units import checked
from saltus.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Law", "Sum", "Tabulated"]

_NUMBERS = ("float", "float | None", "int", float, int)  # annotations of fields that take no text
_RADIUS = 10.0  # nm; radius of the tip by which gaps are ordered where no law of a sum gives it


@dataclass(frozen=True, kw_only=True)
class Law(NamedArguments):
    """Base of all laws; `+` adds laws.

    A law of one's own is a frozen dataclass: its fields are the parameters, and `regions` has its formulas, the
    farthest region first. A field that is None takes the value that another law of the sum gives to this name. The
    radius ``R_nm`` is the probe's unless a law has it as a field.

    Three class variables say more. `contact` is the gap at which contact begins, a formula in the parameters. A law
    that has it needs no region for contact: one is made, of the same force, so that the time in contact is known.
    `positive` names parameters that must not be 0. `own` names those that another law of a sum may have with
    another meaning: the second law's then ends with ``_2``.

    Parameters
    ----------
    check : bool, optional
        Whether implausible values are refused.

    Attributes
    ----------
    regions : dict of str to Region
        Formulas; a law with one region has no crossings.
    crossings : tuple of Crossing
        Where regions end.
    parameters : dict of str to float
        Values that are given.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Yukawa(Law):
    ...     '''A screened attraction.'''
    ...
    ...     F_nN: float
    ...     l_nm: float
    ...     touch_nm: float
    ...     contact = "touch_nm"
    ...
    ...     @property
    ...     def regions(self):
    ...         return {"everywhere": Region("-F_nN*exp(-D_nm/l_nm)*l_nm/D_nm", domain="D_nm")}
    >>> law = Yukawa(F_nN=1.0, l_nm=2.0, touch_nm=0.3)
    >>> law.parameters, float(law.force_nN(2.0).round(6))
    ({'F_nN': 1.0, 'l_nm': 2.0, 'touch_nm': 0.3}, -0.367879)
    """

    positive: ClassVar[tuple[str, ...]] = ()  # parameters that must not be 0, beyond those that never may
    contact: ClassVar[str] = ""  # gap at which contact begins; empty where the law has no contact of its own
    own: ClassVar[tuple[str, ...]] = ()  # parameters that another law of a sum may have with another meaning

    check: InitVar[bool] = True

    def __post_init__(self, check: bool) -> None:
        checks.flag("check", check)
        for one in fields(self):
            value = getattr(self, one.name)
            if value is None and one.default is None:
                continue
            if not isinstance(value, str) or one.type in _NUMBERS:
                number = checked(one.name, value, plausible=check)
                object.__setattr__(self, one.name, number)
                if one.name in self.positive:
                    checks.positive(one.name, number)

    @property
    def regions(self) -> dict[str, Region]:
        """Formulas of each region, the farthest first."""
        raise NotImplementedError("a law has regions")

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where regions end."""
        return ()

    @property
    def parameters(self) -> dict[str, float]:
        """Names and values of the parameters that are given."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return {name: value for name, value in values.items() if checks.is_real(value)}

    @staticmethod
    def tabulated(D_nm: ArrayLike, F_nN: ArrayLike, sigma_nN: ArrayLike | None = None) -> Tabulated:
        """Return a smooth law that has the forces of a table.

        It is one analytic formula, or two that meet at a gap where the table bends. Beyond the table the force falls
        with the distance squared, within twice the misfit. A motion that comes nearer than the table's least gap ends
        with an error.

        Parameters
        ----------
        D_nm : array_like, shape (row,)
            Gaps in nm, in ascending order.
        F_nN : array_like, shape (row,)
            Forces in nN, positive where they repel.
        sigma_nN : array_like, shape (row,), optional
            Standard errors of the forces, in nN: the law need not be nearer.

        Returns
        -------
        Tabulated
            Its ``misfit`` is the greatest difference from the table, over the greatest force.

        Raises
        ------
        InputError
            The gaps do not ascend, there are less than 8, they are not in nm, or no formula comes near the forces.

        Examples
        --------
        >>> import numpy as np
        >>> D = np.linspace(0.3, 5.0, 60)
        >>> law = Law.tabulated(D, -0.4 / D**2)
        >>> law.force_nN([0.5, 2.0]).round(3).tolist(), law.misfit < 1e-3
        ([-1.6, -0.1], True)
        """
        gaps, forces = checks.ascending("D_nm", D_nm), checks.array("F_nN", F_nN)
        errors = None if sigma_nN is None else checks.array("sigma_nN", sigma_nN)
        for name, values in (("F_nN", forces), ("sigma_nN", forces if errors is None else errors)):
            if values.shape != gaps.shape:
                raise InputError(name, list(values.shape), f"one number for each of {len(gaps)} gaps")
        from saltus.afm.laws.table_fit import fitted_table  # SciPy takes a third of a second

        found = fitted_table(gaps, forces, errors)
        bend = "" if found.bend_nm is None else repr(found.bend_nm)
        return Tabulated(
            far=found.far, near=found.near, bend=bend, least=repr(float(gaps[0])), fitted_to=repr(found.misfit)
        )

    @property
    def parts(self) -> tuple[Law, ...]:
        """The law itself, as the only one."""
        return (self,)

    def __add__(self, other: Law) -> Sum:
        return Sum(laws=self.parts + other.parts) if isinstance(other, Law) else NotImplemented

    def force_nN(
        self,
        D_nm: ArrayLike,
        region: str | None = None,
        *,
        R_nm: float | None = None,
        V_nm_us: ArrayLike = 0.0,
        check: bool = True,
    ) -> NDArray[np.float64]:
        """Return the force on the tip, in nN.

        Parameters
        ----------
        D_nm : array_like
            Gaps, in nm.
        region : str, optional
            Region. By default the one in which a tip is that came from afar to each gap.
        R_nm : float, optional
            Radius of the tip, in nm, where the law needs and does not have it.
        V_nm_us : array_like, optional
            Rates of the gap, in nm/us. The law's own states are 0.
        check : bool, optional
            Whether an implausible `R_nm` is refused.

        Returns
        -------
        ndarray
            Of the shape of `D_nm` and `V_nm_us` together.

        Raises
        ------
        InputError
            There is no such region, or a parameter is given by no law.

        Examples
        --------
        >>> from saltus.afm import DMT, VanDerWaals
        >>> law = VanDerWaals(H_aJ=0.2, a0_nm=0.2) + DMT(E_GPa=10.0)
        >>> law.force_nN([1.0, 0.1], R_nm=12.0).round(6).tolist()
        [-0.4, -8.539407]
        """
        radius = None if R_nm is None else checked("R_nm", R_nm, plausible=check)
        return force_nN(self.parts, D_nm, region, radius, V_nm_us)

    def energy_per_cycle_eV(
        self, *, Zc_nm: float, A_nm: float, f_kHz: float, R_nm: float | None = None, check: bool = True
    ) -> float:
        """Return the energy that the tip loses to the sample in a cycle of a prescribed motion.

        Parameters
        ----------
        Zc_nm, A_nm : float
            Mean and amplitude of the gap ``Zc + A cos(2 pi f t)``, in nm.
        f_kHz : float
            Frequency, in kHz, on which viscous losses depend.
        R_nm : float, optional
            Radius of the tip, in nm, where the law needs and does not have it.
        check : bool, optional
            Whether implausible values are refused.

        Returns
        -------
        float, in eV
            Positive where energy is lost. The cycle is the second one, after hysteresis has been passed once. States of
            a law have come to repeat.

        Raises
        ------
        InputError
            A value that is not allowed or, with `check`, not plausible; states of the law do not repeat in each cycle.

        Examples
        --------
        >>> from saltus.afm import Neck
        >>> neck = Neck(gamma_N_m=0.072, h_nm=1.0, on_nm=1.0, off_nm=3.0)
        >>> round(neck.energy_per_cycle_eV(Zc_nm=10.0, A_nm=9.5, f_kHz=70.0, R_nm=20.0), 8)  # 2 pi gamma R h
        28.23592184
        """
        motion = {"Zc_nm": Zc_nm, "A_nm": A_nm, "f_kHz": f_kHz}
        Zc, A, f = (checked(name, value, plausible=check) for name, value in motion.items())
        radius = None if R_nm is None else checked("R_nm", R_nm, plausible=check)
        return energy_per_cycle_eV(self.parts, Zc, A, f, radius)


@dataclass(frozen=True, kw_only=True)
class Sum(Law):
    """Laws that act at once, as `+` makes them; `saltus.afm.laws.common_regions` has their common regions.

    Parameters
    ----------
    laws : tuple of Law
        The laws.
    check : bool, optional
        Without effect: each law is checked where it is made.

    Examples
    --------
    >>> from saltus.afm import DMT, VanDerWaals
    >>> law = VanDerWaals(H_aJ=0.2, a0_nm=0.2) + DMT(E_GPa=10.0)
    >>> list(law.regions), law.parameters
    (['far', 'contact'], {'H_aJ': 0.2, 'a0_nm': 0.2, 'E_GPa': 10.0})
    """

    laws: tuple[Law, ...]

    def __post_init__(self, check: bool) -> None:
        """Leave the values to the laws, which are checked."""

    @property
    def parts(self) -> tuple[Law, ...]:
        """The laws, one by one."""
        return self.laws

    @property
    def regions(self) -> dict[str, Region]:
        """Formulas of the common regions, the farthest first."""
        return dict(product(self.parts, _RADIUS).regions)

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where common regions end."""
        return product(self.parts, _RADIUS).crossings

    @property
    def parameters(self) -> dict[str, float]:
        """Names and values of the parameters that the parts give."""
        return shared_parameters(self.parts)


@dataclass(frozen=True, kw_only=True)
class Tabulated(Law):
    """A law with the forces of a table; `Law.tabulated` makes it.

    Parameters
    ----------
    far : str
        Force in nN as a formula in ``D_nm``.
    near : str, optional
        The same nearer than a gap at which the force bends. There is the tip in contact.
    bend : str, optional
        This gap, in nm.
    least : str
        Least gap of the table, in nm.
    fitted_to : str
        Greatest difference from the table, over the greatest force.
    check : bool, optional
        Without effect: a table is no quantity.
    """

    far: str
    near: str = ""
    bend: str = ""
    least: str
    fitted_to: str

    @property
    def misfit(self) -> float:
        """Greatest difference from the table, over the greatest force."""
        return float(self.fitted_to)

    @property
    def regions(self) -> dict[str, Region]:
        """One for all gaps of the table, or one on each side of the bend."""
        domain = f"D_nm - ({self.least})"
        if not self.near:
            return {"everywhere": Region(self.far, domain=domain)}
        inside = Region(self.near, indentation=f"{self.bend} - D_nm", domain=domain)
        return {"far": Region(self.far), "contact": inside}

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """At the bend."""
        level = self.bend
        if not level:
            return ()
        return Crossing("far", "contact", level, -1, "touch"), Crossing("contact", "far", level, 1, "release")
