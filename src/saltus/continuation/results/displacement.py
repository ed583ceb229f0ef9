"""How a locus moves with parameters that do not vary along it: at each point as a special point moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.errors import ConvergenceError, InputError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["displaced"]


def displaced(locus: Any, of: str, parameters: Sequence[str] | None) -> xr.Dataset:
    """Return the derivatives of one parameter of a locus at its points; `Locus.displacement` describes them.

    Parameters
    ----------
    locus : Locus, EquilibriumLocus or MapLocus
        The locus.
    of : str
        The parameter that is displaced.
    parameters : sequence of str or None
        Parameters that change.
    """
    from saltus.extras import xr

    of = checks.chosen("of", of, locus.varied)
    rest = tuple(name for name in locus.system.parameter_names if name != of)
    wanted = rest if parameters is None else checks.names("parameters", parameters, "names of parameters")
    wanted = tuple(checks.chosen("parameters", name, rest) for name in wanted)
    count = len(locus.values)
    slopes, notes = np.full((count, len(wanted)), np.nan), np.full(count, "", dtype=object)
    for i in range(count):
        try:
            found = replace(locus.point(i), varied=(of,)).sensitivity(wanted)[of]
        except (InputError, ConvergenceError) as error:
            notes[i] = str(error)
            continue
        slopes[i], notes[i] = found.to_numpy(), found.attrs.get("note", "")
    coordinates: dict[str, Any] = {name: ("point", locus.values[:, k]) for k, name in enumerate(locus.varied)}
    coordinates |= {"parameter": list(wanted), "note": ("point", notes)}
    return xr.Dataset({"displacement": (("point", "parameter"), slopes, {"of": of})}, coordinates)
