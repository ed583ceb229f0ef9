"""What the variables of results' Datasets are: for each a name in words, a unit and a sentence."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, NamedTuple, ParamSpec, TypeVar

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["described"]

Held = TypeVar("Held")
Options = ParamSpec("Options")


class _Words(NamedTuple):
    """The name of a variable in words, its unit, and a sentence."""

    long_name: str
    unit: str
    description: str


# Units: the first two stand for the system's own, all else is written as it is.
_TIME = "<time>"
_RATE = "<rate>"
_STATE = "unit of each state"
_PARAMETER = "unit of each parameter"
_QUANTITY = "unit of each quantity"
_OF_DATUM = "unit of the channel"

# Variables of curves, orbits and equilibria: name, name in words, unit, sentence.
_TABLE = f"""
x0 | start | {_STATE} | State where the solution starts.
multiplier_re | multiplier, real part | 1 | Real part of each Floquet multiplier, or multiplier of an orbit of a map.
multiplier_im | multiplier, imaginary part | 1 | Imaginary part of each multiplier.
eigenvalue_re | eigenvalue, real part | {_RATE} | Real part of each eigenvalue of the linearised field.
eigenvalue_im | eigenvalue, imaginary part | {_RATE} | Imaginary part of each eigenvalue of the linearised field.
stable | stable | 1 | 1 where the solution is stable, 0 where it is not.
admissible | admissible | 1 | 1 where the orbit is one of the system, 0 where it only solves its equations.
regular | regular | 1 | 1 where the solution is one of the system, 0 where it only solves its equations.
implicit | implicit steps | 1 | 1 where implicit steps follow the orbit, 0 where explicit ones do.
period | period | {_TIME} | Period of the orbit.
residual | residual | 1 | Largest residual of the equations, relative to the sizes of the states.
arclength | arclength | 1 | Arclength along the curve, in scaled unknowns, from its first point.
form | number of the signature | 1 | Index of the signature in the attribute forms.
signature | signature | 1 | Modes that the orbit goes through, each with the transition that ends it.
unknown | unknowns | {_STATE} | State and duration of each segment, one solution after the other.
unknown_count | count of unknowns | 1 | How many values of unknown belong to each solution.
lows | least value | {_QUANTITY} | Least value of each quantity along the orbit.
highs | greatest value | {_QUANTITY} | Greatest value of each quantity along the orbit.
low | least value | {_QUANTITY} | Least value of each quantity along the orbit.
high | greatest value | {_QUANTITY} | Greatest value of each quantity along the orbit.
minimum | least value | {_QUANTITY} | Least value of each quantity along the orbit.
maximum | greatest value | {_QUANTITY} | Greatest value of each quantity along the orbit.
means | mean | {_QUANTITY} | Mean of each quantity over a period.
harmonic_re | first harmonic, real part | {_QUANTITY} | Real part of the first Fourier coefficient of each quantity.
harmonic_im | first harmonic, imaginary part | {_QUANTITY} | Imaginary part of the first Fourier coefficient.
freed | freed parameter | {_PARAMETER} | Value of the parameter that varies for the fixed value to be kept.
value | value | {_PARAMETER} | Value of each parameter that varies.
type | type | 1 | Type of the special point, as SN or PD.
label | label | 1 | Type of the special point and its number along the curve.
of | subject | 1 | What the special point is of: a parameter, a quantity, an event or a side.
kind | kind | 1 | Kind of a boundary equilibrium or border collision; empty where none is told.
locus | locus | 1 | Type of the locus that the point belongs to; empty on a branch.
test | test function | 1 | Value of the test function whose zero defines the type.
position | position | 1 | Place among the points of the curve: 3.5 lies between points 3 and 4.
faults | faults | 1 | Reasons why the orbit is none of the system, one bit each.
reasons | reasons | 1 | Reasons why the solution is none of the system, as a JSON list.
saddle | saddle | {_STATE} | Equilibrium that a homoclinic orbit tends to; NaN at other points.
saddle_value | parameters of the saddle | {_PARAMETER} | Parameters of the equilibrium of a homoclinic orbit.
saddle_residual | residual of the saddle | 1 | Residual of the equilibrium of a homoclinic orbit.
saddle_mode | mode of the saddle | 1 | Index of the mode of that equilibrium, -1 at other points.
tangent | tangent | 1 | Tangents of the own branches at branching points, one after the other.
tangent_count | count of tangent components | 1 | How many values of tangent belong to each point.
scale | sizes of the unknowns | {_STATE} | Typical size of each unknown on the curve.
equilibrium | equilibrium | {_STATE} | State of the equilibrium.
mode | mode | 1 | Index of the mode that holds there.
piece | piece | 1 | Index of the piece of the map.
itinerary | itinerary | 1 | Index of the piece of each point of the orbit.
segment_state | state at the start of each segment | {_STATE} | State with which each segment of the orbit starts.
segment_duration | duration of each segment | {_TIME} | How long each segment of the orbit lasts.
segment_mode | mode of each segment | 1 | Name of the mode in which each segment runs.
segment_transition | transition at the end of each segment | 1 | Name of what ends each segment.
t | time | {_TIME} | Time since the start of the first segment.
state | state | 1 | Names of the states.
own_state | state | 1 | Names of the states without the phase.
quantity | quantity | 1 | Names of the states and outputs.
parameter | parameter | 1 | Names of the parameters that vary.
count | count of points | 1 | How many points each curve has.
branch_attributes | attributes of each branch | 1 | Own attributes of each branch, as JSON.
failure | failure | 1 | Reason why a member has no branch; empty where it has one.
point_member | member | 1 | Index of the member that each point belongs to.
special_member | member | 1 | Index of the member that each special point belongs to.
point_level | level | 1 | Index of the doubled branch that each point belongs to.
special_level | level | 1 | Index of the doubled branch that each special point belongs to.
point_sheet | sheet | 1 | Index of the sheet that each point belongs to.
special_sheet | sheet | 1 | Index of the sheet that each special point belongs to.
point_sheet_of | sheet | 1 | Index of the sheet that each point belongs to.
special_sheet_of | sheet | 1 | Index of the sheet that each special point belongs to.
coefficient | coefficient of the normal form | 1 | Coefficient of the normal form; NaN where there is none.
frequency | frequency | {_RATE} | Imaginary part of the critical pair of eigenvalues along a Hopf locus.
angle | angle | rad | Angle of the critical pair of multipliers along a torus locus.
x_end | last state | {_STATE} | State at the end.
touches | touches | 1 | Contacts with a surface that do not cross it.
"""

# Variables that mean something else in one kind of result: kind, then as above.
_TABLES = f"""
Trajectory | event_time | time of the event | {_TIME} | Time of each event.
Trajectory | event_transition | transition | 1 | Index of the transition of each event.
Trajectory | event_mode_before | mode before | 1 | Index of the mode before each event.
Trajectory | event_mode_after | mode after | 1 | Index of the mode after each event.
Trajectory | event_before | state before | {_STATE} | State just before each event.
Trajectory | event_after | state after | {_STATE} | State just after each event.
Trajectory | event_normal_velocity | rate | unit of the event function per unit of time | Rate of the event function.
Trajectory | event_grazing | grazing | 1 | Whether the event's surface was met without speed, within the error.
Trajectory | step_time | time of the step | {_TIME} | Time at the start of each step.
Trajectory | step_length | length of the step | {_TIME} | Length of each step.
Trajectory | step_mode | mode of the step | 1 | Index of the mode during each step.
Trajectory | step_start | state of the step | {_STATE} | State at the start of each step.
Trajectory | step_dense | interpolant | {_STATE} | Coefficients of the interpolant of each step.
Iterates | x | state | {_STATE} | State after each iteration.
Iterates | piece | piece | 1 | Index of the piece of the map at each state.
Iterates | iteration | iteration | 1 | Number of the iteration.
MapOrbit | x | state | {_STATE} | State of each point of the orbit.
Sweep | points | points of the section | {_QUANTITY} | Quantities at the section, the last returns of each motion.
Sweep | label | label | 1 | Kind of the attractor, as period-2, chaotic or quasi-periodic.
Sweep | period | period | returns | Returns after which the motion repeats; 0 where it does not.
Sweep | rotation | rotation number | turns per return | Turns round the closed curve in one return; else NaN.
Sweep | curves | closed curves | 1 | How many closed curves the points lie on.
Sweep | lyapunov | Lyapunov exponent | {_RATE} | Lyapunov exponents in descending order.
Sweep | lyapunov_error | error of the exponent | {_RATE} | Half width of the confidence interval of each exponent.
Sweep | return_time | return time | {_TIME} | Mean time between two returns.
Sweep | observed | observed values | unit of each observable | Value of each observable of the motion.
Sweep | observable | observable | 1 | Expressions of the observables.
Sweep | reason | reason | 1 | Why a label says no more, or why a motion stopped; empty where there is nothing to say.
Sweep | end_state | last state | {_STATE} | State where the motion ended.
Sweep | end_mode | last mode | 1 | Index of the mode in which the motion ended.
Sweep | direction | direction | 1 | Sense in which the parameter went.
Sweep | value | swept parameter | {_PARAMETER} | Value of the swept parameter.
LyapunovSpectrum | exponent | Lyapunov exponent | {_RATE} | Lyapunov exponents in descending order.
LyapunovSpectrum | error | error of the exponent | {_RATE} | Half width of the confidence interval, from batch means.
LyapunovSpectrum | log_growth | logarithm of the growth | 1 | Logarithm of the growth of each direction up to each time.
LyapunovSpectrum | time | time | {_TIME} | Time since transients were discarded.
Attractors | point | points of the attractors | {_STATE} | Points that stand for the attractors.
Attractors | label | attractor | 1 | Index of the attractor that each point belongs to.
Attractors | ellipsoids_centres | centres of ellipsoids | {_STATE} | Centre of each trapping ellipsoid.
Attractors | ellipsoids_shapes | shapes of ellipsoids | 1 | Matrix that maps each ellipsoid to the unit ball.
Attractors | ellipsoids_labels | attractors of ellipsoids | 1 | Label of the attractor of each ellipsoid.
Attractors | ellipsoids_normals | planes of ellipsoids | 1 | Normals of the planes that cut each ellipsoid.
Attractors | ellipsoids_offsets | offsets of planes | 1 | Offsets of these planes.
Attractors | ellipsoids_modes | modes of ellipsoids | 1 | Index of the mode in which each ellipsoid holds, -1 in all.
Attractors | cages_centres | centres of cages | {_STATE} | Centre of each trapping cage.
Attractors | cages_rows_re | rows of cages, real part | 1 | Real parts of the rows by which a cage measures distance.
Attractors | cages_rows_im | rows of cages, imaginary part | 1 | Imaginary parts of these rows.
Attractors | cages_floors | floors of cages | 1 | Distance below which each row counts as nothing.
Attractors | cages_bounds | bounds of cages | 1 | Largest distance within each cage.
Attractors | cages_modes | modes of cages | 1 | Index of the mode in which each cage holds, -1 in all.
Attractors | cages_labels | attractors of cages | 1 | Label of the attractor of each cage.
Attractors | cells_origin | corner of the cells | {_STATE} | Corner of the boxes with index 0.
Attractors | cells_size | size of the cells | {_STATE} | Edges of each box.
Attractors | cells_boxes | boxes | 1 | Indices of the boxes that a motion must visit to be labelled.
Attractors | cells_labels | attractors of boxes | 1 | Label of the attractor of each box.
Basins | labels | label of the attractor | 1 | Label of the attractor of each cell; flag_meanings has the names.
Basins | attractors | file of the attractors | 1 | Bytes of a NetCDF file of the attractors.
Basins | attractor_point | points of the attractors | {_STATE} | Points that stand for the attractors.
Basins | attractor_label | attractor | 1 | Label of the attractor that each point belongs to.
Basins | attractor_state | state | 1 | Names of the states of these points.
ErosionProfile | found | measure | 1 | Value of each measure of each basin.
ErosionProfile | error | error of the measure | 1 | Standard error of the measure.
ErosionProfile | clipped | clipped | 1 | Whether the measure is bounded by the region's edge.
ErosionProfile | note | note | 1 | What is to be said of the value; empty where nothing is.
ErosionProfile | value | parameter | {_PARAMETER} | Value of the parameter.
ErosionProfile | attractor | attractor | 1 | Names of the attractors.
ErosionProfile | measure | measure | 1 | Names of the measures.
Fit | fitted | fitted parameters | {_PARAMETER} | Value of each fitted parameter.
Fit | started | start | {_PARAMETER} | Value with which the fit started.
Fit | bound | bounds | {_PARAMETER} | Least and greatest value that was allowed.
Fit | covariance | covariance | product of the parameters' units | Covariance of the fitted parameters.
Fit | profile | profile | {_PARAMETER} | Ends of the interval by the likelihood's profile; else NaN.
Fit | vary | fitted parameters | 1 | Names of the fitted parameters.
Fit | channel | channel | 1 | Observables of the data.
Fit | fit_x | place of the datum | {_PARAMETER} | Value of the parameter at each datum.
Fit | fit_side | side | 1 | Side of a jump that a datum lies on, -1 or 1; 0 where there is none.
Fit | fit_sheet | sheet | 1 | Index of the sheet that the datum belongs to.
Fit | fit_beyond | beyond a sheet's end | {_PARAMETER} | Distance of the datum from the sheet's end; 0 where one exists.
Fit | limited | limited errors | {_PARAMETER} | Errors below and above where something limits them; else NaN.
Fit | fit_direction | direction | 1 | Sense of the sweep in which the datum was measured.
Fit | fit_residual | residual | 1 | Model less measurement, in standard errors.
Fit | fit_measured | measured, real part | {_OF_DATUM} | Measured value.
Fit | fit_measured_im | measured, imaginary part | {_OF_DATUM} | Imaginary part of the measured value; 0 of a real one.
Fit | fit_model | model, real part | {_OF_DATUM} | Value of the model.
Fit | fit_model_im | model, imaginary part | {_OF_DATUM} | Imaginary part of the model's value.
Fit | fit_sigma | standard error | {_OF_DATUM} | Standard error of the measured value.
Fit | fit_turn | turn | {_OF_DATUM} | Period of an angle; 0 of what is none.
Fit | fit_special_value | place of the special point | {_PARAMETER} | Measured place of each special point.
Fit | fit_special_sigma | standard error of the place | {_PARAMETER} | Standard error of the measured place.
Fit | fit_special_residual | residual of the place | 1 | Model less measurement, in standard errors.
Fit | fit_special_reach | reach | {_PARAMETER} | Interval before the special point in which a jump may be seen.
Fit | fit_special_type | type | 1 | Type of the special point that was measured.
Optimum | value | parameters | {_PARAMETER} | Value of each parameter at the optimum.
Optimum | start | start | {_PARAMETER} | Value of each parameter at the start.
Optimum | path | path | {_PARAMETER} | Value of each parameter after each step.
Optimum | path_objective | objective | unit of the objective | Objective after each step.
Optimum | side | side | 1 | Side of each bound: least or greatest.
Optimum | seen | value of the bounded quantity | unit of each quantity | Value of each bounded quantity at the optimum.
Optimum | limits | bound | unit of each quantity | Value of each bound.
Optimum | multipliers | multiplier of the bound | 1 | Lagrange multiplier of each bound.
Optimum | over | parameters | 1 | Names of the parameters that vary.
Optimum | constraint | bounded quantity | 1 | Expressions that are bounded.
Curve | sheet | sheet | 1 | Index of the sheet.
Curve | jump | jump | 1 | Whether the motion jumps from this point.
Curve | regime | regime | 1 | Attractive or repulsive, by the sign of the virial.
Curve | harmonic_nm | harmonics | nm | Amplitude of the deflection at each harmonic of the first drive.
Curve | harmonic | harmonic | 1 | Order of the harmonic.
Verification | what | claim | 1 | What is claimed of the result.
Verification | said | value in the result | 1 | The claimed value, as JSON.
Verification | found | independent value | 1 | Value of the independent computation, or why there is none, as JSON.
Verification | difference | difference | unit of the claim | Distance of both values; NaN where they are no numbers.
Verification | allowed | allowed difference | unit of the claim | Largest difference with which both agree.
Verification | verdict | verdict | 1 | Whether both agree, differ, or were not checked.
Verification | place | place | 1 | Which solution of a curve it is; empty for a single one.
Calibration | psd | power spectral density | 1 | Power spectral density of the deflection.
Calibration | used | used | 1 | 1 where the bin was used, 0 where it was left out.
Calibration | value | value | unit of each value | Value of each fitted quantity.
Calibration | covariance | covariance | product of the values' units | Covariance of the fitted quantities.
Calibration | name | name | 1 | Names of the fitted quantities.
BimodalMap | status | status | 1 | 0 where the pixel was solved, else the index of a reason.
BimodalMap | solutions | solutions | 1 | How many solutions the equations of the pixel have.
BimodalMap | chi2 | chi square | 1 | Sum of squared residuals, in standard errors.
BimodalMap | derivatives | derivatives | unit of the result per unit of the reading | Derivative by each reading.
ReconstructedForce | inflection_D_nm | gap of the inflection | nm | Gap at which the force has an inflection.
ReconstructedForce | inflection_S | test of the inflection | 1 | Test number; below -1 some amplitudes are ill-posed.
ReconstructedForce | inflection_least_nm | least ill-posed amplitude | nm | Least of them; infinite where there is none.
ReconstructedForce | inflection_most_nm | greatest ill-posed amplitude | nm | Greatest of them; 0 where there is none.
ReconstructedForce | inflection_A_nm | amplitude at the inflection | nm | Amplitude of the data there.
ReconstructedForce | changed | changes by errors | nN | Change of the force by the error of each reading.
"""


def _read(text: str) -> list[list[str]]:
    return [[part.strip() for part in line.split("|")] for line in text.strip().splitlines()]


_COMMON = {name: _Words(*words) for name, *words in _read(_TABLE)}
_KINDS = {(kind, name): _Words(*words) for kind, name, *words in _read(_TABLES)}

# What stands before the name of a variable in a Dataset of several results: pattern, then its meaning.
_PREFIXES = (
    (re.compile(r"special_"), "special points"),
    (re.compile(r"start\."), "first doubling"),
    (re.compile(r"level(\d+)\."), "level {}"),
    (re.compile(r"branch(\d+)_"), "branch {}"),
    (re.compile(r"locus(\d+)_"), "locus {}"),
    (re.compile(r"solution(\d+)_"), "solution {}"),
    (re.compile(r"orbit_?(\d+)_"), "orbit {}"),
    (re.compile(r"(?:over|varied)_"), ""),
)


def described(
    written: Callable[Concatenate[Held, Options], xr.Dataset],
) -> Callable[Concatenate[Held, Options], xr.Dataset]:
    """Return a method `to_xarray` that gives each variable ``long_name``, ``units`` and ``description``.

    A variable that has one of them keeps it. Units are those of the definition, which names none: the unit of a state
    ``x`` is called ``unit of x``. Numbers without a dimension, names and flags have the unit ``1``.

    Parameters
    ----------
    written : callable
        A method of a `Result` that returns its Dataset.

    Returns
    -------
    callable
        The same method with a Dataset whose variables explain themselves.

    Examples
    --------
    >>> import saltus
    >>> rest = saltus.find_equilibrium(saltus.HybridSystem.smooth({"x": "r - x**2"}, {"r": 1.0}), x0=[1.0])
    >>> rest.to_xarray()["eigenvalue_re"].attrs["long_name"]
    'eigenvalue, real part'
    """

    @wraps(written)
    def to_xarray(self: Held, /, *args: Options.args, **options: Options.kwargs) -> xr.Dataset:
        dataset = written(self, *args, **options).copy()
        system, kind = getattr(self, "system", None), type(self).__name__
        for name, variable in dataset.variables.items():
            words = _named(variable.attrs) or _words_of(str(name), kind, system) or _axis(str(name), variable.dims)
            if words is None:
                continue
            units = {_TIME: _time(system), _RATE: f"per {_time(system)}"}.get(words.unit, words.unit)
            told = {"long_name": words.long_name, "units": units, "description": words.description}
            variable.attrs |= {key: value for key, value in told.items() if not variable.attrs.get(key)}
        return dataset

    return to_xarray


def _time(system: Any) -> str:
    return str(getattr(system, "time_unit", "unit of time"))


def _words_of(name: str, kind: str, system: Any) -> _Words | None:
    """Return what a variable is; None of one that nobody knows, as of a kind of result of another package."""
    if (kind, name) in _KINDS:
        return _KINDS[kind, name]
    if (own := _own(name, system)) is not None:
        return own
    if name in _COMMON:
        return _COMMON[name]
    for pattern, meaning in _PREFIXES:
        if (found := pattern.match(name)) and (rest := _words_of(name[found.end() :], kind, system)) is not None:
            long_name = f"{meaning.format(*found.groups())}: {rest.long_name}".removeprefix(": ")
            return rest._replace(long_name=long_name)
    if name.endswith("_count"):
        counted = name.removesuffix("_count")
        return _Words(f"count along {counted}", "1", f"How many values along {counted} each curve has.")
    return None


def _own(name: str, system: Any) -> _Words | None:
    """Return what a variable is that has the name of a state, an output or a parameter, or is an extreme of one."""
    states, outputs = getattr(system, "all_states", ()), getattr(system, "output_names", ())
    if name in states:
        return _Words(f"state {name}", f"unit of {name}", f"State {name} of the definition.")
    if name in outputs:
        return _Words(f"output {name}", f"unit of {name}", f"Output {name} of the definition.")
    if name in getattr(system, "parameter_names", ()):
        return _Words(f"parameter {name}", f"unit of {name}", f"Parameter {name} of the definition.")
    side, _, quantity = name.partition("_")
    if side in ("min", "max") and quantity in (*states, *outputs):
        word = {"min": "least", "max": "greatest"}[side]
        return _Words(f"{word} {quantity}", f"unit of {quantity}", f"The {word} value of {quantity} along the orbit.")
    return None


def _named(attributes: dict[Any, Any]) -> _Words | None:
    """Return what a variable is whose own attributes give its name in words, as those of readings do."""
    name = str(attributes.get("long_name", ""))
    return _Words(name, "1", f"{name[:1].upper()}{name[1:]}.") if name else None


def _axis(name: str, dims: tuple[Any, ...]) -> _Words | None:
    """Return what a coordinate along its own dimension, or of a section, is, as an axis of a grid."""
    if dims not in ((name,), ()):
        return None
    return _Words(f"coordinate {name}", f"unit of {name}", f"Coordinate {name} of the points.")
