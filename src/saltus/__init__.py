"""Dynamics of hybrid (piecewise-smooth) systems: orbits, stability, bifurcations, with tapping-mode AFM built in.

The public names stand in `__init__.pyi`, for editors and type checkers too; each is imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
