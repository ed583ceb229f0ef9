"""Tapping-mode atomic force microscopy: docs/theory/afm.md has the equations.

The public names are listed in `__init__.pyi`; each is imported on first use.

Examples
--------
>>> from saltus import afm
>>> afm.table1().eta
6e-08
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
