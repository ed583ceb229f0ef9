"""Doors: modules of public names that stand in a stub beside them, each imported on first use."""

from __future__ import annotations

import ast
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

__all__ = ["opened"]


def opened(module: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a module, read from the stub beside its `file`."""
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    homes = {
        alias.name: node.module
        for node in stub.body if isinstance(node, ast.ImportFrom) and node.module for alias in node.names
    }  # fmt: skip

    def imported(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"No {module} attribute {name}")
        return getattr(importlib.import_module(homes[name]), name)

    return imported, lambda: sorted(homes), sorted(homes)
