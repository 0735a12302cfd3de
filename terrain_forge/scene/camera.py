"""Cameras: which ray belongs to which pixel."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from terrain_forge.base import Array, Record, shaped


@dataclass(frozen=True, kw_only=True, eq=False)
class Camera(Record):
    """A pinhole camera without distortion, or a view along parallel rays.

    The upper left pixel's centre is at column 0.5, row 0.5. With x = column - width/2 and
    y = row - height/2, a pinhole's ray leaves `position` along forward + x·right + y·down, a
    parallel ray leaves position + x·right + y·down along `forward`.
    """

    position: Array = field(metadata=shaped(3))
    """The pinhole, or the middle of the plane that parallel rays start from [m], shape [3]."""
    forward: Array = field(metadata=shaped(3))
    """Unit vector of the line of sight, shape [3]."""
    right: Array = field(metadata=shaped(3))
    """One pixel to the right: at unit distance for a pinhole, else [m], shape [3]."""
    down: Array = field(metadata=shaped(3))
    """One pixel downwards, like `right`, shape [3]."""
    width: int
    """Columns of pixels."""
    height: int
    """Rows of pixels."""
    pinhole: bool
    """Whether all rays leave one point."""

    def rays(self) -> tuple[Array, Array]:
        """Origins and directions through all pixels, row by row, shape [height · width, 3]."""
        x = np.arange(self.width) + 0.5 - 0.5 * self.width
        y = np.arange(self.height) + 0.5 - 0.5 * self.height
        across = x[None, :, None] * self.right + y[:, None, None] * self.down
        across = across.reshape(-1, 3)
        if self.pinhole:
            return np.broadcast_to(self.position, across.shape), self.forward + across
        return self.position + across, np.broadcast_to(self.forward, across.shape)


def pinhole_camera(
    *, position: Array, yaw: float, pitch: float, field_of_view: float, width: int, height: int
) -> Camera:
    """A level pinhole camera.

    Args:
        position: the pinhole in the world frame [m], shape [3].
        yaw: direction of view, counter-clockwise from east [rad].
        pitch: downwards from the horizontal [rad].
        field_of_view: across the width [rad].
        width: columns of pixels.
        height: rows of pixels.
    """
    pixel = 2.0 * np.tan(0.5 * field_of_view) / width
    level = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    right = np.array([level[1], -level[0], 0.0])
    forward = np.cos(pitch) * level - np.array([0.0, 0.0, np.sin(pitch)])
    return Camera(
        position=position,
        forward=forward,
        right=pixel * right,
        down=pixel * np.cross(forward, right),
        width=width,
        height=height,
        pinhole=True,
    )


def map_camera(
    *, middle: tuple[float, float], top: float, pixel: float, width: int, height: int
) -> Camera:
    """Parallel rays straight down, north up.

    Args:
        middle: east and north coordinate of the picture's middle [m].
        top: height that the rays start from [m].
        pixel: size of a pixel on the ground [m].
        width: columns of pixels.
        height: rows of pixels.
    """
    return Camera(
        position=np.array([*middle, top]),
        forward=np.array([0.0, 0.0, -1.0]),
        right=np.array([pixel, 0.0, 0.0]),
        down=np.array([0.0, -pixel, 0.0]),
        width=width,
        height=height,
        pinhole=False,
    )
