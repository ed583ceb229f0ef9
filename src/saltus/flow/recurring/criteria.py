"""Thresholds by which the kinds of motions are told apart."""

from __future__ import annotations

from dataclasses import dataclass

from saltus import checks

__all__ = ["Criteria"]

_ENOUGH = 16  # fewest returns on which a label may be founded


@dataclass(frozen=True)
class Criteria:
    """Thresholds by which motions are told apart; they are recorded with a sweep.

    Parameters
    ----------
    recurrence : float
        Part of a state's size within which it recurs.
    noise : float
        Tolerances of a step below which a difference of a state is none: ``atol``, and ``rtol`` of its size along the
        motion. So a motion that rests where all states are 0 is seen to rest.
    settling : float
        Part of the points' extent within which a motion recurs that is still settling.
    exponent : float
        Leading Lyapunov exponent per return, its error left out, up to which a longer look decides on chaos.
    longest : int
        Returns after which a motion recurs at the latest, doublings apart, without being looked at for a closed curve.
    doubling : float
        Part of the points' extent within which they lie in pairs after a period doubling.
    gap : float
        Largest part of a turn between neighbouring points that lie on a closed curve, seen from its middle.
    disorder : float
        Largest part of the way of the points' images, from one point to the next round the curve, that goes backwards.
    fewest : int
        Returns that are looked at, at the least, however few are kept; four times `longest` if those are more.
    patience : int
        A motion that cannot be told is followed this many times as long, and if need be as many times that. So is one
        that looks quasi-periodic.
    absence : float
        Time without a return after which a motion is taken not to return. Its unit is the longer of the mean return and
        the phase's period. Before returns are known, periods alone, or 5000 steps a return.
    push : float
        Part of the size of its state by which a motion that rests on an unstable orbit or torus is pushed.

    Examples
    --------
    >>> from saltus.options import Criteria
    >>> Criteria(longest=16).longest
    16
    """

    recurrence: float = 1e-5
    noise: float = 10.0
    settling: float = 0.01
    exponent: float = 0.02
    longest: int = 8
    doubling: float = 0.25
    gap: float = 0.3
    disorder: float = 0.2
    fewest: int = 100
    patience: int = 4
    absence: float = 3000.0
    push: float = 1e-6

    def __post_init__(self) -> None:
        for name in ("recurrence", "settling", "exponent", "doubling", "gap", "disorder", "push"):
            value = checks.between(f"Criteria.{name}", getattr(self, name), 0.0, 1.0, strict=True)
            object.__setattr__(self, name, value)
        for name in ("noise", "absence"):
            object.__setattr__(self, name, checks.positive(f"Criteria.{name}", getattr(self, name)))
        for name, least in (("longest", 1), ("fewest", _ENOUGH), ("patience", 1)):
            object.__setattr__(self, name, checks.count(f"Criteria.{name}", getattr(self, name), least))

    def looked_at(self, keep: int) -> int:
        """Return the count of returns on which a label is founded.

        Parameters
        ----------
        keep : int
            Returns that are kept.

        Returns
        -------
        int
            `keep`, 4 times `longest` or `fewest`, the largest of the three.

        Raises
        ------
        InputError
            `keep` is no count.
        """
        return max(checks.count("keep", keep), 4 * self.longest, self.fewest)
