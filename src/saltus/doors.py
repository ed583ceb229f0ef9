"""Doors: modules of public names that stand in a stub beside them, each imported on first use."""

from __future__ import annotations

import ast
import importlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

__all__ = ["opened", "unknown"]

_FRONT = "saltus"
_DOORS = ("saltus.errors", "saltus.options", "saltus.results")  # modules of classes that users meet


def unknown(module: str, name: str, names: Iterable[str]) -> str:
    """Return the message of an attribute that a module lacks: the door that has it, or the nearest of its own names."""
    import difflib

    others = [door for door in (_FRONT, *_DOORS) if door != module and not name.startswith("_")]
    home = next((door for door in others if name in importlib.import_module(door).__all__), None)
    alike = difflib.get_close_matches(name, list(names), n=1)
    hint = f"; it is {home}.{name}" if home else f"; did you mean {alike[0]!r}?" if alike else ""
    return f"No {module} attribute {name}{hint}"


def opened(module: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a module, read from the stub beside its `file`."""
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    homes = {
        alias.name: node.module
        for node in stub.body if isinstance(node, ast.ImportFrom) and node.module for alias in node.names
    }  # fmt: skip

    def imported(name: str) -> Any:
        if name not in homes:
            raise AttributeError(unknown(module, name, homes))
        return getattr(importlib.import_module(homes[name]), name)

    return imported, lambda: sorted(homes), sorted(homes)
