"""Every rover that a recipe can name, and those of files: it stands and weighs what it should."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from terrain_forge.rovers import built_in_rovers, find_rover
from tests.helpers import rovers

FILES = {
    "a URDF": (rovers.rocker_urdf, ()),
    "an MJCF": (rovers.buggy_mjcf, ("lf", "lr", "rf", "rr")),
}


@pytest.fixture(scope="module", params=[*built_in_rovers(), *FILES])
def rover(request, tmp_path_factory):
    if request.param not in FILES:
        return find_rover(request.param)
    write, wheels = FILES[request.param]
    return rovers.read(write(tmp_path_factory.mktemp("file")), wheels=wheels)


def test_each_link_has_a_mass_and_an_inertia_that_a_body_can_have(rover):
    assert rover.mass == pytest.approx(sum(link.mass for link in rover.links))
    for link in rover.links:
        assert link.mass > 0, link.name
        tensor = np.asarray(link.inertia)
        np.testing.assert_allclose(tensor, tensor.T, rtol=0, atol=1e-12 * tensor.max())
        low, middle, high = np.linalg.eigvalsh(tensor)
        assert low > 0, link.name
        assert low + middle > high * (1 - 1e-6), link.name


def test_names_lead_to_links(rover):
    names = [link.name for link in rover.links]
    assert len(set(names)) == len(names)
    assert {link.parent for link in rover.links} <= {"", *names}
    assert {wheel.link for wheel in rover.wheels} <= set(names)
    assert min(rover.torque_limit, rover.speed_limit, rover.tilt_limit, rover.clearance) > 0


def test_it_stands_on_level_ground(rover, tmp_path):
    model = rovers.on_the_flat(rover, tmp_path / "flat")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(2 / model.opt.timestep))
    place = data.qpos[:7].copy()
    mujoco.mj_step(model, data, round(0.5 / model.opt.timestep))
    assert np.abs(data.qpos[:3] - place[:3]).max() < 2e-3
    assert data.qpos[3] ** 2 + data.qpos[6] ** 2 > 0.99  # upright, whatever its yaw
    wheels = [data.body(wheel.link).xpos[2] for wheel in rover.wheels]
    np.testing.assert_allclose(wheels, [wheel.radius for wheel in rover.wheels], atol=0.03)
