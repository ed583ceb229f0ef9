"""Examples of the gallery: what each says of itself, its picture and its notebook, and which public names it uses."""

from __future__ import annotations

import ast
import hashlib
import json
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = (ROOT / "examples", ROOT / "examples" / "gallery")
PICTURES = ROOT / "docs" / "images" / "gallery"
DOORS = ("afm", "errors", "options", "results")
FIELDS = (
    "Impacts",
    "Friction and sliding",
    "Walking and standing",
    "Machines and valves",
    "Electronics and control",
    "Life",
    "Smooth systems",
    "Maps",
    "Atomic force microscopy",
)


@dataclass(frozen=True)
class Example:
    """One script with its docstring in parts."""

    file: Path

    @property
    def name(self) -> str:
        return self.file.stem

    @property
    def text(self) -> str:
        return self.file.read_text(encoding="utf-8")

    @property
    def docstring(self) -> str:
        return ast.get_docstring(ast.parse(self.text)) or ""

    @property
    def title(self) -> str:
        first = " ".join(self.docstring.partition("\n\n")[0].split())
        return re.split(r"[:.,] ", first.rstrip("."), maxsplit=1)[0]

    @property
    def field(self) -> str:
        """Field of use, which a line `Field: ...` of the docstring says."""
        (found,) = re.findall(r"^Field: (.*)\.$", self.docstring, re.MULTILINE)
        return str(found)

    @property
    def words(self) -> str:
        """The docstring without its title's line of command and its field."""
        parts = [part for part in self.docstring.split("\n\n") if not part.startswith(("    python ", "Field: "))]
        return "\n\n".join(parts)

    @property
    def code(self) -> str:
        """The script without its docstring."""
        first = ast.parse(self.text).body[0]
        return "\n".join(self.text.splitlines()[first.end_lineno :]).strip("\n") + "\n"

    @property
    def picture(self) -> Path:
        return PICTURES / f"{self.name}.png"

    @property
    def print(self) -> str:
        """What the picture depends on: the code without comments and spaces."""
        return hashlib.sha256(ast.dump(ast.parse(self.code)).encode()).hexdigest()[:16]


def examples() -> list[Example]:
    """All examples, by field and then by name."""
    every = [Example(file) for folder in FOLDERS for file in sorted(folder.glob("*.py"))]
    return sorted(every, key=lambda one: (FIELDS.index(one.field), one.file.parent != FOLDERS[1], one.name))


def notebook(example: Example) -> str:
    """The example as a notebook: its words, then a cell for each part between empty lines of the outermost level."""
    tree = ast.parse(example.code)
    lines = example.code.splitlines(keepends=True)
    cells, start = [], 0
    for one, following in zip(tree.body, [*tree.body[1:], None], strict=True):
        end = len(lines) if following is None else one.end_lineno
        if following is None or (end < len(lines) and not lines[end].strip()):
            cells.append("".join(lines[start:end]).strip("\n"))
            start = end
    # the script takes the name of its picture from its arguments
    cells.insert(0, f'import sys\n\nsys.argv = ["{example.name}.py", "{example.name}.png"]')
    written = [{"cell_type": "markdown", "id": "words", "metadata": {}, "source": f"# {example.words}"}]
    written += [
        {"cell_type": "code", "id": f"cell-{i}", "metadata": {}, "source": c, "outputs": [], "execution_count": None}
        for i, c in enumerate(cells)
    ]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": written, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def public_names() -> dict[str, list[str]]:
    """Public names of each module, as its stub or its `__all__` lists them."""
    from importlib import import_module

    names = {}
    for module in ("saltus", *(f"saltus.{door}" for door in DOORS)):
        named = [name for name in import_module(module).__all__ if name not in DOORS and not name.startswith("__")]
        names[module] = sorted(set(named) - {"nearest", "shortened", "shown"}, key=lambda name: (name.lower(), name))
    # an error at the front door has its page at `saltus.errors`
    names["saltus"] = [name for name in names["saltus"] if name not in names["saltus.errors"]]
    return names


def names_used(code: str) -> set[str]:
    """Full public names that a Python text uses, as `saltus.afm.model`."""
    modules = {"saltus": "saltus"}
    found = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "saltus":
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                if node.module == "saltus" and alias.name in DOORS:
                    modules[alias.asname or alias.name] = full
                found.add(full)
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Attribute):
            chain = [node.attr]
            inner = node.value
            while isinstance(inner, ast.Attribute):
                chain.insert(0, inner.attr)
                inner = inner.value
            if isinstance(inner, ast.Name) and inner.id in modules:
                found.add(".".join([modules[inner.id], *chain]))
    return found
