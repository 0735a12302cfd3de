"""Lenses: which ray belongs to which pixel, against OpenCV; lenses that fold are refused."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.model import CameraSensor, Equidistant, RadialTangential
from terrain_forge.sensors.lens import (
    OPTICAL,
    calibration_of,
    lens_of,
    project,
    rays_of,
    unproject,
)

_LENSES = {
    "pinhole": (85.0, None),
    "barrel": (85.0, RadialTangential(k=(-0.17, 0.02, 1e-3, -2e-3, 0.003))),
    "cushion": (60.0, RadialTangential(k=(0.1, 0.02, 0.0, 0.0))),
    "fisheye": (150.0, Equidistant(k=(0.03, -0.01, 0.002, -3e-4))),
}
_SIZE = {"width_px": 320, "height_px": 180}


@pytest.fixture(params=_LENSES)
def sensor(request):
    angle, distortion = _LENSES[request.param]
    return CameraSensor(name="eye", horizontal_fov_deg=angle, distortion=distortion, **_SIZE)


def _places(count=500):
    return np.random.default_rng(1).uniform((-0.5, -0.5), (319.5, 179.5), (count, 2))


def test_rays_lead_back_to_their_pixels(sensor):
    lens, places = lens_of(sensor, rectified=False), _places()
    rays = unproject(lens, places)
    assert np.allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-14)
    pixels, seen = project(lens, 7.0 * rays)
    assert seen.all()
    assert np.abs(pixels - places).max() < 1e-9


def test_rays_are_those_of_opencv(sensor):
    cv2 = pytest.importorskip("cv2")
    lens, places = lens_of(sensor, rectified=False), _places()
    points = 3.0 * unproject(lens, places)[:, None]
    written = calibration_of(sensor, rectified=False)
    fu, fv, cu, cv = written["intrinsics"]
    matrix = np.array([[fu, 0.0, cu], [0.0, fv, cv], [0.0, 0.0, 1.0]])
    k, still = np.array(written["distortion_coefficients"] or [0.0] * 4), np.zeros(3)
    model = cv2.fisheye if written["distortion_model"] == "equidistant" else cv2
    found, _ = model.projectPoints(points, still, still, matrix, k)
    assert np.abs(found[:, 0] - places).max() < 1e-9


def test_the_table_holds_the_rays_of_pixel_centres(sensor):
    lens = lens_of(sensor, rectified=False)
    for column, row in ((0, 0), (319, 179), (77, 31)):
        wanted = unproject(lens, np.array([[column, row]], float))[0]
        assert np.allclose(rays_of(lens)[row, column], wanted, atol=1e-7)


def test_the_first_pixels_centre_is_at_0():
    """A pinhole of 90° and 4 pixels: f = 2, the middle at 1.5, the edges at ±45°."""
    sensor = CameraSensor(name="eye", width_px=8, height_px=8, horizontal_fov_deg=90.0)
    lens = lens_of(sensor, rectified=False)
    assert calibration_of(sensor, rectified=False)["intrinsics"] == pytest.approx([4, 4, 3.5, 3.5])
    edge = unproject(lens, np.array([[-0.5, 3.5], [3.5, 3.5], [7.5, 3.5], [3.5, -0.5]]))
    wanted = np.array([[-1, 0, 1], [0, 0, 1], [1, 0, 1], [0, -1, 1]])
    assert np.allclose(edge / edge[:, 2:], wanted)
    # right and down of the picture, in the camera's own frame
    assert np.array_equal(OPTICAL @ [0, 0, 1], [1, 0, 0])
    assert np.array_equal(OPTICAL @ [1, 0, 0], [0, -1, 0])
    assert np.array_equal(OPTICAL @ [0, 1, 0], [0, 0, -1])


def test_rectified_pictures_are_a_pinholes_of_the_same_focal_length(sensor):
    lens = lens_of(sensor, rectified=True)
    place = np.add(lens.centre, (100.0, -50.0))
    ray = unproject(lens, place[None])[0]
    assert ray[:2] / ray[2] * lens.focal[0] == pytest.approx([100.0, -50.0])
    assert calibration_of(sensor, rectified=True)["distortion_model"] == "none"


def test_a_fisheye_sees_behind_itself():
    bent = Equidistant()
    sensor = CameraSensor(name="eye", horizontal_fov_deg=200.0, distortion=bent, **_SIZE)
    lens = lens_of(sensor, rectified=False)
    ray = unproject(lens, np.array([[-0.5, 89.5]]))[0]
    assert np.degrees(np.arctan2(ray[0], ray[2])) == pytest.approx(-100.0)
    assert not project(lens_of(sensor, rectified=True), ray[None])[1][0]


@pytest.mark.parametrize(
    ("bent", "what"),
    [
        (RadialTangential(k=(-0.6, 0.0, 0.0, 0.0)), "folds 87 px"),
        (Equidistant(k=(-0.5, 0.0, 0.0, 0.0)), "folds"),
    ],
)
def test_a_lens_that_folds_within_its_picture_is_refused(bent, what):
    with pytest.raises(ValueError, match=what):
        CameraSensor(name="eye", distortion=bent, **_SIZE)
    CameraSensor(name="eye", distortion=bent, images=("rectified",), **_SIZE)


def test_the_fold_is_where_the_radius_stops_to_grow():
    """Of r - 0.6 r³ at r = 1/√1.8."""
    bent = RadialTangential(k=(-0.6, 0.0, 0.0, 0.0))
    assert bent.fold == pytest.approx(1.0 / np.sqrt(1.8), abs=0.006)
    lens = lens_of(CameraSensor(name="eye", **_SIZE), rectified=False)
    folding = lens._replace(kind=1, k=(-0.6, 0.0, 0.0, 0.0, 0.0), fold=bent.fold)
    corner, inside = unproject(folding, np.array([[319.0, 179.0], [200.0, 90.0]]))
    assert np.isnan(corner).all()
    assert np.isfinite(inside).all()
