"""A force that was made of data, as a result: over the gap, with errors; what it tells of a law of force."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.afm.laws.law import Law
from saltus.afm.probe.units import NONE_INSISTS, checked
from saltus.afm.reconstruction.inflection import Inflection
from saltus.afm.reconstruction.law_fit import Averages, LawFit, fitted_law
from saltus.described import described
from saltus.result import Result, frozen

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["ReconstructedForce"]

# Arrays with their unit and long name: along the gaps, and along the data.
_OF_GAPS = {
    "D_nm": ("nm", "gap"),
    "F_nN": ("nN", "force"),
    "sigma_nN": ("nN", "standard error of the force"),
}
_OF_DATA = {
    "centre_nm": ("nm", "gap in the middle of the oscillation"),
    "amplitude_nm": ("nm", "amplitude"),
    "shift": ("", "reduced shift"),
    "shift_sigma": ("", "standard error of the reduced shift"),
}
_CHANGED = ("reading", "change", "datum")


@dataclass(frozen=True, eq=False, repr=False)
class ReconstructedForce(Result):
    """The force over the gap that measured or computed data tell; `saltus.afm.reconstruct_force` makes it.

    Attributes
    ----------
    D_nm, F_nN, sigma_nN : ndarray, shape (point,)
        Gaps in ascending order, the force there, positive where it repels, and its standard error. Errors of
        neighbours are correlated. They are those of the data: what happens between two data is told by `halved`.
    method : str
        How it was made.
    R_nm : float
        Radius of the tip, in nm.
    k_N_m : float
        Stiffness of the mode, in N/m.
    centre_nm, amplitude_nm, shift, shift_sigma : ndarray, shape (datum,)
        The data by their least gaps: gap in the middle of the oscillation, amplitude, ``-<F z>/(k A**2)`` and its
        standard error.
    changed : ndarray, shape (reading, 3, datum)
        Changes of the first three of these by the standard error of each reading. No reading where errors are
        estimated.
    chi2 : float
        Sum of squares of what is left of `shift`, over its errors.
    halved : float
        How much the force differs that every other datum tells, over the greatest force.
    inflections : tuple of Inflection
        The test of each inflection of the force: ``D_nm``, ``S``, ``ill_posed`` and others.
    messages : tuple of str
        What speaks against the result, in words.
    errors_given : bool
        Whether errors of the data were given, and not estimated.

    Examples
    --------
    >>> import numpy as np
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=2600.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> Zc = 10.0 + np.geomspace(1.0, 10.0, 40)
    >>> shift = -300e3 * 0.12 * 12.0 / (6.0 * 2600.0 * (Zc**2 - 10.0**2) ** 1.5)
    >>> force = afm.reconstruct_force({"Zc_nm": Zc, "shift_Hz": shift, "deflection_pm": 0.0 * Zc}, probe, A_nm=10.0)
    >>> print(f"{force.F_nN[0]:.3f} nN at {force.D_nm[0]:.2f} nm")
    -0.240 nN at 1.00 nm
    """

    D_nm: NDArray[np.float64]
    F_nN: NDArray[np.float64]
    sigma_nN: NDArray[np.float64]
    method: str
    R_nm: float
    k_N_m: float
    centre_nm: NDArray[np.float64]
    amplitude_nm: NDArray[np.float64]
    shift: NDArray[np.float64]
    shift_sigma: NDArray[np.float64]
    changed: NDArray[np.float64]
    chi2: float
    halved: float
    inflections: tuple[Inflection, ...] = ()
    messages: tuple[str, ...] = ()
    errors_given: bool = True

    def __post_init__(self) -> None:
        for name in (*_OF_GAPS, *_OF_DATA, "changed"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.D_nm)

    def law(self) -> Law:
        """Return the force as a smooth law, which models take; `saltus.afm.Law.tabulated` has the method.

        Returns
        -------
        Law
            Without contact of its own and without losses.

        Raises
        ------
        InputError
            The force is too rough for a smooth law.
        """
        return Law.tabulated(self.D_nm, self.F_nN, self.sigma_nN)

    def fit(
        self,
        law: Law,
        vary: Mapping[str, tuple[float, float]],
        *,
        D_nm: tuple[float, float] | None = None,
        R_nm: float | None = None,
    ) -> LawFit:
        """Return the parameters with which a law has the averages that the data tell.

        The averages of the law over each oscillation are compared with those of the data. In this way errors of the
        force that are correlated, and its smoothness, do not count.

        Parameters
        ----------
        law : Law
            The law; the search starts at its values. Of a hysteretic law both ways count, each in its half of a cycle.
        vary : mapping of str to (float, float)
            Parameters that are sought, with least and greatest values. ``origin_nm`` is added to all gaps, ``R_nm`` is
            the radius of the tip.
        D_nm : (float, float), optional
            Least gaps of the data that count, by default all.
        R_nm : float, optional
            Radius of the tip, in nm; by default the probe's.

        Returns
        -------
        LawFit
            The law with its best values, their errors and correlations.

        Raises
        ------
        InputError
            The law has no such parameter, bounds are not in order or do not hold its value, or data are too few.

        Examples
        --------
        >>> import numpy as np
        >>> from saltus import afm
        >>> probe = afm.Probe(k_N_m=2600.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
        >>> Zc = 10.0 + np.geomspace(1.0, 10.0, 40)
        >>> shift = -300e3 * 0.12 * 12.0 / (6.0 * 2600.0 * (Zc**2 - 10.0**2) ** 1.5)  # Hz; van der Waals
        >>> force = afm.reconstruct_force({"Zc_nm": Zc, "shift_Hz": shift, "deflection_pm": 0.0 * Zc}, probe, A_nm=10.0)
        >>> found = force.fit(afm.VanDerWaals(H_aJ=0.05, a0_nm=0.3), {"H_aJ": (0.01, 1.0)})
        >>> print(f"{found.values['H_aJ']:.4f}")
        0.1200
        """
        checks.instance("law", law, Law)
        radius = self.R_nm if R_nm is None else checked("R_nm", R_nm, insists=NONE_INSISTS)
        seen = (self.changed, self.centre_nm, self.amplitude_nm, self.shift, self.shift_sigma)
        data = Averages(self.k_N_m, *seen, self.errors_given)
        return fitted_law(data, law, vary, D_nm, radius)

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the force along ``point`` and the data along ``datum``."""
        from saltus.extras import xr

        data: dict[str, Any] = {
            name: (dim, getattr(self, name), {"units": unit, "long_name": told})
            for dim, names in (("point", _OF_GAPS), ("datum", _OF_DATA))
            for name, (unit, told) in names.items()
        }
        data["changed"] = (_CHANGED, self.changed, {"long_name": "changes by the error of each reading"})
        table = {f"inflection_{name}": ("inflection", [getattr(one, name) for one in self.inflections])
                 for name in Inflection._fields}  # fmt: skip
        attrs = {name: getattr(self, name) for name in ("method", "R_nm", "k_N_m", "chi2", "halved")}
        attrs |= {"messages": json.dumps(self.messages), "errors_given": int(self.errors_given)}
        return xr.Dataset(data | table, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> ReconstructedForce:
        held.size("point", least=2)
        columns: dict[str, Any] = {name: held.array(name, ("point",)) for name in _OF_GAPS}
        columns |= {name: held.array(name, ("datum",)) for name in _OF_DATA}
        count = len(columns["shift"])
        before = "changed" not in held.dataset.variables  # files of versions that kept the sum of the errors alone
        columns["changed"] = np.empty((0, 3, count)) if before else held.array("changed", _CHANGED)
        columns |= {name: held.number(name, least=0.0) for name in ("R_nm", "k_N_m", "chi2", "halved")}
        table = [held.array(f"inflection_{name}", ("inflection",), finite=False) for name in Inflection._fields]
        return cls(
            **columns,
            method=held.text("method"),
            inflections=tuple(Inflection(*map(float, row)) for row in zip(*table, strict=True)),
            messages=tuple(held.texts("messages")),
            errors_given=bool(held.count("errors_given", 0, 1)),
        )

    def __repr__(self) -> str:
        least, most = self.F_nN.argmin(), self.F_nN.argmax()
        lines: Sequence[str] = [
            f"ReconstructedForce by {self.method} of {len(self.shift)} data: {len(self)} gaps",
            f"  D_nm        {self.D_nm[0]:.6g} to {self.D_nm[-1]:.6g}",
            f"  least       {self.F_nN[least]:.4g} +- {self.sigma_nN[least]:.2g} nN at {self.D_nm[least]:.4g} nm",
            f"  greatest    {self.F_nN[most]:.4g} +- {self.sigma_nN[most]:.2g} nN at {self.D_nm[most]:.4g} nm",
            f"  every other datum tells a force that differs by {100.0 * self.halved:.2g} % of the greatest one",
            *(f"  {message}" for message in self.messages),
        ]
        return "\n".join(lines)
