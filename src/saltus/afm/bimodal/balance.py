"""The balance of two or three modes over a sample: equations between readings, distance and the sample's values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from saltus.afm.bimodal.averages import STANDARD, Motion, Nodes, averages
from saltus.afm.bimodal.hysteresis import remembered
from saltus.afm.bimodal.layers import Layers, layers_of
from saltus.afm.laws.law import Law
from saltus.afm.probe.probe import Probe
from saltus.afm.probe.units import ENERGY_EV
from saltus.errors import InputError

__all__ = ["ENDS", "OF_MODES", "Balance", "mode_of"]

Floats = NDArray[np.float64]

OF_MODES = ("amplitude_nm", "lag_deg", "shift_Hz", "excitation_nm")
ENDS = ("", "_2", "_3")  # of the readings of each mode
_DEGREE = math.pi / 180.0


def mode_of(name: str) -> tuple[str, int]:
    """Return the name that a reading has for the first mode, and the number of its mode from 0."""
    number = max(i for i, end in enumerate(ENDS) if name.endswith(end))
    return name.removesuffix(ENDS[number]), number


class Balance:
    """The equations of a probe and a law.

    With amplitude A, lag and frequency ``f = f0 r`` of a mode, and the drive ``k A0/Q``, its first harmonic demands

    - ``A0 cos(lag) = Q A (1 - r**2) - 2 Q/k <F cos(phi)>``
    - ``A0 sin(lag) = A r + 2 Q/k <F sin(phi)>``, where ``<F sin(phi)>`` is ``omega A <gamma sin(phi)**2>`` of a damping

    and the mean demands ``c = Zc + <F> sum(1/k)``. All variables stand in one row a name, shape (variable, pixel).
    """

    def __init__(self, probe: Probe, law: Law) -> None:
        self.k, self.f0, self.Q = (np.array(getattr(probe, name)) for name in ("k_N_m", "f0_kHz", "Q"))
        self.weights = np.array(probe.optical_weights)
        self.layers: Layers = layers_of(law, probe.R_nm)
        if self.layers.memories and probe.modes > 2:
            hint = "a law without hysteresis takes three; afm.model with three drives takes any law"
            raise InputError(
                "probe", probe.modes, "a probe with two modes: the law's contact ends later than it begins", hint
            )
        self.own = {"R_nm": probe.R_nm, **law.parameters}
        self.ends = ENDS[: probe.modes]
        self.equations = 2 * probe.modes + 1
        self.readings = tuple(name + end for end in self.ends for name in OF_MODES)
        self.amplitudes = [f"amplitude_nm{end}" for end in self.ends]
        self.shifts = [f"shift_Hz{end}" for end in self.ends]
        self.names = ("mean_gap_nm", "Zc_nm", *self.readings, *self.layers.names)
        self.at = {name: i for i, name in enumerate(self.names)}

    def values(self, given: Mapping[str, Floats], pixels: int) -> Floats:
        """All variables, NaN where nothing is given; parameters of the law have the law's values."""
        q = np.full((len(self.names), pixels), math.nan)
        for name in self.layers.names:
            q[self.at[name]] = self.own[name]
        for name, value in given.items():
            q[self.at[name]] = value
        return q

    def parameters(self, q: Floats) -> dict[str, Floats]:
        """The law's parameters among the variables."""
        return {name: q[self.at[name]] for name in self.layers.names}

    def means(self, q: Floats, nodes: Nodes = STANDARD) -> Floats:
        """Means of the force; see `averages`. Where it depends on the past, they have derivatives along shifts too."""
        motion = Motion(q[self.at["mean_gap_nm"]], q[[self.at[name] for name in self.amplitudes]])
        parameters = self.parameters(q)
        if not self.layers.memories:
            return averages(self.layers, motion, parameters, nodes)
        # a force that jumps where contact begins needs more nodes than one that bends there
        found = averages(self.layers, motion, parameters, nodes._replace(outer=2 * nodes.outer))
        # a shift that is not known yet changes the rates by a thousandth or less
        shifts = np.nan_to_num(q[[self.at[name] for name in self.shifts]])
        omega = 2e-3 * math.pi * (self.f0[:, None] + 1e-3 * shifts)
        whole = remembered(self.layers, motion, omega, parameters, nodes)
        whole[:, :, : found.shape[2]] += found
        whole[:, :, found.shape[2] :] *= 2e-6 * math.pi  # from rates in 1/us to shifts in Hz
        return whole

    def unknown_means(self, pixels: int) -> Floats:
        """Means of no pixel's force, NaN."""
        return np.full((2, 1 + len(self.ends), 1 + len(self._columns()), pixels), math.nan)

    def residuals(self, q: Floats, means: Floats) -> tuple[Floats, Floats]:
        """What the equations lack, and its derivatives along all variables.

        Returns
        -------
        residual : ndarray, shape (equation, pixel)
            Cosine and sine of each mode's drive, in nm; last the mean gap, in nm.
        slopes : ndarray, shape (equation, variable, pixel)
        """
        at, along = self.at, self._columns()
        residual = np.zeros((self.equations, q.shape[1]))
        slopes = np.zeros((self.equations, len(q), q.shape[1]))
        for i, end in enumerate(self.ends):
            A, lag, shift, A0 = (q[at[name + end]] for name in OF_MODES)
            columns = [at[name + end] for name in OF_MODES]
            k, Q, f0 = self.k[i], self.Q[i], self.f0[i]
            r, omega = 1.0 + 1e-3 * shift / f0, 2e-3 * math.pi * (f0 + 1e-3 * shift)
            cosine, sine, per_Hz = np.cos(lag * _DEGREE), np.sin(lag * _DEGREE), 1e-3 / f0
            elastic, damping, factor = *means[:, 1 + i], 2.0 * Q / k
            residual[2 * i] = Q * A * (1.0 - r**2) - factor * elastic[0] - A0 * cosine
            slopes[2 * i, along] = -factor * elastic[1:]
            slopes[2 * i, columns] += [Q * (1.0 - r**2), A0 * sine * _DEGREE, -2.0 * Q * A * r * per_Hz, -cosine]
            residual[2 * i + 1] = A * r + factor * omega * A * damping[0] - A0 * sine
            slopes[2 * i + 1, along] = factor * omega * A * damping[1:]
            slopes[2 * i + 1, columns] += [
                r + factor * omega * damping[0],
                -A0 * cosine * _DEGREE,
                A * per_Hz * (1.0 + factor * 2e-3 * math.pi * f0 * damping[0]),
                -sine,
            ]
        bend = float(np.sum(1.0 / self.k))
        residual[-1] = q[at["mean_gap_nm"]] - bend * means[0, 0, 0] - q[at["Zc_nm"]]
        slopes[-1, along] = -bend * means[0, 0, 1:]
        slopes[-1, at["mean_gap_nm"]] += 1.0
        slopes[-1, at["Zc_nm"]] = -1.0
        return residual, slopes

    def _columns(self) -> list[int]:
        """The variables along which the means have derivatives."""
        names = ("mean_gap_nm", *self.amplitudes, *self.layers.names)
        return [self.at[name] for name in (*names, *(self.shifts if self.layers.memories else ()))]

    def steps(self, residual: Floats, slopes: Floats, unknown: Sequence[str]) -> Floats:
        """Newton's steps of as many unknowns as equations, shape (unknown, pixel); NaN where singular."""
        matrix = slopes[:, [self.at[name] for name in unknown]].transpose(2, 0, 1)
        good = np.asarray(np.isfinite(matrix).all((1, 2)) & np.isfinite(residual).all(0))
        good[good] &= np.abs(np.linalg.det(matrix[good])) > 0.0
        steps = np.full((len(unknown), residual.shape[1]), math.nan)
        steps[:, good] = -np.linalg.solve(matrix[good], residual[:, good].T[..., None])[..., 0].T
        return steps

    def level(self, q: Floats) -> Floats:
        """Gap at which the farthest of the law's crossings is, 0 where the law has none."""
        if not self.layers.levels:
            return np.zeros(q.shape[1])
        return self.layers.place(self.layers.levels[0], self.parameters(q))[0]

    def contact(self, q: Floats) -> Floats:
        """Gap at which the nearest of the law's crossings is, 0 where the law has none."""
        if not self.layers.levels:
            return np.zeros(q.shape[1])
        return self.layers.place(self.layers.levels[-1], self.parameters(q))[0]

    def told(self, q: Floats, means: Floats) -> dict[str, Floats]:
        """Further readings: deflection, energies of each mode in a cycle of its own, indentation."""
        found = {"deflection_pm": 1e3 * float(np.sum(self.weights / self.k)) * means[0, 0, 0]}
        low = q[self.at["mean_gap_nm"]]
        for i, end in enumerate(self.ends):
            A, f = q[self.at["amplitude_nm" + end]], self.f0[i] + 1e-3 * q[self.at["shift_Hz" + end]]
            found["virial_eV" + end] = A * means[0, 1 + i, 0] * ENERGY_EV
            found["E_ts_eV" + end] = 4e-3 * math.pi**2 * f * A**2 * means[1, 1 + i, 0] * ENERGY_EV
            low = low - A
        if self.layers.levels:
            found["indentation_nm"] = np.maximum(0.0, self.contact(q) - low)
        return found
