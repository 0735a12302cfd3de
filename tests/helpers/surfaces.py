"""Independent ways to ask a triangle mesh for heights, for tests of what was exported."""

from __future__ import annotations

import numpy as np


def top_under(vertices, faces, points):
    """Highest z of the triangles under each point (x, y), brute force; -inf where there is none."""
    a, b, c = (np.asarray(vertices, np.float64)[faces[:, n]] for n in range(3))
    e1, e2 = (b - a)[:, :2], (c - a)[:, :2]
    area = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
    flat = np.abs(area) > 1e-14
    a, b, c, e1, e2, area = (values[flat] for values in (a, b, c, e1, e2, area))
    edges = np.stack([np.zeros_like(e1[:, 0]), e1[:, 0], e2[:, 0]])
    west, width = a[:, 0] + edges.min(axis=0), float(np.ptp(edges, axis=0).max(initial=0.0))
    order = np.argsort(west)
    rise1, rise2 = (b - a)[order, 2], (c - a)[order, 2]
    a, e1, e2, area, west = (values[order] for values in (a, e1, e2, area, west))
    tops = np.empty(len(points))
    for n, point in enumerate(np.asarray(points)):
        near = slice(*np.searchsorted(west, (point[0] - width - 1e-6, point[0] + 1e-6)))
        d, p, q = point - a[near, :2], e1[near], e2[near]
        u = (d[:, 0] * q[:, 1] - d[:, 1] * q[:, 0]) / area[near]
        v = (p[:, 0] * d[:, 1] - p[:, 1] * d[:, 0]) / area[near]
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
        z = a[near, 2] + u * rise1[near] + v * rise2[near]
        tops[n] = z[inside].max(initial=-np.inf)
    return tops


def random_points(ground, count, seed):
    """Points (east, north) spread over a grid, kept off its outermost millimetre."""
    west, south, east, north = ground.bounds
    low, high = np.array([west, south]) + 1e-3, np.array([east, north]) - 1e-3
    return np.random.default_rng(seed).uniform(low, high, (count, 2))


def resting_height(ground, x, y, radius):
    """Height of a ball's centre that is let down onto the ground: closed form over a fine grid."""
    east, north = np.meshgrid(*[np.linspace(-radius, radius, 801)] * 2)
    inside = east**2 + north**2 < radius**2
    z = ground.height_at(x + east[inside], y + north[inside])
    return float((z + np.sqrt(radius**2 - east[inside] ** 2 - north[inside] ** 2)).max())
