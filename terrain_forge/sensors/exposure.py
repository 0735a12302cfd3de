"""From radiance to a picture's values: what a lens lets through, a chip counts and a reader adds.

Electrons of a pixel are Poisson's, or from some dozens on Gauss' of the same variance; with what
reading adds, variance over mean is the line of the photon transfer (EMVA 1288).
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inner, kernel, mix, normal, normals, over_chunks, poisson
from terrain_forge.model import CameraSensor, Equidistant
from terrain_forge.sensors.lens import Lens, rays_of

Image = NDArray[np.uint8] | NDArray[np.uint16]
Picture = NDArray[np.float32]

_VISIBLE = 0.39
"""Part of the Sun's power between 400 and 700 nm (ASTM E490)."""
_PHOTON = 3.61e-19
"""Energy of a photon of 550 nm [J]."""
_FEW = 40.0
"""Electrons up to which a pixel's are drawn by Poisson's law."""
_PRNU, _DSNU = 1, 2


class Shutter(NamedTuple):
    """How one picture was exposed."""

    time: float
    """How long [s]."""
    gain: float
    """Amplification."""


class Chip:
    """The electronics of a camera behind a lens, with patterns of its own."""

    def __init__(
        self, sensor: CameraSensor, lens: Lens, key: np.uint64, *, sensitivity: float = 1.0
    ) -> None:
        self.sensor, self.lens = sensor, lens
        channels = 3 if sensor.colour else 1
        self.per_radiance = sensitivity * electrons_per_radiance(sensor)
        """Electrons per second and radiance on the axis [e m² sr/(W s)]."""
        noise, shape = sensor.noise, (lens.height, lens.width, channels)
        bright = vignetting(sensor, lens)[:, :, None]

        def drawn(what: int) -> Array:
            return np.asarray(normals(np.uint64(mix(key, what)), math.prod(shape)).reshape(shape))

        self.response = bright * (1.0 + noise.prnu * drawn(_PRNU)).clip(0.0).astype(np.float32)
        """What a pixel counts as a part of what one on the axis does."""
        self.dark = (noise.dsnu_e * drawn(_DSNU)).astype(np.float32)
        """Electrons that a pixel always has [e]."""

    @property
    def highest(self) -> int:
        """The largest value of a pixel."""
        return int(2**self.sensor.bits) - 1

    def values_per_electron(self, gain: float) -> float:
        """The gain of the photon transfer: values for an electron."""
        return gain * self.highest / self.sensor.noise.full_well_e

    def read(self, radiance: Picture, shutter: Shutter, key: np.uint64) -> Image:
        """The picture's values, shape [height, width], or [height, width, 3] of a colour camera.

        Args:
            radiance: What comes to the lens from each pixel's direction [W/(m² sr)], shape
                [height, width, channels].
            shutter: How long, and how much amplified.
            key: What the picture's chance hangs on.
        """
        noise = self.sensor.noise
        blurred = blur(radiance, self.sensor.psf_px)
        values = np.empty(blurred.shape, dtype=np.uint16)
        linear = 65535 if self.sensor.gamma > 1.0 else self.highest
        over_chunks(
            _count,
            values.size,
            blurred.reshape(-1),
            self.response.reshape(-1),
            self.dark.reshape(-1),
            key,
            self.per_radiance * shutter.time,
            float(noise.shot),
            noise.read_e,
            noise.full_well_e,
            shutter.gain * linear / noise.full_well_e,
            float(linear),
            values.reshape(-1),
        )
        if self.sensor.gamma > 1.0:
            values = _curve(self.sensor.gamma, self.highest)[values]
        picture = values if self.sensor.bits > 8 else values.astype(np.uint8)
        return picture if self.sensor.colour else picture[:, :, 0]

    def figures(self) -> dict[str, Any]:
        """What a reader must know to turn values into radiance, with a picture's own shutter."""
        noise = self.sensor.noise
        return {
            "bits": self.sensor.bits,
            "gamma": self.sensor.gamma,
            "full_well_e": noise.full_well_e,
            "read_noise_e": noise.read_e,
            "values_per_electron_at_gain_1": self.values_per_electron(1.0),
            "electrons_per_radiance_and_second": self.per_radiance,
        }


def electrons_per_radiance(sensor: CameraSensor) -> float:
    """Electrons per second and radiance of a pixel on the axis [e m² sr/(W s)].

    Radiance is that of all sunlight; a pixel of a colour camera takes a third of what is visible.
    """
    area = (1e-6 * sensor.pixel_um) ** 2
    part = _VISIBLE * sensor.quantum_efficiency / (3.0 if sensor.colour else 1.0)
    return math.pi / (4.0 * sensor.f_number**2) * area * part / _PHOTON


def vignetting(sensor: CameraSensor, lens: Lens) -> Picture:
    """Brightness of an even scene over that on the axis, shape [height, width]."""
    if sensor.vignetting is None:
        return np.ones((lens.height, lens.width), dtype=np.float32)
    a, b, c = sensor.vignetting
    x = np.arange(lens.width) - lens.centre[0]
    y = np.arange(lens.height) - lens.centre[1]
    r = (x**2 + y[:, None] ** 2) / (0.25 * (lens.width**2 + lens.height**2))
    bright = 1.0 + r * (a + r * (b + r * c))
    if not isinstance(sensor.distortion, Equidistant):
        bright = bright * np.square(np.square(rays_of(lens)[:, :, 2]))
    return np.maximum(bright, 0.0).astype(np.float32)


def blur(picture: Picture, width: float) -> Picture:
    """A picture through a Gaussian of a standard deviation [pixels]; its light stays the same.

    The weights are those of the discrete Gaussian (Lindeberg 1990, doi:10.1109/34.49051), whose
    variance is exact however narrow it is; light that would leave at an edge is thrown back.
    """
    if width == 0.0:
        return np.ascontiguousarray(picture, np.float32)
    rows, _, channels = picture.shape
    weights = _gaussian(width)
    across = np.empty_like(picture, dtype=np.float32)
    flat = np.ascontiguousarray(picture, np.float32).reshape(rows, -1)
    over_chunks(_blur_rows, rows, flat, channels, weights, across.reshape(rows, -1))
    down = np.empty_like(across)
    over_chunks(_blur_columns, rows, across.reshape(rows, -1), weights, down.reshape(rows, -1))
    return down


@cache
def _gaussian(width: float) -> Picture:
    """Weights from the middle outwards: exp(-t) Iₙ(t), t the variance."""
    t = width * width
    half = math.ceil(4.0 * width) + 1

    def bessel(n: int) -> float:
        terms = range(int(t) + 40)
        return math.fsum(
            math.exp(
                (2 * m + n) * math.log(0.5 * t) - math.lgamma(m + 1) - math.lgamma(m + n + 1) - t
            )
            for m in terms
        )

    weights = np.array([bessel(n) for n in range(half + 1)])
    weights /= weights[0] + 2.0 * math.fsum(weights[1:])
    return weights.astype(np.float32)


@cache
def _curve(gamma: float, highest: int) -> NDArray[np.uint16]:
    """Values of linear ones of 16 bits."""
    curve = [highest * (n / 65535) ** (1.0 / gamma) for n in range(65536)]
    return np.round(curve).astype(np.uint16)


@kernel
def _count(  # type: ignore[no-untyped-def]
    first, last, radiance, response, dark, key, per_radiance, shot, read, well, gain, top,
    values,
):  # fmt: skip
    """Count electrons, read them, and round."""
    reading = read * read
    for n in range(first, last):
        mean = radiance[n] * response[n] * per_radiance
        hashed = mix(key, n)
        if shot > 0.0 and mean < _FEW:
            electrons = poisson(hashed, mean) + read * normal(mix(hashed, 1))
        else:
            electrons = mean + np.sqrt(shot * mean + reading) * normal(hashed)
        value = (min(electrons, well) + dark[n]) * gain + 0.5
        values[n] = np.uint16(min(max(value, 0.0), top))


@inner
def _reflected(n, size):  # type: ignore[no-untyped-def]
    """The place within 0 … size - 1 that lies there where both ends are mirrors."""
    n %= 2 * size
    return n if n < size else 2 * size - 1 - n


@kernel
def _blur_rows(first, last, picture, channels, weights, out):  # type: ignore[no-untyped-def]
    size, half = picture.shape[1], len(weights) - 1
    margin, columns = half * channels, picture.shape[1] // channels
    padded = np.empty(size + 2 * margin, np.float32)
    for row in range(first, last):
        padded[margin : margin + size] = picture[row]
        for n in range(half):
            before, after = _reflected(-n - 1, columns), _reflected(columns + n, columns)
            for c in range(channels):
                padded[margin - (n + 1) * channels + c] = picture[row, before * channels + c]
                padded[margin + size + n * channels + c] = picture[row, after * channels + c]
        for n in range(size):
            out[row, n] = weights[0] * padded[margin + n]
        for k in range(1, half + 1):
            step, weight = k * channels, weights[k]
            for n in range(size):
                out[row, n] += weight * (padded[margin + n - step] + padded[margin + n + step])


@kernel
def _blur_columns(first, last, picture, weights, out):  # type: ignore[no-untyped-def]
    rows = picture.shape[0]
    for row in range(first, last):
        for n in range(picture.shape[1]):
            out[row, n] = weights[0] * picture[row, n]
        for k in range(1, len(weights)):
            above, below, weight = _reflected(row - k, rows), _reflected(row + k, rows), weights[k]
            for n in range(picture.shape[1]):
                out[row, n] += weight * (picture[above, n] + picture[below, n])
