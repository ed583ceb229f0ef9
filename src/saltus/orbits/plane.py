"""The plane on which a closed smooth orbit starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import OBLIQUE

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["normal_across"]


def normal_across(slope: NDArray[np.float64], outwards: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normal of a plane across a flow, of such a length that its product with the flow's direction is 1.

    The plane holds the orbit's centre, unless the flow would cross it at a small angle: a cycle that shrinks to its
    centre keeps the angle.

    Parameters
    ----------
    slope, outwards : ndarray, shape (n,)
        The flow, and the way from the centre, in units of the states' sizes.

    Examples
    --------
    >>> normal_across(np.array([0.0, 2.0]), np.array([1.0, 0.0])).tolist()
    [0.0, 1.0]
    """
    slope = slope / max(float(np.linalg.norm(slope)), 1e-300)
    outwards = outwards / max(float(np.linalg.norm(outwards)), 1e-300)
    normal = slope - float(slope @ outwards) * outwards
    if not float(normal @ normal) > OBLIQUE**2:
        normal = slope
    return np.asarray(normal / max(float(slope @ normal), 1e-300))
