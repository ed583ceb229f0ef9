"""What kernels need of a map at given parameters, and the errors of motions that end early."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.errors import MapDivergenceError, SaltusError
from saltus.flow.starting import negative_root
from saltus.scales import STATE_ROUNDED
from saltus.system.compiled import FUNCTIONS
from saltus.system.tiling import pieces_error

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.maps import Map

__all__ = ["LIMIT", "STRETCH", "MapCode", "code_of", "error_of"]

STRETCH = 2_000_000  # iterations between two looks for an interrupt
LIMIT = 1e100  # modulus of a component beyond which a motion has diverged

_CALLED = ("field", "vary", "guard")  # functions called by kernels, in the order of `MapCode.functions`


class MapCode(NamedTuple):
    """What kernels need of a map at given parameters."""

    # shape (4,): addresses of the image, of its derivative along a frame, and of the conditions; 1 where it has roots
    functions: NDArray[np.int64]
    guards: NDArray[np.int64]  # shape (pieces + 1,): `Map.guards`
    p: NDArray[np.float64]  # parameters, with the constants behind them
    circles: NDArray[np.int64]  # shape (angles,): places of the angles among the states


def code_of(system: Map, p: NDArray[np.float64]) -> MapCode:
    """Return what kernels need of a map at parameters as `Map.parameter_vector` returns them."""
    addresses = system.compiled.addresses[[FUNCTIONS.index(name) for name in _CALLED]]
    addresses = np.append(addresses, np.int64(system.compiled.under_roots))
    return MapCode(addresses, system.guards, system.compiled.extended(p), system.angle_places)


def error_of(
    status: int, step: int, x: NDArray[np.float64], system: Map, p: NDArray[np.float64], limit: float = LIMIT
) -> SaltusError:
    """Return the error of a motion that ended early, by the status of a kernel."""
    from saltus.maps.kernels.steps import NOWHERE, beside

    if status == NOWHERE:
        piece = beside(x.copy(), code_of(system, p), np.empty_like(x))
        if piece >= 0 and (told := negative_root(system, piece, x, p, STATE_ROUNDED * np.abs(x))):
            return MapDivergenceError(step, x.tolist(), told)
        return pieces_error(system, x, p)
    reason = "a component is no number" if np.isnan(x).any() else f"a component is beyond {limit:.3g}"
    return MapDivergenceError(step, x.tolist(), reason)
