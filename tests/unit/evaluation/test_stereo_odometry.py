"""Our stereo odometry on pictures of a textured plane, whose motion is known exactly."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from terrain_forge.base import DataError
from terrain_forge.datasets import open_recording
from terrain_forge.evaluation import baselines, score_poses, stereo_odometry
from terrain_forge.evaluation.poses import TimedPoses
from terrain_forge.writers import write_png
from tests.helpers.recordings import EPOCH, write_recording

cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed")

_FOCAL, _SIZE, _BASELINE = 300.0, (320, 240), 0.12
_CENTRE = (159.5, 119.5)
_COUNT = 25


def _texture():
    rng = np.random.default_rng(0)
    noise = sum(
        cv2.resize(rng.normal(size=(n, n)), (1024, 1024), interpolation=cv2.INTER_CUBIC) * w
        for n, w in ((256, 1.0), (64, 1.0), (16, 1.0))
    )
    return np.clip(128 + 35 * noise, 0, 255).astype(np.uint8)


_PLANE = _texture()


def _picture(place, turn):
    """The plane z = 2 m of the world, 250 texels a metre, seen from a pose."""
    camera = np.array([[_FOCAL, 0, _CENTRE[0]], [0, _FOCAL, _CENTRE[1]], [0, 0, 1]])
    texel = np.array([[1 / 250, 0, -2], [0, 1 / 250, -2], [0, 0, 1.0]])
    lift = np.array([[1, 0, -place[0]], [0, 1, -place[1]], [0, 0, 2.0 - place[2]]])
    return cv2.warpPerspective(_PLANE, camera @ turn.T @ lift @ texel, _SIZE)


@cache
def _pairs():
    return list(_seen())


def _seen():
    for n in range(_COUNT):
        place = np.array([0.03 * n, 0.1 * np.sin(0.2 * n), 0.01 * n])
        turn = cv2.Rodrigues(np.array([0.0, 0.004 * n, 0.008 * n]))[0]
        pair = [_picture(place + turn @ [side, 0, 0], turn) for side in (0.0, _BASELINE)]
        yield 0.1 * n, place, turn, *pair


def _told(order=1, count=_COUNT, pairs=_pairs, focal=(_FOCAL, _FOCAL), centre=_CENTRE):
    seen = ((time, *pair[::order]) for time, _, _, *pair in pairs()[:count])
    return stereo_odometry(seen, focal=focal, centre=centre, baseline=_BASELINE)


def test_it_finds_the_motion():
    known = [(time, place, turn) for time, place, turn, *_ in _pairs()]
    from scipy.spatial.transform import Rotation

    quaternion = np.roll(Rotation.from_matrix([turn for *_, turn in known]).as_quat(), 1, axis=-1)
    truth = TimedPoses(
        time=np.array([time for time, *_ in known]),
        position=np.array([place for _, place, _ in known]),
        quaternion=quaternion,
    )
    told = _told()
    found = score_poses(truth, told)
    assert found.poses == _COUNT
    assert found.ate.most < 0.01
    assert _told() == told


def test_pixels_need_not_be_square():
    """The same pictures with rows a quarter closer to each other."""

    def squeezed():
        return [
            (*rest, *(cv2.resize(one, None, fx=1.0, fy=1.25) for one in pair))
            for *rest, pair in ((*told[:3], told[3:]) for told in _pairs())
        ]

    down = (_CENTRE[1] + 0.5) * 1.25 - 0.5
    told = _told(pairs=squeezed, focal=(_FOCAL, 1.25 * _FOCAL), centre=(_CENTRE[0], down))
    np.testing.assert_allclose(told.position, [place for _, place, *_ in _pairs()], atol=0.02)


def test_swapped_eyes_give_nothing():
    with pytest.raises(DataError, match="found no motion"):
        _told(order=-1, count=8)


def test_pictures_of_more_bits_come_as_their_upper_8(tmp_path, monkeypatch):
    folder = write_recording(tmp_path / "dataset", seconds=0.2, lidar=False)
    deep = (np.arange(48 * 64).reshape(48, 64) % 4096).astype(np.uint16)
    for key in ("cam0", "cam1"):
        write_png(folder / f"mav0/{key}/data/{EPOCH}.png", deep)
    index = folder / "dataset.json"
    index.write_text(index.read_text().replace('"data": {}', '"data": {"bits": 12}'))
    monkeypatch.setattr(baselines, "stereo_odometry", lambda images, **_: list(images))
    ((_, left, right),) = baselines.stereo(open_recording(folder))
    np.testing.assert_array_equal(left, deep // 16)
    np.testing.assert_array_equal(right, deep // 16)
