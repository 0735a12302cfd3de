"""ROS messages of cameras: pictures, their calibration, true depth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from terrain_forge.base import Array
from terrain_forge.datasets.pictures import RECTIFIED, picture_of, truth_stream
from terrain_forge.datasets.reader import Recording
from terrain_forge.datasets.ros_parts import Pair, RosParts
from terrain_forge.datasets.streams import RecordedCamera

_IMAGE, _INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
_MODELS = {"radtan": "plumb_bob", "none": "plumb_bob", "equidistant": "equidistant"}

Stream = tuple[str, str, Callable[[], Iterator[Pair]]]
"""A topic's name, the type of its messages, and they."""


class CameraMessages:
    """Makes the messages of a recording's cameras, whose frames are named by their folders."""

    def __init__(self, recording: Recording, parts: RosParts, frames: Mapping[str, str]) -> None:
        self._recording, self._parts, self._frames = recording, parts, frames
        # A right camera's P leads from the left one's frame, and readers want one frame of both.
        self._views = {**frames, **{p.right.key: frames[p.left.key] for p in recording.pairs}}

    def streams(self, camera: RecordedCamera, *, depth: bool) -> Iterator[Stream]:
        """What a camera tells, with its true depth where that is wanted and was recorded."""
        view, projection = self._views[camera.key], projection_of(self._recording, camera)
        infos = self._infos(camera, view, camera.distortion, projection)
        yield f"/{camera.key}/camera_info", _INFO, infos
        yield f"/{camera.key}/image_raw", _IMAGE, self._pictures(camera, "data", view)
        if depth and "depth" in camera.channels:
            yield from self._depth(camera)

    def _depth(self, camera: RecordedCamera) -> Iterator[Stream]:
        """Depth with a camera_info as of a camera alone, and the pictures whose depth it is."""
        frame, name = self._frames[camera.key], f"/{camera.key}"

        def depths() -> Iterator[Pair]:
            for number, stamp in enumerate(camera.stamps.tolist()):
                metres = camera.depth(number).astype(np.float32)
                metres[metres == 0.0] = np.nan  # REP 118
                yield stamp, self._image(stamp, frame, metres, "32FC1")

        rectified = truth_stream(camera) == RECTIFIED
        lens = ("none", np.zeros(0)) if rectified else camera.distortion
        infos = self._infos(camera, frame, lens, np.hstack([camera.matrix, np.zeros((3, 1))]))
        yield f"{name}/depth/camera_info", _INFO, infos
        yield f"{name}/depth/{'image_rect' if rectified else 'image_raw'}", _IMAGE, depths
        if rectified:
            yield f"{name}/image_rect", _IMAGE, self._pictures(camera, RECTIFIED, frame)

    def _pictures(
        self, camera: RecordedCamera, stream: str, frame: str
    ) -> Callable[[], Iterator[Pair]]:
        def pictures() -> Iterator[Pair]:
            for number, stamp in enumerate(camera.stamps.tolist()):
                picture = picture_of(camera, number, stream)
                encoding = "rgb8" if picture.ndim == 3 else "mono8"
                yield stamp, self._image(stamp, frame, picture, encoding)

        return pictures

    def _image(self, stamp: int, frame: str, picture: Any, encoding: str) -> Any:
        rows, columns = picture.shape[:2]
        data = np.ascontiguousarray(picture).view(np.uint8).ravel()
        header, step = self._parts.header(stamp, frame), data.size // rows
        return self._parts.make(_IMAGE, header, rows, columns, encoding, 0, step, data)

    def _infos(
        self, camera: RecordedCamera, frame: str, lens: tuple[str, Array], projection: Array
    ) -> Callable[[], Iterator[Pair]]:
        """Calibration with each picture."""
        model, given = lens
        coefficients = np.zeros(4 if model == "equidistant" else 5)
        coefficients[: len(given)] = given
        region = self._parts.make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        width, height = camera.size
        matrices = camera.matrix.ravel(), np.eye(3).ravel(), projection.ravel()
        told = (height, width, _MODELS[model], coefficients, *matrices, 0, 0, region)

        def infos() -> Iterator[Pair]:
            for stamp in camera.stamps.tolist():
                yield stamp, self._parts.make(_INFO, self._parts.header(stamp, frame), *told)

        return infos


def projection_of(recording: Recording, camera: RecordedCamera) -> Array:
    """The projection matrix, shape [3, 4]: of undistorted pictures of the same focal length.

    Its last column leads from the left camera's frame: P[3] of the right one is −f·baseline.
    """
    found = np.hstack([camera.matrix, np.zeros((3, 1))])
    for pair in recording.pairs:
        if pair.right is camera:
            found[:, :3] = pair.left.matrix
            found[0, 3] = -found[0, 0] * pair.baseline
    return found
