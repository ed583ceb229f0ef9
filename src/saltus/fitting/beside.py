"""Data with the model beside them, as a Dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.fitting.jumps import DOWN

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.fitting.evaluation import Evaluation
    from saltus.fitting.measured import Channel

__all__ = ["dataset_of"]


def dataset_of(found: Evaluation) -> xr.Dataset:
    """Return the data with the model beside them."""
    from saltus.extras import xr

    measured, (sheet, _, side) = found.measured, found.assigned
    count, rows = len(measured), measured.rows
    model = [
        _beside(one, found.instrument.factor(one.name), found.seen[[measured.formulas.index(f) for f in one.formulas]])
        for one in measured.channels
    ]
    residual = found.residuals[: rows * count].reshape(rows, count).T
    each = ("datum", "channel")
    table = np.array([one.values for one in measured.channels], dtype=np.complex128).T
    shown = np.array(model, dtype=np.complex128).T
    points = measured.points
    return xr.Dataset(
        {
            "x": ("datum", measured.x),
            "side": ("datum", side),
            "beyond": ("datum", found.beyond),
            "sheet": ("datum", sheet),
            "direction": ("datum", np.array(measured.direction, dtype=object)),
            "residual": (("datum", "row"), residual),
            "measured": (each, table.real),
            "measured_im": (each, table.imag),
            "model": (each, shown.real),
            "model_im": (each, shown.imag),
            "sigma": (each, np.array([one.sigma for one in measured.channels]).T),
            "turn": ("channel", np.array([one.turn for one in measured.channels])),
            "special_value": ("special_datum", np.array([point.value for point in points], dtype=float)),
            "special_sigma": ("special_datum", np.array([point.sigma for point in points], dtype=float)),
            "special_reach": (
                "special_datum",
                np.array([-point.reach if point.direction == DOWN else point.reach for point in points], dtype=float),
            ),
            "special_residual": ("special_datum", found.residuals[rows * count : rows * count + len(points)]),
            "special_type": ("special_datum", np.array([point.type for point in points], dtype=object)),
        },
        {"channel": [one.name for one in measured.channels]},
    )


def _beside(channel: Channel, gain: float, seen: NDArray[np.float64]) -> NDArray[Any]:
    """Return an observable of the model, times a gain; an angle in the turn of the data."""
    found = gain * channel.model(seen)
    return found - channel.turn * np.round((found - channel.values) / channel.turn) if channel.turn else found
