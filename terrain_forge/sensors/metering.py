"""The shutter of each picture of a camera: fixed, or by what the camera saw a moment ago."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

from terrain_forge.base import Mask, portable
from terrain_forge.model import AutoExposure, FixedExposure
from terrain_forge.sensors.exposure import Picture, Shutter

LOOK = 32, 18
"""Columns and rows of the small pictures that are metered."""
_BRIGHTEST = 0.9
_SKY = 0.95
"""What the brightest tenth of a whole picture begins at, at most: the sky stays below white."""
_FEWEST = 0.1
"""Part of a picture that is metered for itself where it is no sky."""
_LAGS = 4.0
"""Time constants that are looked back."""
_LOOKS = 6.0
"""Looks in a time constant, at most."""
_STEPS = 64
"""Exposures of a factor 2."""


class Meter:
    """Meters every few pictures; what it says of a picture hangs on its number alone."""

    def __init__(
        self,
        spec: FixedExposure | AutoExposure,
        *,
        rate: float,
        enough: float,
        look: Callable[[int], tuple[Picture, Mask]],
    ) -> None:
        """Begin to meter.

        Args:
            spec: How pictures are exposed.
            rate: Of the pictures [Hz].
            enough: Radiance times time that fills a pixel [W s/(m² sr)].
            look: A small picture's radiance at a picture's time, shape [height, width,
                channels], and which of its pixels are sky, shape [height, width].
        """
        self._spec, self._rate, self._enough = spec, rate, enough
        self._look = look
        # All are kept, a number each: in the end the exposures of a whole recording are told.
        self._wanted = cache(self._logarithm)

    def shutter(self, number: int) -> Shutter:
        """The shutter of a picture."""
        spec = self._spec
        if isinstance(spec, FixedExposure):
            return Shutter(spec.time_s, spec.gain)
        stride = max(1, math.floor(spec.lag_s * self._rate / _LOOKS))
        newest = number - number % stride
        count = math.floor(_LAGS * spec.lag_s * self._rate / stride) + 1
        numbers = [n for n in range(newest, newest - count * stride, -stride) if n >= 0]
        fade = 1.0 / (self._rate * spec.lag_s) if spec.lag_s else 0.0
        weights = [math.exp(-fade * (number - n)) for n in numbers]
        # What was before the first picture was like it.
        if len(numbers) < count and spec.lag_s:
            weights[-1] = weights[-1] / -math.expm1(-fade * stride)
        total = math.fsum(weights)
        mean = math.fsum(w * self._wanted(n) for w, n in zip(weights, numbers, strict=True)) / total
        # In whole steps, as cameras do, so that nothing hangs on the last bit of a mean.
        wanted = float(portable.power(2.0, round(mean * _STEPS) / _STEPS))
        time = min(max(wanted, spec.shortest_s), spec.longest_s)
        return Shutter(time, min(max(wanted / time, 1.0), spec.most_gain))

    def _logarithm(self, number: int) -> float:
        """Logarithm to the base of 2 of the time that a look wants [s], at a gain of 1."""
        spec = self._spec
        assert isinstance(spec, AutoExposure)
        radiance, sky = self._look(number)
        metered = radiance[~sky] if (~sky).mean() >= _FEWEST else radiance
        bright = _brightest(metered) / spec.level
        if spec.sky == "held":
            bright = max(bright, _brightest(radiance) / _SKY)
        least, most = self._enough / spec.longest_s, self._enough / spec.shortest_s
        return math.log2(self._enough / min(max(bright, 1e-6 * least), 1e6 * most))


def _brightest(radiance: Picture) -> float:
    """What the brightest tenth of some pixels begins at."""
    values = sorted(radiance.ravel().tolist())
    return float(values[int(_BRIGHTEST * (len(values) - 1))])
