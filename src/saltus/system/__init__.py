"""The definition of a hybrid system or a map, its derivatives, and the code generated from it."""

from saltus.system.filippov import filippov
from saltus.system.hybrid import HybridSystem, Mode, Transition
from saltus.system.maps import Map, Piece

__all__ = ["HybridSystem", "Map", "Mode", "Piece", "Transition", "filippov"]
