"""Configuration files of `saltus basins`, in TOML: a system, its parameters, a grid and options."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, Strict, ValidationError, model_validator

from saltus import checks
from saltus.basins.attractors.found import renamed
from saltus.basins.map.grid import Plane
from saltus.basins.map.options import TOLERANCES
from saltus.config_files import attribute_of, called, read_toml
from saltus.errors import InputError, nearest
from saltus.system import HybridSystem, Map

__all__ = ["AttractorTable", "Config", "EngineOptions", "PlaneTable", "read_config", "system_of"]

_STRICT = ConfigDict(extra="forbid", frozen=True)  # of tables: no unknown keys

_Number: TypeAlias = Annotated[float, Strict()]  # neither text nor boolean
_Count: TypeAlias = Annotated[int, Strict()]  # neither text nor boolean nor fraction


class EngineOptions(BaseModel):
    """The table ``[engine]``: engine and accuracy; absent entries have the defaults of `BasinOptions`."""

    model_config = _STRICT

    name: Literal["cpu", "cuda", "dask"] = "cpu"
    """What computes."""
    tolerance: _Number | None = Field(default=None, ge=TOLERANCES[0], le=TOLERANCES[1])
    """Of a step."""
    longest: _Count | None = Field(default=None, ge=1)
    """Periods after which a motion is undecided."""


class AttractorTable(BaseModel):
    """The table ``[attractors]``: arguments of the search; absent entries have the defaults of `find_attractors`."""

    model_config = _STRICT

    region: dict[str, Any] | None = None
    """For each state the interval or the value at which motions start; by default the box of the grid."""
    options: dict[str, Any] | None = None
    """Arguments of `saltus.options.AttractorOptions`: how many motions start, how long they are followed, and so on."""

    @model_validator(mode="before")
    @classmethod
    def _renamed(cls, given: Any) -> Any:
        tables = isinstance(given, Mapping) and [given.get(key, {}) for key in ("search", "options")]
        return renamed(given) if tables and all(isinstance(table, Mapping) for table in tables) else given


class PlaneTable(BaseModel):
    """The table ``[plane]``: a plane of any direction, `saltus.basins.Plane`, in place of a grid."""

    model_config = _STRICT

    origin: dict[str, _Number]
    u: dict[str, _Number]
    v: dict[str, _Number]
    extents: tuple[tuple[_Number, _Number], tuple[_Number, _Number]]
    counts: tuple[_Count, _Count]
    names: tuple[str, str] = ("u", "v")


class Config(BaseModel):
    """Content of a configuration; `read_config` reads one."""

    model_config = _STRICT

    system: str
    """A known name, or ``module:attribute``."""
    model: dict[str, Any] = Field(default_factory=dict)
    """Arguments of what makes the system."""
    parameters: dict[str, _Number] = Field(default_factory=dict)
    """Parameters that differ from the system's defaults."""
    interval: _Number | None = Field(default=None, gt=0.0)
    """Time between two looks at a system without a phase."""
    grid: dict[str, Any] | None = None
    """For each state ``[low, high, count]`` or the value it is frozen at."""
    plane: PlaneTable | None = None
    """In the place of `grid`."""
    engine: EngineOptions = EngineOptions()
    """What computes, and how well."""
    attractors: AttractorTable = AttractorTable()
    """How attractors are looked for."""

    @property
    def cells(self) -> dict[str, Any] | Plane:
        """The grid as `saltus.map_basins` takes it."""
        if self.plane is not None:
            return Plane(**{name: getattr(self.plane, name) for name in PlaneTable.model_fields})
        return dict(self.grid or {})


def read_config(path: Path) -> Config:
    r"""Return the configuration in a TOML file.

    Parameters
    ----------
    path : Path
        The file. ``system`` is needed, and one of the tables ``[grid]`` and ``[plane]``; see `Config`.

    Raises
    ------
    InputError
        There is no such file, or it is no TOML. An entry is unknown, missing or of another kind; the error names it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "config.toml"
    ...     _ = path.write_text('system = "tapping_mode"\n[grid]\nq1 = [-5, 5, 100]\nv1 = 0.5\n')
    ...     read_config(path).cells
    {'q1': [-5, 5, 100], 'v1': 0.5}
    """
    entries = read_toml(checks.path("config", path))
    try:
        config = Config.model_validate(entries)
    except ValidationError as error:
        raise _told(error, entries) from None
    if (config.grid is None) == (config.plane is None):
        given = "both" if config.grid is not None else "neither"
        raise InputError("grid, plane", given, "one of the two tables, [grid] or [plane]")
    return config


def _told(error: ValidationError, entries: Mapping[str, Any]) -> InputError:
    """Return one validation error as an `InputError` that names the key."""
    mistakes = error.errors()
    # a key that is missing may be one that is misspelt
    first = next((one for one in mistakes if one["type"] == "extra_forbidden"), mistakes[0])
    place = [part for part in first["loc"] if isinstance(part, str | int)]
    key = ".".join(map(str, place))
    if first["type"] == "missing":
        return InputError(key, None, "given")
    if first["type"] == "extra_forbidden":
        known = _known(place[:-1])
        where = f" in [{'.'.join(map(str, place[:-1]))}]" if len(place) > 1 else ""
        return InputError("key", str(place[-1]), f"one of {', '.join(known)}{where}", nearest(place[-1], known))
    allowed = first["msg"].removeprefix("Input should be ").replace("'", "").replace("a valid integer", "an integer")
    return InputError(key, first["input"], allowed.replace("a valid ", "a "))


def _known(place: list[str | int]) -> tuple[str, ...]:
    """Return the allowed keys of a table, given by the path to it."""
    table: Any = Config
    for part in place:
        table = {"engine": EngineOptions, "attractors": AttractorTable, "plane": PlaneTable}[str(part)]
    return tuple(table.model_fields)


def system_of(
    config: Config, known: Mapping[str, Callable[..., HybridSystem | Map]], folder: Path
) -> HybridSystem | Map:
    """Return the system of a configuration.

    Parameters
    ----------
    known : mapping of str to callable
        Functions that return systems, by name.
    folder : Path
        Folder in which modules are looked for first: that of the configuration.

    Raises
    ------
    InputError
        No system of that name, no such module or attribute, or arguments that its function does not take.
    """
    make: Any = known.get(config.system)
    if make is None:
        if ":" not in config.system:
            allowed = f"{', '.join(known)}, or module:attribute"
            raise InputError("system", config.system, allowed, nearest(config.system, known))
        make = attribute_of(config.system, folder, "system")
    system = called(make, config.model, "model") if callable(make) else make
    if isinstance(system, HybridSystem | Map):  # a user's module may hold, or make, anything
        if system is make and config.model:
            raise InputError("model", config.model, "left out", f"{config.system} is made already")
        return system
    if callable(make):
        allowed, hint = "what makes a HybridSystem or a Map", f"it made {type(system).__name__}"
    else:
        allowed, hint = "a HybridSystem or a Map, or what makes one", f"it is {make!r}"
    raise InputError("system", config.system, allowed, hint)
