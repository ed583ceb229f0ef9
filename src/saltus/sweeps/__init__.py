"""Sweeps of a parameter by simulation, and Lyapunov exponents."""

from saltus.flow.recurring.criteria import Criteria
from saltus.flow.variational import Average
from saltus.sweeps.brute_force import run_sweep
from saltus.sweeps.lyapunov import LyapunovSpectrum, lyapunov_spectrum
from saltus.sweeps.options import SweepOptions
from saltus.sweeps.section import Section
from saltus.sweeps.sweep import Sweep, SweptValue

__all__ = [
    "Average",
    "Criteria",
    "LyapunovSpectrum",
    "Section",
    "Sweep",
    "SweepOptions",
    "SweptValue",
    "lyapunov_spectrum",
    "run_sweep",
]
