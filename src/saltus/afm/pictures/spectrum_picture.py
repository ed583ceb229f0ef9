"""Picture of a thermal spectrum with the oscillator that was fitted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.afm.calibration.calibration import Calibration
from saltus.afm.calibration.spectra import PSD_UNITS
from saltus.plotting import plot, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_spectrum"]

_POINTS = 2000  # points of the fitted line
_BESIDE = 1.5  # frequencies shown beside the fitted ones, as a factor
_BROAD = 5.0  # ratio of fitted frequencies beyond which their axis is logarithmic


@plot.register(Calibration)
def plot_spectrum(calibration: Calibration, *, ax: Axes | None = None) -> Axes:
    """Draw a thermal spectrum and the fitted oscillator and return the matplotlib Axes.

    Bins that were not fitted are pale, and shown beside the fitted ones only. The dashed line is the white noise.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        `ax` is no Axes.
    """
    ax = style.axes(ax)
    f, used = calibration.f_kHz, calibration.used
    ax.plot(f[~used], calibration.psd[~used], ".", color="0.75", markersize=2, label="not fitted")
    ax.plot(f[used], calibration.psd[used], ".", color="C0", markersize=2, label="spectrum", zorder=1)
    line = np.linspace(f[used].min(), f[used].max(), _POINTS)
    label = f"fit: {calibration['f0_kHz']:.4g} kHz, Q {calibration['Q']:.3g}"
    ax.plot(line, calibration.model(line), color="C3", label=label, zorder=3)
    ax.axhline(calibration["white"], color="C3", linestyle="--", linewidth=1.0, label="white noise")
    ax.set(
        xlabel="frequency (kHz)", ylabel=f"power spectral density ({_unit(calibration.unit)})", yscale="log",
        xlim=(max(f[0], f[used].min() / _BESIDE), min(f[-1], f[used].max() * _BESIDE)),
    )  # fmt: skip
    if line[-1] > _BROAD * line[0]:
        ax.set_xscale("log")
    style.draw_legend(ax)
    return ax


def _unit(name: str) -> str:
    return PSD_UNITS[name].replace("^2", "$^2$")
