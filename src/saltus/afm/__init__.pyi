"""The public names; `__init__.py` reads where each is, and imports it on first use."""

from .animation import animate as animate
from .cantilever import Cantilever as Cantilever
from .paper import table1 as table1
from .regimes import settled_orbit as settled_orbit
from .sample import DMTSample as DMTSample, tip_force as tip_force
from .tapping import Setup as Setup, tapping_mode as tapping_mode
