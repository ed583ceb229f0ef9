"""Columns of a curve held against the solution of each point, which is computed anew from the point's unknowns.

A column says nothing of its own: it must follow from the solution. Each is judged by its own error, and the worst place
of a column is the row that `verify` lists.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.results.orbit_columns import OrbitColumns
from saltus.errors import SaltusError
from saltus.scales import (
    EPS,
    EQUATIONS_SOLVED,
    LEAST_ALLOWANCE,
    VERIFIED_EXTREME,
    VERIFIED_VALUE,
    Verdict,
    critical_error,
    value_error,
    zero,
)
from saltus.verification.remade import Claim, claims, orbit_claims
from saltus.verification.table import AGREES, DIFFERS, Row, place_of, unchecked

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["ELSEWHERE", "column_rows", "solution_rows"]

# claims that checks of solutions have
ELSEWHERE = ("stable", "regular", "admissible", "faults", "multipliers", "period", "lows", "highs")


def column_rows(curve: Any) -> list[Row]:
    """Return a row for each column of a curve: where it differs most from the solutions, over its error."""
    return _claimed(_of_points(curve), "column ")


def solution_rows(
    solution: Any, elsewhere: Sequence[str] = ELSEWHERE, sizes: NDArray[np.float64] | None = None
) -> list[Row]:
    """Return rows of what a solution says, held against its unknowns.

    Of what is checked `elsewhere` as well, only what differs is told.

    sizes: those of the states along its curve, shape (state,).
    """
    known = {} if sizes is None else {"sizes": sizes}
    rows = _claimed([("", claims(solution, known))])
    return [row for row in rows if row.what not in elsewhere or row.verdict == DIFFERS]


def _claimed(told: Iterable[tuple[str, Iterable[Claim]]], prefix: str = "") -> list[Row]:
    """Return a row for each claim of several solutions, which come with their places: the worst of all places."""
    worst: dict[str, tuple[float, Row]] = {}
    for place, each in told:
        try:
            for claim in each:
                share, row = _judged(claim, prefix)
                if claim.what not in worst or share > worst[claim.what][0]:
                    worst[claim.what] = share, row._replace(place=place)
        except SaltusError as error:  # the unknowns solve no equations
            row = Row("solution", "solves the equations", str(error), math.nan, math.nan, DIFFERS, place)
            worst.setdefault("solution", (math.inf, row))
    return [row for _, row in worst.values()]


def _judged(claim: Claim, prefix: str) -> tuple[float, Row]:
    """Return by how many errors a claim is off where it is off most, and its row; less than 0 where none is told.

    What is off where it is undetermined comes before all that agrees.
    """
    what = f"{prefix}{claim.what}"
    if claim.said.shape != claim.found.shape:
        return math.inf, Row(what, str(claim.said.shape), str(claim.found.shape), math.nan, math.nan, DIFFERS)
    off = _differences(claim.said, claim.found)
    known = np.isfinite(claim.error)
    if not claim.said.size:
        return -1.0, unchecked(what, 0.0, "undetermined")
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = np.where(off > 0.0, off / np.maximum(claim.error, LEAST_ALLOWANCE), 0.0)
    shares = np.where(known, shares, np.where(off > 0.0, 1.0, -1.0))
    i = int(np.argmax(shares))
    if not known[i]:
        return float(shares[i]), unchecked(what, _plain(claim.said[i]), "undetermined")
    said, found = _plain(claim.said[i]), _plain(claim.found[i])
    difference, error = float(off[i]), float(claim.error[i])
    verdict = zero(difference, error)
    if verdict is Verdict.UNCLEAR:
        return float(shares[i]), unchecked(what, said, f"{found}, within ten errors of {error:.1g}")
    logical = isinstance(said, bool | str)
    numbers = (math.nan, math.nan) if logical else (difference, error)
    return float(shares[i]), Row(what, said, found, *numbers, AGREES if verdict else DIFFERS)


def _differences(said: NDArray[Any], found: NDArray[Any]) -> NDArray[np.float64]:
    """Return the distances of numbers; those that are NaN on both sides, or the same infinity, are equal."""
    if said.dtype.kind in "bU" or found.dtype.kind in "bU":
        return np.asarray(said != found, dtype=float)
    with np.errstate(invalid="ignore"):
        off = np.abs(said - found)
    equal = (said == found) | (np.isnan(said) & np.isnan(found))
    return np.asarray(np.where(equal, 0.0, np.nan_to_num(off, nan=math.inf, posinf=math.inf)))


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _of_points(curve: Any) -> Iterator[tuple[str, Iterator[Claim]]]:
    if not isinstance(curve, OrbitColumns):
        yield from ((place_of(curve, i), _zero(curve, i)) for i in range(len(curve)))
        return
    stiff: list[bool] = []
    for i in range(len(curve)):
        problem, u = curve._solved(i)
        yield place_of(curve, i), _orbit(curve, i, problem, u)
        stiff.append(bool(problem.stiff))
    yield "", iter([_steps(curve.implicit, np.array(stiff))])


def _steps(said: NDArray[np.bool_], found: NDArray[np.bool_]) -> Claim:
    """Return the claim of how flows were followed: implicit steps go on from where they are needed, and explicit ones.

    So a stretch of one kind has an orbit, at least, that is followed so by itself.
    """
    stretches = np.cumsum(np.append(False, said[1:] != said[:-1]))
    begun = [np.any(found[stretches == number] == said[stretches == number]) for number in stretches.tolist()]
    return Claim.of("implicit", said, np.where(begun, said, found), 0.0)


def _orbit(curve: OrbitColumns, i: int, problem: OrbitProblem, u: NDArray[np.float64]) -> Iterator[Claim]:
    """Yield what the columns of a curve of orbits say at a point, whose orbit solves `problem` at `u`."""
    names = ("x0", "period", "lows", "highs", "means", "harmonics", "multipliers", "admissible", "residual")
    said = {name: getattr(curve, name)[i] for name in names}
    if len(curve.varied) == 1:
        fixed = curve._fixed(i)
        said |= {"stable": curve.stable[i], "family": fixed is not None and fixed.family}
        if fixed is not None:
            yield Claim.of(*_quantity(curve, i, fixed.quantity))
    yield from orbit_claims(problem, u, said)
    yield from _of_locus(curve, i, curve.multipliers[i], np.abs(curve.multipliers[i]) - 1.0)


def _quantity(curve: OrbitColumns, i: int, name: str) -> tuple[str, float, float, float]:
    """Return the quantity along which a branch goes, as it is said and of the orbit, and the error of that."""
    orbit, side = curve.solution(i), name[:4]
    if name == "period":
        found = orbit.period
    elif side in ("min_", "max_") and name[4:] in orbit.max:
        found = (orbit.min if side == "min_" else orbit.max)[name[4:]]
    else:
        found = orbit.max[name] if name in orbit.max else orbit.observe(name)[name]
    return name, float(curve.values[i]), found, VERIFIED_EXTREME * max(abs(found), abs(float(curve.values[i])))


def _zero(curve: Any, i: int) -> Iterator[Claim]:
    """Yield what the columns of a curve of equilibria or of map orbits say at a point."""
    kind = next(name for name in ("eigenvalues", "multipliers") if hasattr(curve, name))
    values = getattr(curve, kind)[i]
    said = {
        kind: values, "stable": curve.stable[i], "sound": curve.sound[i], "residual": curve.residual[i],
        "sizes": np.abs(curve.unknowns).max(axis=0),
    }  # fmt: skip
    said |= {"locus": curve.type} if len(curve.varied) > 1 else {}
    yield from claims(curve.solution(i), said)
    yield from _of_locus(curve, i, values, values.real if kind == "eigenvalues" else np.abs(values) - 1.0)


def _of_locus(curve: Any, i: int, values: NDArray[np.complex128], growth: NDArray[np.float64]) -> Iterator[Claim]:
    """Yield what a locus says besides at a point: that nothing but what is critical grows, and the critical pair."""
    if len(curve.varied) < 2:
        return
    resting = hasattr(curve, "eigenvalues")
    unit = float(np.abs(values).max(initial=0.0)) if resting else 1.0
    tolerance = getattr(curve, "tolerance", EQUATIONS_SOLVED)
    error = critical_error(tolerance) * unit
    clear = np.isfinite(growth) & (np.abs(growth) > error)
    told = bool(np.all(np.isfinite(growth)))
    yield Claim.of("stable", curve.stable[i], not np.any(growth[clear] > 0.0), 0.0 if told else math.inf)
    for name in ("angle", "frequency"):
        if hasattr(curve, name):
            found = _turning(curve, name, values, growth)
            known = np.all(np.isfinite(values))
            turned = value_error(tolerance) * unit
            yield Claim.of(name, getattr(curve, name)[i], found, turned if known else math.inf)
    if isinstance(curve, OrbitColumns):
        yield from _of_start(curve, i)
    else:
        yield from _coefficient(curve, i)


def _of_start(curve: Any, i: int) -> Iterator[Claim]:
    """Yield the size of an orbit's coefficient where a locus starts: it is the unit."""
    if np.array_equal(curve.values[i], [curve.parameters[name] for name in curve.varied]):
        size = abs(float(curve.coefficient[i]))
        yield Claim.of("coefficient", size, 1.0 if math.isfinite(size) else size, EPS)


def _coefficient(curve: Any, i: int) -> Iterator[Claim]:
    """Yield the coefficient of a normal form; that of a saddle-node has the sign of a vector."""
    said, form = float(curve.coefficient[i]), curve.point(i).normal_form
    found = getattr(form, "coefficient", math.nan)
    if math.isnan(said) and math.isnan(found):
        return
    if curve.type == "SN":
        said, found = abs(said), abs(found)
    yield Claim.of("coefficient", said, found, VERIFIED_VALUE * float(np.nanmax(np.abs([said, found]))))


def _turning(curve: Any, name: str, values: NDArray[np.complex128], growth: NDArray[np.float64]) -> float:
    """Return the angle of the critical multipliers, or the frequency of the critical pair; NaN where it has none."""
    kind = curve.type
    if isinstance(curve, OrbitColumns) and kind in ("SN", "PD"):
        return {"SN": 0.0, "PD": math.pi}[kind]
    if kind not in ("TR", "HB") or not np.any(values.imag > 0.0):
        return math.nan
    pairs = np.flatnonzero(values.imag > 0.0)
    critical = complex(values[pairs[np.argmin(np.abs(growth[pairs]))]])
    return critical.imag if name == "frequency" else math.atan2(critical.imag, critical.real)
