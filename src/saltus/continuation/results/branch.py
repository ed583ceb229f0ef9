"""A branch of periodic orbits along one parameter."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, final

import numpy as np

from saltus.continuation.results.orbit_curve import OrbitCurve
from saltus.continuation.results.parameters import OneParameter
from saltus.described import described
from saltus.orbits import PeriodicOrbit, solve_orbit
from saltus.orbits.pieces import in_pieces
from saltus.orbits.signature import Signature
from saltus.orbits.solve import converge
from saltus.orbits.unfolding import Fixed, read_fixed
from saltus.result import frozen
from saltus.system.plain import held_system

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents
    from saltus.orbits.problem import OrbitProblem

__all__ = ["Branch"]


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Branch(OneParameter[PeriodicOrbit], OrbitCurve):
    """Periodic orbits along one parameter.

    Attributes
    ----------
    parameter : str
        The parameter that varies, or a quantity, as ``max_x``. Its values along the branch are in `values`, shape
        (point,). Types of `special_points` are SN, PD, TR, BP, GR, HB, BE, HOM, SNIC, TP, EX and users' events.
        `OrbitCurve` lists the other attributes.
    fixed : Fixed or None
        Along a quantity: its name and its value at the start, and the parameter that is free.
    freed : ndarray, shape (point,)
        Values of the free parameter; NaN where none is free.

    Examples
    --------
    >>> import saltus
    >>> oscillator = saltus.HybridSystem.smooth({"x": "v", "v": "mu*(1 - x**2)*v - x"}, {"mu": 1.0})
    >>> orbit = saltus.find_orbit(oscillator, x0=[2.0, 0.0])
    >>> branch = saltus.continue_orbit(orbit, "mu", bounds=(0.5, 2.0))
    >>> [round(float(value), 6) for value in sorted(branch.values)[:: len(branch) - 1]]
    [0.5, 2.0]
    >>> round(branch.at(1.5)[0].period, 6)
    7.096374
    """

    fixed: Fixed | None = None
    freed: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        super().__post_init__()
        freed = self.freed if self.freed.size else np.full(len(self.values), np.nan)
        object.__setattr__(self, "freed", frozen(freed))

    def _attempts(
        self, first: PeriodicOrbit, last: PeriodicOrbit, share: float, value: float
    ) -> Iterator[Callable[[], PeriodicOrbit]]:
        """Yield what solves for an orbit at a value, from a guess between two neighbours and from the nearer one."""
        guesses = [(first.form, first.unknowns), (last.form, last.unknowns)]
        if share > 0.5:
            guesses.reverse()
        if first.form == last.form:
            guesses.insert(0, (first.form, (1.0 - share) * first.unknowns + share * last.unknowns))
        return (partial(self._converged, form, u, first, value) for form, u in guesses)

    def _converged(self, form: Signature, u: NDArray[np.float64], like: PeriodicOrbit, value: float) -> PeriodicOrbit:
        if self.fixed is None:
            p = self.system.parameter_vector({**like.parameters, self.parameter: value})
            return in_pieces(converge(self.system, form, u, p, self.tolerance))
        blocks = u.reshape(len(form), -1)
        guess = replace(like, form=form, states=blocks[:, :-1], durations=blocks[:, -1])
        segments = [(mode, transition or None, x0, duration) for mode, transition, x0, duration in guess.segments]
        return solve_orbit(
            self.system, like.parameters, segments, fix={self.parameter: value},
            free=self.fixed.free or None, tolerance=self.tolerance,
        )  # fmt: skip

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a quantity along the branch.

        Parameters
        ----------
        name : str
            As `OrbitCurve.column` takes it, or the free parameter.

        Returns
        -------
        ndarray, shape (point,)
            In the units of the definition.

        Raises
        ------
        InputError
            A quantity of another name.
        """
        if self.fixed is not None and self.fixed.free and name == self.fixed.free:
            return self.freed
        return super().column(name)

    def _of_each(self) -> dict[str, Any]:
        free = {self.fixed.free: self.freed} if self.fixed is not None and self.fixed.free else {}
        return free | super()._of_each()

    def _parameters_at(self, index: int) -> dict[str, float]:
        if self.fixed is None:
            return super()._parameters_at(index)
        free = {self.fixed.free: float(self.freed[index])} if self.fixed.free else {}
        return dict(self.parameters) | free

    def _known(self, index: int, problem: OrbitProblem) -> NDArray[np.complex128]:
        """See `OrbitColumns._known`; at a grazing they are limits."""
        known: NDArray[np.complex128] = self.multipliers[index]
        return known

    def _fixed(self, index: int) -> Fixed | None:
        return None if self.fixed is None else replace(self.fixed, value=float(self.values[index]))

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the branch as a Dataset: points against ``point``, special points against ``special``."""
        dataset = super().to_xarray()
        if self.fixed is not None:
            dataset["freed"] = ("point", self.freed)
            dataset.attrs["fixed"] = json.dumps(self.fixed.as_list())
        return dataset

    @classmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...], values: NDArray[np.float64]) -> dict[str, Any]:
        fields = super()._own_fields(held, varied, values)
        fixed = read_fixed(held, held_system(held))
        if fixed is not None:
            fields |= {"fixed": fixed, "freed": held.array("freed", ("point",), finite=False)}
        return fields
