"""Names of attractors of a model by their regimes: attractive where the virial is positive, else repulsive."""

from __future__ import annotations

from saltus import checks
from saltus.afm.models.orbit_observables import observables
from saltus.basins import Attractors

__all__ = ["name_by_regime"]


def name_by_regime(attractors: Attractors) -> Attractors:
    """Return attractors of a model with their regimes as names.

    The sign of the virial decides, not contact. Letters are added where several attractors are in one regime.
    Attractors that are no periodic orbits keep their names.

    Parameters
    ----------
    attractors : Attractors
        What `saltus.find_attractors` returns for a model of `saltus.afm.model`.

    Returns
    -------
    Attractors
        The same ones, in the same order and with the same trapping regions.

    Raises
    ------
    InputError
        They are no attractors, or those of another system.

    References
    ----------
    A. San Paulo, R. Garcia, Phys. Rev. B 64, 193411 (2001): the virial.

    Examples
    --------
    >>> from saltus import afm, basins, find_orbit, options
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=40.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> orbit = find_orbit(afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=5.0), x0=[0.0, 0.0])
    >>> region = {"z1_nm": (-9.0, 9.0), "v1_nm_us": (-17.0, 17.0)}
    >>> few = options.AttractorOptions(motions=10)
    >>> name_by_regime(basins.attractors_from({"found": orbit}, region, options=few)).names
    ('repulsive',)
    """
    checks.instance("attractors", attractors, Attractors)
    regimes = {name: str(observables(orbit)["regime"]) for name, orbit in attractors.orbits.items()}
    return attractors.renamed([regimes.get(name, name) for name in attractors.names])
