"""The outcome of an audit: what was looked at along a curve of solutions, and what contradicts what always holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from saltus.errors import InputError

__all__ = ["Audit", "Breach"]

_SHOWN = 8  # breaches that a text has in full


@dataclass(frozen=True)
class Breach:
    """Something along a curve that contradicts what always holds.

    Attributes
    ----------
    check : str
        What was looked at: ``forward``, ``twice``, ``ledger``, ``Liouville`` or ``label``; of a locus also
        ``condition``, ``coefficient`` or ``other values``.
    text : str
        What is seen, in words.
    position : float
        Place among the curve's points: 3.5 lies between points 3 and 4.
    values : tuple of float
        The varied parameters there.

    Examples
    --------
    >>> Breach("ledger", "1 direction becomes unstable, and no special point says so", 3.5, (0.2,))
    ledger, point 3.5: 1 direction becomes unstable, and no special point says so
    """

    check: str
    text: str
    position: float
    values: tuple[float, ...]

    def __repr__(self) -> str:
        return f"{self.check}, point {self.position:g}: {self.text}"


@dataclass(frozen=True)
class Audit:
    """What was looked at along a curve, and what contradicts what always holds.

    docs/theory/continuation.md, "The audit", lists the checks.

    Attributes
    ----------
    breaches : tuple of Breach
        In order along the curve for each check.
    checked : tuple of (str, int)
        Each check, with the number of places where it could tell. Empty where no audit was made, as in older files.
    remarks : tuple of str
        Where the equations degenerate, so that a point has no name there. Nothing contradicts.

    Examples
    --------
    >>> from saltus import HybridSystem, continue_equilibrium, find_equilibrium
    >>> fold = HybridSystem.smooth({"x": "r + 3*x - x**3"}, {"r": 1.0})
    >>> branch = continue_equilibrium(find_equilibrium(fold, {}, [2.0]), "r", (-4.0, 4.0))
    >>> branch.audit.passed, branch.audit.breaches
    (True, ())
    """

    breaches: tuple[Breach, ...] = ()
    checked: tuple[tuple[str, int], ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether an audit was made and nothing contradicts."""
        return bool(self.checked) and not self.breaches

    def as_list(self) -> list[Any]:
        """Return the audit as plain data, for files."""
        found = [[breach.check, breach.text, breach.position, list(breach.values)] for breach in self.breaches]
        kept = [list(self.remarks)] if self.remarks else []
        return [found, [list(row) for row in self.checked], *kept]

    @classmethod
    def from_list(cls, data: Sequence[Any]) -> Audit:
        """Return the audit that `as_list` described.

        Parameters
        ----------
        data : sequence
            What `as_list` returned.

        Returns
        -------
        Audit

        Raises
        ------
        InputError
            It describes none.
        """
        try:
            breaches, checked, *kept = data
            remarks = [str(text) for row in kept for text in row]
            found = tuple(
                Breach(str(check), str(text), float(position), tuple(float(value) for value in values))
                for check, text, position, values in breaches
            )
            return cls(found, tuple((str(name), int(count)) for name, count in checked), tuple(remarks))
        except (TypeError, ValueError) as error:
            raise InputError("attribute 'audit'", data, "breaches and checks, as an audit writes them") from error

    def lines(self) -> list[str]:
        """Return a line for each breach and each remark; breaches behind the first ones are counted."""
        rest = len(self.breaches) - _SHOWN
        shown = [repr(breach) for breach in self.breaches[:_SHOWN]] + ([f"{rest} more"] if rest > 0 else [])
        return [*shown, *(f"degenerate, {text}" for text in self.remarks)]

    def __repr__(self) -> str:
        if not self.checked:
            return "Audit: none was made"
        told = ", ".join(f"{name} at {count} places" for name, count in self.checked)
        many = len(self.breaches)
        what = f"{many} breach{'es' if many > 1 else ''}" if many else "passed"
        return "\n".join([f"Audit: {what}; looked at {told}", *(f"  {line}" for line in self.lines())])
