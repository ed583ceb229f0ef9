"""The laws of saltus by their names, as files and configurations call them."""

from __future__ import annotations

from saltus.afm.laws import adhesive, contact, fields, long_range, maxwell, thin, tips, viscous
from saltus.afm.laws.law import Law

__all__ = ["LAWS"]

_MODULES = (contact, tips, thin, viscous, maxwell, adhesive, long_range, fields)

LAWS: dict[str, type[Law]] = {
    name: kind
    for module in _MODULES
    for name in module.__all__
    if isinstance(kind := getattr(module, name), type) and issubclass(kind, Law)
}
