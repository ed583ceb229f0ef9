"""Frequency shift, excitation and losses of a probe at constant amplitude, as a result."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.models.parts import check_model
from saltus.afm.models.readings import READINGS, Reading
from saltus.afm.probe.units import ENERGY_EV, suffix
from saltus.described import described
from saltus.result import Result, frozen
from saltus.system.plain import held_system

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents
    from saltus.orbits import PeriodicOrbit
    from saltus.system import HybridSystem

__all__ = ["SHIFT_READINGS", "FrequencyShift", "shift_readings"]

SHIFT_READINGS = {
    "Zc_nm": Reading("nm", "distance"),
    "shift_Hz": Reading("Hz", "frequency shift"),
    "excitation_nm": Reading("nm", "excitation, as a free amplitude"),
} | {name: READINGS[name] for name in ("E_ts_eV", "virial_eV", "deflection_pm", "peak_force_nN", "min_force_nN")}
_OBSERVED = ("mean(sample_pW)", "mean(virial_aJ)", "mean(deflection_nm)", "max(force_nN)", "min(force_nN)")


def shift_readings(orbit: PeriodicOrbit, mode: int) -> dict[str, float]:
    """Return the readings of an orbit of a self-excited model; `mode` is the number of the excited one."""
    seen = orbit.observe(*_OBSERVED)
    power, virial, deflection, peak, least = (seen[name] for name in _OBSERVED)
    return {
        "Zc_nm": orbit.parameters["Zc_nm"],
        "shift_Hz": 1e3 * (1e3 / orbit.period - orbit.parameters[f"f0_kHz{suffix(mode)}"]),
        "excitation_nm": orbit.parameters["A0_nm"],
        "E_ts_eV": power * orbit.period * ENERGY_EV,
        "virial_eV": virial * ENERGY_EV,
        "deflection_pm": deflection * 1e3,
        "peak_force_nN": peak,
        "min_force_nN": least,
    }


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyShift(Result):
    """Readings of frequency modulation along the distance; `saltus.afm.frequency_shift` makes it.

    Attributes
    ----------
    system : HybridSystem
        The self-excited model.
    A_nm : float
        The amplitude that is held.
    columns : mapping of str to ndarray, shape (point,)
        ``Zc_nm``, ``shift_Hz``, ``excitation_nm``, ``E_ts_eV`` (loss in the sample in a cycle), ``virial_eV``,
        ``deflection_pm``, ``peak_force_nN``, ``min_force_nN``.
    stopped : str
        Why no point is nearer.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=10.0), Zc_nm=14.0)
    >>> far = afm.frequency_shift(system, (13.0, 14.0), 10.0, points=3)
    >>> far.column("shift_Hz").round(2).tolist()
    [-2.94, -3.71, -4.83]
    """

    system: HybridSystem
    A_nm: float
    columns: Mapping[str, NDArray[np.float64]]
    stopped: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", {name: frozen(values) for name, values in self.columns.items()})

    def __len__(self) -> int:
        return len(self.columns["Zc_nm"])

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a reading at all points.

        Parameters
        ----------
        name : str
            The reading, as ``shift_Hz``.

        Returns
        -------
        ndarray, shape (point,)

        Raises
        ------
        InputError
            There is no such reading.
        """
        return self.columns[checks.chosen("reading", name, tuple(self.columns))]

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the readings as a Dataset along ``point``."""
        from saltus.extras import xr

        data = {
            name: ("point", values, {"units": SHIFT_READINGS[name].unit, "long_name": SHIFT_READINGS[name].long_name})
            for name, values in self.columns.items()
        }
        attrs = {"definition": json.dumps(self.system.definition()), "A_nm": self.A_nm, "stopped": self.stopped}
        return xr.Dataset(data, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> FrequencyShift:
        system = held_system(held)
        check_model(system, "definition")
        held.size("point", least=1)
        columns = {name: held.array(name, ("point",)) for name in SHIFT_READINGS}
        return cls(system, held.number("A_nm", least=0.0), columns, held.text("stopped"))

    def __repr__(self) -> str:
        Zc, shift, loss = (self.columns[name] for name in ("Zc_nm", "shift_Hz", "E_ts_eV"))
        return "\n".join(
            [
                f"FrequencyShift of {self.system.name or 'a model'} at A_nm = {self.A_nm:.6g}: {len(self)} points",
                f"  Zc_nm       {Zc.min():.6g} to {Zc.max():.6g}",
                f"  shift_Hz    {shift.min():.6g} to {shift.max():.6g}",
                f"  E_ts_eV     {loss.min():.6g} to {loss.max():.6g}",
                f"  ended: {self.stopped}",
            ]
        )
