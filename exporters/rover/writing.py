"""The rover export: one file per format, and the meshes that they share."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from urllib.parse import quote as in_address

from terrain_forge.exporters.mjcf.rover import rates_lost, write_rover
from terrain_forge.exporters.mjcf.rover import rig_losses as mjcf_losses
from terrain_forge.exporters.rover import control, sdf, urdf
from terrain_forge.exporters.sdf.model import usable_name
from terrain_forge.exporters.sdf.sensors import rig_losses as sdf_losses

from terrain_forge.base import ExportError
from terrain_forge.geometry import write_rover_meshes
from terrain_forge.model import ExportReport, Opening, Rover, World
from terrain_forge.writers import identifier

from .options import Options


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write the world's rover as NAME.urdf, NAME.xml, NAME.sdf, NAME.usda and what goes with them.

    Raises:
        ExportError: if the world has no rover.
    """
    rover = world.rover
    if not rover.links:
        raise ExportError("the world has no rover to export")
    name = usable_name(identifier(rover.name))
    gravity = world.site.body.gravity
    if "urdf" in options.formats:
        urdf.write_urdf(directory / f"{name}.urdf", rover, name=name, options=options)
        control.write_controllers(directory / f"{name}_controllers.yaml", rover)
    if "mjcf" in options.formats:
        path = directory / f"{name}.xml"
        write_rover(path, rover, gravity=gravity, friction=options.friction)
    if "sdf" in options.formats:
        sdf.write_sdf(directory, rover, name=name, options=options)
    if "usd" in options.formats:
        from .usd import write_usd

        write_usd(directory / f"{name}.usda", rover, name=name, friction=options.friction)
    if options.formats != ("usd",):
        write_rover_meshes(rover, directory / "meshes")
    files = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    return ExportReport(files=tuple(files), losses=_losses(rover, options))


def _losses(rover: Rover, options: Options) -> tuple[str, ...]:
    losses = list(rover.losses)
    if "urdf" in options.formats or "sdf" in options.formats:
        losses.append("Only MJCF has the inertia of the wheels' gear trains (armature).")
        low, high = float(min(rover.wheel_radii)), float(max(rover.wheel_radii))
        if high > 1.01 * low:
            losses.append(
                "Controllers of URDF and SDF know one radius of all wheels: their mean, "
                f"{control.wheel_radius(rover):.3g} m, of {low:.3g} to {high:.3g} m."
            )
    if rover.couplings and "usd" in options.formats:
        losses.append(
            "USD physics has no joints that follow others: the rover's gears are left out."
        )
    if rover.couplings and "sdf" in options.formats and options.release == "fortress":
        losses.append(
            "SDF 1.9 has no joints that follow others: the rover's gears are left out; "
            "`release: harmonic` keeps them."
        )
    if rover.couplings and "sdf" in options.formats and options.release != "fortress":
        names = ", ".join(control.joint_name(gear.link) for gear in rover.couplings)
        losses.append(
            f"Drake puts motors on the SDF's joints that follow others ({names}): they need the "
            "effort that DART holds them with; read the URDF, or remove the motors there."
        )
    if "usd" in options.formats:
        from terrain_forge.exporters.usd.rover import rig_losses as usd_losses

        losses += [*usd_losses(rover), *rates_lost(rover, " in USD")]
    if "mjcf" in options.formats:
        losses += mjcf_losses(rover, where=" in MJCF")
    if {"urdf", "sdf"} & set(options.formats):
        losses += sdf_losses(rover)
    return tuple(losses)


def opening(folder: Path, options: Options) -> Opening | None:
    """How ROS 2 shows the rover.

    RViz finds a mesh by a whole address alone, so it is given a copy with such ones.
    """
    if "urdf" not in options.formats:
        return None
    place, name = quote(folder.name), next(folder.glob("*.urdf")).name
    copied, model = "", f'"$PWD"/{place}/{name}'
    if (folder / "meshes").is_dir() and not options.mesh_prefix:
        meshes = f"file://${{PWD// /%20}}/{in_address(folder.name)}/meshes/"
        model = f"/tmp/{name}"
        copied = f'sed "s#=\\"meshes/#=\\"{meshes}#" {place}/{name} > {model} && '
    return Opening(
        title="The rover in ROS 2",
        commands=f"{copied}ros2 launch urdf_tutorial display.launch.py model:={model}",
    )
