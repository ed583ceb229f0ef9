"""Covariance of a fit by linear theory, from derivatives of orbits that are solved at the data."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import SaltusError
from saltus.fitting.optimum import covariance
from saltus.flow.formulas import read_formula
from saltus.scales import VERIFIED_VALUE, Verdict, zero
from saltus.verification.table import AGREES, DIFFERS, Row, unchecked

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.fitting.result import Fit

__all__ = ["covariance_rows"]

_WHAT = "covariance"


def covariance_rows(fit: Fit) -> Iterator[Row]:
    """Yield whether the covariance is that of the data; knowledge from elsewhere, which is not kept, makes it less."""
    said = float(fit.covariance[0, 0])
    reason = _without(fit)
    if reason:
        yield unchecked(_WHAT, said, reason)
        return
    try:
        # residuals are listed channel after channel
        slopes = np.concatenate(np.stack([_slopes(fit, i) for i in range(fit.data.sizes["datum"])], axis=1))
    except SaltusError as error:
        yield unchecked(_WHAT, said, str(error))
        return
    found = covariance(slopes, fit.residuals)
    told, known = (np.isfinite(np.diag(table)) for table in (fit.covariance, found))
    if np.any(known & ~told):
        yield Row(_WHAT, "not told by the data", "finite", np.nan, np.nan, DIFFERS)
        return
    both = told & known
    if both.any():
        yield _compared(fit.covariance[np.ix_(both, both)], found[np.ix_(both, both)])
    if np.any(told & ~known):
        yield unchecked(_WHAT, said, "the data alone do not tell it; what is known beforehand is not kept")


def _without(fit: Fit) -> str:
    """Return why the data alone do not give the covariance by derivatives of orbits; empty where they do."""
    if fit.instrument.names:
        return "it has unknowns of the measurement"
    if fit.data.sizes["special_datum"]:
        return "special points were measured"
    if np.any(fit.data["side"] != 0) or fit.beyond:
        return "data lie beyond the ends of sheets"
    formulas = [formula for one in fit.formulas.values() for formula in one]
    if len(formulas) != len(fit.formulas) or any(read_formula(fit.system, formula).turn for formula in formulas):
        return "the data are complex, or angles"
    return ""


def _slopes(fit: Fit, i: int) -> NDArray[np.float64]:
    """Return derivatives of the model at a datum by the varied parameters, in standard errors, (channel, vary)."""
    x, formulas = float(fit.data["x"][i]), [one[0] for one in fit.formulas.values()]
    model, sigma = (fit.data[name].to_numpy()[i] for name in ("model", "sigma"))
    orbits: list[Any] = []
    failed: SaltusError | None = None
    for branch in fit.branches:
        try:
            orbits += branch.at(x)
        except SaltusError as error:  # a branch that does not come to the datum
            failed = error
    if not orbits and failed is not None:
        raise failed
    off = [np.abs((np.array(list(one.observe(*formulas).values())) - model) / sigma).max() for one in orbits]
    found = orbits[int(np.argmin(off))].sensitivity(formulas, fit.names)
    return np.asarray(np.array([found[name].to_numpy() for name in formulas]) / sigma[:, None])


def _compared(said: NDArray[np.float64], found: NDArray[np.float64]) -> Row:
    """Return the row of two covariances: by how much one exceeds the other, at most, in any combination."""
    sizes = np.sqrt(np.diag(found))
    values, axes = np.linalg.eigh(found / np.outer(sizes, sizes))
    across = axes / np.sqrt(values)
    with np.errstate(invalid="ignore"):
        ratios = np.linalg.eigvalsh(across.T @ (said / np.outer(sizes, sizes)) @ across) - 1.0
    error = VERIFIED_VALUE / float(values[0] / values[-1])
    most, least = float(ratios.max()), float(ratios.min())
    if most > error and zero(most, error) is Verdict.NO:
        return Row(_WHAT, 1.0 + most, 1.0, most, error, DIFFERS)
    if zero(np.array([most, least]), error) is Verdict.YES:
        return Row(_WHAT, 1.0 + most, 1.0, max(most, -least), error, AGREES)
    return unchecked(_WHAT, 1.0 + least, "less than by the data alone: what is known beforehand is not kept")
