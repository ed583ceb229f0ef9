"""What a file holds of a fit: data, observables, instrument, intervals; all checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.contents import checked_texts
from saltus.errors import InputError
from saltus.fitting.instrument import Instrument

if TYPE_CHECKING:
    import xarray as xr

    from saltus.contents import Contents

__all__ = ["data_of", "formulas_of", "instrument_of", "limited_of", "limits_of"]


def data_of(held: Contents) -> xr.Dataset:
    """Return the data in a file, checked."""
    from saltus.extras import xr

    each = ("datum", "channel")
    held.size("datum", least=1)
    held.size("row", least=1)
    names = held.array("channel", ("channel",), str)
    data: dict[str, Any] = {"x": ("datum", held.array("fit_x", ("datum",)))}
    data["side"] = ("datum", held.array("fit_side", ("datum",), int, least=-1, most=1))
    beyond = held.array("fit_beyond", ("datum",), least=0.0) if "fit_beyond" in held.dataset else None
    data["beyond"] = ("datum", np.zeros(held.size("datum")) if beyond is None else beyond)
    data["sheet"] = ("datum", held.array("fit_sheet", ("datum",), int, least=0))
    data["direction"] = ("datum", held.array("fit_direction", ("datum",), str))
    data["residual"] = (("datum", "row"), held.array("fit_residual", ("datum", "row")))
    for name in ("measured", "measured_im", "model", "model_im", "sigma"):
        data[name] = (each, held.array(f"fit_{name}", each))
    for name in ("special_value", "special_sigma", "special_residual"):
        data[name] = ("special_datum", held.array(f"fit_{name}", ("special_datum",)))
    reach = held.array("fit_special_reach", ("special_datum",)) if "fit_special_reach" in held.dataset else None
    data["special_reach"] = ("special_datum", np.zeros(held.size("special_datum")) if reach is None else reach)
    data["turn"] = ("channel", held.array("fit_turn", ("channel",), least=0.0))
    data["special_type"] = ("special_datum", held.array("fit_special_type", ("special_datum",), str))
    return xr.Dataset(data, {"channel": names})


def formulas_of(held: Contents) -> dict[str, tuple[str, ...]]:
    """Return the observables of the channels in a file, checked."""
    names = held.array("channel", ("channel",), str).tolist()
    found = {
        name: tuple(checked_texts(one, f"formulas of {name}")) for name, one in held.json("formulas", dict).items()
    }
    if list(found) != names or sum(map(len, found.values())) != held.size("row"):
        raise InputError("attribute 'formulas'", list(found), f"one for each row of residuals of {', '.join(names)}")
    return found


def instrument_of(held: Contents) -> Instrument:
    """Return the unknowns of the measurement in a file; none of a file that has none."""
    if "instrument" not in held.dataset.attrs:
        return Instrument()
    table = held.json("instrument", dict)
    try:
        offset, gain, drift = (checks.text(name, table[name]) for name in ("offset", "gain", "drift"))
        drifting, values = (
            {key: checks.number(f"{name} of {key}", value) for key, value in table[name].items()}
            for name in ("drifting", "values")
        )
        scaled = tuple(checked_texts(table["scaled"], "scaled"))
        return Instrument(offset, gain, scaled, drift, drifting, values)
    except (KeyError, AttributeError) as error:
        raise InputError("attribute 'instrument'", table, "offset, gain, drift, scaled, drifting, values") from error


def limits_of(held: Contents, names: Sequence[str]) -> dict[str, str]:
    """Return in words what limits parameters, by a file; none of a file that does not say."""
    if "limits" not in held.dataset.attrs:
        return {}
    found = held.json("limits", dict)
    for name in found:
        checks.chosen("limits", name, names)
    return {name: checks.text(f"limits of {name}", words) for name, words in found.items()}


def limited_of(held: Contents, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the intervals of parameters that are limited, by a file."""
    if "limited" not in held.dataset:
        return {}
    table = held.array("limited", ("vary", "profile_end"), finite=False)
    return {
        name: (float(low), float(high))
        for name, (low, high) in zip(names, table, strict=True)
        if np.isfinite(low) and np.isfinite(high)
    }
