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
    """A level pinhole camera at a position in the world frame [m].

    It looks towards `yaw`, counter-clockwise from east, and `pitch`, downwards from the horizontal,
    and sees `field_of_view` across its width [rad].
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
    """Parallel rays straight down from a height `top` [m], north up, a `pixel` in metres."""
    return Camera(
        position=np.array([*middle, top]),
        forward=np.array([0.0, 0.0, -1.0]),
        right=np.array([pixel, 0.0, 0.0]),
        down=np.array([0.0, -pixel, 0.0]),
        width=width,
        height=height,
        pinhole=False,
    )
