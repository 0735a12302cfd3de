"""Turns and codes of the frames go there and back, whatever they are given."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from terrain_forge.base import (
    compass_to_direction,
    image_rows,
    linear_from_srgb,
    matrix_from_quaternion,
    quaternion_from_rpy,
    rpy_from_matrix,
    rpy_from_quaternion,
    srgb_from_linear,
)

FEW = settings(max_examples=40, deadline=None, derandomize=True, database=None)
angle = st.floats(-3.1, 3.1)
tilt = st.floats(-1.5, 1.5)  # short of the pole, where roll and yaw are one


@FEW
@given(roll=angle, pitch=tilt, yaw=angle)
def test_angles_survive_quaternions_and_matrices(roll, pitch, yaw):
    rpy = np.array([roll, pitch, yaw])
    quaternion = quaternion_from_rpy(rpy)
    np.testing.assert_allclose(np.linalg.norm(quaternion), 1.0, rtol=1e-12)
    np.testing.assert_allclose(rpy_from_quaternion(quaternion), rpy, atol=1e-9)
    np.testing.assert_allclose(rpy_from_matrix(matrix_from_quaternion(quaternion)), rpy, atol=1e-9)


@FEW
@given(roll=angle, pitch=angle, yaw=angle)
def test_matrices_turn_and_do_not_mirror(roll, pitch, yaw):
    matrix = matrix_from_quaternion(quaternion_from_rpy(np.array([roll, pitch, yaw])))
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) > 0.999
    about_z = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)])
    np.testing.assert_allclose(matrix[:, 0], about_z, atol=1e-12)  # where the rover's x points


@FEW
@given(azimuth=st.floats(0, 6.28), elevation=tilt)
def test_compass_directions_are_unit_vectors_clockwise_from_north(azimuth, elevation):
    east, north, up = compass_to_direction(azimuth, elevation)
    np.testing.assert_allclose(np.hypot(np.hypot(east, north), up), 1.0, rtol=1e-12)
    np.testing.assert_allclose(np.arctan2(east, north) % (2 * np.pi), azimuth, atol=1e-9)
    np.testing.assert_allclose(np.arcsin(up), elevation, atol=1e-9)


@FEW
@given(value=st.floats(0, 1))
def test_colours_survive_srgb(value):
    np.testing.assert_allclose(
        srgb_from_linear(linear_from_srgb(np.array([value]))), value, atol=1e-6
    )


@FEW
@given(rows=st.integers(1, 9), columns=st.integers(1, 9))
def test_image_rows_are_turned_and_turned_back(rows, columns):
    grid = np.arange(rows * columns).reshape(rows, columns)
    assert np.array_equal(image_rows(image_rows(grid)), grid)
    assert np.array_equal(image_rows(grid)[0], grid[-1])
