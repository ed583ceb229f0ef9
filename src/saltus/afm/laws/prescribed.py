"""Laws along a prescribed motion: the force at a gap, and the energy that a cycle of a given amplitude costs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.laws.common_regions import Product, product, sum_of, value_of
from saltus.afm.laws.prescribed_states import energy_of_states_aJ
from saltus.afm.probe.units import ENERGY_EV
from saltus.errors import InputError
from saltus.system.definition import Definition
from saltus.system.evaluate import evaluate
from saltus.system.parts import Mode

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.afm.laws.regions import Part

__all__ = ["ForceTable", "energy_per_cycle_eV", "force_nN"]

_NODES = 200  # Gauss points on the way from one crossing to the next
_LEGS = 4  # half cycles that are followed: two cycles, of which the second counts


class ForceTable:
    """The forces of a product of laws at many gaps."""

    def __init__(self, parts: tuple[Part, ...], R_nm: float | None) -> None:
        self.product: Product = product(parts, R_nm)
        names = ("D_nm", "V_nm_us", *self.product.states)
        regions = self.product.regions
        idle = Mode(dict.fromkeys(names, "0"))
        force = {key: sum_of((region.force, region.impulse_force)) for key, region in regions.items()}
        domain = {key: region.domain or "1" for key, region in regions.items()}
        outputs = {"force_nN": force, "domain": domain}
        self.known = Definition(names, self.product.parameters, dict.fromkeys(regions, idle), outputs=outputs)

    def force(self, D: NDArray[np.float64], V: NDArray[np.float64], region: str) -> NDArray[np.float64]:
        """Force at gaps and their rates in a region, the law's own states being 0."""
        states = np.zeros((D.size, len(self.known.states)))
        states[:, 0], states[:, 1] = D.ravel(), V.ravel()
        mode = np.full(D.size, self.known.mode_index(region))
        outside = evaluate(self.known, "domain", states, mode) < 0.0
        if outside.any():
            formula = self.product.regions[region].domain
            hint = f"there the law is not valid: its domain in region {region!r} is {formula} > 0"
            raise InputError("D_nm", float(D.ravel()[outside][0]), "in the domain of the law", hint)
        return evaluate(self.known, "force_nN", states, mode).reshape(D.shape)

    def force_in(
        self, D: NDArray[np.float64], V: NDArray[np.float64], regions: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Force at gaps and their rates, each in the region of a number."""
        force = np.empty(D.shape)
        for number, region in enumerate(self.product.regions):
            here = regions == number
            if here.any():
                force[here] = self.force(D[here], V[here], region)
        return force

    def regions_on_approach(self, D: NDArray[np.float64]) -> NDArray[np.int64]:
        """Numbers of the regions in which a tip is that came from afar to gaps."""
        _refuse_states(self)
        return self._passed(D, np.zeros(D.shape, dtype=np.int64), -1)

    def regions_on_retraction(self, D: NDArray[np.float64], nearest: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of the regions in which a tip is that came from the region of its least gap."""
        return self._passed(D, np.broadcast_to(nearest, D.shape).copy(), 1)

    def _passed(self, D: NDArray[np.float64], regions: NDArray[np.int64], direction: int) -> NDArray[np.int64]:
        names = list(self.product.regions)
        ends = {region: self.levels(region, direction) for region in names}
        for _ in names:
            for number, region in enumerate(names):
                left = regions == number
                for level, target in ends[region]:
                    gone = left & (direction * (D - level) > 0.0)
                    regions[gone] = names.index(target)
                    left &= ~gone
        return regions

    def levels(self, region: str, direction: int) -> list[tuple[float, str]]:
        """Gaps at which a region ends in a direction, in the order in which they are met, and what comes next."""
        ends = [one for one in self.product.crossings if one.source == region and one.direction == direction]
        found = [(value_of(one.level, self.product.parameters), one.target) for one in ends]
        return sorted(found, reverse=direction < 0)


def force_nN(
    parts: tuple[Part, ...], D_nm: ArrayLike, region: str | None, R_nm: float | None, V_nm_us: ArrayLike
) -> NDArray[np.float64]:
    """Return the force of laws at gaps; see `Law.force_nN`."""
    table = ForceTable(parts, R_nm)
    D, V = np.broadcast_arrays(checks.array("D_nm", D_nm), checks.array("V_nm_us", V_nm_us))
    if region is not None:
        return table.force(D, V, checks.chosen("region", region, table.product.regions))
    return table.force_in(D, V, table.regions_on_approach(D))


def energy_per_cycle_eV(parts: tuple[Part, ...], Zc_nm: float, A_nm: float, f_kHz: float, R_nm: float | None) -> float:
    """Return the energy lost in a cycle of a prescribed motion; see `Law.energy_per_cycle_eV`."""
    table = ForceTable(parts, R_nm)
    Zc, A, omega = Zc_nm, A_nm, 2e-3 * math.pi * f_kHz
    if table.product.states:
        return energy_of_states_aJ(table.product, Zc, A, f_kHz) * ENERGY_EV
    region = next(iter(table.product.regions))
    energies = []
    for leg in range(_LEGS):
        direction, angle, end, lost = (-1 if leg % 2 == 0 else 1), leg * math.pi, (leg + 1) * math.pi, 0.0
        while angle < end:
            stop, target = end, region
            for level, after in table.levels(region, direction):
                if direction * (Zc + A * math.cos(end) - level) > 0.0:
                    at = math.acos(max(-1.0, min(1.0, (level - Zc) / A)))
                    stop, target = max(angle, leg * math.pi + (at if direction < 0 else math.pi - at)), after
                    break
            lost += _lost(table, region, (angle, stop), (Zc, A, omega))
            if target == region:
                break
            angle, region = stop, target
        energies.append(lost)
    return sum(energies[-2:]) * ENERGY_EV


def _lost(table: ForceTable, region: str, angles: tuple[float, float], motion: tuple[float, float, float]) -> float:
    """Return minus the work of the force on the way between two angles of the motion, in aJ."""
    (begin, end), (Zc, A, omega) = angles, motion
    roots, weights = np.polynomial.legendre.leggauss(_NODES)
    s = 0.5 * (roots + 1.0)
    angle = begin + (end - begin) * s**2 * (3.0 - 2.0 * s)  # stands still at both ends, where the force may have roots
    D, V = Zc + A * np.cos(angle), -A * omega * np.sin(angle)
    rate = (end - begin) * 6.0 * s * (1.0 - s)
    return float(-np.sum(0.5 * weights * rate * table.force(D, V, region) * V) / omega)


def _refuse_states(table: ForceTable) -> None:
    if table.product.states:
        allowed = "a law without states of its own"
        raise InputError("law", list(table.product.states), allowed, "its force depends on the past: take an orbit's")
