"""Wheels on the ground: planes, steps and climbs with known answers, and the guards."""

import math
import re

import numpy as np
import pytest
from scipy.integrate import trapezoid
from terrain_forge.exporters import mjcf

from terrain_forge.base import SimulationError, quaternion_from_rpy
from terrain_forge.driving import Vehicle, drive, load_scene
from terrain_forge.driving.controller import PlanarPath, PurePursuit
from terrain_forge.driving.energy import EnergyAudit
from terrain_forge.driving.result import longitudinal_slip
from terrain_forge.driving.simulation import Watch
from terrain_forge.driving.snapshot import Snapshot, wheel_states
from terrain_forge.model import BODIES, MARS
from terrain_forge.recipe import DriveSpec
from tests.helpers import rovers, worlds
from tests.helpers.rovers import morpheus
from tests.unit.driving.test_drive import boulder_at, drive_through, line, plain

MU = MARS.friction.regolith.coefficient


def vehicle_on(world, folder, position, rpy, **options):
    """The world's rover set down at a pose."""
    mjcf.export(world, folder, options=mjcf.Options(**options))
    vehicle = Vehicle(load_scene(folder / "scene.xml"), world.rover)
    vehicle.set_down(np.asarray(position, float), quaternion_from_rpy(np.asarray(rpy, float)))
    return vehicle


def speed_on_a_slope(folder, slope, *, up, **options):
    """How fast locked wheels creep or slide down, facing uphill or across [m/s]."""
    world = plain(line((0, 0), (0, 3)), slope=slope)
    rpy = (0.0, -slope, 0.0) if up else (-slope, 0.0, math.pi / 2)
    vehicle = vehicle_on(world, folder, (2.0, 0.0, 2.0 * math.tan(slope)), rpy, **options)
    start = vehicle.position
    for _ in range(100):
        vehicle.step(np.zeros(6), 10)
    return float(np.linalg.norm(vehicle.position - start)) / 2.0


@pytest.mark.parametrize("up", [True, False])
def test_locked_wheels_hold_below_the_friction_angle_and_slide_above(tmp_path, up):
    assert speed_on_a_slope(tmp_path, 0.85 * math.atan(MU), up=up) < 0.0005
    assert speed_on_a_slope(tmp_path, 1.05 * math.atan(MU), up=up) > 0.05


def test_friction_is_the_ground_s_and_the_option_s(tmp_path):
    """A slope between two friction angles: slippery ground lets go, bedrock holds."""
    slope = 0.92 * math.atan(MARS.friction.bedrock.coefficient)
    assert slope > 1.05 * math.atan(MU)
    assert speed_on_a_slope(tmp_path, slope, up=False) > 0.05
    assert speed_on_a_slope(tmp_path, slope, up=False, surface="bedrock") < 0.0005
    assert speed_on_a_slope(tmp_path, slope, up=False, friction=1.0) < 0.0005


def test_each_contact_has_its_surface_s_friction(tmp_path):
    """The rover's left wheels stand on a rock, its right ones on the ground."""
    world = plain(line((-4, 0), (4, 0)), field=boulder_at((0.0, 0.6, -0.7)))
    vehicle = vehicle_on(world, tmp_path, (0.0, 0.0, 0.1), (0.0, 0.0, 0.0))
    found = {"rock": set(), "ground": set()}
    for contact in vehicle.data.contact:
        names = {vehicle.model.geom(g).name for g in contact.geom}
        kind = "rock" if any(n.startswith("rock") for n in names) else "ground"
        found[kind].add(round(float(contact.friction[0]), 6))
    assert found == {"rock": {0.7}, "ground": {0.66}}


@pytest.mark.parametrize("body", BODIES.values(), ids=list(BODIES))
def test_frictions_are_plausible_and_say_where_they_are_from(body):
    for surface in ("regolith", "bedrock", "rock"):
        friction = getattr(body.friction, surface)
        assert friction.lowest < friction.coefficient < friction.highest
        assert "doi:" in friction.source or "NTRS" in friction.source
    assert MARS.friction.regolith.lowest == pytest.approx(math.tan(math.radians(30)), abs=0.005)


@pytest.mark.parametrize(("height", "climbs"), [(0.10, True), (0.45, False)])
def test_a_step_is_climbed_up_to_what_wheels_can(tmp_path, height, climbs):
    world = plain(line((-1, 0), (1.2, 0)))
    elevation = np.where(world.ground.east > 0.1, height, 0.0)[None, :]
    ground = world.ground.replace(elevation=np.broadcast_to(elevation, world.ground.shape))
    result = drive_through(world.replace(ground=ground), tmp_path)
    assert result.completed == climbs
    if climbs:
        assert result.position[-1, 2] == pytest.approx(height, abs=0.01)
        assert np.abs(result.joint_angle).max() > math.radians(3)
    else:
        assert result.reason.startswith(("stuck", "tipped"))


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    """A drive straight on over level ground."""
    return drive_through(plain(line((-1, 0), (1, 0))), tmp_path_factory.mktemp("level"))


def test_straight_on_the_rover_goes_as_far_as_its_wheels_roll(level):
    result = level
    rolled = trapezoid(result.wheel_rate, result.time, axis=0).mean() * 0.14
    assert result.distance / rolled == pytest.approx(1.0, abs=0.05)
    assert result.mean_slip < 0.05
    assert result.saturated == 0.0


def test_a_spot_turn_has_the_known_gain_of_skidding(tmp_path):
    """About half the kinematic rate (measured for six wheels of this layout).

    The rover faces backwards, so that it turns on the spot first.
    """
    result = drive_through(plain(line((-2, 0), (2, 0), yaw=3.0)), tmp_path)
    assert result.completed
    assert abs(result.heading_error[0]) > 2.8
    assert abs(result.heading_error[-1]) < 0.1
    assert result.largest_cross_track < 0.3
    spot = np.flatnonzero(np.abs(result.heading_error) > 1.0)[5:-5]
    rover = morpheus()
    left = rover.wheel_centres[:, 1] > 0
    rims = 0.14 * result.wheel_rate[spot]
    wheels = (rims[:, ~left].mean(1) - rims[:, left].mean(1)) / 0.76
    real = np.diff(np.unwrap(result.rpy[:, 2]))[spot] / 0.1
    assert np.median(real / wheels) == pytest.approx(0.5, abs=0.12)


def test_a_climb_costs_its_height(level, tmp_path):
    """What the motors put in is the height gained, times weight, plus what rolling takes."""
    slope = math.radians(12.0)
    world = plain(line((-1, 0), (1, 0)), slope=slope)
    points = world.trajectories[0].position.copy()
    points[:, 2] = math.tan(slope) * points[:, 0]
    rpy = np.tile([0.0, -slope, 0.0], (len(points), 1))
    uphill = world.trajectories[0].replace(position=points, rpy=rpy)
    result = drive_through(world.replace(trajectories=(uphill,)), tmp_path)
    rise = result.position[-1, 2] - result.position[0, 2]
    lifted = morpheus().mass * MARS.gravity * rise
    moving = level.energy.gained
    assert result.energy.gained == pytest.approx(lifted + moving, rel=0.02)
    extra = result.energy.driving + result.energy.braking - lifted - moving
    assert 0.0 < extra < 0.4 * lifted
    wheels = 6 * (0.5 * 2.3 * 0.14**2 + 0.2)  # with the armature
    kinetic = 0.5 * (morpheus().mass + wheels / 0.14**2) * 0.4**2
    assert moving == pytest.approx(kinetic, rel=0.05)
    assert level.energy.dissipated > 0.0


def test_slip_has_its_sign_and_its_ends():
    rim, speed = np.array([1.0, 1.0, 0.0, 1.0, 0.001, -1.0]), np.array([0, 1, 1, 0.5, 0, -0.5])
    slip, moves = longitudinal_slip(rim, speed)
    np.testing.assert_allclose(slip, (1, 0, -1, 0.5, 0, -0.5))
    np.testing.assert_array_equal(moves, (True, True, True, True, False, True))


@pytest.mark.parametrize("push", [50.0, 0.0, -50.0])
def test_a_wheel_that_rolls_does_not_slip_under_a_ledge_either(push):
    rolling = Snapshot(
        position=np.zeros(3), quaternion=np.array([1.0, 0.0, 0.0, 0.0]), centre=np.zeros(3),
        moving=np.array([[0.0, 2.0, 0.0, 0.2, 0.0, 0.0]]), wheel=np.zeros((1, 3)),
        push=np.array([[0.0, 0.0, push]]), axle=np.array([[0.0, 1.0, 0.0]]), rate=np.array([2.0]),
        torque=np.zeros(1), joint_angle=np.zeros(0),
    )  # fmt: skip
    told = wheel_states([rolling], sides=np.ones(1), radii=np.array([0.1]))
    assert told["wheel_slip"] == pytest.approx(0.0, abs=1e-12)


def test_slip_is_along_the_ground_however_the_body_pitches(tmp_path):
    """Wheels that stand on level ground under a body that looks up by 25°."""
    tilt = math.radians(25)
    turn = np.array([[math.cos(tilt), math.sin(tilt)], [-math.sin(tilt), math.cos(tilt)]])
    wheels = ""
    for x, y in ((0.3, 0.25), (0.3, -0.25), (-0.3, 0.25), (-0.3, -0.25)):
        ahead, up = turn @ (x, -0.15)  # as the body sees it
        wheels += (
            f'<body name="wheel{x}{y}" pos="{ahead} {y} {up}"><joint name="j{x}{y}" axis="0 1 0"/>'
            '<geom type="cylinder" size=".15 .04" zaxis="0 1 0" mass="2"/></body>'
        )
    file = tmp_path / "up.xml"
    file.write_text(
        '<mujoco><worldbody><body name="hull"><freejoint/><geom type="box" size=".2 .1 .05" '
        f'mass="9" pos="0 0 .1"/>{wheels}</body></worldbody></mujoco>'
    )
    rover = rovers.read(file)
    vehicle = Vehicle(rovers.on_the_flat(rover, tmp_path / "o"), rover)
    vehicle.set_down(np.zeros(3), quaternion_from_rpy(np.array([0.0, -tilt, 0.0])))
    assert vehicle.attitude[1] == pytest.approx(tilt, abs=0.02)
    slips = []
    for tick in range(1, 150):
        vehicle.step(np.full(4, 2.0 * min(tick / 100, 1.0)), 10)
        slips.append(vehicle.states([vehicle.snapshot()])["wheel_slip"])
    assert np.abs(np.array(slips[50:])).max() < 0.02  # along the body's axis 1 - cos 25° = 0.09


def test_an_audit_lets_friction_take_and_nothing_give():
    audit = EnergyAudit(reference=10.0, energy=5.0)
    audit.add(driving=4.0, braking=0.0, energy=7.0)
    audit.add(driving=0.0, braking=-1.0, energy=6.5)
    assert audit.fault() == ""
    balance = audit.balance()
    assert (balance.gained, balance.dissipated) == pytest.approx((1.5, 1.5))
    audit.add(driving=0.0, braking=0.0, energy=8.0)
    assert audit.fault().startswith("energy grew without cause, by 2 J")


def test_wheels_that_speed_up_uphill_push_and_do_not_lag(tmp_path):
    """In the ramp of the speed no wheel is slower than the ground beneath it.

    A servo's damping that only the integrator knows would let contacts push the rover ahead.
    """
    slope, gain = math.radians(10.0), 0.25
    world = plain(line((-4, 0), (4, 0)), slope=slope)
    start = (-3.0, 0.0, -3.0 * math.tan(slope))
    vehicle = vehicle_on(world, tmp_path, start, (0.0, -slope, 0.0))
    slips, torques = [], []
    for tick in range(1, 50):
        vehicle.step(np.full(6, gain * 0.02 * tick / 0.14), 10)
        states = vehicle.states([vehicle.snapshot()])
        slips.append(states["wheel_slip"])
        torques.append(states["wheel_torque"].sum())
    assert min(map(np.min, slips[15:])) > -0.03
    wheels = 6 * (0.5 * 2.3 * 0.14**2 + 0.2)  # with the armature
    inertia = morpheus().mass + wheels / 0.14**2
    force = morpheus().mass * MARS.gravity * math.sin(slope) + inertia * gain
    damping = 6 * 0.1 * np.mean(np.arange(15, 50) * 0.02 * gain / 0.14)
    assert np.mean(torques[15:]) == pytest.approx(0.14 * force + damping, rel=0.1)


def test_a_wheel_that_was_held_does_not_catch_up(tmp_path):
    world = plain(line((-4, 0), (4, 0)))
    vehicle = vehicle_on(world, tmp_path, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    axles = [vehicle.model.joint(wheel.link).id for wheel in world.rover.wheels]
    turning = vehicle.model.jnt_dofadr[axles]
    vehicle.model.dof_damping[turning] = 1e4  # brakes that no motor can overcome
    for _ in range(200):
        vehicle.step(np.full(6, 2.0), 10)
    assert vehicle.saturated_steps > 150
    vehicle.model.dof_damping[turning] = 0.1
    rates = []
    for _ in range(100):
        vehicle.step(np.full(6, 2.0), 10)
        rates.append(vehicle.wheel_rates)
    assert np.max(rates[50:]) < 2.3


def test_a_rover_that_slides_off_its_path_says_so(tmp_path):
    """Uphill where the slope is steeper than the friction angle, 33°."""
    slope = math.radians(35.0)
    world = plain(line((0, 0), (4, 0)), slope=slope)
    points = world.trajectories[0].position.copy()
    points[:, 2] = math.tan(slope) * points[:, 0]
    rpy = np.tile([0.0, -slope, 0.0], (len(points), 1))
    uphill = world.trajectories[0].replace(position=points, rpy=rpy)
    result = drive_through(world.replace(trajectories=(uphill,)), tmp_path)
    assert re.match(r"left the path by .* after 0.0 m of 4.0 m: .*wheels slip by", result.reason)


def test_motors_too_weak_for_a_slope_are_told(tmp_path):
    """From level ground onto a slope of 20°, which needs 1.5 N m of each wheel."""
    world = plain(line((-1, 0), (3, 0)))
    rise = math.tan(math.radians(20.0)) * world.ground.east.clip(0.0)
    elevation = np.broadcast_to(rise, world.ground.shape)
    world = world.replace(
        ground=world.ground.replace(elevation=elevation),
        rover=world.rover.replace(torque_limit=0.6, steering=("fork",)),
    )
    result = drive_through(world, tmp_path)
    assert not result.completed
    assert result.reason.startswith("stuck")
    assert "motors at their torque limit" in result.reason
    assert result.reason.endswith("joints that steer are held (fork)")
    assert result.saturated > 0.5
    assert np.abs(result.wheel_torque).max() <= 0.6 + 1e-9


def test_wheels_that_spin_in_place_are_told(tmp_path):
    """Before a wall, with a friction of 0.1: all wheels slip wholly."""
    world = plain(line((-1, 0), (3, 0)))
    elevation = np.broadcast_to(np.where(world.ground.east > 0.0, 1.0, 0.0), world.ground.shape)
    world = world.replace(ground=world.ground.replace(elevation=elevation))
    mjcf.export(world, tmp_path, options=mjcf.Options(friction=0.1))
    result = drive(
        scene=tmp_path / "scene.xml",
        trajectory=world.trajectories[0],
        rover=world.rover,
        spec=DriveSpec(path="arc"),
    )
    assert not result.completed
    assert result.reason.startswith("stuck")
    slip = int(re.search(r"wheels slip by (\d+)%", result.reason)[1])
    assert 95 <= slip <= 100
    assert result.saturated == 0.0


class Rocking:
    """Stands in for a rover that does not move, and now and then touches a rock by its wheels."""

    rover, saturated_steps = morpheus(), 0

    def __init__(self, hits):
        self.hits, self.place = iter(hits), (0.0, 0.0)

    def fault(self):
        return ""

    def snapshot(self):
        return None

    def states(self, taken):
        return {"wheel_slip": np.zeros((len(taken), 6))}

    def rock_forces(self):
        return next(self.hits)


def test_a_rock_that_is_touched_now_and_then_holds_the_rover():
    """For 0.02 s of each 0.2 s; its body met another rock at the start alone."""
    touch = {"rock_7": (1.0, False)}
    begin = [{"rock_7": (1.0, True), "rock_8": (1.0, True)}]
    vehicle = Rocking(begin + [touch if n % 10 == 0 else {} for n in range(1000)])
    path = plain(line((-2, 0), (2, 0))).trajectories[0]
    watch = Watch(trajectory=path, spec=DriveSpec(path="arc"), tick=0.02)
    pursuit = PurePursuit(PlanarPath.of(path), lookahead=1.0)
    while not watch.reason:
        watch.look(vehicle, pursuit, tilt=0.0)
    assert watch.reason == "stuck after 0.0 m of 4.0 m: its wheels against rock_7"


def start(world, folder, change=lambda model: None):
    """Drive the world's first path in a model that was changed."""
    mjcf.export(world, folder, options=mjcf.Options())
    model = load_scene(folder / "scene.xml")
    change(model)
    trajectory = world.trajectories[0]
    return drive(scene=model, trajectory=trajectory, rover=world.rover, spec=DriveSpec(path="arc"))


def test_energy_from_nowhere_stops_the_drive(tmp_path):
    """Wheels whose dampers push instead of braking, which no motor pays for."""

    def push(model):
        for wheel in morpheus().wheels:
            model.dof_damping[model.jnt_dofadr[model.joint(wheel.link).id]] = -8.0

    result = start(plain(line((-4, 0), (4, 0))), tmp_path, push)
    assert not result.completed
    assert result.reason.startswith("energy grew without cause")


def test_contacts_that_are_dropped_stop_the_drive(tmp_path):
    """A wheel on so fine a ground that MuJoCo keeps only some of its contacts."""
    world = plain(line((-0.1, 0), (0.1, 0)))
    fine = np.zeros((201, 201), np.float32)
    ground = world.ground.replace(elevation=fine, spacing=0.01, origin=(-1.0, -1.0))
    with pytest.raises(SimulationError, match="contacts were dropped"):
        start(worlds.on_ground(world, ground), tmp_path)


def test_numbers_that_are_not_finite_stop_the_drive(tmp_path):
    world = plain(line((-4, 0), (4, 0)))
    vehicle = vehicle_on(world, tmp_path, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert vehicle.fault() == ""
    vehicle.data.qvel[0] = np.nan
    with np.errstate(invalid="ignore"):
        vehicle.step(np.zeros(6), 1)
    assert "unstable" in vehicle.fault()


def test_a_start_inside_a_rock_names_it(tmp_path):
    world = plain(line((0, 0), (4, 0)), field=boulder_at((0.0, 0.0, 0.2)))
    with pytest.raises(SimulationError, match=r"start at \(0.00, 0.00, .*not free.*rock_3"):
        start(world, tmp_path)


def test_a_scene_without_the_rover_says_so(tmp_path):
    world = worlds.world(rocks=0)
    mjcf.export(world, tmp_path, options=mjcf.Options())
    model = load_scene(tmp_path / "scene.xml")
    with pytest.raises(SimulationError, match="does not hold the rover 'morpheus': it has no body"):
        Vehicle(model, morpheus())
    with pytest.raises(SimulationError, match="'none' has no wheels"):
        Vehicle(model, world.rover)


def test_sleeping_rocks_change_no_bit_of_the_drive(tmp_path):
    """What makes large worlds fast is no approximation."""
    import mujoco

    world = worlds.world(rover=morpheus())
    mjcf.export(world, tmp_path, options=mjcf.Options())
    states = []
    for sleep in (True, False):
        model = load_scene(tmp_path / "scene.xml")
        vehicle = Vehicle(model, world.rover)
        if not sleep:
            model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        path = world.trajectories[0]
        vehicle.set_down(path.position[0], quaternion_from_rpy(path.rpy[0]))
        for _ in range(100):
            vehicle.step(np.full(6, 2.0), 10)
        states.append(vehicle.data.qpos.copy())
    np.testing.assert_array_equal(*states)


@pytest.mark.slow
def test_half_the_time_step_drives_the_same(tmp_path):
    """The chosen step is small enough: halving it changes slip, torque and turning little."""
    angle = np.linspace(0, np.pi, 100)
    from tests.unit.driving.test_drive import path

    arc = path(np.column_stack([3 * np.cos(angle), 3 * np.sin(angle)]))
    results = []
    for step in (0.002, 0.001):
        mjcf.export(plain(arc), tmp_path, options=mjcf.Options(timestep_s=step))
        spec = DriveSpec(path="arc")
        results.append(
            drive(scene=tmp_path / "scene.xml", trajectory=arc, rover=morpheus(), spec=spec)
        )
    coarse, fine = results
    assert coarse.distance == pytest.approx(fine.distance, rel=0.005)
    assert coarse.skid_gain == pytest.approx(fine.skid_gain, rel=0.1)
    assert coarse.energy.driving == pytest.approx(fine.energy.driving, rel=0.15)
