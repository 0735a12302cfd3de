"""The kernels of traversability: each fills rows, so that threads change no result.

Sums run over each node's own surroundings in a fixed order, so that a window has the whole's bits.
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import inner, kernel


@kernel
def measure_ground(first, last, elevation, spacing, cells, slope, roughness, step):  # type: ignore[no-untyped-def]
    """Slope [rad] and RMS residual [m] of the plane under a square, and steps [m].

    `cells`: half the square, a wheel's reach, and the border where nothing is known [cells].
    """
    half, lag, border = cells
    rows, columns = elevation.shape
    low, high = max(first, border), min(last, rows - border)
    if low >= high or columns <= 2 * border:
        return
    total, moment, square = _row_sums(elevation, low - half, high + half, half, border)
    count = (2 * half + 1) ** 2
    spread = count * half * (half + 1) / 3.0
    for j in range(low, high):
        for i in range(border, columns - border):
            mean = east = north = power = 0.0
            for k in range(2 * half + 1):
                row = j - low + k
                mean += total[row, i]
                north += (k - half) * total[row, i]
                east += moment[row, i]
                power += square[row, i]
            rise = np.sqrt(east * east + north * north) / spread
            rest = power - mean * mean / count - rise * rise * spread
            slope[j, i] = np.arctan(rise / spacing)
            roughness[j, i] = np.sqrt(max(rest, 0.0) / count)
            step[j, i] = _step(elevation, j, i, lag)


@inner
def _row_sums(elevation, first, last, half, border):  # type: ignore[no-untyped-def]
    """Over squares' rows: heights, heights times columns from the middle, squares of heights."""
    columns = elevation.shape[1]
    total = np.zeros((last - first, columns))
    moment, square = np.zeros_like(total), np.zeros_like(total)
    for j in range(last - first):
        for i in range(border, columns - border):
            for k in range(-half, half + 1):
                z = np.float64(elevation[first + j, i + k])
                total[j, i] += z
                moment[j, i] += k * z
                square[j, i] += z * z
    return total, moment, square


@inner
def _step(elevation, j, i, lag):  # type: ignore[no-untyped-def]
    """Largest step across a node within a wheel's reach, east-west and north-south [m]."""
    largest = 0.0
    for k in range(lag + 1):
        for along in range(2):
            dj, di = (lag, 0) if along else (0, lag)
            row, column = (j - k, i) if along else (j, i - k)
            before = np.float64(elevation[row - dj, column - di])
            begin = np.float64(elevation[row, column])
            end = np.float64(elevation[row + dj, column + di])
            after = np.float64(elevation[row + 2 * dj, column + 2 * di])
            # What the ground beside rises too is slope and no step.
            jump = end - begin
            largest = max(largest, min(abs(jump - (begin - before)), abs(jump - (after - end))))
    return largest


@kernel
def steps_at(elevation, row, column, lag):  # type: ignore[no-untyped-def]
    """Largest step [m] at any of some nodes, shape [poses, nodes]; none where it is not known."""
    rows, columns = elevation.shape
    largest = np.zeros(len(row))
    for n in range(len(row)):
        for k in range(row.shape[1]):
            j, i = row[n, k], column[n, k]
            if 2 * lag <= min(j, i, rows - 1 - j, columns - 1 - i):
                largest[n] = max(largest[n], _step(elevation, j, i, lag))
    return largest


@kernel
def nearest_step(first, last, step, limit, reach, spacing, clearance):  # type: ignore[no-untyped-def]
    """Lower `clearance` [m] to the distance of the nearest node whose step exceeds the limit."""
    rows, columns = step.shape
    low, high = max(first - reach, 0), min(last + reach, rows)
    beside = np.full((high - low, columns), reach + 1, np.int32)
    for j in range(high - low):
        away = reach + 1
        for i in range(columns):
            away = 0 if step[low + j, i] > limit else min(away + 1, reach + 1)
            beside[j, i] = away
        away = reach + 1
        for i in range(columns - 1, -1, -1):
            away = 0 if step[low + j, i] > limit else min(away + 1, reach + 1)
            beside[j, i] = min(beside[j, i], away)
    for j in range(first, last):
        for i in range(columns):
            best = (reach + 1) ** 2
            for k in range(max(j - reach, 0), min(j + reach + 1, rows)):
                across = beside[k - low, i]
                best = min(best, across * across + (k - j) ** 2)
            clearance[j, i] = min(clearance[j, i], np.sqrt(best) * spacing)


@kernel
def stamp_obstacles(clearance, centre, support, units, farthest, spacing):  # type: ignore[no-untyped-def]
    """Lower `clearance` [m] to the distance of rocks' outlines; all lengths else in cells."""
    rows, columns = clearance.shape
    for n in range(len(centre)):
        reach = support[n].max() + farthest
        x, y = centre[n, 0], centre[n, 1]
        for j in range(max(int(np.ceil(y - reach)), 0), min(int(np.floor(y + reach)) + 1, rows)):
            west = max(int(np.ceil(x - reach)), 0)
            for i in range(west, min(int(np.floor(x + reach)) + 1, columns)):
                gap = -np.inf
                for d in range(units.shape[1]):
                    along = (i - x) * units[0, d] + (j - y) * units[1, d]
                    gap = max(gap, along - support[n, d])
                clearance[j, i] = min(clearance[j, i], gap * spacing)


@kernel
def stamp_heights(step, centre, radius, height):  # type: ignore[no-untyped-def]
    """Raise steps to the heights of the rocks [m] that stand there; centre and radius in cells."""
    rows, columns = step.shape
    for n in range(len(centre)):
        x, y, r = centre[n, 0], centre[n, 1], radius[n]
        for j in range(max(int(np.ceil(y - r)), 0), min(int(np.floor(y + r)) + 1, rows)):
            for i in range(max(int(np.ceil(x - r)), 0), min(int(np.floor(x + r)) + 1, columns)):
                near = (i - x) ** 2 + (j - y) ** 2 <= r * r
                if near and step[j, i] >= 0.0 and height[n] > step[j, i]:
                    step[j, i] = height[n]


@kernel
def rate_nodes(first, last, slope, roughness, step, clearance, limits, spans, margins, cost):  # type: ignore[no-untyped-def]
    """Cost of nodes: the worst of slope, steps nearby, roughness and nearness of obstacles.

    `limits`: slope [rad], step [m], roughness [m], and clearances [m] below which the rover cannot
    be, and from which on it can turn; `spans`: columns to each side within its half width, for each
    row from the node's own on [cells]; `margins`: unknown cells in the west, south, east and north.
    """
    steepest, highest, roughest, narrow, wide = limits
    west, south, east, north = margins
    rows, columns = cost.shape
    reach = len(spans) - 1
    low, high = max(first - reach, 0), min(last + reach, rows)
    beside = _row_maxima(step, low, high, spans[0], highest)
    for j in range(first, last):
        for i in range(columns):
            outside = i < west or j < south or i >= columns - east or j >= rows - north
            if outside or slope[j, i] < 0.0:
                cost[j, i] = -1.0
                continue
            steep = slope[j, i] / steepest
            if steep > 1.0 or clearance[j, i] < narrow:
                cost[j, i] = 1.0
                continue
            nearby = np.float32(0.0)
            for k in range(max(j - reach, low), min(j + reach + 1, high)):
                nearby = max(nearby, beside[spans[abs(k - j)], k - low, i])
            close = (wide - clearance[j, i]) / (wide - narrow)
            worst = max(max(nearby / highest, roughness[j, i] / roughest), max(steep, close))
            cost[j, i] = min(max(worst, 0.0), 0.99)


@inner
def _row_maxima(step, low, high, widest, highest):  # type: ignore[no-untyped-def]
    """Largest steps that the rover still goes over, within 0 to `widest` columns to both sides.

    What is higher is an obstacle, which counts by its distance.
    """
    columns = step.shape[1]
    maxima = np.zeros((widest + 1, high - low, columns), np.float32)
    for j in range(high - low):
        for i in range(columns):
            maxima[0, j, i] = step[low + j, i] if step[low + j, i] <= highest else 0.0
        for span in range(1, widest + 1):
            for i in range(columns):
                before, after = max(i - span, 0), min(i + span, columns - 1)
                ends = max(maxima[0, j, before], maxima[0, j, after])
                maxima[span, j, i] = max(maxima[span - 1, j, i], ends)
    return maxima
