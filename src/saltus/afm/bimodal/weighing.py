"""Least squares of the balance's equations, each weighed by what the readings' errors make of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus.afm.bimodal.averages import STANDARD, Nodes
from saltus.afm.bimodal.balance import Balance

__all__ = ["Weighed", "Weighing"]

Floats = NDArray[np.float64]

_EXACT = 1e-5  # share of a drive to which its equations are meant, beside known errors
_ROUGH = 1e-2  # the same where no errors are known
_ROUNDING = 1e-12  # added to correlations, so that rounding leaves them positive definite


class Weighed(NamedTuple):
    """Equations in units of their errors."""

    residual: Floats  # (pixel, equation)
    slopes: Floats  # (pixel, equation, unknown)
    readings: Floats  # (pixel, equation, known)
    plain: Floats  # the residual in nm, (pixel, equation)
    weights: Floats  # (pixel, equation, equation): what makes a plain residual one in units of its errors


class Weighing:
    """The equations of pixels as functions of the unknowns."""

    def __init__(
        self, balance: Balance, unknown: Sequence[str], sigma: dict[str, Floats], logarithmic: set[str]
    ) -> None:
        self.balance, self.unknown, self.sigma = balance, list(unknown), sigma
        self.known = [name for name in balance.names if name not in unknown]
        self.logarithmic = [i for i, name in enumerate(unknown) if name in logarithmic]
        self.rows = [balance.at[name] for name in unknown]
        drives = [f"excitation_nm{end}" for end in balance.ends]
        self.scales = [balance.at[name] for name in (*np.repeat(drives, 2), "amplitude_nm")]

    def at(self, q: Floats, pixels: NDArray[np.intp], nodes: Nodes = STANDARD) -> Weighed:
        """Return the equations at variables of some pixels."""
        balance = self.balance
        residual, slopes = balance.residuals(q, balance.means(q, nodes))
        count, share = balance.equations, _EXACT if self.sigma else _ROUGH
        scales = np.abs(q[self.scales])
        floor = share * scales
        for i, end in enumerate(balance.ends):
            name, rows = f"lag_deg{end}", [2 * i, 2 * i + 1]
            if name in self.sigma:  # the equations are not straight in an error of a lag
                turned = 0.5 * np.radians(self.sigma[name][pixels]) ** 2 * np.sqrt(3.0)
                floor[rows] = np.hypot(floor[rows], turned * scales[rows])
        covariance = np.einsum("en,ef->nef", floor**2, np.eye(count))
        for name, sigma in self.sigma.items():
            along = slopes[:, balance.at[name]] * sigma[pixels]
            covariance += np.einsum("en,fn->nef", along, along)
        own = slopes[:, self.rows].transpose(2, 0, 1)
        given = slopes[:, [balance.at[name] for name in self.known]].transpose(2, 0, 1)
        least = np.full((len(pixels), count, 1), np.nan)
        whole = np.concatenate([residual.T[..., None], own, given], axis=2)
        good = np.isfinite(whole).all((1, 2)) & np.isfinite(covariance).all((1, 2))
        out = np.broadcast_to(least, whole.shape).copy()
        scale = np.sqrt(np.einsum("nee->ne", covariance[good]))
        correlation = covariance[good] / (scale[:, :, None] * scale[:, None, :]) + _ROUNDING * np.eye(count)
        root = np.linalg.cholesky(correlation)
        weights = np.full((len(pixels), count, count), np.nan)
        weights[good] = np.linalg.inv(root) / scale[:, None, :]
        out[good] = weights[good] @ whole[good]
        sought = 1 + len(self.unknown)
        return Weighed(out[..., 0], out[..., 1:sought], out[..., sought:], residual.T, weights)

    def moved(self, q: Floats, steps: Floats) -> Floats:
        """Return the variables after steps of the unknowns, shape (unknown, pixel); some step by their logarithm."""
        out = q.copy()
        for i, row in enumerate(self.rows):
            if i in self.logarithmic:
                out[row] = q[row] * np.exp(np.clip(steps[i], -1.0, 1.0))
            else:
                out[row] = q[row] + steps[i]
        return out

    def scaled(self, q: Floats, slopes: Floats) -> Floats:
        """Return derivatives along the unknowns as they step."""
        out = slopes.copy()
        for i in self.logarithmic:
            out[..., i] *= q[self.rows[i]][:, None]
        return out
