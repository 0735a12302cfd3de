"""SDF worlds in Gazebo Fortress' own libraries: libsdformat, ign-common, ign-physics with DART."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from shlex import quote
from typing import Any
from xml.etree import ElementTree

import numpy as np

from terrain_forge.base import (
    Array,
    SimulationError,
    cache_folder,
    image_rows,
    quaternion_from_rpy,
)
from terrain_forge.model import Opening
from terrain_forge.paths import Deviation, deviation, spline_places
from terrain_forge.validation import (
    SETTLING,
    Consumer,
    NotRun,
    Reading,
    Sample,
    heights_on,
    highest_on,
    is_ground,
    read_answer,
    read_mesh,
    resting_balls,
    run,
)
from terrain_forge.writers import file_name

_SOURCE = Path(__file__).with_name("probe.cc")
_PACKAGES = (
    *("ignition-physics5", "ignition-physics5-sdf", "ignition-physics5-mesh", "sdformat12"),
    *("ignition-physics5-heightmap", "ignition-common4-graphics", "ignition-plugin1-loader"),
    *("eigen3", "ignition-math6-eigen3"),
)
_NEWEST = (1, 9)
"""The newest SDF that libsdformat 12 knows."""
_ROUNDING = 1e-6
"""Part of a heightmap's range of heights that float32 and text round away."""
_PLUGIN = "ignition-physics5-dartsim-plugin"
_BALL = """<model name="probe_ball_{n}"><pose>{x:.9g} {y:.9g} {z:.9g} 0 0 0</pose><link name="ball">
<inertial><mass>1</mass><inertia><ixx>{i:.9g}</ixx><iyy>{i:.9g}</iyy><izz>{i:.9g}</izz></inertia>
</inertial><collision name="ball"><geometry><sphere><radius>{r:.9g}</radius></sphere></geometry>
</collision></link><joint name="slider" type="prismatic"><parent>world</parent><child>ball</child>
<axis><xyz>0 0 1</xyz></axis></joint></model>
"""


def read_files(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """The ground that an SDF export collides as, and its actors between their waypoints."""
    del scratch
    collision = find_heightmap(folder)
    replays = tuple(_replays(sample, folder / "scene.sdf"))
    if collision is not None:
        classic = options.flavour == "classic"
        return _heightmap(sample, folder, collision, classic=classic, replays=replays)
    heights = highest_on(map(read_mesh, _ground_files(folder)), sample.points)
    return Reading(consumer="files", heights=heights, replays=replays)


def _ground_files(folder: Path) -> Iterator[Path]:
    """The collision meshes of the ground in the models that world.sdf includes."""
    for include in ElementTree.parse(folder / "world.sdf").iter("include"):
        for collision in _ground_of(folder, include):
            if uri := collision.findtext("geometry/mesh/uri", ""):
                yield folder / "models" / uri.removeprefix("model://")


def _ground_of(folder: Path, include: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """The collisions of the ground in the model that an element includes."""
    name = include.findtext("uri", "").removeprefix("model://")
    model = folder / "models" / name / "model.sdf"
    for collision in ElementTree.parse(model).iter("collision") if model.is_file() else ():
        if is_ground(collision.get("name", "")):
            yield collision


def find_heightmap(folder: Path) -> ElementTree.Element | None:
    """The collision of an SDF export that is a heightmap, if it has one."""
    for model in sorted(folder.glob("models/*/model.sdf")):
        for collision in ElementTree.parse(model).iterfind("model/link/collision"):
            if collision.find("geometry/heightmap") is not None:
                return collision
    return None


def _heightmap(
    sample: Sample,
    folder: Path,
    collision: ElementTree.Element,
    *,
    classic: bool,
    replays: tuple[Deviation | None, ...],
) -> Reading:
    """The samples of a heightmap nearest to the points; what lies between is a loss of the export.

    A sample may be off by half of a grey level.
    """
    size = _triple(collision, "geometry/heightmap/size")
    levels = _levels(folder, collision)
    pixels, last = image_rows(levels).astype(np.float64), len(levels) - 1
    if classic:
        # Gazebo Classic spreads the samples over all of the size, and only lifts them.
        spread, centre = size[:2], _triple(collision, "geometry/heightmap/pos") * (0, 0, 1)
    else:
        # gz-physics spreads them over less, and gz-sim hands it no `pos`.
        spread, centre = size[:2] * last / (last + 1), _triple(collision, "pose")
    low = centre[:2] - spread / 2
    index = np.rint((sample.points - low) / spread * last).astype(np.int64)
    west, south, east, north = sample.world.ground.bounds
    quantum = float(size[2]) / np.iinfo(levels.dtype).max
    return Reading(
        consumer="files",
        points=np.clip(low + index * spread / last, (west, south), (east, north)),
        heights=centre[2] + pixels[index[:, 1], index[:, 0]] * quantum,
        ground_limit=quantum / 2 + _ROUNDING * float(size[2]),
        replays=replays,
    )


def _triple(collision: ElementTree.Element, path: str) -> Array:
    """The first three numbers of an element, zeros where there is none."""
    return np.array(collision.findtext(path, "0 0 0").split()[:3], np.float64)


def _levels(folder: Path, collision: ElementTree.Element) -> np.ndarray:
    """Grey levels of a heightmap's image, of 8 or 16 bits."""
    from PIL import Image

    uri = collision.findtext("geometry/heightmap/uri", "")
    with Image.open(folder / "models" / uri.split("//")[1]) as image:
        levels = np.asarray(image)
    return levels if levels.dtype == np.uint8 else levels.astype(np.uint16)


def _replays(sample: Sample, scene: Path) -> Iterator[Deviation | None]:
    """How far actors leave the paths on Gazebo's spline, which is ours: a test compares them."""
    if not sample.world.trajectories:
        return
    actors = {actor.get("name"): actor for actor in ElementTree.parse(scene).iter("actor")}
    for trajectory in sample.world.trajectories:
        actor = actors.get(file_name(trajectory.name))
        stops = [] if actor is None else list(actor.iter("waypoint"))
        if not stops:
            yield None
            continue
        times = np.array([stop.findtext("time", "") for stop in stops], dtype=np.float64)
        poses = np.array([stop.findtext("pose", "").split() for stop in stops], dtype=np.float64)
        yield deviation(
            trajectory,
            times=times,
            position=poses[:, :3],
            quaternion=quaternion_from_rpy(poses[:, 3:]),
            places_between=spline_places,
        )


def read_sdf(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """An SDF export as libsdformat and Gazebo Fortress' physics have it.

    The probe is compiled at its first use.

    Raises:
        NotRun: if a compiler or a library is missing.
        SimulationError: if the probe fails.
    """
    if options.binary:
        raise NotRun("Gazebo Fortress reads no GLB")
    program, answers = _program(), []
    with tempfile.TemporaryDirectory(dir=scratch) as temporary:
        for name in ("world", "scene"):
            # The scene adds what moves to the world, whose meshes are read once.
            binary = Path(temporary) / "meshes.bin" if name == "world" else None
            file = folder / f"{name}.sdf"
            command: list[str | Path] = [program, "read", file, folder / "models", binary or ""]
            text = run(command, log=scratch / f"{name}.log")
            answers.append(read_answer(sample, text, binary))
        unlike, balls, engine = _unlike(folder, options), None, "no engine"
        if not unlike:
            balls, engine = _rest(sample, program, folder, Path(temporary))
    world, scene = answers
    findings = tuple(dict.fromkeys((*(world.findings or ()), *(scene.findings or ()))))
    version, newer = ElementTree.parse(folder / "world.sdf").getroot().get("version", ""), ""
    if findings and tuple(map(int, version.split("."))) > _NEWEST:
        known = ".".join(map(str, _NEWEST))
        newer = f"libsdformat 12 knows SDF up to {known}, the file is {version}"
    return replace(
        _with_heightmap(sample, world),
        consumer=f"{world.consumer}, {engine}",
        tracks=scene.tracks,
        rock_error=options.outline_error,
        close=options.close_within_m > 0.0,
        balls=balls,
        reasons={"balls": unlike, "findings": newer},
        findings=None if newer else findings,
    )


def _unlike(folder: Path, options: Any) -> str:
    """Why Fortress' engine cannot stand for the one that an export is for, empty if it can."""
    collision = find_heightmap(folder)
    if collision is None:
        return ""
    if options.flavour == "classic":
        return "Classic's engine, which places heightmaps in its own way, is not run"
    if _levels(folder, collision).dtype == np.uint16:
        return "Fortress takes heightmaps of 16 bits for 0 to 1 m high"
    return ""


def _rest(
    sample: Sample, program: Path, folder: Path, temporary: Path
) -> tuple[np.ndarray | None, str]:
    """Where the balls rest in DART on the ground alone, no rock being near, and what ran."""
    inertia = 0.4 * sample.balls.radius**2
    balls = "".join(
        _BALL.format(n=n, x=x, y=y, z=z, i=inertia, r=sample.balls.radius)
        for n, (x, y, z) in enumerate(sample.balls.start.tolist())
    )
    root = ElementTree.parse(folder / "world.sdf").getroot()
    for world in root.iter("world"):
        for include in world.findall("include"):
            if next(_ground_of(folder, include), None) is None:
                world.remove(include)
        world.extend(ElementTree.fromstring(f"<balls>{balls}</balls>"))
    file = temporary / "balls.sdf"
    file.write_text(ElementTree.tostring(root, encoding="unicode"), encoding="utf-8")
    text = run([program, "rest", file, folder / "models", _plugin(), str(SETTLING)])
    engine = next(line for line in text.splitlines() if line.startswith("consumer\t"))
    return resting_balls(text), engine.partition("\t")[2]


def _with_heightmap(sample: Sample, reading: Reading) -> Reading:
    """The reading, with what a heightmap is off by its own samples and by the cut of its cells.

    Libraries cut them either way.
    """
    if not reading.quantum:
        return reading
    ground, (mesh,) = sample.world.ground, reading.ground
    west, south, east, north = ground.bounds
    nodes = np.clip(mesh.vertices[:, :2], (west, south), (east, north))
    line = np.linspace(-1.0, 1.0, 21) * sample.balls.radius
    offsets = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    under = (sample.balls.xy[:, None, :] + offsets).reshape(-1, 2)  # what balls may touch
    points = np.concatenate([sample.points, np.clip(under, (west, south), (east, north))])
    ideal = np.column_stack([mesh.vertices[:, :2], ground.height_at(nodes[:, 0], nodes[:, 1])])
    southwest, southeast, northeast, _, _, northwest = mesh.faces.reshape(-1, 6).T
    other = np.stack([southwest, southeast, northwest, southeast, northeast, northwest], axis=-1)
    cuts = [mesh.replace(vertices=ideal, faces=cut.reshape(-1, 3)) for cut in (mesh.faces, other)]
    wanted = ground.height_at(points[:, 0], points[:, 1])
    besides = max(float(np.nanmax(np.abs(heights_on(c, points) - wanted))) for c in cuts)
    return replace(reading, besides=besides)


@cache
def _program() -> Path:
    """The compiled probe, from the cache where it is already there.

    Raises:
        NotRun: if it cannot be compiled.
    """
    for tool in ("g++", "pkg-config"):
        if not shutil.which(tool):
            raise NotRun(f"{tool} is not installed")
    asked = _run("pkg-config", "--cflags", "--libs", *_PACKAGES)
    if asked.returncode:
        raise NotRun(asked.stderr.strip().splitlines()[-1])
    key = sha256(_SOURCE.read_bytes() + asked.stdout.encode()).hexdigest()[:32]
    cache = cache_folder() or Path(tempfile.mkdtemp(prefix="terrain-forge-"))
    program = cache / f"gazebo-probe-{key}"
    if program.is_file():
        return program
    cache.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=cache, prefix="new-") as folder:
        # Others see all of it or nothing.
        new = Path(folder) / program.name
        flags = asked.stdout.split()
        done = _run("g++", "-std=c++17", "-O1", str(_SOURCE), *flags, "-o", str(new))
        if done.returncode:
            error = next((line for line in done.stderr.splitlines() if "error" in line), "")
            raise NotRun(f"the probe does not compile with these libraries: {error}")
        new.replace(program)
    return program


def _plugin() -> Path:
    """The physics engine's library."""
    told = _run("pkg-config", "--variable=libdir", _PLUGIN).stdout.strip()
    name = f"lib{_PLUGIN}.so"
    for folder in (Path(told), Path("/usr/lib/x86_64-linux-gnu")):
        if (folder / name).is_file():
            return folder / name
    raise SimulationError(f"{name} is not installed")


def _run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False)


def opening(folder: Path, options: Any) -> Opening:
    """How the folder is opened."""
    name = quote(folder.name)
    models = f'"$PWD"/{name}/models'
    if options.flavour == "classic":
        return Opening(
            title="Gazebo Classic",
            commands=f"GAZEBO_MODEL_PATH={models} gazebo {name}/scene.sdf",
        )
    return Opening(
        title="Gazebo",
        commands=f"GZ_SIM_RESOURCE_PATH={models} gz sim {name}/scene.sdf\n"
        f"# Fortress: IGN_GAZEBO_RESOURCE_PATH={models} ign gazebo {name}/scene.sdf",
    )


CONSUMERS = (
    Consumer(name="files", read=read_files, quick=True, full=False),
    # Its parser, mesh loaders and physics; gz-sim itself is not run.
    Consumer(name="Gazebo Fortress' libraries", read=read_sdf),
)
"""What reads these exports back."""
