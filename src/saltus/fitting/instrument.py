"""Unknowns of a measurement beside those of the model: origin of the parameter, gain of a detector, a drift."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

__all__ = ["Instrument"]


@dataclass(frozen=True)
class Instrument:
    """What a measurement does to a model's curve; an empty name stands for what is known.

    The parameter of the model is that of the data and the offset. Observables of the model times the gain are data. A
    parameter of the model drifts in proportion to the time that has passed.
    """

    offset: str = ""  # name of the number that is added to the parameter of the data
    gain: str = ""  # name of the factor on observables
    scaled: tuple[str, ...] = ()  # columns that the gain multiplies
    drift: str = ""  # name of the change of a parameter from the first datum to the last
    drifting: Mapping[str, float] = field(default_factory=dict)  # parameters that drift, with their changes at drift 1
    values: Mapping[str, float] = field(default_factory=dict)  # values by name; others have no effect

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the unknowns."""
        return tuple(name for name in (self.offset, self.gain, self.drift) if name)

    def value(self, name: str) -> float:
        """Return the value of an unknown; by default one without effect: 1 of a gain, 0 of others."""
        return self.values.get(name, 1.0 if name and name == self.gain else 0.0)

    def among(self, names: Collection[str]) -> Instrument:
        """Return the same instrument, of which only unknowns among some names are unknown."""
        offset, gain, drift = (name if name in names else "" for name in (self.offset, self.gain, self.drift))
        return replace(self, offset=offset, gain=gain, drift=drift)

    @property
    def moved_by(self) -> float:
        """The offset."""
        return self.value(self.offset) if self.offset else 0.0

    @property
    def drifted_by(self) -> float:
        """The drift."""
        return self.value(self.drift) if self.drift else 0.0

    def factor(self, column: str) -> float:
        """Return the factor on the model's observable of a column."""
        return self.value(self.gain) if self.gain and column in self.scaled else 1.0

    def of_model(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return those of some names that are the model's."""
        return tuple(name for name in names if name not in self.names)
