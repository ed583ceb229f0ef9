"""Confidence intervals for a share that is estimated from samples."""

from __future__ import annotations

import math

from saltus import checks

__all__ = ["checked_confidence", "wilson"]


def wilson(hits: int, samples: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the Wilson interval of a share, estimated by `hits` among `samples` independent samples.

    Where all samples agree, one end is 0 or 1. The other end is then the exact one-sided bound. With no hit it is
    ``1 - (1 - confidence)**(1 / samples)``, less than ``3 / samples`` at 95 %.

    Parameters
    ----------
    hits, samples : int
        ``0 <= hits <= samples``, and at least one sample.
    confidence : float, optional
        Of the interval.

    Returns
    -------
    tuple of float
        Its lower and upper end.

    Raises
    ------
    InputError
        Counts or a confidence that cannot be.

    References
    ----------
    E. B. Wilson, Probable inference, the law of succession, and statistical inference, J. Am. Stat. Assoc. 22 (1927)
    209-212; L. D. Brown, T. T. Cai, A. DasGupta, Interval estimation for a binomial proportion, Stat. Sci. 16 (2001)
    101-133; J. A. Hanley, A. Lippman-Hand, If nothing goes wrong, is everything all right?, JAMA 249 (1983) 1743-1745.

    Examples
    --------
    >>> print("%.4f %.4f" % wilson(9, 10))
    0.5958 0.9821
    >>> print("%.5f %.5f" % wilson(0, 1000))
    0.00000 0.00299
    """
    from scipy.special import ndtri

    confidence = checked_confidence(confidence)
    samples = checks.count("samples", samples)
    hits = checks.count("hits", hits, 0, samples, "the count of samples")
    if hits in (0, samples):
        room = -math.expm1(math.log1p(-confidence) / samples)
        return (0.0, room) if hits == 0 else (1.0 - room, 1.0)
    z = float(ndtri(0.5 + 0.5 * confidence))
    p, z2 = hits / samples, z * z / samples
    middle = (p + 0.5 * z2) / (1.0 + z2)
    half = z * math.sqrt(p * (1.0 - p) / samples + 0.25 * z2 / samples) / (1.0 + z2)
    return middle - half, middle + half


def checked_confidence(confidence: float) -> float:
    """Return a confidence between 0 and 1, exclusive."""
    return checks.between("confidence", confidence, 0.0, 1.0, strict=True)
