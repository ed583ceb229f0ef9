"""Options of computations; the names stand in `options.pyi`, and each is imported on first use."""

from saltus.doors import opened

__getattr__, __dir__, __all__ = opened(__name__, __file__)
