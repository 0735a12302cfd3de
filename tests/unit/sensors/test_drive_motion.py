"""The motion of a simulated drive: one smooth curve, true to what MuJoCo's own sensors measure."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from terrain_forge.base import RecipeError, quaternion_from_rpy
from terrain_forge.driving import DriveLog, Logger, drive, load_scene
from terrain_forge.model import Trajectory, exporter
from terrain_forge.recipe import DriveSpec
from terrain_forge.recording import motion_of_drive
from terrain_forge.recording.driven import motion_of_log
from terrain_forge.sensors import RoverLinks
from tests.helpers import worlds
from tests.helpers.rovers import morpheus, skid4

STEP = 0.002


def log_of(rover, *, forwards=None, pitch=None, joints=0.0, looks=4000):
    """A log of a rover that goes east on a plane."""
    zero, joined = np.zeros(looks), [link.name for link in rover.links if link.joint == "passive"]
    rpy = np.column_stack([zero, zero if pitch is None else pitch, zero])
    wheels = np.zeros((looks, len(rover.wheels)))
    return DriveLog(
        step=STEP,
        position=np.column_stack([zero if forwards is None else forwards, zero, zero]),
        quaternion=quaternion_from_rpy(rpy),
        joints=tuple(joined),
        joint_angle=np.full((looks, len(joined)), joints),
        wheel_angle=wheels + 0.3,
        wheel_rate=wheels,
        wheel_torque=wheels,
    )


def test_what_a_log_tells_slowly_stays_and_what_jolts_does_not_ring():
    rover, time = skid4(), STEP * np.arange(4000)
    wave = np.sin(2 * np.pi * 10.0 * time)
    motion = motion_of_log(log_of(rover, forwards=0.1 * wave, pitch=0.1 * wave), rover, path="a")
    moments = np.linspace(1.0, 7.0, 1501)
    state, phase = motion.base.at(moments), 2 * np.pi * 10.0 * moments
    assert state.position[:, 0] == pytest.approx(0.1 * np.sin(phase), abs=0.1 * 0.01)
    fastest = 0.1 * (2 * np.pi * 10.0) ** 2
    assert state.acceleration[:, 0] == pytest.approx(-fastest * np.sin(phase), abs=0.01 * fastest)
    assert state.rate[:, 1] == pytest.approx(
        2 * np.pi * np.cos(phase), abs=0.02 * np.pi
    )  # the pitch's own rate
    jolt = np.where(time < 4.0, 0.0, 1.0)
    motion = motion_of_log(log_of(rover, forwards=jolt), rover, path="a", still=2.0)
    moments = np.linspace(0.0, motion.end, 9000)
    place = motion.base.at(moments).position[:, 0]
    assert -0.05 < place.min() < place.max() < 1.05
    settled = np.abs(moments - moments[np.argmax(place > 0.5)]) > 0.06
    assert np.all(np.minimum(np.abs(place), np.abs(place - 1.0))[settled] < 1e-3)
    assert np.all(motion.wheels == pytest.approx(0.3))


def test_a_drive_stands_still_before_it_starts_and_its_links_move():
    rover, time = morpheus(), STEP * np.arange(2000)
    log = log_of(rover, forwards=0.2 * time, joints=0.2, looks=2000)
    motion = motion_of_log(log, rover, path="a", still=1.5)
    state = motion.base.at(np.linspace(0.0, 1.5, 400))
    assert np.abs(state.acceleration).max() < 1e-9
    assert np.abs(state.velocity).max() < 1e-12
    assert motion.base.at(3.0).velocity[0] == pytest.approx([0.2, 0.0, 0.0], abs=1e-9)
    places = RoverLinks(rover, motion).at(2.0)
    for link in (link for link in rover.links if link.joint == "passive"):
        origin, turn = places[link.name]
        assert origin == pytest.approx(link.origin)
        assert turn @ link.axis == pytest.approx(link.axis)
        assert np.trace(turn) == pytest.approx(1.0 + 2.0 * np.cos(0.2))


def test_a_link_that_rolls_on_and_on_turns_evenly():
    rover = morpheus()
    log = log_of(rover, joints=1.5 * STEP * np.arange(4000)[:, None])
    motion = motion_of_log(log, rover, path="a")
    assert len(motion.links) == 3
    for name, curve in motion.links:
        (axis,) = (link.axis for link in rover.links if link.name == name)
        rates = curve.at(np.linspace(0.1, 7.9, 2001)).rate
        assert rates == pytest.approx(np.tile(1.5 * axis, (2001, 1)), abs=1e-4)


def test_a_path_that_the_world_lacks_is_refused():
    with pytest.raises(RecipeError, match=r"no path is called 'ark' \(did you mean 'arc'\?\)"):
        motion_of_drive(worlds.world(rover=skid4()), "ark")


class Beside(Logger):
    """Keeps MuJoCo's accelerometer and gyroscope at the IMU too."""

    def begin(self, vehicle):
        super().begin(vehicle)
        self.told, self.model = [], vehicle.model
        self.data = mujoco.MjData(self.model)

    def note(self, states):
        flags = self.model.opt.disableflags
        self.model.opt.disableflags = flags & ~int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
        for state in states:  # as they were when each step began
            mujoco.mj_setState(self.model, self.data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
            mujoco.mj_forward(self.model, self.data)
            self.told.append(self.data.sensordata.copy())
        self.model.opt.disableflags = flags
        super().note(states)


@pytest.mark.slow
def test_the_curve_moves_as_mujocos_own_accelerometer_and_gyroscope_tell(tmp_path):
    world = worlds.world(rocks=0, rover=morpheus())
    mjcf, path = exporter("mjcf"), world.trajectories[0]
    mjcf.export(world, tmp_path, options=mjcf.Options())
    model, logger = load_scene(tmp_path / "scene.xml"), Beside()
    result = drive(
        scene=model,
        trajectory=path,
        rover=world.rover,
        spec=DriveSpec(path="arc", cross_track_m=2.0),
        logger=logger,
    )
    motion = motion_of_log(logger.log(), world.rover, path="arc")
    assert motion.end == pytest.approx(result.duration, abs=0.02)
    begin = int(model.sensor("imu_accelerometer").adr[0])
    told = np.array(logger.told)[:, begin : begin + 6]
    time = model.opt.timestep * np.arange(len(told))
    time = time[time <= motion.end]
    imu = next(sensor for sensor in world.rover.sensors if sensor.kind == "imu")
    state = motion.base.at(time).at_mount(imu.position, np.eye(3))
    pull = state.acceleration + np.array([0.0, 0.0, world.site.body.gravity])
    felt = np.einsum("nji,nj->ni", state.rotation, pull)
    slow = butter(6, 20.0, fs=1.0 / model.opt.timestep, output="sos")
    within = slice(300, len(time) - 300)
    for ours, theirs, most in (
        (felt, told[: len(time), :3], 0.03),
        (state.rate, told[: len(time), 3:], 0.03),
    ):
        ours, theirs = (sosfiltfilt(slow, one[within], axis=0) for one in (ours, theirs))
        assert theirs.std(axis=0).max() > 0.01
        assert ours.std(axis=0) == pytest.approx(theirs.std(axis=0), rel=most)
        assert np.all((ours - theirs).std(axis=0) < 2 * most * theirs.std(axis=0))
    assert np.abs(felt).max() < 1.1 * np.abs(told[:, :3]).max()


@pytest.mark.slow
def test_a_drive_that_does_not_arrive_is_recorded_until_its_end_and_said(caplog):
    world = worlds.world(rocks=0, rover=skid4())
    wall = np.where(world.ground.east < 0.0, 0.0, 1.5)
    zero = np.zeros(121)
    way = Trajectory(
        name="wall",
        time=np.linspace(0.0, 12.0, 121),
        position=np.column_stack([np.linspace(-3.0, 3.0, 121), zero, zero]),
        rpy=np.column_stack([zero, zero, zero]),
        closed=False,
    )
    walled = world.replace(
        ground=world.ground.replace(elevation=np.tile(wall, (world.ground.shape[0], 1))),
        trajectories=(way,),
    )
    motion = motion_of_drive(walled, "wall", still=1.0)
    assert motion.ended.startswith("stuck")
    assert "the drive of 'wall' ends early, and its recording too: stuck" in caplog.text
    assert motion.base.at(motion.end).position[0, 0] < 0.5
