"""Where motions coexist: loci of the folds of distance curves over free amplitude and distance, as a result."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.afm.models.parts import check_model
from saltus.continuation import Locus
from saltus.continuation.results.prefixed import own_attributes, prefixed_part, side_by_side
from saltus.described import described
from saltus.errors import InputError
from saltus.result import Result
from saltus.system.plain import held_system

if TYPE_CHECKING:
    import xarray as xr

    from saltus.contents import Contents
    from saltus.continuation import SpecialPoint
    from saltus.system import HybridSystem

__all__ = ["PLANE", "Bistability", "turns_of"]

PLANE = ("A0_nm", "Zc_nm")  # parameters of the plane


def turns_of(locus: Locus, name: str, sign: float) -> list[SpecialPoint]:
    """Return the turning points of a locus at which a parameter has a minimum, or a maximum.

    Parameters
    ----------
    name : str
        The parameter.
    sign : {1.0, -1.0}
        1 for the minima along the locus, -1 for the maxima.
    """
    values, found = sign * locus.column(name), []
    for point in locus.special_points.of_type("TP"):
        before, after = int(np.floor(point.position)), int(np.ceil(point.position))
        sides = values[[max(before - (before == after), 0), min(after + (before == after), len(values) - 1)]]
        if point.of == name and sides.min() > sign * point.value(name):
            found.append(point)
    return found


@dataclass(frozen=True, eq=False, repr=False)
class Bistability(Result):
    """Folds of distance curves over the free amplitude and the distance; `saltus.afm.bistability` makes it.

    A fold is a jump of an experiment. Between two folds at one distance three orbits coexist, of which two are stable.

    Attributes
    ----------
    system : HybridSystem
        The model.
    A0_nm, Zc_nm : (float, float)
        The ranges, in nm.
    loci : tuple of Locus
        Loci of the folds; `Locus.stopped` says where each begins and ends.
    failures : tuple of str
        Distances at which the search for folds failed or ended before the largest amplitude, and why.
    jumping : (int, int) or None
        The turn from which on an approach jumps: number of the locus, and of the special point on it.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)
    >>> print(str(afm.bistability(system)).splitlines()[0])
    Bistability of tip and sample, 1 mode: 1 locus of folds, A0_nm from 1 to 30, Zc_nm from 0.5 to 30
    """

    system: HybridSystem
    A0_nm: tuple[float, float]
    Zc_nm: tuple[float, float]
    loci: tuple[Locus, ...]
    failures: tuple[str, ...] = ()
    jumping: tuple[int, int] | None = None

    @property
    def locus(self) -> Locus:
        """The locus with the most points."""
        return max(self.loci, key=len)

    @property
    def cusps(self) -> tuple[tuple[float, float], ...]:
        """Free amplitude and distance of all cusps, in nm: there two loci of folds merge."""
        points = [point for locus in self.loci for point in locus.special_points.of_type("CP")]
        return tuple((point.value("A0_nm"), point.value("Zc_nm")) for point in points)

    @property
    def cusp(self) -> tuple[float, float] | None:
        """Free amplitude and distance of the cusp at the largest amplitude, in nm; None where there is none."""
        return max(self.cusps, default=None)

    @property
    def critical(self) -> SpecialPoint | None:
        """The turn from which on an approach from afar jumps, as a special point; None where none is found."""
        return None if self.jumping is None else self.loci[self.jumping[0]].special_points[self.jumping[1]]

    @property
    def critical_amplitude_nm(self) -> float | None:
        """The critical amplitude in nm: the free amplitude from which on an approach from afar jumps.

        There the fold of the motion that comes from afar turns. Two distance curves beside it have been followed: one
        at a smaller amplitude without a jump on the approach, one at a larger amplitude with a jump. None where no turn
        of a locus is such: then a locus leaves the range or ends, or nothing jumps.
        """
        return None if self.critical is None else float(self.critical.value("A0_nm"))

    @property
    def critical_distance_nm(self) -> float | None:
        """The distance at the critical amplitude, in nm; None where there is none."""
        return None if self.critical is None else float(self.critical.value("Zc_nm"))

    @property
    def least_bistable_amplitude_nm(self) -> float | None:
        """The least free amplitude at which any locus of folds turns, in nm; None where none turns.

        Two motions coexist from there on. Where contact loses energy, an approach reaches the second one only at the
        larger `critical_amplitude_nm`; before, a knock or a sweep of the frequency does.
        """
        values = (point.value("A0_nm") for locus in self.loci for point in turns_of(locus, "A0_nm", 1.0))
        return min(map(float, values), default=None)

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return all loci as one Dataset: variables and dimensions of locus `i` have the prefix ``locus<i>_``."""
        datasets = [locus.to_xarray() for locus in self.loci]
        attrs = {
            "A0_nm": json.dumps(self.A0_nm),
            "Zc_nm": json.dumps(self.Zc_nm),
            "definition": json.dumps(self.system.definition()),
            "failures": json.dumps(self.failures),
            "jumping": json.dumps(self.jumping),
            "loci": json.dumps([own_attributes(dataset) for dataset in datasets]),
        }
        return side_by_side(datasets, "locus").assign_attrs(attrs)

    @classmethod
    def _read(cls, held: Contents) -> Bistability:
        system = held_system(held)
        check_model(system, "definition")
        loci = []
        for i, attributes in enumerate(held.json("loci", list)):
            locus = Locus.from_xarray(prefixed_part(held, "locus", i, attributes))
            if locus.names != PLANE or locus.type != "SN":
                raise InputError(f"locus {i}", f"{locus.type}, {locus.names}", f"SN, over {PLANE}")
            loci.append(locus)
        if not loci:
            raise InputError("attribute 'loci'", [], "one locus or more")
        first, second = (_range(held, name) for name in PLANE)
        return cls(system, first, second, tuple(loci), tuple(held.texts("failures")), _jumping(held, loci))

    def __repr__(self) -> str:
        (low, high), (near, far) = self.A0_nm, self.Zc_nm
        count = f"{len(self.loci)} {'locus' if len(self.loci) == 1 else 'loci'} of folds"
        lines = [
            f"Bistability of {self.system.name or 'a model'}: {count}, "
            f"A0_nm from {low:.6g} to {high:.6g}, Zc_nm from {near:.6g} to {far:.6g}"
        ]
        lines += [f"  cusp                A0_nm = {A0:.9g}, Zc_nm = {Zc:.9g}" for A0, Zc in self.cusps]
        told = "  critical amplitude  "
        if self.critical is None:
            lines.append(f"{told}none: no approach is found that jumps from a turn of a locus on")
        else:
            lines.append(f"{told}A0_nm = {self.critical_amplitude_nm:.9g}, Zc_nm = {self.critical_distance_nm:.9g}")
        least = self.least_bistable_amplitude_nm
        if least is not None and least != self.critical_amplitude_nm:
            lines.append(f"  least bistable      A0_nm = {least:.9g}: two motions coexist from there on")
        for locus in self.loci:
            lines += [f"  began: {locus.stopped[0]}", f"  ended: {locus.stopped[1]}"]
        lines += [f"  folds sought in part: {failure}" for failure in self.failures]
        return "\n".join(lines)


def _range(held: Contents, name: str) -> tuple[float, float]:
    given = held.json(name, list)
    numbers = isinstance(given, list) and all(type(value) in (int, float) for value in given)
    if not numbers or len(given) != 2 or not np.all(np.isfinite(given)) or not given[0] < given[1]:
        raise InputError(f"attribute {name!r}", given, "two numbers, the lower one first")
    return float(given[0]), float(given[1])


def _jumping(held: Contents, loci: Sequence[Locus]) -> tuple[int, int] | None:
    given = held.json("jumping", list, type(None))
    if given is None:
        return None
    numbers = len(given) == 2 and all(type(value) is int and value >= 0 for value in given)
    if not numbers or given[0] >= len(loci) or given[1] >= len(loci[given[0]].special_points):
        raise InputError("attribute 'jumping'", given, "the numbers of a locus and of a special point on it")
    return given[0], given[1]
