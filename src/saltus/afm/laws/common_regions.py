"""Laws of a sum in common regions: the product of their regions, without those that no motion reaches.

Crossings of several laws at one gap, given by one text, happen at once. Gaps with different texts are ordered by their
values. Where the order of two gaps decides that a crossing cannot happen, the region's domain ends at that gap. So a
motion at parameters with another order ends with an error.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

from saltus import checks
from saltus.afm.laws.regions import Crossing, Part, Region
from saltus.afm.probe.units import suffix
from saltus.errors import InputError
from saltus.system.definition import Definition
from saltus.system.evaluate import evaluate
from saltus.system.parts import Mode

__all__ = ["Product", "in_brackets", "named", "own_names", "product", "shared_parameters", "sum_of", "value_of"]

_NAME = re.compile(r"(?<![\w.])[A-Za-z_]\w*")
_ELASTIC = "E_GPa"  # parameter of laws of elastic contact, of which a sum has one
_ANY_VALUE = 0.7310585786300049  # of a gap, a rate or a state, at which no formula has a pole by chance
_Place: TypeAlias = tuple[str, ...]  # the region of each law


@dataclass(frozen=True)
class Product:
    """The laws of a sum as one."""

    parameters: Mapping[str, float]  # values of all parameters that the formulas use
    positive: tuple[str, ...]  # parameters that must not be 0
    states: tuple[str, ...]  # the laws' own states
    # common regions, that of a tip far away first. The domain of each is a product of all domains.
    regions: Mapping[str, Region]
    crossings: tuple[Crossing, ...]  # where they end


def named(text: str, meanings: Mapping[str, str]) -> str:
    """Return a formula with names replaced by what they mean.

    Examples
    --------
    >>> named("-c*D_nm + 1e-3*Dx", {"D_nm": "Zc + z"})
    '-c*(Zc + z) + 1e-3*Dx'
    """
    return _NAME.sub(lambda found: in_brackets(meanings.get(found[0], found[0])), text)


def in_brackets(text: str) -> str:
    """Return a formula that can be a factor: in brackets, if it is no single name or number and has none.

    Examples
    --------
    >>> in_brackets("a + b"), in_brackets("(a + b)"), in_brackets("(a)*(b)"), in_brackets("a_nm")
    ('(a + b)', '(a + b)', '((a)*(b))', 'a_nm')
    """
    if re.fullmatch(r"[\w.]+", text):
        return text
    depth = 0
    for place, character in enumerate(text):
        depth += {"(": 1, ")": -1}.get(character, 0)
        if depth == 0:
            return text if place == len(text) - 1 else f"({text})"
    return f"({text})"


def sum_of(terms: Iterable[str]) -> str:
    """Return the sum of formulas, without those that are 0.

    Examples
    --------
    >>> sum_of(["-a", "0", "b*c"]), sum_of(["0"])
    ('(-a) + (b*c)', '0')
    """
    shown = [term for term in terms if term != "0"]
    return " + ".join(map(in_brackets, shown)) if len(shown) > 1 else "".join(shown) or "0"


def own_names(parts: tuple[Part, ...]) -> list[dict[str, str]]:
    """Return for each law what those of its parameters are called that an earlier law has as its own, too.

    Examples
    --------
    >>> from saltus.afm import Hydration, Morse
    >>> own_names((Morse(U_aJ=0.4, l_nm=0.1, D0_nm=0.3), Hydration(F_nN=1.0, l_nm=0.3)))
    [{}, {'l_nm': 'l_nm_2'}]
    """
    counts: Counter[str] = Counter()
    names = []
    for part in parts:
        counts.update(part.own)
        names.append({name: name + suffix(counts[name]) for name in part.own if counts[name] > 1})
    return names


def shared_parameters(parts: tuple[Part, ...]) -> dict[str, float]:
    """Return all parameters that laws give; raise `InputError` where two laws give one name different values."""
    values: dict[str, float] = {}
    for part, names in zip(parts, own_names(parts), strict=True):
        for name, value in ((names.get(one, one), value) for one, value in part.parameters.items()):
            if values.setdefault(name, value) != value:
                hint = f"{type(part).__name__} has another value; give it once, or make a law with another name"
                raise InputError(name, values[name], "one value in all laws of a sum", hint)
    return values


def value_of(text: str, values: Mapping[str, float]) -> float:
    """Return the value of a formula in parameters alone.

    Examples
    --------
    >>> value_of("2*a", {"a": 1.5})
    3.0
    """
    known = Definition(("unused_",), values, {"any": Mode({"unused_": "0"})})
    return float(evaluate(known, text, [[0.0]], [0])[0])


def product(parts: tuple[Part, ...], R_nm: float | None = None) -> Product:
    """Return the common regions of laws.

    Parameters
    ----------
    parts : tuple of Law
        The laws, one by one.
    R_nm : float, optional
        Radius of the tip, where no part gives it.

    Raises
    ------
    InputError
        Laws do not go together: two values of one parameter, a parameter without a value, a state with two meanings.
    """
    return _Making(parts, R_nm).made()


class _Making:
    """The product of laws in the making."""

    def __init__(self, parts: tuple[Part, ...], R_nm: float | None) -> None:
        self.parts = parts
        self.check_kinds()
        self.values = shared_parameters(parts)
        if R_nm is not None:
            self.values.setdefault("R_nm", R_nm)
        told = [_renamed(*_told(part), names) for part, names in zip(parts, own_names(parts), strict=True)]
        self.of_parts = [regions for regions, _ in told]
        self.crossings_of = [crossings for _, crossings in told]
        self.check_names()
        contact = self.contact()
        levels = {"contact_nm": contact, "release_nm": self.release(contact)}
        self.ends = [
            tuple(replace(one, level=levels.get(one.level, one.level)) for one in crossings)
            for crossings in self.crossings_of
        ]
        self.states = self.own_states()

    def check_kinds(self) -> None:
        """Raise `InputError` where a sum has a force twice."""
        names = [type(part).__name__ for part in self.parts]
        for name in names:
            if names.count(name) > 1:
                raise InputError("law", " + ".join(names), f"with {name} once", "its force would count twice")
        elastic = [
            name for name, part in zip(names, self.parts, strict=True) if part.contact and _ELASTIC in vars(part)
        ]
        if len(elastic) > 1:
            hint = "the elastic force would count twice: take one, and VanDerWaals for the attraction"
            raise InputError("law", " + ".join(names), f"with one of {', '.join(elastic)}", hint)

    def contact(self) -> str:
        """Gap at which contact begins: that of a law of contact, else the first below which a law tells a depth."""
        told = [part.contact for part in self.parts if part.contact]
        passed = [
            one.level
            for crossings, regions in zip(self.crossings_of, self.of_parts, strict=True)
            for one in crossings
            if one.direction < 0 and regions[one.target].indentation
        ]
        return next((level for level in (*told, *passed) if level != "contact_nm"), "0")

    def release(self, contact: str) -> str:
        """Gap at which contact ends: that of a law of contact, else where it begins."""
        told = (
            one.level
            for part, crossings, regions in zip(self.parts, self.crossings_of, self.of_parts, strict=True)
            for one in crossings
            if part.contact and one.direction > 0 and regions[one.source].indentation
        )
        return next(told, contact)

    def own_states(self) -> tuple[str, ...]:
        states: list[str] = []
        for part, regions in zip(self.parts, self.of_parts, strict=True):
            own = [set(region.states) for region in regions.values()]
            if any(other != own[0] for other in own):
                raise InputError(type(part).__name__, own, "a law with the same states in every region")
            if taken := own[0] & set(states):
                raise InputError(type(part).__name__, sorted(taken), "a law with states that no other law has")
            states += list(next(iter(regions.values())).states)
        return tuple(states)

    def made(self) -> Product:
        start = tuple(next(iter(regions)) for regions in self.of_parts)
        places, moves, beyond = [start], [], {}
        for place in places:
            steps, beyond[place] = self.steps(place)
            for crossing, target in steps:
                moves.append((place, crossing, target))
                if target not in places:
                    places.append(target)
        names = self.names(places)
        regions = {names[place]: self.region(place, beyond[place]) for place in places}
        crossings = self.crossings(moves, names)
        return Product(self.values, self.positive(), self.states, regions, crossings)

    def steps(self, place: _Place) -> tuple[list[tuple[Crossing, _Place]], list[str]]:
        """Crossings from a place with where they lead, and levels which others come before."""
        leaving: dict[tuple[str, int], list[Crossing]] = {}
        for own, ends in zip(place, self.ends, strict=True):
            for crossing in ends:
                if crossing.source == own:
                    leaving.setdefault((crossing.level, crossing.direction), []).append(crossing)
        values = {level: self.level(level) for level, _ in leaving}
        steps, beyond = [], []
        for (level, direction), together in leaving.items():
            others = [values[other] for other, way in leaving if way == direction]
            if others.count(values[level]) > 1:
                alike = [other for other, way in leaving if way == direction and values[other] == values[level]]
                raise InputError(
                    " and ".join(alike), values[level], "different gaps, or one", "two events coincide there"
                )
            if _comes_later(values[level], others, direction):
                beyond.append(f"D_nm - {in_brackets(level)}" if direction < 0 else f"{in_brackets(level)} - D_nm")
                continue
            target = tuple(
                next((one.target for one in together if one in ends and one.source == own), own)
                for own, ends in zip(place, self.ends, strict=True)
            )
            steps.append((together[0], target))
        return steps, beyond

    def level(self, text: str) -> float:
        """Value of a level, NaN where it depends on states."""
        used = set(_NAME.findall(text))
        return math.nan if used & set(self.states) else value_of(text, self.values)

    def names(self, places: list[_Place]) -> dict[_Place, str]:
        several = [i for i, regions in enumerate(self.of_parts) if len(regions) > 1]
        short = {place: "_".join(dict.fromkeys(place[i] for i in several)) or "free" for place in places}
        if len(set(short.values())) == len(places):
            return short
        return {place: "_".join(place[i] for i in several) for place in places}

    def region(self, place: _Place, beyond: list[str]) -> Region:
        """The formulas at a place, in which ``D_nm`` and ``V_nm_us`` stay."""
        mine = [regions[own] for regions, own in zip(self.of_parts, place, strict=True)]
        separation = next((region.separation for region in mine if region.separation), "D_nm")
        meanings = {"contact_nm": self.contact()}
        meanings["separation_nm"] = named(separation, meanings)
        if meanings["separation_nm"] == "0":
            self.check_touching(mine)

        def total(texts: Iterable[str]) -> str:
            return sum_of(named(text, meanings) for text in texts)

        still = {"V_nm_us": "0"}
        domains = dict.fromkeys(named(text, meanings) for text in (*(one.domain for one in mine), *beyond) if text)
        return Region(
            force=total(region.force for region in mine),
            elastic=total(named(one.force, still) if one.elastic is None else one.elastic for one in mine),
            states={name: named(rate, meanings) for region in mine for name, rate in region.states.items()},
            impulse=total(region.impulse for region in mine),
            impulse_force=total(region.impulse_force for region in mine),
            separation=meanings["separation_nm"],
            indentation=named(next((one.indentation for one in mine if one.indentation), ""), meanings),
            domain="*".join(map(in_brackets, domains)),
        )

    def check_touching(self, regions: list[Region]) -> None:
        """Raise `InputError` where a law's force has a pole at separation 0, at which others of the sum touch."""
        touching = dict.fromkeys((*self.states, "V_nm_us"), _ANY_VALUE) | {"D_nm": -_ANY_VALUE, "separation_nm": 0.0}
        for part, region in zip(self.parts, regions, strict=True):
            uses_separation = "separation_nm" in _NAME.findall(region.force)
            if uses_separation and not math.isfinite(value_of(region.force, self.values | touching)):
                hint = f"its force is infinite there; {self.pair(part)}"
                allowed = "a law that can be added to one whose surfaces touch at separation 0"
                raise InputError("law", type(part).__name__, allowed, hint)

    def pair(self, pole: Part) -> str:
        """Name the law with contact at a cut-off that goes with one whose force is infinite at separation 0."""
        elastic = next((part for part in self.parts if part.contact and _ELASTIC in vars(part)), None)
        if elastic is None:
            return "DMT(a0_nm=...) touches at a0_nm"
        name, E = type(elastic).__name__, self.values[_ELASTIC]
        cut_off = f"{name}(..., a0_nm=0.3)" if "a0_nm" in vars(elastic) else f"DMT(E_GPa={E:g}, a0_nm=0.3)"
        return f"take {type(pole).__name__}(...) + {cut_off}, which touches at its cut-off a0_nm"

    def crossings(
        self, moves: list[tuple[_Place, Crossing, _Place]], names: Mapping[_Place, str]
    ) -> tuple[Crossing, ...]:
        short = [crossing.name for _, crossing, _ in moves]
        long = [f"{crossing.name}_{names[place]}" for place, crossing, _ in moves]
        found = []
        for i, (place, crossing, target) in enumerate(moves):
            name = short[i] if short.count(short[i]) == 1 else long[i]
            name = name if long.count(name) <= 1 else f"{name}_{names[target]}"
            found.append(replace(crossing, source=names[place], target=names[target], name=name))
        return tuple(found)

    def positive(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for part in self.parts for name in part.positive if name in self.values))

    def check_names(self) -> None:
        """Raise `InputError` where a formula uses a parameter that no law gives."""
        texts = [crossing.level for crossings in self.crossings_of for crossing in crossings]
        for region in (region for regions in self.of_parts for region in regions.values()):
            texts += [region.force, region.elastic or "0", region.impulse, region.indentation, region.domain]
            texts += region.states.values()
        used = {name for text in texts for name in _NAME.findall(text)}
        unset = {name for part in self.parts for name in vars(part) if getattr(part, name) is None} | {"R_nm"}
        for name in sorted(used & unset - set(self.values)):
            hint = "R_nm may be given by the probe" if name == "R_nm" else ""
            raise InputError(name, None, "given by one of the laws", hint)


def _regions_of(part: Part) -> dict[str, Region]:
    """Return the regions of a law; raise `InputError` where a crossing leads elsewhere."""
    regions = checks.mapping("regions", part.regions, "names to Region")
    if not regions:
        raise InputError("regions", regions, "one region or more", type(part).__name__)
    for name, region in regions.items():
        checks.instance(f"region {name!r}", region, Region)
    for crossing in part.crossings:
        for end in (crossing.source, crossing.target):
            checks.chosen(f"end of crossing {crossing.name!r}", end, regions)
    return regions


def _told(part: Part) -> tuple[dict[str, Region], tuple[Crossing, ...]]:
    """Return regions and crossings of a law, with contact where the law tells its gap and no region has a depth."""
    regions, crossings = _regions_of(part), part.crossings
    if not part.contact or any(region.indentation for region in regions.values()):
        return regions, crossings
    depth = f"{in_brackets(part.contact)} - D_nm"
    touched = {one.target for one in crossings if one.direction < 0 and one.level == part.contact}
    if touched:
        told = {key: replace(one, indentation=depth) if key in touched else one for key, one in regions.items()}
        return told, crossings
    if crossings:
        allowed = f"a law with a crossing at its gap of contact, {part.contact}, or one with one region"
        raise InputError("law", type(part).__name__, allowed, "or the regions of contact have an indentation")
    ((key, region),) = regions.items()
    touch = Crossing(key, "contact", part.contact, -1, "touch")
    release = Crossing("contact", key, part.contact, 1, "release")
    return {key: region, "contact": replace(region, indentation=depth)}, (touch, release)


def _renamed(
    regions: dict[str, Region], crossings: tuple[Crossing, ...], names: Mapping[str, str]
) -> tuple[dict[str, Region], tuple[Crossing, ...]]:
    """Return regions and crossings with other names of parameters."""
    if not names:
        return regions, crossings
    new = {
        key: replace(
            region,
            force=named(region.force, names),
            elastic=None if region.elastic is None else named(region.elastic, names),
            states={state: named(rate, names) for state, rate in region.states.items()},
            impulse=named(region.impulse, names),
            impulse_force=named(region.impulse_force, names),
            separation=named(region.separation, names),
            indentation=named(region.indentation, names),
            domain=named(region.domain, names),
        )
        for key, region in regions.items()
    }
    return new, tuple(replace(one, level=named(one.level, names)) for one in crossings)


def _comes_later(level: float, others: list[float], direction: int) -> bool:
    """Whether another level is passed first; NaN stands for a level that is not known."""
    return not any(map(math.isnan, [level, *others])) and direction * level > min(direction * other for other in others)
