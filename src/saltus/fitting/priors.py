"""What is known of parameters before a fit: values with standard errors, as further residuals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus import checks
from saltus.errors import InputError

__all__ = ["NO_PRIORS", "Priors", "read_priors"]

_FAR = 3.0  # distance of a fit from a known value, in its standard errors, from which they contradict each other


class Priors(NamedTuple):
    """Known values of varied parameters."""

    places: tuple[int, ...]  # which of the varied parameters
    values: NDArray[np.float64]  # shape (prior,)
    sigma: NDArray[np.float64]  # shape (prior,): standard errors

    def residuals(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters less their known values, in standard errors."""
        return np.asarray((parameters[list(self.places)] - self.values) / self.sigma)

    def contradicted(self, parameters: NDArray[np.float64], names: Sequence[str]) -> tuple[str, ...]:
        """Return in words which known values parameters contradict, by more than three standard errors."""
        return tuple(
            f"the prior of {names[place]}, {value:.6g} +- {sigma:.2g}, is {abs(away):.3g} of its standard errors off"
            " the fit: it contradicts the data or the bounds"
            for place, value, sigma, away in zip(
                self.places, self.values, self.sigma, self.residuals(parameters), strict=True
            )
            if abs(away) > _FAR
        )

    def jacobian(self, count: int) -> NDArray[np.float64]:
        """Return the derivatives of the residuals by `count` parameters."""
        return np.eye(count)[list(self.places)] / self.sigma[:, None]


NO_PRIORS = Priors((), np.zeros(0), np.zeros(0))


def read_priors(priors: object, names: Sequence[str]) -> Priors:
    """Return priors, checked; `names` are the varied parameters.

    Raises
    ------
    InputError
        A prior is of another parameter, or no value with a positive standard error.

    Examples
    --------
    >>> read_priors({"k": (2.0, 0.1)}, ["c", "k"]).residuals(np.array([0.0, 2.3])).round(6).tolist()
    [3.0]
    """
    if priors is None:
        return NO_PRIORS
    given: Mapping[str, object] = checks.mapping("priors", priors, "values with standard errors by parameter")
    places, values, sigma = [], [], []
    for name, pair in given.items():
        checks.chosen("priors", name, names, hint="what is not varied has no prior")
        if not isinstance(pair, tuple | list) or len(pair) != 2:
            raise InputError(f"priors[{name!r}]", pair, "a pair of a value and its standard error")
        places.append(list(names).index(name))
        values.append(checks.number(f"priors[{name!r}][0]", pair[0]))
        sigma.append(checks.positive(f"priors[{name!r}][1]", pair[1]))
    return Priors(tuple(places), np.array(values), np.array(sigma))
