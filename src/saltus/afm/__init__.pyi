"""The public names; `__init__.py` reads where each is, and imports it on first use."""

from .bimodal.bimodal_map import BimodalMap as BimodalMap
from .bimodal.inversion import bimodal_map as bimodal_map
from .bimodal.operating_points import bimodal as bimodal
from .bimodal.operation import AM as AM, FM as FM
from .calibration.calibrating import CalibrationOptions as CalibrationOptions, calibrate as calibrate
from .calibration.calibration import Calibration as Calibration
from .calibration.spectra import read_spectrum as read_spectrum
from .calibration.stiffness import sader_stiffness as sader_stiffness
from .curves.bistable_region import Bistability as Bistability
from .curves.curve import Curve as Curve
from .curves.curves import distance_curve as distance_curve, frequency_curve as frequency_curve
from .curves.fold_search import bistability as bistability, tip_radius as tip_radius
from .curves.identification import fit as fit
from .files.columns import FileContents as FileContents
from .files.instrument_files import instrument_file as instrument_file
from .files.measured_curves import read_curve as read_curve
from .fm.amplitude_loop import feedback as feedback
from .fm.frequency_modulation import frequency_shift as frequency_shift
from .fm.self_excitation import self_excited as self_excited
from .fm.shift_curve import FrequencyShift as FrequencyShift
from .laws.adhesive import JKR as JKR, Neck as Neck, Schwarz as Schwarz
from .laws.contact import DMT as DMT, Hertz as Hertz, VanDerWaals as VanDerWaals
from .laws.fields import (
    Electrostatic as Electrostatic,
    ElectrostaticTip as ElectrostaticTip,
    MagneticDipoles as MagneticDipoles,
    Meniscus as Meniscus,
)
from .laws.law import Law as Law
from .laws.long_range import DLVO as DLVO, Hydration as Hydration, LennardJones as LennardJones, Morse as Morse
from .laws.maxwell import GeneralisedMaxwell as GeneralisedMaxwell
from .laws.regions import Crossing as Crossing, Region as Region
from .laws.thin import ThinCone as ThinCone, ThinPunch as ThinPunch, ThinSphere as ThinSphere
from .laws.tips import Cone as Cone, FlatPunch as FlatPunch, SphereCone as SphereCone
from .laws.viscous import SLS as SLS, Dashpot as Dashpot, KelvinVoigt as KelvinVoigt
from .models.attractor_regimes import name_by_regime as name_by_regime
from .models.modelling import model as model
from .models.orbit_observables import observables as observables
from .models.parts import parts_of as parts_of
from .paper.regimes import settled_orbit as settled_orbit
from .paper.sample import DMTSample as DMTSample, tip_force as tip_force
from .paper.table1 import table1 as table1
from .paper.tapping import Setup as Setup, tapping_mode as tapping_mode
from .pictures.animation import animate as animate
from .probe.cantilever import Cantilever as Cantilever
from .probe.drive import Drive as Drive
from .probe.fluid import Fluid as Fluid, FluidMode as FluidMode, fluid_modes as fluid_modes, immersed as immersed
from .probe.hydrodynamic import hydrodynamic_function as hydrodynamic_function
from .probe.probe import Probe as Probe
from .reconstruction.force import ReconstructedForce as ReconstructedForce
from .reconstruction.law_fit import LawFit as LawFit
from .reconstruction.reconstruction import reconstruct_force as reconstruct_force
