"""Our own stereo visual odometry, a baseline that needs nothing but OpenCV."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError
from terrain_forge.evaluation.poses import TimedPoses

_CORNERS, _QUALITY, _APART = 1500, 0.005, 8
_WINDOW, _LEVELS = (21, 21), 4
_BACK = 0.5
"""How far a point may be from where it began, tracked there and back [px]."""
_ROWS = 1.0
"""How far apart in rows the two images of a point may be [px]."""
_DISPARITY = 1.0
"""Smallest disparity that has a depth [px]."""
_INLIER = 1.0
"""Largest error of projection of a point that is believed [px]."""
_KEPT = 0.5
"""A new keyframe is made where less than this part of the last one's points is seen."""
_LEAST = 12


class _Keyframe(NamedTuple):
    pixels: NDArray[np.float32]
    points: Array
    place: Array
    turn: Array


def stereo_odometry(
    pairs: Iterable[tuple[float, NDArray[np.uint8], NDArray[np.uint8]]],
    *,
    focal: tuple[float, float],
    centre: tuple[float, float],
    baseline: float,
) -> TimedPoses:
    """The motion of the left camera from rectified pairs, in its frame at the first one.

    Corners (Shi & Tomasi 1994) of a keyframe get their depth from the right image, are tracked
    (Lucas & Kanade 1981, pyramids: Bouguet 2000) and give the pose by P3P in RANSAC and refinement;
    a pair in which too few are found is left out.

    Args:
        pairs: Time [s], left and right image, shape [rows, columns].
        focal: Focal lengths of both, across and down [px].
        centre: Principal point, column and row; the first pixel's centre is 0.
        baseline: Distance of the cameras [m].

    Raises:
        DataError: if OpenCV is missing, or fewer than two pairs give a pose.
    """
    cv2 = opencv("stereo odometry")
    camera = np.array([[focal[0], 0, centre[0]], [0, focal[1], centre[1]], [0, 0, 1.0]])
    times: list[float] = []
    places: list[Array] = []
    turns: list[Array] = []
    keyframe: _Keyframe | None = None
    last: NDArray[np.uint8] | None = None
    pixels = np.zeros((0, 2), np.float32)
    for time, left, right in pairs:
        place, turn = np.zeros(3), np.eye(3)
        if keyframe is not None and last is not None:
            pixels, seen = _tracked(cv2, last, left, pixels)
            pixels = pixels[seen]
            keyframe = keyframe._replace(points=keyframe.points[seen])
            found = _pose(cv2, keyframe.points, pixels, camera)
            if found is None:
                keyframe = None
                last = left
                continue
            own_place, own_turn, inlier = found
            place = keyframe.place + keyframe.turn @ own_place
            turn = keyframe.turn @ own_turn
            pixels = pixels[inlier]
            keyframe = keyframe._replace(points=keyframe.points[inlier])
        elif times:
            place, turn = places[-1], turns[-1]  # lost for a moment: it goes on from there
        if keyframe is None or len(pixels) < _KEPT * len(keyframe.pixels):
            pixels, points = _triangulated(cv2, left, right, camera, baseline)
            keyframe = _Keyframe(pixels, points, place, turn) if len(points) >= _LEAST else None
        if keyframe is not None:
            times.append(time)
            places.append(place)
            turns.append(turn)
        last = left
    if len(times) < 2:
        raise DataError("stereo odometry found no motion: too few corners in the images")
    from scipy.spatial.transform import Rotation

    quaternion = np.roll(Rotation.from_matrix(np.array(turns)).as_quat(), 1, axis=-1)
    return TimedPoses(
        name="stereo-odometry",
        time=np.array(times),
        position=np.array(places),
        quaternion=quaternion,
    )


def opencv(what: str) -> Any:
    """The module of OpenCV.

    Raises:
        DataError: says what needs it, if it is missing.
    """
    try:
        import cv2
    except ImportError:
        raise DataError(f"{what} needs OpenCV: pip install 'terrain-forge[slam]'") from None
    return cv2


def _tracked(
    cv2: Any, before: NDArray[np.uint8], now: NDArray[np.uint8], pixels: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Where points of one image are in another, and which were found there and back."""
    if not len(pixels):
        return pixels, np.zeros(0, bool)
    options = {"winSize": _WINDOW, "maxLevel": _LEVELS}
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, now, pixels, None, **options)
    back, again, _ = cv2.calcOpticalFlowPyrLK(now, before, there, None, **options)
    near = np.linalg.norm(back - pixels, axis=1) < _BACK
    rows, columns = now.shape
    inside = (there >= 0).all(axis=1) & (there < (columns - 1, rows - 1)).all(axis=1)
    return there, found[:, 0].astype(bool) & again[:, 0].astype(bool) & near & inside


def _triangulated(
    cv2: Any,
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    camera: Array,
    baseline: float,
) -> tuple[NDArray[np.float32], Array]:
    """Corners of the left image and where they are in its camera's frame [m]."""
    corners = cv2.goodFeaturesToTrack(left, _CORNERS, _QUALITY, _APART)
    if corners is None:
        return np.zeros((0, 2), np.float32), np.zeros((0, 3))
    pixels = corners.reshape(-1, 2)
    other, seen = _tracked(cv2, left, right, pixels)
    disparity = pixels[:, 0] - other[:, 0]
    seen &= (np.abs(pixels[:, 1] - other[:, 1]) < _ROWS) & (disparity > _DISPARITY)
    pixels, disparity = pixels[seen], disparity[seen].astype(np.float64)
    depth = camera[0, 0] * baseline / disparity
    rays = (pixels.astype(np.float64) - camera[:2, 2]) / camera[[0, 1], [0, 1]]
    return pixels, np.column_stack([rays * depth[:, None], depth])


def _pose(
    cv2: Any, points: Array, pixels: NDArray[np.float32], camera: Array
) -> tuple[Array, Array, NDArray[np.intp]] | None:
    """Place and rotation of the camera that sees points at pixels, and which of them fit."""
    if len(points) < _LEAST:
        return None
    cv2.setRNGSeed(0)
    good, vector, shift, inlier = cv2.solvePnPRansac(
        points, pixels.astype(np.float64), camera, None, iterationsCount=200,
        reprojectionError=_INLIER, confidence=0.999, flags=cv2.SOLVEPNP_P3P,
    )  # fmt: skip
    if not good or inlier is None or len(inlier) < _LEAST:
        return None
    rows = inlier[:, 0].astype(np.intp)
    vector, shift = cv2.solvePnPRefineLM(
        points[rows], pixels[rows].astype(np.float64), camera, None, vector, shift
    )
    turn = cv2.Rodrigues(vector)[0]
    return -turn.T @ shift[:, 0], turn.T, rows
