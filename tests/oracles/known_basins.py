"""Labels of well-known basins, by programs of their own: an outcome for each cell centre of a square grid."""

from __future__ import annotations

import numpy as np
from numba import njit

from saltus.basins.map.basins import Basins

UNDECIDED = 254


def centres(low, high, count):
    return low + (np.arange(count) + 0.5) * (high - low) / count


def basins(labels, half=1.0, points=None):
    """Basins over [-half, half]^D, or as many half widths, from an array of labels 0, 1, 2, ... named a, b, c, ..."""
    labels = np.asarray(labels, dtype=np.uint8)
    names = {letter: label for label, letter in enumerate("abcdefgh")}
    halves = np.broadcast_to(half, labels.ndim)
    axes = {"xyzu"[k]: centres(-w, w, n) for k, (w, n) in enumerate(zip(halves, labels.shape, strict=True))}
    return Basins.from_array(labels, axes, names, points)


def sampled(outside, count, half=1.0, points=None):
    """Basins a, where ``outside(x, y, ...)`` does not hold, and b over [-half, half]^D, or as many half widths."""
    counts = np.atleast_1d(count)
    halves = np.broadcast_to(half, counts.size)
    x = np.meshgrid(*(centres(-w, w, n) for w, n in zip(halves, counts, strict=True)), indexing="ij", sparse=True)
    return basins(np.broadcast_to(outside(*x), tuple(counts)), half, points)


def newton(half, count):
    """Which root of z^3 = 1 Newton's method goes to."""
    x = centres(-half, half, count)
    return _newton(x)


@njit(error_model="numpy")
def _newton(x):
    labels = np.full((x.size, x.size), UNDECIDED, np.uint8)
    roots = np.exp(2j * np.pi * np.arange(3) / 3)
    for i in range(x.size):
        for j in range(x.size):
            z = complex(x[i], x[j])
            for _ in range(60):
                step = (z * z * z - 1.0) / (3.0 * z * z)
                z -= step
                if abs(step) < 1e-9:
                    break
            for k in range(3):
                if abs(z - roots[k]) < 1e-6:
                    labels[i, j] = k
    return labels


@njit
def henon(axis, iterations=100):
    """0 where the orbit of the Henon map with a = 1.4, b = 0.3 stays bounded, 1 where it does not."""
    labels = np.zeros((axis.size, axis.size), np.uint8)
    for i in range(axis.size):
        for j in range(axis.size):
            x, y = axis[i], axis[j]
            for _ in range(iterations):
                x, y = 1.0 - 1.4 * x * x + y, 0.3 * x
                if abs(x) > 100.0:
                    labels[i, j] = 1
                    break
    return labels


@njit
def _duffing_field(t, x, v):
    return v, 0.2 * np.cos(t) - 0.15 * v + x - x * x * x


@njit
def duffing(axis, steps=80):
    """In which well a motion of x'' + 0.15 x' - x + x^3 = 0.2 cos t ends; it is followed until it repeats itself."""
    labels, h = np.full((axis.size, axis.size), UNDECIDED, np.uint8), 2.0 * np.pi / steps
    for i in range(axis.size):
        for j in range(axis.size):
            x, v = axis[i], axis[j]
            for _ in range(400):
                x0, v0 = x, v
                for k in range(steps):
                    t = k * h
                    a1, b1 = _duffing_field(t, x, v)
                    a2, b2 = _duffing_field(t + 0.5 * h, x + 0.5 * h * a1, v + 0.5 * h * b1)
                    a3, b3 = _duffing_field(t + 0.5 * h, x + 0.5 * h * a2, v + 0.5 * h * b2)
                    a4, b4 = _duffing_field(t + h, x + h * a3, v + h * b3)
                    x += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
                    v += h * (b1 + 2.0 * b2 + 2.0 * b3 + b4) / 6.0
                near = min(abs(x + 0.77905441), abs(x - 1.21009108))
                if near < 1e-2 and abs(x - x0) + abs(v - v0) < 1e-3:
                    labels[i, j] = 0 if x < 0.0 else 1
                    break
    return labels


@njit
def pendulum(axis, damping=0.2, height=0.2, omega=0.8, h=0.02):
    """Over which of three magnets at the corners of a triangle a pendulum comes to rest, released at rest.

    It is followed until its energy is below -3: the passes between the magnets are at -2.943.
    """
    mx = np.array([1.0, -0.5, -0.5])
    my = np.array([0.0, np.sqrt(3.0) / 2.0, -np.sqrt(3.0) / 2.0])
    labels = np.full((axis.size, axis.size), UNDECIDED, np.uint8)
    k = np.zeros((4, 4))
    s = np.zeros(4)
    y = np.zeros(4)
    for i in range(axis.size):
        for j in range(axis.size):
            s[0], s[1], s[2], s[3] = axis[i], axis[j], 0.0, 0.0
            for _ in range(20000):
                for stage in range(4):
                    c = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                    for m in range(4):
                        y[m] = s[m] + (c * h * k[stage - 1, m] if stage else 0.0)
                    ax = -omega * omega * y[0] - damping * y[2]
                    ay = -omega * omega * y[1] - damping * y[3]
                    for m in range(3):
                        dx, dy = mx[m] - y[0], my[m] - y[1]
                        d = np.sqrt(dx * dx + dy * dy + height * height)
                        ax += dx / (d * d * d)
                        ay += dy / (d * d * d)
                    k[stage, 0], k[stage, 1], k[stage, 2], k[stage, 3] = y[2], y[3], ax, ay
                for m in range(4):
                    s[m] += h * (k[0, m] + 2.0 * k[1, m] + 2.0 * k[2, m] + k[3, m]) / 6.0
                energy = 0.5 * (s[2] ** 2 + s[3] ** 2 + omega * omega * (s[0] ** 2 + s[1] ** 2))
                nearest, best = 0, 1e300
                for m in range(3):
                    d = np.sqrt((s[0] - mx[m]) ** 2 + (s[1] - my[m]) ** 2 + height * height)
                    energy -= 1.0 / d
                    if d < best:
                        nearest, best = m, d
                if energy < -3.0:
                    labels[i, j] = nearest
                    break
    return labels
