"""Tapping mode as a hybrid system: flight over the sample and contact with it, driven by the cantilever's base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

from saltus import checks
from saltus.afm.paper.galerkin import Coefficients, coefficients
from saltus.afm.paper.sample import DMTSample
from saltus.afm.probe.cantilever import Cantilever
from saltus.afm.probe.slips import warn_of_slips
from saltus.errors import InputError
from saltus.system import HybridSystem, Mode, Transition

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["Setup", "StaticTerm", "tapping_mode"]

StaticTerm = Literal["consistent", "as-printed"]  # sign of the static term, see `tapping_mode`

# Drive and damping of the paper's figures, where they say nothing else; units as in `tapping_mode`.
OMEGA = 1.0  # frequency of the drive, in omega_1
YBAR = 0.108  # amplitude of the drive, in eta
D_ATT = 0.025  # damping without contact, in omega_1
D_REP = 4.0  # damping in contact, in omega_1


_MOST_MODES = 100  # modes of the cantilever, at most; the system's functions grow with their square


@dataclass(frozen=True)
class Setup:
    """A cantilever at rest above a sample.

    Parameters
    ----------
    cantilever : Cantilever
        The beam.
    sample : DMTSample
        The sample, and the tip's radius.
    eta : float, in m
        Gap between tip and sample at rest, larger than the gap `sample.a0` at which contact begins.

    Raises
    ------
    InputError
        `eta` is not a finite number above `sample.a0`, or an argument is of another kind.

    Warns
    -----
    RuntimeWarning
        `eta` looks as one in nm.

    Examples
    --------
    >>> from saltus.afm import Cantilever, DMTSample
    >>> lever = Cantilever.from_measured(k=2.0, f0=70e3, Q=200.0)
    >>> setup = Setup(lever, DMTSample(R=20e-9, H=1e-19, E_star=2e9, a0=2e-10), eta=60e-9)
    >>> print(f"{setup.eta * 1e9:.0f} nm")
    60 nm
    """

    cantilever: Cantilever
    sample: DMTSample
    eta: float

    def __post_init__(self) -> None:
        checks.instance("cantilever", self.cantilever, Cantilever)
        checks.instance("sample", self.sample, DMTSample)
        object.__setattr__(self, "eta", checks.positive("eta", self.eta, "m"))
        warn_of_slips(eta=self.eta)
        if self.eta <= self.sample.a0:
            raise InputError("eta", self.eta, f"larger than a0 = {self.sample.a0!r}, where contact begins (in m)")


def tapping_mode(
    setup: Setup,
    modes: int = 1,
    *,
    parameters: Mapping[str, float] | None = None,
    static_term: StaticTerm = "consistent",
) -> HybridSystem:
    """Return tapping mode with `modes` modes of the cantilever as a hybrid system.

    States are the modes' displacements and velocities at the tip, ``(q1, ..., qn, v1, ..., vn)``, in units of the rest
    gap `eta` and of time ``1 / omega_1``. The phase `theta` is that of the drive. Hybrid modes are ``"flight"`` (gap
    above `a0`) and ``"contact"``; transitions are ``"touch"`` and ``"release"``. Outputs are the gap ``z`` in units of
    `eta`, and its rate ``v``. ``force`` is the force on the tip in units of ``k eta``, positive where it repels.
    Regimes are ``"attractive"`` (no contact) and ``"repulsive"``. docs/theory/afm.md derives the equations.

    Parameters
    ----------
    setup : Setup
        Cantilever, sample, and the gap between them.
    modes : int
        Number of modes of the cantilever, 1 or more.
    parameters : mapping of str to float, optional
        Values other than the defaults below. ``D_att`` and ``D_rep`` set all modes at once.
    static_term : {"consistent", "as-printed"}
        Sign of the static deflection's force. Eq. (4) prints ``-C_i``, with which rest is no equilibrium; the
        consistent sign is ``+C_i``. For the paper's set-up results differ by about 1e-5.

    Returns
    -------
    HybridSystem
        With the parameters

        ==================  ============================  =========================  =================
        name                default                       unit                       allowed
        ==================  ============================  =========================  =================
        ``Omega``           1                             omega_1                    > 0
        ``ybar``            0.108                         eta                        any
        ``D_att_i``         1/Q if measured, else 0.025   omega_1                    >= 0
        ``D_rep_i``         4                             omega_1                    >= 0
        ``k``               of the cantilever             N/m                        > 0
        ``eta, a0, R``      of the set-up                 m                          > 0
        ``E_star``          of the set-up                 Pa                         >= 0
        ``H``               of the set-up                 J                          >= 0
        ==================  ============================  =========================  =================

        Drive and damping alone are dimensionless: a change of `eta` at fixed ``ybar`` changes the base's amplitude in
        metres too. The force in flight is singular at ``z = 0``, so the domain of flight is ``z > 0``; contact has
        none. ``Q`` and the ratios of frequencies are the cantilever's, and no parameters.

    Raises
    ------
    InputError
        `modes`, `static_term` or a parameter is not allowed, or a parameter has no such name.

    Notes
    -----
    A measured `Q` sets ``D_att_i = 1/Q`` for every mode: a drag in proportion to the beam's velocity, uniform along it
    (Eq. (8) with one coefficient). Mode i then has the quality factor ``Q omega_i / omega_1``. Where `Q_2` was measured
    as well, set ``D_att_2`` to ``(omega_2 / omega_1) / Q_2``, and so on.

    References
    ----------
    ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Eqs. (4)-(15). Departs from it in the sign of the
    static term (above) and in G (`saltus.afm.paper.galerkin.coefficients`).

    Examples
    --------
    >>> from saltus.afm import table1
    >>> system = tapping_mode(table1(), modes=2, parameters={"Omega": 1.15})
    >>> system.states, system.mode_names, system.transition_names, system.output_names
    (('q1', 'q2', 'v1', 'v2'), ('flight', 'contact'), ('touch', 'release'), ('z', 'v', 'force'))
    >>> system.resolve({"D_rep": 2.0})["D_rep_2"]
    2.0
    """
    checks.instance("setup", setup, Setup)
    n = checks.count("modes", modes, 1, _MOST_MODES)
    checks.chosen("static_term", static_term, get_args(StaticTerm))
    parameters = checks.mapping("parameters", parameters, "names to numbers, or None")
    definition = _definition(setup, n, static_term)
    system = HybridSystem(**definition)
    if not parameters:
        return system
    return HybridSystem(**(definition | {"parameters": system.resolve(parameters)}))


def _definition(setup: Setup, n: int, static_term: StaticTerm) -> dict[str, Any]:
    """Return the arguments of `HybridSystem` as texts: a system whose code is in the cache then needs no SymPy."""
    numbers = coefficients(setup.cantilever, setup.sample, setup.eta, n)
    each = range(1, n + 1)
    gap = f"1 - {' - '.join(f'q{i}' for i in each)} - ybar*sin(theta)"
    z = f"({gap})"
    rate = f"-{' - '.join(f'v{i}' for i in each)} - ybar*Omega*cos(theta)"
    C = "(-H*R/(6*k*eta**3))"
    G = "(4/3*E_star*sqrt(R*eta)/k)"
    force = {"flight": f"{C}/{z}**2", "contact": f"{C}/(a0/eta)**2 + {G}*(a0/eta - {z})**(3/2)"}
    static = C if static_term == "consistent" else f"-{C}"
    damping = {"flight": "D_att", "contact": "D_rep"}
    fields = {mode: _field(numbers, f"{static} - ({force[mode]})", damping[mode]) for mode in force}
    D_att = setup.cantilever.damping
    return {
        "states": (*(f"q{i}" for i in each), *(f"v{i}" for i in each)),
        "parameters": {
            "Omega": OMEGA,
            "ybar": YBAR,
            **{f"D_att_{i}": D_ATT if D_att is None else D_att for i in each},
            **{f"D_rep_{i}": D_REP for i in each},
            "k": numbers.k,
            "eta": setup.eta,
            "a0": setup.sample.a0,
            "E_star": setup.sample.E_star,
            "R": setup.sample.R,
            "H": setup.sample.H,
        },
        "modes": {"flight": Mode(fields["flight"], domain=gap), "contact": Mode(fields["contact"])},
        "transitions": (
            Transition("flight", "contact", event=f"{gap} - a0/eta", direction=-1, name="touch"),
            Transition("contact", "flight", event=f"{gap} - a0/eta", direction=1, name="release"),
        ),
        "phase": ("theta", "Omega"),
        "outputs": {"z": gap, "v": rate, "force": force},
        "groups": {name: tuple(f"{name}_{i}" for i in each) for name in damping.values()},
        "positive": ("Omega", "k", "eta", "a0", "R"),
        "parameter_bounds": {
            **{f"{name}_{i}": (0.0, float("inf")) for name in damping.values() for i in each},
            "E_star": (0.0, float("inf")),
            "H": (0.0, float("inf")),
        },
        "regimes": {"attractive": ("flight",), "repulsive": ("flight", "contact")},
        "name": f"tapping-mode AFM, {n} {'mode' if n == 1 else 'modes'}",
    }


def _field(numbers: Coefficients, forces: str, damping: str) -> dict[str, str]:
    """Return the texts of Eq. (12) in one hybrid mode, whose damping is named `damping`."""
    positions, velocities = {}, {}
    for i, (K, B) in enumerate(zip(numbers.K.tolist(), numbers.B.tolist(), strict=True), start=1):
        drive = f"{'-' if B < 0 else '+'} {abs(B)!r}*Omega**2*ybar*sin(theta)"
        spring = "q1" if i == 1 else f"{K!r}*q{i}"
        positions[f"q{i}"] = f"v{i}"
        velocities[f"v{i}"] = f"-{damping}_{i}*v{i} - {spring} + {forces} {drive}"
    return positions | velocities
