"""The public names; `__init__.py` reads where each is, and imports it on first use."""

from .amplitude_loop import feedback as feedback
from .animation import animate as animate
from .attractor_regimes import name_by_regime as name_by_regime
from .bistable_region import Bistability as Bistability
from .cantilever import Cantilever as Cantilever
from .curve import Curve as Curve
from .curves import distance_curve as distance_curve, frequency_curve as frequency_curve
from .drive import Drive as Drive
from .fold_search import bistability as bistability, tip_radius as tip_radius
from .frequency_modulation import frequency_shift as frequency_shift
from .identification import fit as fit
from .laws.adhesive import JKR as JKR, Neck as Neck, Schwarz as Schwarz
from .laws.contact import DMT as DMT, Hertz as Hertz, VanDerWaals as VanDerWaals
from .laws.law import Law as Law
from .laws.long_range import DLVO as DLVO, Hydration as Hydration, LennardJones as LennardJones, Morse as Morse
from .laws.regions import Crossing as Crossing, Region as Region
from .laws.viscous import SLS as SLS, Dashpot as Dashpot, KelvinVoigt as KelvinVoigt
from .measured_curves import read_curve as read_curve
from .modelling import model as model
from .orbit_observables import observables as observables
from .paper import table1 as table1
from .probe import Probe as Probe
from .regimes import settled_orbit as settled_orbit
from .sample import DMTSample as DMTSample, tip_force as tip_force
from .self_excitation import self_excited as self_excited
from .shift_curve import FrequencyShift as FrequencyShift
from .tapping import Setup as Setup, tapping_mode as tapping_mode
