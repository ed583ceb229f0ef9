"""Write docs/files.md, the map of the package's files: python tools/file_map.py."""

from __future__ import annotations

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "saltus"
PAGE = ROOT / "docs" / "files.md"


def purpose(file: Path) -> str:
    """Return the first sentence of a module's docstring."""
    text = " ".join((ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").split("\n\n")[0].split())
    first = text.partition(". ")[0].rstrip(".")
    return first.replace("|", "\\|")


def page() -> str:
    """Return the text of the page: a section for each package, a line for each file."""
    lines = [
        "# Map of files",
        "",
        "`tools/file_map.py` writes this page from the first sentence of each file. Which way a call takes",
        "through them stands in [the architecture](architecture.md).",
    ]
    for package in sorted({file.parent for file in PACKAGE.rglob("*.py")}):
        name = package.relative_to(PACKAGE.parent).as_posix()
        lines += ["", f"## {name}", "", f"{purpose(package / '__init__.py')}.", ""]
        files = sorted(file for file in package.glob("*.py") if file.name != "__init__.py")
        lines += [f"- `{file.name}`: {purpose(file)}" for file in files]
        if not files:
            lines.pop()
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
