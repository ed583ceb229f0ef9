"""Distance curves and frequency curves of a model, from afar over all folds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from saltus import checks
from saltus.afm.curves.curve import Curve
from saltus.afm.curves.routes import Asked, Landing
from saltus.afm.curves.sheets import (
    CLEAR,
    CLEAR_NM,
    STEPS,
    UNSTABLE_FROM,
    Tracing,
    free_amplitude,
    free_orbit,
    reached,
    traced,
    whole,
)
from saltus.afm.models.modelling import frequency_of
from saltus.afm.models.parts import driven_mode, parts_of
from saltus.afm.models.readings import formulas
from saltus.afm.models.settling import periods_of_patience, settled, stays_in_contact
from saltus.afm.probe.units import check_changes, suffix
from saltus.continuation import Branch, StepControl, continue_orbit
from saltus.errors import ConvergenceError, InputError
from saltus.linear_threads import one_thread
from saltus.orbits import PeriodicOrbit, find_orbit
from saltus.progress import Reporter

if TYPE_CHECKING:
    from saltus.progress import Progress, Report
    from saltus.system import HybridSystem

_ROUNDING = 1e-12  # distance from the end of a way, over its begin, that is rounding


def distance_curve(
    system: HybridSystem,
    bounds: tuple[float, float],
    *,
    f_kHz: float | str | None = None,
    parameters: Mapping[str, float] | None = None,
    of: str | int = "deflection",
    steps: StepControl | None = None,
    starts: int = 0,
    progress: bool | Report = False,
) -> Curve:
    """Return the readings of a model along the distance ``Zc_nm``, from afar over all folds.

    The free motion far from the sample is followed towards it. Where the ways of an experiment jump to a motion that
    the branch does not have, this motion is followed as a further sheet. A curve whose way ends because the tip is
    pulled in and stays in contact says so.

    A sheet onto which no way jumps is found by motions that settle on it. They start from rest, with the free motion,
    in contact, and with the tip drawn back by half of the free amplitude. So it is at both ends of the range, in the
    middle, and at shares of the free amplitude. It is also at each eighth of the range where no motion is stable, and
    in narrower gaps. `starts` asks for more. What settles on no orbit of up to four periods is told by
    ``Curve.failures``. A sheet that no motion settles on is missed.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`.
    bounds : (float, float)
        The range of ``Zc_nm``, in nm; below 0 the cantilever is pressed into the sample.
    f_kHz : float or {"f0", "peak"}, optional
        Frequency of the first drive; by default the model's.
    parameters : mapping of str to float, optional
        Parameters that differ from the model's.
    of : {"deflection", "tip"} or int, optional
        Of what amplitude and lag are told, as `saltus.afm.observables` takes it.
    steps : StepControl, optional
        Sizes of steps and their limits.
    starts : int, optional
        Places, in equal distances, at each of which motions from 17 starts are followed as well, as
        `saltus afm observe` does. Each place takes as long as some curves: 0.2 to 4 s.
    progress : bool or callable, optional
        True for a bar on stderr, or a function of a `saltus.Progress`: orbits, and motions that are to settle.

    Returns
    -------
    Curve
        An interrupt (Ctrl-C) keeps the sheets so far; `Curve.failures` says so all along the range.

    Raises
    ------
    InputError
        The system is no such model, or a value is not allowed.
    ConvergenceError
        No motion is found at the upper end.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=20.0)
    >>> curve = distance_curve(system, (5.0, 14.0))
    >>> for jump in curve.jumps:
    ...     print(f"{jump.direction} at {jump.value:.4f} nm: {jump.before_nm:.3f} to {jump.after_nm:.3f} nm")
    approach at 9.8783 nm: 9.847 to 10.600 nm
    retract at 11.5029 nm: 11.986 to 11.188 nm
    >>> [round(afm.observables(orbit)["amplitude_nm"], 5) for orbit in curve.at(Zc_nm=10.0)]
    [10.7157, 10.04805, 9.89528]
    """
    formulas(system, of)  # raises where it cannot be told
    low, high = checks.interval("bounds", bounds)
    p = _at_frequency(system, system.resolve(parameters), f_kHz)
    check_changes(system.parameters, p | {"Zc_nm": max(low, high, key=abs)})
    checks.count("starts", starts, 0)
    with _working(system, progress) as told:
        first = from_afar(system, p, high, steps)
        return traced(Tracing("Zc_nm", (low, high), steps, told), first, of, starts)


def frequency_curve(
    system: HybridSystem,
    bounds: tuple[float, float],
    *,
    Zc_nm: float | None = None,
    parameters: Mapping[str, float] | None = None,
    of: str | int = "deflection",
    steps: StepControl | None = None,
    starts: int = 0,
    progress: bool | Report = False,
) -> Curve:
    """Return the readings of a model along the frequency ``f_kHz`` of its first drive, over all folds.

    The motion at the lower end of the range is reached from afar. Further sheets are found as `distance_curve` does. If
    the range is beside the resonance, the motion there is followed to the range. The way down begins where a tip
    at rest settles at the upper end.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`.
    bounds : (float, float)
        The range of ``f_kHz``, in kHz.
    Zc_nm : float, optional
        Distance, in nm; by default the model's.
    parameters : mapping of str to float, optional
        Parameters that differ from the model's.
    of, steps, starts, progress : optional
        As `distance_curve` takes them.

    Returns
    -------
    Curve
        An interrupt (Ctrl-C) keeps the sheets so far; `Curve.failures` says so all along the range.

    Raises
    ------
    InputError, ConvergenceError
        As for `distance_curve`; no motion is found at the lower end.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=8.5)
    >>> tune = frequency_curve(system, (298.0, 302.0))
    >>> [f"{jump.direction} at {jump.value:.4f} kHz" for jump in tune.jumps]
    ['down at 300.0501 kHz', 'down at 299.2872 kHz', 'up at 299.4915 kHz']
    """
    formulas(system, of)  # raises where it cannot be told
    low, high = checks.interval("bounds", bounds)
    p = system.resolve(parameters) | ({} if Zc_nm is None else {"Zc_nm": Zc_nm})
    p |= {"f_kHz": checks.positive("f_kHz", low, "kHz")}
    check_changes(system.parameters, p | {"f_kHz": high})
    checks.count("starts", starts, 0)
    with _working(system, progress) as told:
        first = from_afar(system, p, p["Zc_nm"], steps)
        return traced(Tracing("f_kHz", (low, high), steps, told), first, of, starts)


@contextmanager
def _working(system: HybridSystem, progress: bool | Report) -> Iterator[bool | Report]:
    """Give whom to tell of each orbit and motion; matrices of long periods have some hundred rows."""
    with Reporter(progress) as reporter, one_thread(len(system.states) * STEPS.pieces):

        def told(one: Progress) -> None:
            reporter.step(1, one.text, one.last)

        yield told if reporter.report is not None else False


def from_afar(
    system: HybridSystem, parameters: Mapping[str, float], Zc_nm: float, steps: StepControl | None
) -> tuple[PeriodicOrbit, ...]:
    """Return the motions at a distance to which the free motion afar leads, towards the sample.

    Raises
    ------
    ConvergenceError
        None is periodic there; the message says where.
    """
    try:
        return _from_afar(system, parameters, Zc_nm, steps)
    except ConvergenceError as error:
        place = f"Zc_nm = {Zc_nm:.9g}, f_kHz = {parameters['f_kHz']:.9g}"
        what = f"periodic motion with which the curve begins, at {place}"
        hint = "it may be quasi-periodic or chaotic there: begin the range elsewhere"
        raise ConvergenceError(what, error.residual, error.iterations, hint, unit=error.unit) from error


def _from_afar(
    system: HybridSystem, parameters: Mapping[str, float], Zc_nm: float, steps: StepControl | None
) -> tuple[PeriodicOrbit, ...]:
    steps = steps or STEPS
    patience = periods_of_patience(parameters)
    free = free_amplitude(system, parameters)
    if free == 0.0:
        sizes = {drive.size[0] + suffix(i): 0.0 for i, drive in enumerate(parts_of(system).drives.parts, 1)}
        raise InputError("drive", sizes, "above 0 for one drive at least", "without a drive nothing swings")
    far = max(Zc_nm, CLEAR * free, free + CLEAR_NM)
    start = free_orbit(system, dict(parameters) | {"Zc_nm": far}, free)
    if far == Zc_nm:
        return (start,)
    branch = whole(continue_orbit(start, "Zc_nm", (Zc_nm, far), steps=steps, directions="down", stop_at="SN"))
    folds = branch.special_points.of_type("SN")
    if folds:
        landing = Asked.beyond("Zc_nm", folds[0].orbit, Zc_nm - far).landing(folds[0].orbit)
        landed = landing.after if isinstance(landing, Landing) else None
        if landed is not None and stays_in_contact(landed):
            return (find_orbit(system, {**parameters, "Zc_nm": Zc_nm}, folds[0].orbit.x0, settle=patience),)
        if landed is not None and (found := _followed_down(landed, Zc_nm, far, steps)) is not None:
            return (found,)
        branch = whole(continue_orbit(start, "Zc_nm", (Zc_nm, far), steps=steps, directions="down"))
    # where it ends before, a hysteretic law is met: beyond, the motion is another
    return _at_distance(branch, Zc_nm) or (
        find_orbit(system, {**parameters, "Zc_nm": Zc_nm}, branch.solution(-1).x0, settle=patience),
    )


def _at_distance(branch: Branch, Zc_nm: float) -> tuple[PeriodicOrbit, ...]:
    """Return the orbits at a distance of a branch towards the sample; none where it ends before, but for rounding."""
    end = float(branch.values.min())
    if end - Zc_nm > _ROUNDING * float(branch.values.max()):
        return ()
    return branch.at(max(end, Zc_nm))


def _followed_down(orbit: PeriodicOrbit, Zc_nm: float, far: float, steps: StepControl) -> PeriodicOrbit | None:
    """Return the orbit at a distance to which a stable motion leads, towards the sample; None where it is not simple.

    Where the motion loses its stability, it settles at the distance itself.
    """
    if orbit.parameters["Zc_nm"] <= Zc_nm:
        return None
    way = whole(continue_orbit(orbit, "Zc_nm", (Zc_nm, far), steps=steps, directions="down", stop_at=UNSTABLE_FROM))
    if there := _at_distance(way, Zc_nm):
        return there[0]
    found = settled(orbit.system, {**orbit.parameters, "Zc_nm": Zc_nm}, way.solution(-1).x0)
    return None if isinstance(found, str) or found.form.turns > 1 else found


def approach_jumps(
    system: HybridSystem, parameters: Mapping[str, float], Zc_nm: tuple[float, float], steps: StepControl | None
) -> list[float]:
    """Return the distances at which an approach from afar jumps in a range, in nm."""
    how = Tracing("Zc_nm", Zc_nm, steps, progress=False)
    curve = reached(how, from_afar(system, parameters, Zc_nm[1], steps), "deflection")
    return [jump.value for jump in curve.ways[0].jumps if not (jump.window or stays_in_contact(jump.after))]


def _at_frequency(system: HybridSystem, p: dict[str, float], f_kHz: float | str | None) -> dict[str, float]:
    if f_kHz is None:
        return p
    end = suffix(driven_mode(system))
    return p | {"f_kHz": checks.positive("f_kHz", frequency_of(f_kHz, p[f"f0_kHz{end}"], p[f"Q{end}"]), "kHz")}
