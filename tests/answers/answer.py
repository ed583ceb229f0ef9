"""A known answer, and what it means that a computed value agrees with it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
LONG = 10  # significant digits from which a computed value is shown with as many, else with two more

Found = float | str | tuple[float, ...]


@dataclass(frozen=True)
class Answer:
    """A problem with the answer that its source prints, and a function that computes ours.

    `printed` is a word, or a text with as many numbers as `compute` returns. `formula` is a closed form, which SymPy
    reads; several are parted by commas.
    """

    problem: str
    source: str
    printed: str
    compute: Callable[[], Found]
    formula: str = ""
    campaign: bool = False

    @property
    def numbers(self) -> list[Decimal]:
        """The printed numbers; none of a word."""
        return [] if self.printed[0].isalpha() else [Decimal(text) for text in NUMBER.findall(self.printed)]

    @property
    def digits(self) -> str:
        """How many significant digits each number has; of a word nothing."""
        return ", ".join(str(significant(number)) for number in self.numbers)

    def agrees(self, found: Found) -> bool:
        """Return whether what was found is what is printed, once it is rounded to as many digits."""
        if not self.numbers:
            return found == self.printed
        pairs = zip(self.numbers, values(found), strict=True)
        return all(rounded(value, unit_of(number)) == number for number, value in pairs)

    def shown(self, found: Found) -> str:
        """Return what was found as the page shows it: the printed text with other numbers."""
        if not self.numbers:
            return str(found)
        left = iter(values(found))
        return NUMBER.sub(lambda printed: told(printed.group(), next(left)), self.printed)


def values(found: Found) -> tuple[float, ...]:
    return found if isinstance(found, tuple) else (float(found),)


def unit_of(number: Decimal) -> Decimal:
    """Return one in the last digit of a printed number."""
    return Decimal(1).scaleb(int(number.as_tuple().exponent))


def told(printed: str, value: float) -> str:
    """Return a value in the form of a printed number."""
    mantissa, power, exponent = printed.partition("e")
    unit = unit_of(Decimal(mantissa)) * (1 if significant(Decimal(mantissa)) >= LONG else Decimal("0.01"))
    return f"{Decimal(repr(float(value))).scaleb(-int(exponent or 0)).quantize(unit)}{power}{exponent}"


def significant(number: Decimal) -> int:
    return len(number.as_tuple().digits)


def rounded(value: float, unit: Decimal) -> Decimal:
    return Decimal(repr(float(value))).quantize(unit)
