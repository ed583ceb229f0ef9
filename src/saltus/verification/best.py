"""What an optimum and a fit say besides their orbits: values, conditions of first order, residuals of data."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import SaltusError
from saltus.flow.formulas import read_formula
from saltus.orbits import solve_orbit
from saltus.scales import EPS, GRADIENT_LEFT, ILL_CONDITIONED, VERIFIED_EXTREME, VERIFIED_VALUE
from saltus.verification.covariance import covariance_rows
from saltus.verification.table import Row, compared, equal, unchecked

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.fitting.result import Fit
    from saltus.optimisation.optimum import Optimum

__all__ = ["fit_rows", "optimum_rows"]

_STABLE = "stable"  # the constraint on the largest multiplier


def optimum_rows(optimum: Optimum, points: int) -> list[Row]:
    """Return the checks of an optimum: its values, those of its constraints, and that no first change improves it."""
    orbit = optimum.orbit
    rows = [
        _same("best", optimum.best, _value(optimum, optimum.objective)),
        _same("best at the end of the path", float(optimum.path_objective[-1]), optimum.best),
        *(_same(f"path, {name}", float(last), float(value), EPS)
          for name, last, value in zip(optimum.over, optimum.path[-1], optimum.values, strict=True)),
        *(_same(f"start, {name}", float(said), float(first), EPS)
          for name, said, first in zip(optimum.over, optimum.start, optimum.path[0], strict=True)),
    ]  # fmt: skip
    for name, seen in zip(optimum.constraints, optimum.seen.tolist(), strict=True):
        if name == _STABLE:
            found = float(np.abs(orbit.multipliers[: None if orbit.system.phase is not None else -1]).max(initial=0.0))
        else:
            found = _value(optimum, name)
        rows.append(_same(f"value of {name}", seen, found))
    return [*rows, *_bounds(optimum), *_first_order(optimum), *_along(optimum, points)]


def _value(optimum: Optimum, name: str) -> float:
    known = optimum.orbit.parameters
    return float(known[name]) if name in known else float(optimum.orbit.observe(name)[name])


def _same(what: str, said: float, found: float, share: float = VERIFIED_EXTREME) -> Row:
    return compared(what, said, found, share * max(abs(said), abs(found)))


def _bounds(optimum: Optimum) -> Iterator[Row]:
    """Yield whether bounds are kept, and met where a multiplier says so, and whether that has the sign of its side."""
    way = 1.0 if optimum.goal == "maximise" else -1.0
    columns = (optimum.constraints, optimum.sides, optimum.seen, optimum.limits, optimum.multipliers)
    for name, side, seen, limit, multiplier in zip(*columns, strict=True):
        sign = 1.0 if side == "upper" else -1.0
        size = max(abs(float(seen)), abs(float(limit)), ILL_CONDITIONED)
        beyond = max(sign * float(seen - limit), 0.0)
        yield compared(f"bound of {name}", 0.0, beyond, VERIFIED_VALUE * size)
        if multiplier != 0.0:
            yield compared(f"active bound of {name}", float(limit), float(seen), VERIFIED_VALUE * size)
            yield equal(f"multiplier of {name} by its side", True, bool(way * sign * multiplier > 0.0))


def _first_order(optimum: Optimum) -> Iterator[Row]:
    """Yield whether the gradient is that of the active bounds: by exact derivatives, over the sizes of the changes."""
    active = [i for i, rate in enumerate(optimum.multipliers.tolist()) if rate != 0.0]
    if any(optimum.constraints[i] == _STABLE for i in active):
        yield unchecked("gradient", optimum.residual, "the bound of stability is active")
        return
    names = [optimum.objective, *(optimum.constraints[i] for i in active)]
    try:
        gradients = [_gradient(optimum, name) for name in names]
    except SaltusError as error:
        yield unchecked("gradient", optimum.residual, str(error))
        return
    units = np.maximum(np.abs(optimum.values), np.ptp(optimum.path, axis=0))
    terms = np.array([gradients[0], *(-optimum.multipliers[i] * g for i, g in zip(active, gradients[1:], strict=True))])
    size = max(float(np.abs(terms * units).max()), abs(optimum.best), ILL_CONDITIONED)
    left = float(np.abs(terms.sum(axis=0) * units).max()) / size
    yield compared("gradient left", optimum.residual, left, GRADIENT_LEFT)


def _gradient(optimum: Optimum, name: str) -> NDArray[np.float64]:
    if name in optimum.orbit.parameters:
        return np.array([float(name == other) for other in optimum.over])
    return np.asarray(optimum.orbit.sensitivity([name], optimum.over)[name].to_numpy())


def _along(optimum: Optimum, points: int) -> Iterator[Row]:
    """Yield whether the objective on the way is that of orbits solved there, and what no other means tells."""
    orbit, count = optimum.orbit, len(optimum.path)
    segments = [(mode, transition or None, x, duration) for mode, transition, x, duration in orbit.segments]
    chosen = np.unique(np.linspace(0, count - 1, min(points, count)).round().astype(int)).tolist()
    for step in chosen:
        place, said = dict(zip(optimum.over, optimum.path[step].tolist(), strict=True)), optimum.path_objective[step]
        what = f"objective of step {step}"
        try:
            there = solve_orbit(orbit.system, {**orbit.parameters, **place}, segments)
            known = optimum.objective in there.parameters
            found = there.parameters if known else there.observe(optimum.objective)
            yield _same(what, float(said), float(found[optimum.objective]))
        except SaltusError as error:
            yield unchecked(what, float(said), str(error))
    if len(chosen) < count:
        for name in ("path", "path_objective"):
            yield unchecked(f"variable {name}", name, f"{count - len(chosen)} steps between; points={count} checks all")
    yield unchecked("mismatch and curvature", optimum.curvature, "they are differences between orbits nearby")


def fit_rows(fit: Fit, points: int) -> list[Row]:
    """Return the checks of a fit: its parameters are those of its branches, its residuals those of data and model."""
    rows = []
    for name, value, low, high in zip(fit.names, fit.values, *fit.bounds, strict=True):
        own = [branch.parameters[name] for branch in fit.branches if name in branch.parameters and name != fit.along]
        rows += [_same(f"value of {name}", float(value), float(known), EPS) for known in own]
        rows.append(equal(f"{name} within its bounds", True, bool(low <= value <= high)))
    spread = np.diag(fit.covariance)
    rows.append(equal("covariance is that of errors", True, _is_covariance(fit.covariance, spread)))
    for name, (low, high) in fit.profiles.items():
        rows.append(equal(f"{name} within its profile", True, bool(low <= fit[name] <= high)))
    for name, (low, high) in fit.limited.items():
        rows.append(equal(f"{name} within its interval", True, bool(low <= fit[name] <= high)))
    rows += [*_residuals(fit), *covariance_rows(fit)]
    return [*rows, *_beyond(fit), *_model(fit, points)]


def _beyond(fit: Fit) -> Iterator[Row]:
    """Yield whether the branches have no stable orbit at data that lie beyond the ends of sheets."""
    for row in fit.beyond if not fit.instrument.names else ():
        x, stable = float(fit.data["x"][row]), 0
        for branch in fit.branches:
            try:
                stable += sum(orbit.stable and orbit.admissible for orbit in branch.at(x))
            except SaltusError:  # a branch that does not come to the datum
                continue
        yield equal(f"stable orbits at datum {row}", 0, stable)._replace(place=f"{fit.along} = {x:.6g}")


def _is_covariance(table: NDArray[np.float64], spread: NDArray[np.float64]) -> bool:
    """Return whether a matrix is symmetric, and no correlation exceeds 1."""
    known = np.isfinite(spread)
    part = table[np.ix_(known, known)]
    sizes = np.sqrt(np.maximum(spread[known], 0.0))
    room = ILL_CONDITIONED * np.outer(sizes, sizes)
    return bool(np.all(np.abs(part - part.T) <= room) and np.all(np.abs(part) <= np.outer(sizes, sizes) + room))


def _residuals(fit: Fit) -> Iterator[Row]:
    """Yield whether the residuals of real data within their sheets are the difference of data and model by sigma."""
    data = fit.data
    within = data["beyond"].to_numpy() == 0.0  # beyond the end of its sheet a datum costs its distance, too
    for c, channel in enumerate(map(str, data["channel"].to_numpy().tolist())):
        formulas = fit.formulas.get(channel, ())
        if len(formulas) != 1 or read_formula(fit.system, formulas[0]).turn:
            continue
        measured, model, sigma = (data[name].to_numpy()[:, c] for name in ("measured", "model", "sigma"))
        said, found = data["residual"].to_numpy()[:, c], (model - measured) / sigma
        if np.all(np.sign(said[within]) == -np.sign(found[within])):
            found = -found
        off = np.where(within & np.isfinite(found), np.abs(said - found), 0.0)
        i = int(np.argmax(np.where(within, off, -1.0)))
        allowed = VERIFIED_VALUE * max(1.0, abs(float(found[i])))
        yield compared(f"residual of {channel}", float(said[i]), float(found[i]), allowed)._replace(place=f"datum {i}")


def _model(fit: Fit, points: int) -> Iterator[Row]:
    """Yield whether the model at some data is the observable of an orbit of its sheet, solved at the datum."""
    data = fit.data
    plain = not fit.instrument.names
    within = np.flatnonzero(data["side"].to_numpy() == 0)
    chosen = within[np.unique(np.linspace(0, within.size - 1, min(points, within.size)).round().astype(int))]
    for c, channel in enumerate(map(str, data["channel"].to_numpy().tolist())):
        formulas = fit.formulas.get(channel, ())
        if not plain or len(formulas) != 1:
            yield unchecked(f"model of {channel}", 0.0, "it is what an instrument makes of observables")
            continue
        for i in chosen.tolist():
            yield _model_at(fit, formulas[0], channel, i, c)


def _model_at(fit: Fit, formula: str, channel: str, i: int, c: int) -> Row:
    x, said = float(fit.data["x"][i]), float(fit.data["model"].to_numpy()[i, c])
    found: list[float] = []
    stable: list[float] = []
    for branch in fit.branches:
        try:
            orbits = branch.at(x)
        except SaltusError:  # a branch that does not come to the datum
            continue
        found += [_observed(orbit, formula) for orbit in orbits]
        stable += [value for value, orbit in zip(found[-len(orbits) :], orbits, strict=True) if orbit.stable]
    what, place = f"model of {channel}", f"{fit.along} = {x:.6g}"
    if not found:
        return unchecked(what, said, "no orbit is found there")._replace(place=place)
    near = min(found, key=lambda value: abs(value - said))
    if stable and len(fit.formulas) == 1 and not read_formula(fit.system, formula).turn:
        measured = float(fit.data["measured"].to_numpy()[i, c])
        near = min(stable, key=lambda value: abs(value - measured))
    return compared(what, said, near, ILL_CONDITIONED * max(abs(near), 1.0))._replace(place=place)


def _observed(orbit: Any, formula: str) -> float:
    return float(orbit.parameters[formula] if formula in orbit.parameters else orbit.observe(formula)[formula])
