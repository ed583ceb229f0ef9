"""A fit as a result: values, errors, correlations, residuals, sheets, what the data do not tell."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation import Branch
from saltus.continuation.results.branch_files import RAGGED, branches_of, branches_together
from saltus.described import described
from saltus.extras import check_installed
from saltus.fitting.goodness import misfit_of
from saltus.fitting.instrument import Instrument
from saltus.fitting.optimum import FOUND
from saltus.fitting.search import WILD
from saltus.fitting.stored import data_of, formulas_of, instrument_of, limited_of, limits_of
from saltus.result import Result, frozen
from saltus.system.plain import held_system

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents
    from saltus.system import HybridSystem

__all__ = ["Fit"]

_CORRELATED = 0.95  # size of a correlation from which linear errors are not enough
_OFF = 5.0  # residual in standard errors from which a datum is off every sheet


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Fit(Result):
    """Parameters of a model from measured data; `saltus.fit` makes it.

    Attributes
    ----------
    system : HybridSystem
        The model.
    along : str
        The parameter along which the data were measured.
    names : tuple of str
        The varied parameters.
    values, start : ndarray, shape (vary,)
        Their best values, and where the search started.
    bounds : ndarray, shape (2, vary)
        Their least and greatest values.
    covariance : ndarray, shape (vary, vary)
        Of the values, by linear theory; infinite for what the data do not tell.
    profiles : mapping of str to (float, float)
        Interval in which the profile of the loss rises by at most 1, of parameters that were profiled.
    branches : tuple of Branch
        The model's branches at the best values.
    data : xarray.Dataset
        Along ``datum``: ``x``, the number of the ``sheet``, its ``side`` (-1 or 1 at or beyond an end, 0 within),
        ``beyond`` (how far beyond the end, where no stable orbit exists, else 0), and ``direction``. Along ``datum``
        and ``row``: ``residual``, in standard errors. Along ``datum`` and ``channel``: ``measured``, ``model`` and
        ``sigma``; ``_im`` is added for imaginary parts. Along ``special_datum``: measured special points.
    formulas : mapping of str to tuple of str
        The observables of each channel: one, or amplitude and phase of complex data.
    evaluations : int
        How often the branches were traced.
    stopped : str
        Why the search ended.
    notes : tuple of str
        What was found about the data, and what they do not tell.
    limits : mapping of str to str
        What limits parameters within their errors, in words: the end of a sheet, the reach of a jump, a bound.
    limited : mapping of str to (float, float)
        Intervals of these parameters: where the loss has risen by 1, or their limit.
    instrument : Instrument
        What the measurement does to the model's curve: offset, gain and drift.
    remedy : str
        Which unknowns of the measurement that were not varied would lower chi2, by a linear estimate, and by how much.
        It is empty where the data fit, and where none would lower chi2 by 30 % of its excess.

    Examples
    --------
    >>> import numpy as np
    >>> import saltus
    >>> spring = saltus.HybridSystem.smooth(
    ...     {"x": "v", "v": "-c*v - x + cos(s)"}, {"c": 0.3, "w": 1.0}, phase=("s", "w")
    ... )
    >>> w = np.linspace(0.6, 1.4, 9)
    >>> data = {"w": w, "amplitude(x, 1)": 1.0 / np.hypot(1.0 - w**2, 0.2 * w)}
    >>> branch = saltus.continue_orbit(saltus.find_orbit(spring, x0=[0.0, 0.0]), "w", (0.5, 1.5))
    >>> found = saltus.fit(data, branch, {"c": (0.05, 1.0)}, {"amplitude(x, 1)": 0.01})
    >>> round(found["c"], 6)
    0.2
    """

    system: HybridSystem
    along: str
    names: tuple[str, ...]
    values: NDArray[np.float64]
    start: NDArray[np.float64]
    bounds: NDArray[np.float64]
    covariance: NDArray[np.float64]
    branches: tuple[Branch, ...]
    data: xr.Dataset
    formulas: Mapping[str, tuple[str, ...]]
    evaluations: int
    stopped: str
    profiles: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    instrument: Instrument = field(default_factory=Instrument)
    remedy: str = ""
    limits: Mapping[str, str] = field(default_factory=dict)
    limited: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("values", "start", "bounds", "covariance"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(checks.chosen("parameter", name, self.names))])

    @property
    def parameters(self) -> dict[str, float]:
        """All parameters of the model at the optimum, without the one along which the data were measured."""
        known = {**self.branches[0].parameters, **dict(zip(self.names, self.values.tolist(), strict=True))}
        return {name: value for name, value in known.items() if name not in (self.along, *self.instrument.names)}

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors of the varied parameters.

        They are those of linear theory, but of parameters in `limits` the greater part of the interval.
        """
        found = dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))
        parts = {name: max(self[name] - low, high - self[name]) for name, (low, high) in self.limited.items()}
        return found | {name: part for name, part in parts.items() if part > 0.0}

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Intervals of the varied parameters, which contain the true values in 68.3 % of all measurements.

        They are those of limited parameters, profiles where these were computed, else value and standard error.
        Intervals that a reach or a bound limits contain true values more often.
        """
        plain = {name: (self[name] - error, self[name] + error) for name, error in self.errors.items()}
        return plain | dict(self.profiles) | dict(self.limited)

    @property
    def beyond(self) -> tuple[int, ...]:
        """Rows of data at whose places the model has no stable orbit: they cost their distance from the next sheet."""
        return tuple(np.flatnonzero(self.data["beyond"].to_numpy() > 0.0).tolist())

    @property
    def correlation(self) -> pd.DataFrame:
        """Correlations of the varied parameters; NaN where the data do not tell one."""
        from saltus.extras import pd

        spread = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore"):
            table = np.where(np.isfinite(np.outer(spread, spread)), self.covariance / np.outer(spread, spread), np.nan)
        return pd.DataFrame(table, index=list(self.names), columns=list(self.names))

    @property
    def residuals(self) -> NDArray[np.float64]:
        """All residuals in standard errors: data row after row, then special points."""
        return np.concatenate([self.data["residual"].to_numpy().T.ravel(), self.data["special_residual"].to_numpy()])

    @property
    def chi2(self) -> float:
        """Sum of the squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def chi2_per_datum(self) -> float:
        """Sum of the squared residuals over their number; about 1 where the standard errors are those of the data."""
        return self.chi2 / self.residuals.size

    @property
    def outliers(self) -> tuple[int, ...]:
        """Rows of data that lie more than 5 standard errors off while all others fit: one, or 5 % of the data."""
        rows = np.flatnonzero(self._is_off)
        most = max(1, int(WILD * self.data.sizes["datum"]))
        return tuple(rows.tolist()) if 0 < rows.size <= most and not misfit_of(self._kept(rows), self._free) else ()

    @property
    def chi2_without_outliers(self) -> float:
        """Sum of the squared residuals over their number, without those of `outliers`."""
        kept = np.concatenate(self._kept(np.array(self.outliers, dtype=int)))
        return float(kept @ kept) / max(kept.size, 1)

    @property
    def misfit(self) -> str:
        """In words, that the data do not fit; empty where they do.

        They do not where chi2 has a probability below 0.001 by known standard errors, or exceeds its mean by five
        standard deviations. They do not where neighbouring residuals agree more than chance lets them. Data in
        `outliers` do not count.
        """
        rows = np.array(self.outliers, dtype=int)
        why = misfit_of(self._kept(rows), self._free)
        if not why:
            return ""
        off = f"{self._off} of {self.data.sizes['datum']} data lie more than {_OFF:g} standard errors off the model"
        return (
            f"the data do not fit: {why}, and {off}; the model or the standard errors do not suit them, or the best"
            f" parameters lie elsewhere{self.remedy and '; '}{self.remedy}"
        )

    @property
    def _free(self) -> int:
        """Parameters that were fitted to the data."""
        return int(np.isfinite(np.diag(self.covariance)).sum())

    def _kept(self, rows: NDArray[np.int64]) -> list[NDArray[np.float64]]:
        """Return residuals without those of some data, in the order along each way; last those of special points."""
        table, x = self.data["residual"].to_numpy(), self.data["x"].to_numpy()
        ways = self.data["direction"].to_numpy()
        kept = np.ones(len(x), dtype=bool)
        kept[rows] = False
        found = []
        for way in dict.fromkeys(ways.tolist()):
            own = np.flatnonzero((ways == way) & kept)
            own = own[np.argsort(x[own], kind="stable")]
            found += list(table[own].T)
        return [*found, self.data["special_residual"].to_numpy()]

    @property
    def _is_off(self) -> NDArray[np.bool_]:
        return np.asarray((np.abs(self.data["residual"].to_numpy()) > _OFF).any(axis=1))

    @property
    def _off(self) -> int:
        """Data that lie off every sheet."""
        return int(self._is_off.sum())

    @property
    def message(self) -> str:
        """In words, why the search ended, and first whether the data do not fit."""
        return f"{self.misfit}; {self.stopped}" if self.misfit else self.stopped

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table of the varied parameters: value, standard error, profile, start and bounds."""
        from saltus.extras import pd

        rows = [
            {
                "parameter": name, "value": self.values[i], "error": self.errors[name],
                "profile_low": self.profiles.get(name, (np.nan, np.nan))[0],
                "profile_high": self.profiles.get(name, (np.nan, np.nan))[1],
                "start": self.start[i], "low": self.bounds[0, i], "high": self.bounds[1, i],
            }
            for i, name in enumerate(self.names)
        ]  # fmt: skip
        return pd.DataFrame(rows).set_index("parameter")

    def to_lmfit(self) -> Any:
        """Return the fit as lmfit's `MinimizerResult`, for its reports; needs the extra ``saltus[fit]``.

        Raises
        ------
        SaltusError
            lmfit is not installed.
        """
        check_installed("lmfit")
        from lmfit import Parameters
        from lmfit.minimizer import MinimizerResult

        parameters, table = Parameters(), self.correlation
        for i, name in enumerate(self.names):
            low, high = self.bounds[:, i]
            parameters.add(name, float(self.values[i]), min=float(low), max=float(high))
            parameters[name].init_value = float(self.start[i])
            error = self.errors[name]
            parameters[name].stderr = error if np.isfinite(error) else None
            others = [other for other in self.names if other != name and np.isfinite(table.loc[name, other])]
            parameters[name].correl = {other: float(table.loc[name, other]) for other in others}
        result = MinimizerResult(
            params=parameters, var_names=list(self.names), init_vals=self.start.tolist(),
            init_values=dict(zip(self.names, self.start.tolist(), strict=True)), covar=np.array(self.covariance),
            residual=self.residuals, nfev=self.evaluations, method="saltus", success=self.message == FOUND,
            errorbars=bool(np.all(np.isfinite(self.covariance))), message=self.message, nvarys=len(self.names),
            ndata=self.residuals.size, aborted=self.stopped.startswith("interrupted"), scale_covar=False,
        )  # fmt: skip
        result._calculate_statistics()
        return result

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the fit as a Dataset: parameters along ``vary``, data along ``datum``, branches along ``point``."""
        from saltus.extras import xr

        data, coords = branches_together(self.branches, "sheet_of")
        own: dict[str, Any] = {
            "fitted": ("vary", self.values),
            "started": ("vary", self.start),
            "bound": (("bound_end", "vary"), self.bounds),
            "covariance": (("vary", "vary_other"), self.covariance),
            "profile": (
                ("vary", "profile_end"),
                np.array([self.profiles.get(n, (np.nan, np.nan)) for n in self.names]),
            ),
        }
        if self.limited:
            rows = [self.limited.get(name, (np.nan, np.nan)) for name in self.names]
            own["limited"] = (("vary", "profile_end"), np.array(rows))
        own |= {f"fit_{name}": variable.variable for name, variable in self.data.data_vars.items()}
        coords |= {"vary": list(self.names), "channel": self.data["channel"].to_numpy()}
        attrs = {
            "along": self.along,
            "definition": json.dumps(self.system.definition()),
            "evaluations": self.evaluations,
            "stopped": self.stopped,
            "formulas": json.dumps({name: list(one) for name, one in self.formulas.items()}),
            "notes": json.dumps(list(self.notes)),
            "ragged": RAGGED,
            "instrument": json.dumps(asdict(self.instrument)),
            "remedy": self.remedy,
            "limits": json.dumps(dict(self.limits)),
        }
        return xr.Dataset(data | own, coords, attrs)

    @classmethod
    def _read(cls, held: Contents) -> Fit:
        system, along = held_system(held), held.text("along")
        checks.chosen("attribute 'along'", along, system.parameter_names)
        names = tuple(map(str, held.array("vary", ("vary",), str).tolist()))
        instrument = instrument_of(held)
        for name in names:
            checks.chosen("vary", name, [*system.parameter_names, *instrument.names])
        count = len(names)
        held.expect(vary_other=count, bound_end=2, profile_end=2)
        found = branches_of(held, "sheet_of", [False] * held.size("sheet_of", least=1), along)
        profile = held.array("profile", ("vary", "profile_end"), finite=False)
        covariance = held.array("covariance", ("vary", "vary_other"), finite=False)
        return cls(
            system=system,
            along=along,
            names=names,
            values=held.array("fitted", ("vary",)),
            start=held.array("started", ("vary",)),
            bounds=held.array("bound", ("bound_end", "vary")),
            covariance=covariance,
            branches=tuple(branch for branch in found if branch is not None),
            data=data_of(held),
            formulas=formulas_of(held),
            evaluations=held.count("evaluations"),
            stopped=held.text("stopped"),
            profiles={
                name: (float(low), float(high))
                for name, (low, high) in zip(names, profile, strict=True)
                if np.isfinite(low) and np.isfinite(high)
            },
            notes=tuple(held.texts("notes")),
            instrument=instrument,
            remedy=held.text("remedy") if "remedy" in held.dataset.attrs else "",
            limits=limits_of(held, names),
            limited=limited_of(held, names),
        )

    def __repr__(self) -> str:
        count, of_points = self.data.sizes["datum"], self.data.sizes["special_datum"]
        more = f" and {of_points} special points" if of_points else ""
        lines = [
            f"Fit of {self.system.name or 'a hybrid system'} along {self.along}: {count} data{more},"
            f" chi2/n = {self.chi2_per_datum:.3f}"
        ]
        lines += [f"  {self.misfit}"] if self.misfit else []
        lines += [f"  {text}" for text in self._outlying()]
        wide = max(len(name) for name in self.names)
        for i, name in enumerate(self.names):
            error = self.errors[name]
            known = f"+- {error:.2g}" if np.isfinite(error) else "not told by the data"
            lines.append(f"  {name:{wide}}  {self.values[i]:.8g} {known}" + self._interval(name))
        lines += [f"  {text}" for text in self._sheets()]
        table = self.correlation.to_numpy()
        for i, j in combinations(range(len(self.names)), 2):
            if abs(table[i, j]) > _CORRELATED:
                lines.append(f"  {self.names[i]} and {self.names[j]} correlate by {table[i, j]:.3f}")
        lines += [f"  {note}" for note in self.notes]
        return "\n".join([*lines, f"  {self.stopped}, after {self.evaluations} evaluations"])

    def _interval(self, name: str) -> str:
        if name not in self.profiles and name not in self.limited:
            return ""
        (low, high), kind = self.intervals[name], "profile" if name in self.profiles else "interval"
        limit = f", limited by {self.limits[name]}" if name in self.limits else ""
        return f", {kind} {low:.6g} to {high:.6g}{limit}"

    def _outlying(self) -> list[str]:
        """Return in words which data are outliers, and chi2 with and without these."""
        if not self.outliers:
            return []
        channels = [name for name, formulas in self.formulas.items() for _ in formulas]
        table, told = self.data["residual"].to_numpy(), []
        for row in self.outliers:
            worst = int(np.argmax(np.abs(table[row])))
            way = str(self.data["direction"].to_numpy()[row])
            told.append(
                f"outlier: datum {row} at {self.along} = {float(self.data['x'][row]):.9g}{way and f', {way}'}, whose"
                f" {channels[worst]} is {abs(table[row, worst]):.3g} standard errors off"
            )
        number = f"{len(self.outliers)} outlier{'s' if len(self.outliers) > 1 else ''}"
        return [*told, f"chi2/n = {self.chi2_per_datum:.3g} with {number}, {self.chi2_without_outliers:.3g} without"]

    def _sheets(self) -> list[str]:
        """Return in words how the data lie on the sheets."""
        sheet = self.data["sheet"].to_numpy()
        told = [f"sheet {number}: {int((sheet == number).sum())} data" for number in np.unique(sheet)]
        lines = [", ".join(told)]
        for row in self.beyond:
            way, away = str(self.data["direction"].to_numpy()[row]), float(self.data["beyond"][row])
            at = f"{self.along} = {float(self.data['x'][row]):.9g}{way and f', {way}'}"
            lines.append(
                f"datum {row} at {at} lies {away:.3g} beyond the end of sheet {sheet[row]}: the model has no stable"
                " orbit there, and the distance counts"
            )
        if self._off:
            lines.append(f"{self._off} data lie more than {_OFF:g} standard errors off every stable sheet")
        if missed := int((np.abs(self.data["special_residual"].to_numpy()) > _OFF).sum()):
            lines.append(f"{missed} special points lie more than {_OFF:g} standard errors off those of the model")
        return lines
