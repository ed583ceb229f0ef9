"""The paper's cantilever and sample: data only."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from saltus.afm.paper.tapping import Setup

__all__ = ["table1"]


def table1() -> Setup:
    """Return the set-up of the paper's Table 1.

    Returns
    -------
    Setup
        Cantilever 240 x 64 x 2.1 um of 2300 kg/m**3, tip of 20 nm, 60 nm above the sample.

    Notes
    -----
    Table 1 lacks Young's modulus of the cantilever. 176 GPa reproduces the paper's numbers: the onset of period
    doubling, the attractors of Fig. 7 and those of Figs. 8-10.

    References
    ----------
    ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Table 1.

    Examples
    --------
    >>> setup = table1()
    >>> print(f"{setup.cantilever.f0:.2f} Hz, {setup.cantilever.k:.7f} N/m, {setup.eta * 1e9:.0f} nm")
    51519.24 Hz, 1.9434665 N/m, 60 nm
    """
    # Not at the top: the package imports this module at once, and shall stay light.
    from saltus.afm.paper.sample import DMTSample
    from saltus.afm.paper.tapping import Setup
    from saltus.afm.probe.cantilever import Cantilever

    return Setup(
        cantilever=Cantilever(length=240e-6, width=64e-6, thickness=2.1e-6, density=2300.0, young=176e9),
        sample=DMTSample(R=20e-9, H=2.96e-19, E_star=10.4e9, a0=2e-10),
        eta=60e-9,
    )
