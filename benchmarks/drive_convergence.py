"""Time step, softness and servo of the drive: what changes when they do (docs/driving.md).

    python benchmarks/drive_convergence.py

A rover drives 8 m straight on over rough ground with rocks, turns on the spot, and stands on a
slope of 0.85 atan μ with locked wheels; each variant changes one setting of the export.
"""

from __future__ import annotations

import math
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from terrain_forge.exporters import mjcf

from terrain_forge.base import quaternion_from_rpy
from terrain_forge.driving import Vehicle, drive, eased, load_scene
from terrain_forge.making import plan
from terrain_forge.model import MARS, Trajectory, World
from terrain_forge.pipeline import realise
from terrain_forge.recipe import DriveSpec, load_recipe

RECIPE = """schema: 1
name: rough
seed: 3
body: mars
dtm: {kind: flat, size_m: [16, 12]}
terrain: {spacing_m: 0.125, layers: [{kind: fractal}]}
rocks: {populations: [{name: all, size_frequency: {kind: golombek, k: 0.03}, diameter_m: [0.1, 0.25]}]}
exports: [mjcf]
"""  # noqa: E501
LENGTH, SPEED = 8.0, 0.3


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One set of settings."""

    name: str
    step: float = 0.002
    softness: float = 0.04
    servo: float = 1500.0
    damping: float = 40.0
    gear: float = 0.2
    ratio: float = 10.0

    def model(self, scene: Path) -> Any:
        """The scene with these settings."""
        model = load_scene(scene)
        model.opt.timestep, model.opt.impratio = self.step, self.ratio
        surface = model.geom_priority == 2
        model.geom_solref[surface, 0] = self.softness
        model.actuator_gainprm[:, 0] = self.servo
        model.actuator_biasprm[:, 1:3] = -self.servo, -self.damping
        model.dof_armature[model.dof_armature > 0.0] = self.gear
        return model


VARIANTS = (
    Variant(name="chosen"),
    *(Variant(name=f"step {step:g} s", step=step) for step in (0.005, 0.001, 0.0005)),
    *(Variant(name=f"softness {s:g} s", softness=s) for s in (0.01, 0.02, 0.06)),
    *(Variant(name=f"servo {k:g} N m", servo=k) for k in (300.0, 3000.0)),
    *(Variant(name=f"servo damping {d:g} N m s", damping=d) for d in (10.0, 100.0, 1000.0)),
    *(Variant(name=f"gear inertia {g:g} kg m²", gear=g) for g in (0.05, 1.0)),
    *(Variant(name=f"impratio {r:g}", ratio=r) for r in (1.0, 50.0)),
)


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        rough, slope = make_worlds(Path(folder))
        print("| variant | real-time factor | distance / rolled | mean slip | spot gain | vertical "
              "acceleration rms / largest [m/s²] | motor work [J] | energy unexplained [J] | creep "
              "uphill / across [mm/s] | ahead of the wheels [mm/s] |")  # fmt: skip
        print("|---" * 10 + "|")
        for variant in VARIANTS:
            print(row(variant, rough, slope))


def make_worlds(folder: Path) -> tuple[tuple[World, Path], tuple[World, Path]]:
    """The rough ground and the slope, with their scenes."""
    file = folder / "rough.yaml"
    file.write_text(RECIPE)
    recipe = load_recipe(file)
    rough = realise(plan(recipe.recipe, folder=folder))
    angle = 0.85 * math.atan(MARS.friction.regolith.coefficient)
    plane = np.tile(math.tan(angle) * rough.ground.east, (rough.ground.shape[0], 1))
    bare = rough.field.select(np.zeros(0, np.intp))
    slope = rough.replace(ground=rough.ground.replace(elevation=plane), field=bare)
    scenes = []
    for name, world in (("rough", rough), ("slope", slope)):
        (folder / name).mkdir()
        mjcf.export(world, folder / name, options=mjcf.Options())
        scenes.append((world, folder / name / "scene.xml"))
    return scenes[0], scenes[1]


def row(variant: Variant, rough: tuple[World, Path], slope: tuple[World, Path]) -> str:
    """One line of the table."""
    world, scene = rough
    begin = time.perf_counter()
    x = np.linspace(-LENGTH / 2, LENGTH / 2, 30)
    height = world.ground.height_at(x, 0 * x)
    line = Trajectory(
        name="line", time=np.linspace(0, LENGTH / SPEED, 30),
        position=np.column_stack([x, 0 * x, height]), rpy=np.zeros((30, 3)), closed=False,
    )  # fmt: skip
    model = variant.model(scene)
    result = drive(
        scene=model, trajectory=line, rover=world.rover, spec=DriveSpec(path="line", tilt_deg=60)
    )
    factor = result.duration / (time.perf_counter() - begin)
    rates = 0.5 * (result.wheel_rate[1:] + result.wheel_rate[:-1])
    rolled = (np.diff(result.time)[:, None] * rates).sum(0).mean() * world.rover.wheels[0].radius
    jolts = vertical_acceleration(variant, rough)
    creeps = [creep(variant, slope, uphill=uphill) for uphill in (True, False)]
    return (
        f"| {variant.name} | {factor:.0f} | {result.distance / rolled:.3f} | {result.mean_slip:.3f}"
        f" | {spot_gain(variant, world, scene):.2f} | {jolts.std():.2f} / "
        f"{np.abs(jolts).max():.1f} | {result.energy.driving:.0f} | {result.energy.unexplained:.3f}"
        f" | {creeps[0]:.2f} / {creeps[1]:.2f} | {lead(variant, world, scene):.1f} |"
    )


def vertical_acceleration(variant: Variant, rough: tuple[World, Path]) -> np.ndarray:
    """Acceleration of base_link while it drives straight on at 100 Hz [m/s²]."""
    world, scene = rough
    vehicle = set_down(variant, world, scene, (-4.0, 0.0), (0.0, 0.0, 0.0))
    steps = round(0.01 / vehicle.model.opt.timestep)
    speed, rates = [], np.zeros(6)
    wanted = np.full(6, SPEED / world.rover.wheels[0].radius)
    for _ in range(2000):
        rates = eased(world.rover, wanted, rates, time=0.01)
        vehicle.step(rates, steps)
        speed.append(vehicle.data.qvel[2])
    return np.diff(speed) / 0.01


def spot_gain(variant: Variant, world: World, scene: Path) -> float:
    """Turn rate of the wheels over that of the rover, on rough ground."""
    vehicle = set_down(variant, world, scene, (0.0, 0.0), (0.0, 0.0, 0.0))
    sides = np.sign([wheel.centre[1] for wheel in world.rover.wheels])
    steps = round(0.02 / vehicle.model.opt.timestep)
    rates, commands = [], np.zeros(6)
    for n in range(500):
        commands = eased(world.rover, -2.0 * sides, commands, time=0.02)
        vehicle.step(commands, steps)
        if n > 100:
            rates.append(vehicle.turn_rate)
    wheel = world.rover.wheels[0]
    return 2.0 * wheel.radius / abs(wheel.centre[1]) / float(np.mean(rates))


def creep(variant: Variant, slope: tuple[World, Path], *, uphill: bool) -> float:
    """Speed of the rover with locked wheels on the slope [mm/s]."""
    world, scene = slope
    rise = float(world.ground.height_at(1.0, 0.0) - world.ground.height_at(0.0, 0.0))
    angle = math.atan(rise)
    rpy = (0.0, -angle, 0.0) if uphill else (-angle, 0.0, math.pi / 2)
    vehicle = set_down(variant, world, scene, (2.0, 0.0), rpy)
    start = vehicle.position
    for _ in range(100):
        vehicle.step(np.zeros(6), round(0.02 / vehicle.model.opt.timestep))
    return 1e3 * float(np.linalg.norm(vehicle.position - start)) / 2.0


def lead(variant: Variant, world: World, scene: Path) -> float:
    """How much faster than its rims the rover is while they speed up by 0.25 m/s² [mm/s]."""
    vehicle = set_down(variant, world, scene, (-4.0, 0.0), (0.0, 0.0, 0.0))
    radius = world.rover.wheels[0].radius
    steps, ahead = round(0.02 / vehicle.model.opt.timestep), []
    for tick in range(1, 51):
        vehicle.step(np.full(6, 0.25 * 0.02 * tick / radius), steps)
        if tick > 15:
            along = vehicle.data.body(world.rover.links[0].name).xmat[::3] @ vehicle.data.qvel[:3]
            ahead.append(along - radius * vehicle.wheel_rates.mean())
    return 1e3 * float(np.mean(ahead))


def set_down(variant, world, scene, place, rpy) -> Vehicle:
    """The rover at a place."""
    vehicle = Vehicle(variant.model(scene), world.rover)
    position = np.array([*place, float(world.ground.height_at(*place))])
    vehicle.set_down(position, quaternion_from_rpy(np.array(rpy)))
    return vehicle


if __name__ == "__main__":
    main()
