"""The plane on which a closed smooth orbit starts, and those on which its further pieces start where it is cut."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import OBLIQUE

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["facings", "further_planes", "normal_across"]


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


def further_planes(
    starts: NDArray[np.float64], flows: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return point and normal of the plane across the flow at each further piece's start, one after the other.

    A cut keeps its place among the states while the durations of the pieces change. At a fixed share of the period it
    would move along the orbit instead, and through each jump of a fast state.

    Parameters
    ----------
    starts, flows : ndarray, shape (planes, n)
        States at the starts, and the flow there.
    sizes : ndarray, shape (n,)
        Sizes of the states.
    """
    slopes = flows / sizes
    normals = slopes / np.maximum(np.linalg.norm(slopes, axis=1), 1e-300)[:, None] / sizes
    return np.asarray(np.concatenate([starts, normals], axis=1).ravel())


def facings(planes: NDArray[np.float64], flows: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how steeply a flow crosses each plane, over its speed there, shape (planes,).

    Parameters
    ----------
    planes : ndarray, shape (planes, 2, n)
        Their points and normals.
    flows : ndarray, shape (planes, n)
        The flow where an orbit crosses them.
    sizes : ndarray, shape (n,)
        Sizes of the states.
    """
    speeds = [float(np.linalg.norm(flow / sizes)) for flow in flows]
    rows = zip(flows, planes, speeds, strict=True)
    return np.array([float(f @ plane[1]) / speed if speed > 0.0 else 0.0 for f, plane, speed in rows])
