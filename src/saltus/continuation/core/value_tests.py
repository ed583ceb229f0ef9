"""Functions of eigenvalues or multipliers that vanish where these become critical: docs/theory/equilibria.md."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.scales import FAR_FROM_CRITICAL, LARGEST_TESTED, PAIRED

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Tested", "border_tests", "bounded", "circle_tests"]


class Tested(NamedTuple):
    """Functions of values that belong together; docs/theory/equilibria.md lists them."""

    values: list[float]
    sizes: list[float]  # changes of the functions as the values change by their sizes
    turns: bool  # whether the values are a complex pair
    far: bool  # whether they are so far from critical that they cannot come there and back in a step
    scale: float  # way of the values that is neither short nor long
    infinite: bool = False  # whether all functions change their signs at once where a value passes infinity

    def like(self, other: Tested) -> Tested:
        """Return the functions with the signs that they have next to other ones where a value passed infinity between.

        They are linear in a point of the projective plane, 1 with sum and product of the values. A vector and its
        opposite are one point.
        """
        if not self.infinite or sum(a * b for a, b in zip(self.values, other.values, strict=True)) >= 0.0:
            return self
        return self._replace(values=[-value for value in self.values])


def bounded(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return multipliers without the size of those that are infinite, or nearly."""
    large = np.abs(values) >= LARGEST_TESTED
    if not large.any():
        return values
    found = values.copy()
    found[large] = np.where(values.real[large] < 0.0, -LARGEST_TESTED, LARGEST_TESTED)
    return found


def circle_tests(values: list[complex]) -> Tested:
    """Return functions of multipliers that vanish at 1, at -1, and for a pair at the unit circle.

    They are bounded, and smooth where one or two multipliers pass infinity but for their sign.
    """
    if len(values) == 1:
        (value,) = values
        size = abs(value)
        unit = math.hypot(1.0, size)
        change, far = (1.0 + size) / unit, size < FAR_FROM_CRITICAL or size > 1.0 / FAR_FROM_CRITICAL
        distances = [(1.0 - value.real) / unit, (1.0 + value.real) / unit]
        return Tested(distances, [change, change], False, far, max(1.0, size), True)
    if len(values) == 2:
        a, b = values
        size, second = abs(a), abs(b)
        total, product, one, other = (a + b).real, (a * b).real, 1.0 + size, 1.0 + second
        unit = math.hypot(1.0, total, product)
        distances = [(1.0 - total + product) / unit, (1.0 + total + product) / unit, (1.0 - product) / unit]
        changes = [
            (one * abs(1.0 - b) + other * abs(1.0 - a)) / unit,
            (one * abs(1.0 + b) + other * abs(1.0 + a)) / unit,
            (1.0 + abs(product)) / unit,
        ]
        sizes = [size, second]
    else:
        unit, distances, changes = math.prod(math.hypot(1.0, abs(value)) for value in values), [], []
        for side in (1.0, -1.0):
            distance, change = 1.0 + 0.0j, 0.0
            for value in values:
                own, size = 1.0 - side * value, 1.0 + abs(value)
                distance, change = distance * own, change * abs(own) + abs(distance) * size
            distances.append(distance.real / unit)
            changes.append(change / unit)
        sizes = [abs(value) for value in values]
    far = max(sizes) < FAR_FROM_CRITICAL or min(sizes) > 1.0 / FAR_FROM_CRITICAL
    return Tested(distances, changes, _turns(values), far, max(1.0, *sizes), infinite=len(values) == 2)


def border_tests(values: list[complex]) -> Tested:
    """Return functions of eigenvalues that vanish at 0, and for a pair at the imaginary axis."""
    if len(values) == 1:
        value = values[0]
        return Tested([value.real], [1e-3 + abs(value)], False, False, abs(value.real))
    if len(values) == 2:
        a, b = values
        modulus = abs(a)
        size = 1e-3 + modulus
        sizes, turns = [size * (1e-3 + abs(b)), size], abs(a.imag) > PAIRED * modulus
        return Tested([(a * b).real, (a + b).real], sizes, turns, False, min(abs(a.real), abs(b.real)))
    product, size = 1.0 + 0.0j, 1.0
    for value in values:
        product, size = product * value, size * (1e-3 + abs(value))
    return Tested([product.real], [size], False, False, min(abs(value.real) for value in values))


def _turns(values: list[complex]) -> bool:
    return len(values) == 2 and abs(values[0].imag) > PAIRED * abs(values[0])
