"""Figures of lidars that are sold, for the presets of `sensors/lidar.py`.

Beams are listed as the makers' drivers number them: Velodyne's and Livox's from the lowest up,
Ouster's from the highest down. docs/lidars.md tells which figures are assumptions.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

_OS1_ELEVATIONS = (
    16.729, 16.118, 15.543, 14.995, 14.526, 13.937, 13.381, 12.837, 12.378, 11.801, 11.251, 10.704,
    10.251, 9.693, 9.138, 8.603, 8.149, 7.594, 7.049, 6.513, 6.056, 5.504, 4.961, 4.419, 3.967,
    3.424, 2.881, 2.328, 1.88, 1.337, 0.787, 0.239, -0.205, -0.756, -1.39, -1.854, -2.3, -2.839,
    -3.386, -3.935, -4.391, -4.929, -5.472, -6.028, -6.471, -7.02, -7.563, -8.116, -8.572, -9.112,
    -9.66, -10.227, -10.687, -11.226, -11.777, -12.35, -12.807, -13.347, -13.902, -14.49, -14.968,
    -15.504, -16.078, -16.679,
)  # fmt: skip
_OS1_AZIMUTHS = (
    3.073, 0.904, -1.261, -3.384, 3.048, 0.9, -1.235, -3.335, 3.029, 0.915, -1.2, -3.301, 3.026,
    0.921, -1.179, -3.268, 3.032, 0.933, -1.156, -3.23, 3.028, 0.953, -1.131, -3.209, 3.059, 0.976,
    -1.112, -3.182, 3.071, 0.99, -1.087, -3.155, 3.097, 1.014, -1.103, -3.133, 3.118, 1.035, -1.039,
    -3.116, 3.144, 1.061, -1.013, -3.101, 3.178, 1.092, -0.993, -3.089, 3.217, 1.125, -0.972,
    -3.072, 3.265, 1.159, -0.949, -3.066, 3.321, 1.204, -0.921, -3.055, 3.381, 1.252, -0.898,
    -3.071,
)  # fmt: skip
_HDL_64E_ORDER = (
    6, 7, 10, 11, 0, 1, 4, 5, 8, 9, 14, 15, 18, 19, 22, 23, 12, 13, 16, 17, 20, 21, 26, 27, 30, 31,
    2, 3, 24, 25, 28, 29,
)  # fmt: skip
"""Numbers in their block of the lasers of an HDL-64E, from the lowest up."""


def _interleaved(beams: int, step: float) -> tuple[float, ...]:
    """When beams fire [µs] that take turns between the lower and the upper half, lowest first."""
    half = beams // 2
    order = [2 * n for n in range(half)] + [2 * n + 1 for n in range(half)]
    return tuple(round(step * place, 3) for place in order)


def _hdl_64e_times() -> tuple[float, ...]:
    """Both blocks fire at once, groups of four lasers every 6 µs."""
    within = (0.0, 1.26, 2.46, 3.66)
    block = tuple(round(6.0 * (n // 4) + within[n % 4], 3) for n in _HDL_64E_ORDER)
    return block + block


def _rising(low: float, step: float, count: int) -> tuple[float, ...]:
    return tuple(np.round(low + step * np.arange(count), 4).tolist())


LIDAR_PRESETS: Mapping[str, Mapping[str, Any]] = {
    # VLP-16 User Manual 63-9243 Rev. E, chapters 2 and 9: angles, 2.304 µs from beam to beam,
    # 55.296 µs from firing to firing, ±3 cm, 2 mm; the power of a return is our assumption.
    "vlp-16": {
        "elevations_deg": _rising(-15.0, 2.0, 16),
        "firing_times_us": _interleaved(16, 2.304),
        "firing_period_us": 55.296,
        "range_min_m": 0.5,
        "range_max_m": 100.0,
        "range_at_tenth_m": 50.0,
        "noise_m": 0.015,
        "quantum_m": 0.002,
    },
    # HDL-32E User Manual 63-9113 and its packet timing note 63-9277 Rev. D: 1.152 µs from beam to
    # beam, 46.08 µs from firing to firing; angles as in Velodyne's db.xml, in hundredths.
    "hdl-32e": {
        "elevations_deg": tuple(np.round(-92.0 / 3.0 + 4.0 / 3.0 * np.arange(32), 2).tolist()),
        "firing_times_us": _interleaved(32, 1.152),
        "firing_period_us": 46.08,
        "range_min_m": 1.0,
        "range_max_m": 100.0,
        "range_at_tenth_m": 50.0,
        "noise_m": 0.02,
        "quantum_m": 0.002,
    },
    # HDL-64E S2 User Manual, appendix with the laser firing times; nominal angles: thirds of a
    # degree above -8.33°, halves below. 50 m at a reflectance of a tenth, 120 m at most.
    "hdl-64e": {
        "elevations_deg": (
            *_rising(-24.0 - 1.0 / 3.0, 0.5, 32), *_rising(-8.0 - 1.0 / 3.0, 1.0 / 3.0, 32),
        ),
        "firing_times_us": _hdl_64e_times(),
        "firing_period_us": 48.0,
        "range_min_m": 0.9,
        "range_max_m": 120.0,
        "range_at_tenth_m": 50.0,
        "noise_m": 0.02,
        "quantum_m": 0.002,
    },
    # The unit 991913000010, of the first generation: calibration and beam origin in the metadata
    # that Ouster's SDK is tested with (tests/metadata/2_1_2_os1-991913000010-64.json); ranges and
    # noise of the OS1 datasheet.
    "os1-64": {
        "elevations_deg": _OS1_ELEVATIONS,
        "azimuth_offsets_deg": _OS1_AZIMUTHS,
        "horizontal_samples": 1024,
        "beam_origin_m": 0.012163,
        "range_min_m": 0.8,
        "range_max_m": 120.0,
        "range_at_tenth_m": 40.0,
        "noise_m": 0.015,
        "quantum_m": 0.001,
    },
    # The simulated lidar of MarsSim (its actor_template.sdf): everything at one moment.
    "paper-64": {
        "channels": 64,
        "vertical_fov_deg": 32.0,
        "horizontal_samples": 1800,
        "range_min_m": 1.5,
        "range_max_m": 100.0,
        "noise_m": 0.01,
        "snapshot": True,
    },
    # Livox Avia User Manual v1.0: 70.4° × 77.2°, 240 000 points a second, 190 m at a reflectance of
    # a tenth, 2 cm. Six lasers above each other and the prisms' speeds are assumptions, the latter
    # those of a Mid-40 (Brazeal et al. 2021, doi:10.3390/s21144722).
    "livox-avia": {
        "elevations_deg": _rising(-3.4, 1.36, 6),
        "prism_rpm": (7294.0, -4664.0),
        "prism_deviations_deg": (17.6, 17.6),
        "firing_period_us": 25.0,
        "range_min_m": 1.0,
        "range_max_m": 450.0,
        "range_at_tenth_m": 190.0,
        "noise_m": 0.02,
        "quantum_m": 0.001,
    },
}  # fmt: skip
"""Fields of a `LidarSensor` by the names of presets."""
