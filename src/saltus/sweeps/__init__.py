"""Floor 4: sweeps of a parameter by simulation, and Lyapunov exponents."""

from saltus.flow.motion_kind import Criteria
from saltus.sweeps.brute_force import run_sweep
from saltus.sweeps.lyapunov import LyapunovSpectrum, lyapunov_spectrum
from saltus.sweeps.section import Section
from saltus.sweeps.sweep import Sweep, SweptValue

__all__ = ["Criteria", "LyapunovSpectrum", "Section", "Sweep", "SweptValue", "lyapunov_spectrum", "run_sweep"]
