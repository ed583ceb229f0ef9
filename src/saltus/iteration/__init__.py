"""One motion of a map: its iterates, and the growth of perturbations along it."""

from saltus.system.cache import let_numba_cache

let_numba_cache()

from saltus.iteration.iterates import Iterates, iterate  # noqa: E402

__all__ = ["Iterates", "iterate"]
