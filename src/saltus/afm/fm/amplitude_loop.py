"""The amplitude loop: a lock-in reads the amplitude, and an integrator moves the base until it has its set value."""

from __future__ import annotations

from saltus.afm.models.parts import check_model
from saltus.afm.models.readings import turns_of
from saltus.afm.probe.units import checked
from saltus.errors import InputError
from saltus.system import HybridSystem

__all__ = ["feedback"]

_WAVES = {"in_phase_nm": "cos", "quadrature_nm": "sin"}  # the lock-in's states, and what it multiplies by


def feedback(
    system: HybridSystem, setpoint_nm: float, *, Ki_1_ms: float, tau_us: float, check: bool = True
) -> HybridSystem:
    """Return a model in which a loop holds the amplitude by moving the base, as a hybrid system.

    A lock-in multiplies the deflection z by cosine and sine of the first drive's phase. A low-pass of first order
    smooths both, to X and Y: ``tau_us X' = 2 z cos(theta) - X``, and likewise Y. The distance integrates what the
    amplitude lacks: ``Zc_nm' = Ki (setpoint_nm - sqrt(X**2 + Y**2))``.

    The distance ``Zc_nm`` is a state in place of a parameter. Orbits of the loop are those of the distance curve at the
    set amplitude. They differ by what the low-pass lets through at twice the drive's frequency, which makes the
    amplitude smaller by about the share ``1/(4 omega tau)**2``. Laws feel the tip's velocity, not that of the base,
    which is far slower.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`.
    setpoint_nm : float
        The set amplitude of the deflection, in nm.
    Ki_1_ms : float
        Gain of the integrator: nm per ms for each nm that the amplitude lacks.
    tau_us : float
        Time constant of the lock-in's low-pass, in us.
    check : bool, optional
        Whether implausible values are refused.

    Returns
    -------
    HybridSystem
        States of the model, then ``in_phase_nm``, ``quadrature_nm``, ``Zc_nm``. Its parameters are those of the model
        without ``Zc_nm``, and ``setpoint_nm``, ``Ki_1_ms``, ``tau_us``.

    Raises
    ------
    InputError
        The system is no such model, or a value is not allowed or, with `check`, not plausible.

    References
    ----------
    J. Kokavecz, O. Marti, P. Heszler, A. Mechler, Phys. Rev. B 73, 155403 (2006): imaging bandwidth of the amplitude
    loop.

    Examples
    --------
    Before the probe moves, the amplitude is too small, and the base is withdrawn:

    >>> from saltus import afm, simulate
    >>> probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=20.0, R_nm=10.0)
    >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=9.0)
    >>> loop = feedback(system, 8.0, Ki_1_ms=1.0, tau_us=100.0)
    >>> loop.states
    ('z1_nm', 'v1_nm_us', 'in_phase_nm', 'quadrature_nm', 'Zc_nm')
    >>> motion = simulate(loop, x0=[0.0, 0.0, 0.0, 0.0, 20.0], t_end=20000.0)
    >>> print(f"{motion(20000.0)[4]:.3f}")
    7.098
    """
    check_model(system, "system")
    if "Zc_nm" not in system.parameter_names:
        raise InputError("system", system.name, "a model whose distance Zc_nm is a parameter")
    own = {"setpoint_nm": setpoint_nm, "Ki_1_ms": Ki_1_ms, "tau_us": tau_us}
    values = {name: checked(name, value, plausible=check) for name, value in own.items()}
    definition, turns = system.definition(), turns_of(system)
    angle = "theta" if turns == 1 else f"{turns}*theta"
    for key, mode in definition["modes"].items():
        seen = definition["outputs"]["deflection_nm"][key]
        mode["field"] |= {
            **{name: f"(2*({seen})*{wave}({angle}) - {name})/tau_us" for name, wave in _WAVES.items()},
            "Zc_nm": "0.001*Ki_1_ms*(setpoint_nm - sqrt(in_phase_nm**2 + quadrature_nm**2))",
        }
    kept = {name: value for name, value in definition["parameters"].items() if name != "Zc_nm"}
    changed = {
        "name": f"{definition['name']}, amplitude loop",
        "states": [*definition["states"], *_WAVES, "Zc_nm"],
        "parameters": kept | values,
        "positive": [*definition["positive"], "setpoint_nm", "tau_us"],
        "parameter_bounds": definition["parameter_bounds"] | {"Ki_1_ms": [0.0, float("inf")]},
    }
    return HybridSystem.from_definition(definition | changed)
