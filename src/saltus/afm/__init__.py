"""Floor 6: tapping-mode atomic force microscopy.

The public names stand in `__init__.pyi`, for editors and type checkers too; each is imported on first use.

Examples
--------
>>> from saltus import afm
>>> afm.table1().eta
6e-08
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
