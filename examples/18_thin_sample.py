"""A sphere on a thin sample: the force over that on a thick one, by the law and by formulas in print.

Dots are the layer's integral equation, solved on Gauss points, in units of the thickness:
``phi(t) - 1/pi int_-a^a K(t - s) phi(s) ds = q - t**2/R`` with ``K(u) = int (1 - L(w)) cos(w u) dw``.

Field: Atomic force microscopy.

    python 18_thin_sample.py [picture]
"""

import math
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from saltus import afm

THICKNESS = 1000.0  # nm; also the radius of the sphere
E = 1e-5  # GPa
NU = 0.5
DIMITRIADIS = (1.0, 1.133, 1.283, 0.769, 0.0975)
GARCIA = (1.0, 1.133, 1.497, 1.469, 0.755)
LAST = 0.55  # sqrt(R h)/t up to which the law is valid
FAR = 30.0  # wavenumbers up to which a layer differs from a half space


def layer(a):
    """Depth and force of a contact of radius a, in units of the thickness and at modulus 1."""
    w, weight = np.polynomial.legendre.leggauss(120)
    w, weight = FAR / 2.0 * (w + 1.0), FAR / 2.0 * weight
    kappa = 3.0 - 4.0 * NU
    below = 2.0 * kappa * np.cosh(2.0 * w) + 1.0 + kappa**2 + 4.0 * w**2
    kernel = (1.0 - (2.0 * kappa * np.sinh(2.0 * w) - 4.0 * w) / below) * weight
    t, size = np.polynomial.legendre.leggauss(30)
    t, size = a / 2.0 * (t + 1.0), a / 2.0 * size
    waves, end = np.cos(np.outer(t, w)), np.cos(a * w)
    matrix = np.eye(t.size) - 2.0 / math.pi * (waves * kernel) @ waves.T * size
    row = 2.0 / math.pi * (end * kernel) @ waves.T * size
    level, bent = np.linalg.solve(matrix, np.ones(t.size)), np.linalg.solve(matrix, t**2)
    depth = (a**2 + row @ bent) / (1.0 + row @ level)
    return depth, 2.0 * float(size @ (depth * level - bent))


x = np.linspace(1e-3, 0.9, 300)
inside = x[x < LAST]
gaps = -(inside**2) * THICKNESS
law = afm.ThinSphere(E_GPa=E, thickness_nm=THICKNESS, nu=NU).force_nN(gaps, R_nm=THICKNESS)
thick = afm.Hertz(E_GPa=E).force_nN(gaps, R_nm=THICKNESS)
depths, forces = np.array([layer(a) for a in np.linspace(0.1, 1.25, 16)]).T

figure, ax = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
ax.plot(inside, law / thick, "-", color="tab:blue", lw=2.0, label="ThinSphere")
ax.plot(x, np.polyval(GARCIA[::-1], x), "--", color="tab:green", label="Garcia and Garcia (2018)")
ax.plot(x, np.polyval(DIMITRIADIS[::-1], x), ":", color="tab:red", label="Dimitriadis et al. (2002)")
ax.plot(np.sqrt(depths), forces / (4.0 / 3.0 * depths**1.5), "o", color="0.2", ms=4.0, label="integral equation")
ax.axvline(LAST, color="0.8", lw=0.8)
ax.set_xlim(0.0, 0.9)
ax.set_ylim(0.9, 5.0)
ax.set_xlabel(r"$\sqrt{R h}/t$")
ax.set_ylabel("force over that on a thick sample")
ax.set_title(r"Bonded sample, $\nu = 0.5$")
ax.legend(frameon=False)

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "18_thin_sample.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=90)
print("written", picture)
