"""Light: the Sun and the sky as a picture's renderer takes them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Triple = tuple[float, float, float]


class Light(NamedTuple):
    """What shines, already scaled to the picture's exposure."""

    towards_sun: Triple
    """Unit vector to the Sun's middle."""
    upwards: Triple
    """From the Sun's middle to its upper limb, over its distance."""
    sideways: Triple
    """From the Sun's middle to its limb beside, over its distance."""
    sun: Triple
    """Radiance of a white surface that faces the Sun, linear RGB."""
    sky: Triple
    """Radiance of a white surface under the whole sky, linear RGB."""
    lean: tuple[float, float]
    """How much more of the sky's light gets to ground for each unit of its slope's sine towards
    east and north."""
    bounce: Triple
    """Radiance of a white surface that sees only ground, linear RGB."""
    dome: NDArray[np.float64]
    """The sky's radiance: by the sine of the elevation, (k / (n - 1))², times by the chord to the
    Sun, 2 (k / (n - 1))², linear RGB, shape [2, n, 3]."""
    even: Triple
    """What is added to it all over the sky, linear RGB."""
    through: float
    """What of the Sun's light on level ground gets through the air, directly or as the sky's."""
    haze: float
    """Distance after which 1/e of the contrast is left [m]; infinite without air."""
    airy: bool
    """Whether there is a sky that shines."""
    law: NDArray[np.float64]
    """How surfaces send light back, as `photometric_law` makes it."""


def triple(vector: Any) -> Triple:
    """Three plain numbers: kernels pass them about without counting references."""
    return float(vector[0]), float(vector[1]), float(vector[2])
