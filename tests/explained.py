"""Variables of Datasets that do not say what they are."""

import xarray as xr

_ASKED = ("long_name", "units", "description")


def unexplained(dataset: xr.Dataset) -> list[str]:
    """Return the names of all variables without a name in words, a unit or a description."""
    return [str(name) for name, held in dataset.variables.items() if not all(held.attrs.get(key) for key in _ASKED)]
