"""What is to be told of each pixel of a map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Reasons"]


class Reasons:
    """Texts, and the number of one at each pixel: the last that was told of it."""

    def __init__(self, pixels: int) -> None:
        self.status, self.texts = np.zeros(pixels, dtype=np.int64), [""]

    def tell(self, where: NDArray[np.bool_] | NDArray[np.intp], text: str) -> None:
        """Tell something of some pixels, which a mask or numbers name."""
        if not len(self.status[where]):
            return
        self.status[where] = len(self.texts)
        self.texts.append(text)
