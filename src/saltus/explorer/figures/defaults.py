"""Default values of Bokeh's properties, made once: Bokeh makes and checks one anew at each look at a property."""

from __future__ import annotations

from typing import Any

__all__ = ["remember_defaults"]

_IMMUTABLE = (bool, float, int, str, type(None))  # types of defaults that all models of a class may share


def remember_defaults() -> None:
    """Let Bokeh remember the defaults of its properties in this process, as far as they are the same for all models.

    Those that a theme replaces, that are mutable, or that are made for each model are left alone.
    """
    from bokeh.core.property.descriptors import PropertyDescriptor

    made_anew = PropertyDescriptor._get_default
    if getattr(made_anew, "remembers", False):
        return
    known: dict[tuple[type, str], Any] = {}

    def default(descriptor: Any, model: Any) -> Any:
        key = type(model), descriptor.name
        themed = vars(model).get("__themed_values__")
        if themed is not None and descriptor.name in themed:
            return made_anew(descriptor, model)
        if key in known:
            return known[key]
        value = made_anew(descriptor, model)
        if type(value) in _IMMUTABLE and not descriptor.has_unstable_default(model):
            known[key] = value
        return value

    default.remembers = True  # type: ignore[attr-defined]
    PropertyDescriptor._get_default = default
