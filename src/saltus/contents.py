"""The contents of a result's file, each part checked when it is taken.

A file may be damaged, or made to do harm. All data from outside come in here, where shapes, kinds, ranges and names are
checked. The code that uses the data need not check them again.
"""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Contents", "as_json", "checked_texts", "complex_of"]

_KINDS = {float: "fiu", int: "iu", bool: "biu", str: "OUS"}  # NumPy's kinds of data that stand for each of Python's

_SHOWN = 60  # characters of a value that a message shows


class Contents:
    """Variables and attributes of a Dataset, each checked when it is taken.

    Parameters
    ----------
    dataset : xarray.Dataset
        As `Result.to_xarray` makes it.

    Examples
    --------
    >>> import xarray as xr
    >>> held = Contents(xr.Dataset({"mode": ("step", [0, 7])}, attrs={"t_end": 2.0}))
    >>> held.number("t_end", least=0.0)
    2.0
    >>> held.array("mode", ("step",), int, least=0, most=1)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: variable 'mode' = 7: must be between 0 and 1
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self.dataset = dataset

    def expect(self, **sizes: int) -> None:
        """Raise `InputError` where a dimension has another size than is named, or is not there."""
        for dim, size in sizes.items():
            if self.dataset.sizes.get(dim) != size:
                raise InputError(f"dimension {dim!r}", self.dataset.sizes.get(dim), f"of size {size}")

    def size(self, dim: str, least: int = 0) -> int:
        """Return the size of a dimension."""
        found = self.dataset.sizes.get(dim)
        if found is None or found < least:
            raise InputError(f"dimension {dim!r}", found, f"of size {least} or more")
        return int(found)

    def array(
        self,
        name: str,
        dims: tuple[str, ...],
        kind: type = float,
        *,
        least: float = -math.inf,
        most: float = math.inf,
        finite: bool = True,
    ) -> NDArray[Any]:
        """Return a variable as an array of its kind.

        Parameters
        ----------
        name : str
            The variable.
        dims : tuple of str
            Its dimensions.
        kind : {float, int, bool, str}
            What its entries are.
        least, most : float, optional
            Bounds of all entries that are numbers.
        finite : bool, optional
            Whether they must be finite; if not, they may be infinite or no numbers whatever the bounds.

        Raises
        ------
        InputError
            There is no such variable, or it is another.
        """
        where = f"variable {name!r}"
        if name not in self.dataset.variables:
            raise InputError(where, None, "in the file")
        variable = self.dataset[name]
        if variable.dims != dims:
            raise InputError(f"{where}'s dimensions", variable.dims, str(dims))
        if variable.dtype.kind not in _KINDS[kind] and variable.size:  # an empty one has any kind when it is read
            raise InputError(f"{where}'s kind", str(variable.dtype), f"that of {kind.__name__}")
        values: NDArray[Any] = variable.to_numpy()
        if kind is str:
            return self._texts(values, where)
        if kind is bool:
            least, most = 0, 1
        known = values if kind is not float or finite else values[np.isfinite(values)]
        wrong = known[~((known >= least) & (known <= most) & np.isfinite(known))]
        if wrong.size:
            raise InputError(where, wrong.flat[0].item(), _between(least, most))
        return values.astype({float: np.float64, int: np.int64, bool: np.bool_}[kind])

    def first_finite(self, name: str, dims: tuple[str, ...], count: int) -> NDArray[np.float64]:
        """Return numbers of which the first `count` along the last dimension are finite, as extremes of states are."""
        values = self.array(name, dims, finite=False)
        wrong = values[..., :count][~np.isfinite(values[..., :count])]
        if wrong.size:
            raise InputError(f"variable {name!r}", float(wrong[0]), "finite for each state")
        return values

    def _texts(self, values: NDArray[Any], where: str) -> NDArray[Any]:
        for value in values.flat:
            if not isinstance(value, str):
                raise InputError(where, _shown(value), "texts")
        return values.astype(object)

    def names(self, name: str, wanted: Sequence[str]) -> None:
        """Raise `InputError` where a variable does not name its own dimension as is wanted."""
        found = tuple(map(str, self.array(name, (name,), str).tolist()))
        if found != tuple(wanted):
            raise InputError(f"variable {name!r}", _shown(list(found)), f"{list(wanted)}")

    def number(self, name: str, least: float = -math.inf, most: float = math.inf, *, finite: bool = True) -> float:
        """Return an attribute that is a number, as `array` checks it."""
        value = np.asarray(self._attribute(name))
        where = f"attribute {name!r}"
        if value.size != 1 or value.dtype.kind not in "fiub":
            raise InputError(where, _shown(self._attribute(name)), "a number")
        number = float(value.item())
        if (finite or math.isfinite(number)) and not (least <= number <= most and math.isfinite(number)):
            raise InputError(where, number, _between(least, most))
        return number

    def count(self, name: str, least: int = 0, most: float = 2**53) -> int:
        """Return an attribute that is a whole number."""
        number = self.number(name, least, most)
        if not number.is_integer():
            raise InputError(f"attribute {name!r}", number, "a whole number")
        return int(number)

    def text(self, name: str) -> str:
        """Return an attribute that is a text."""
        value = self._attribute(name)
        if not isinstance(value, str):
            raise InputError(f"attribute {name!r}", _shown(value), "a text")
        return value

    def json(self, name: str, *kinds: type) -> Any:
        """Return what an attribute says as JSON; `kinds` are those that it may be."""
        return as_json(self.text(name), f"attribute {name!r}", *kinds)

    def texts(self, name: str) -> list[str]:
        """Return an attribute that is a list of texts as JSON."""
        return checked_texts(self.json(name, list), f"attribute {name!r}")

    def _attribute(self, name: str) -> Any:
        if name not in self.dataset.attrs:
            raise InputError(f"attribute {name!r}", None, "in the file")
        return self.dataset.attrs[name]


def as_json(text: str, where: str, *kinds: type) -> Any:
    """Return what a text says as JSON; raise `InputError` where it is none, or of none of the kinds."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(where, _shown(text), "JSON", f"{error}") from error
    if kinds and not isinstance(value, kinds):
        raise InputError(where, _shown(value), "JSON of " + " or ".join(kind.__name__ for kind in kinds))
    return value


def checked_texts(value: Any, where: str) -> list[str]:
    """Return a list of texts; raise `InputError` where it is another thing."""
    if not isinstance(value, list | tuple) or not all(isinstance(part, str) for part in value):
        raise InputError(where, _shown(value), "a list of texts")
    return list(value)


def _shown(value: Any) -> str:
    shown = value if isinstance(value, str) else repr(value)
    return shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}..."


def _between(least: float, most: float) -> str:
    if math.isinf(least) and math.isinf(most):
        return "finite"
    if math.isinf(most):
        return f"finite and >= {least:g}"
    return f"<= {most:g}" if math.isinf(least) else f"between {least:g} and {most:g}"


def complex_of(re: NDArray[np.float64], im: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return re + i im, exact also for infinite parts."""
    out = np.empty(re.shape, dtype=np.complex128)
    out.real, out.imag = re, im
    return out
