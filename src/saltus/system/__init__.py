"""The definition of a hybrid system, its derivatives, and the code generated from it."""

from saltus.system.hybrid import HybridSystem, Mode, Transition

__all__ = ["HybridSystem", "Mode", "Transition"]
