"""Models in files of versions that did not keep what a model was made of: its parts, told from names."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from saltus.afm.probe.units import suffix

if TYPE_CHECKING:
    from saltus.system import HybridSystem

__all__ = ["is_older", "plain_parts"]

_OUTPUTS = {"deflection_nm", "force_nN", "drive_pW", "medium_pW", "sample_pW", "virial_aJ"}  # of each model
_SIZE = re.compile(r"(A0_nm|F0_nN|Y_nm)(?:_(\d+))?")  # the amplitude of a drive
_OWN = re.compile(r"(?:Zc_nm|(?:f_kHz|k_N_m|f0_kHz|Q|R_nm|A0_nm|F0_nN|Y_nm|ratio|phase_deg|at_kHz)(?:_\d+)?)")


def is_older(system: HybridSystem) -> bool:
    """Return whether a system has the outputs of a model, but nothing that tells what it was made of."""
    return not system.made_of and set(system.output_names) >= _OUTPUTS


def plain_parts(system: HybridSystem) -> dict[str, Any]:
    """Return probe, law and drives of an older model, as a model keeps them; its law has a name of its own, ``older``.

    Weights of the modes in light and at the base are taken as those of a uniform beam: no reading depends on them.
    """
    p = system.parameters
    modes = sum(re.fullmatch(r"z\d+_nm", name) is not None for name in system.states)
    ends = [suffix(i) for i in range(1, modes + 1)]
    probe = {name: [p[name + end] for end in ends] for name in ("k_N_m", "f0_kHz", "Q")}
    found = sorted((int(one[2] or 1), one[1]) for one in map(_SIZE.fullmatch, p) if one is not None)
    return {
        "probe": probe | {"R_nm": p.get("R_nm", 1.0)},
        "law": [{"name": "older", "values": {name: value for name, value in p.items() if not _OWN.fullmatch(name)}}],
        "drives": [_drive(system, number, size) for number, size in found],
    }


def _drive(system: HybridSystem, number: int, size: str) -> dict[str, Any]:
    end = suffix(number)
    name, p = size + end, system.parameters
    field = system.modes[system.mode_names[0]].field
    modes = [i for i in range(1, len(field) + 1) if re.search(rf"\b{name}\b", field.get(f"v{i}_nm_us", ""))]
    mode = modes[0] if size == "A0_nm" and modes else 1
    peaked = f"Q{suffix(mode)}" in system.parameter_bounds  # where a peak is meant, Q must be large enough for one
    return {
        size: p[name],
        "mode": mode,
        "ratio": p.get(f"ratio{end}", 1.0),
        "repeats": f"theta{end}" not in system.states,
        "phase_deg": p.get(f"phase_deg{end}", 0.0),
        "at": p.get(f"at_kHz{end}", "peak" if peaked else "f0"),
    }
