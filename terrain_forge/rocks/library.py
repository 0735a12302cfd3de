"""The rock library: random shapes at rest, with levels of detail, hulls and mass properties.

Libraries are kept in the cache (`base.cache_folder`), so that a second build, or another world,
need not make them again.
"""

from __future__ import annotations

import json
import platform
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from logging import getLogger
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, MinLen
from numpy.random import Generator, Philox
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    DataError,
    Idle,
    InputFile,
    RecipeError,
    Spec,
    cache_folder,
    checked,
    from_plain,
    kernel_threads,
    mix,
    portable,
    read_arrays,
    stage_key,
    to_plain,
    worker_threads,
)
from terrain_forge.model import CustomMesh, Mesh, RockLibrary, RockPrototype, box_projection
from terrain_forge.rocks.embedding.footprint import bounds
from terrain_forge.rocks.shapes.carving import Sphere, carve, carve_close, levels_of_detail
from terrain_forge.rocks.shapes.collision import collision_parts
from terrain_forge.rocks.shapes.families import COARSE_FACES, FAMILIES, Family
from terrain_forge.rocks.shapes.shapes import projections
from terrain_forge.rocks.shapes.solid import hausdorff_distance, mass_properties
from terrain_forge.rocks.shapes.texture import rock_surface

logger = getLogger(__name__)

MOST_FILES = 64
"""Libraries that are kept; the oldest go first."""

_MAKERS = ("numpy", "scipy", "numba", "manifold3d", "coacd")
_BROKEN = (DataError, OSError, ValueError, LookupError, TypeError)
MOST_PACKED = 64
"""Shapes by which is judged whether rocks can be packed."""
_OUTLINE_TOLERANCE = 2e-3  # of a mean axis


@dataclass(frozen=True, kw_only=True)
class MeshSpec(Spec):
    """A rock shape of the user's own."""

    file: Annotated[str, MinLen(1), InputFile(kind="mesh")]
    """A closed mesh in metres, z up: OBJ, STL, PLY, GLB or glTF. It is scaled to the diameters that
    are drawn; its materials are not used."""
    family: Annotated[str, MinLen(1)] | None = None
    """Family that the shape counts to; by default the file's name without its ending."""
    keep_up: bool = False
    """Whether it lies as the file has it; else it is laid on its most stable side."""

    @property
    def family_name(self) -> str:
        """The family that the shape counts to."""
        return self.family or PurePosixPath(self.file).stem


@dataclass(frozen=True, kw_only=True)
class LibrarySpec(Spec):
    """Which rock shapes a world draws from."""

    shapes: Annotated[int, Interval(ge=0, le=1000)] = 24
    """Number of different shapes that are made; more of them change none of the first ones. 0 only
    where `meshes` has shapes."""
    seed: Annotated[int, Interval(ge=0, le=2**63 - 1)] = 0
    """Seed of the library alone, so that several worlds can share one."""
    families: Annotated[tuple[Family, ...], MinLen(1)] = ("block", "slab", "block", "cobble")
    """Families that the shapes take in turn; one named twice gives twice as many. `block`: angular
    and freshly broken; `slab`: flat, of layered rock; `cobble`: worn round; `vesicular`: basalt
    with gas bubbles; `ventifact`: faceted by windblown sand; `breccia`: broken rock that an impact
    has welded together."""
    meshes: tuple[MeshSpec, ...] = ()
    """The user's own shapes, which follow those that are made."""
    hull_vertices: Annotated[int, Interval(ge=16, le=64)] = 64
    """Largest number of vertices of a shape's convex collision parts; GPU engines like 32."""
    hull_excess: Annotated[float, Interval(ge=0.1, le=1)] = 0.2
    """Part by which the volume of a shape's collision parts together may exceed the shape's. A
    shape that one hull does not fit so well is cut into several parts, which takes seconds for
    each, once."""
    hull_distance: Annotated[float, Interval(ge=0.1, le=1)] = 0.15
    """How far the surface of the collision parts may be from the shape's anywhere (Hausdorff
    distance), as a part of its mean axis."""

    def idle(self) -> Iterator[Idle]:
        """What is for shapes that are made, where there are none."""
        if self.shapes == 0:
            yield from (Idle(name, "shapes: 0 makes none") for name in ("seed", "families"))

    def sample(self) -> LibrarySpec:
        """As many shapes as tell how they can be packed, none cut up: more would take minutes."""
        few = replace(self, shapes=min(self.shapes, max(MOST_PACKED, len(self.families))))
        if not self.is_tight:
            return few
        usual = LibrarySpec()
        excess = max(self.hull_excess, usual.hull_excess)
        distance = max(self.hull_distance, usual.hull_distance)
        return replace(
            few, hull_vertices=usual.hull_vertices, hull_excess=excess, hull_distance=distance
        )

    @property
    def is_tight(self) -> bool:
        """Whether the collision parts are to be closer than usual.

        One hull then fits few of the slabs, vesicular rocks and breccias, and not all of them can
        be cut so closely, which only making them tells: seconds of processor time for each.
        """
        usual = LibrarySpec()
        closer = self.hull_excess < usual.hull_excess or self.hull_distance < usual.hull_distance
        return closer or self.hull_vertices < usual.hull_vertices

    def doubtful(self) -> LibrarySpec | None:
        """What a plan makes of it, to see whether it can be: the user's shapes, if there are any.

        With them come the others where these are made in a moment; a build then has them all.
        """
        if not self.meshes:
            return None
        return replace(self, shapes=0) if self.is_tight or self.sample() != self else self

    @property
    def coarse_faces(self) -> float:
        """About how many triangles a rock of its families has where it is merged with others."""
        taken = [self.families[n % len(self.families)] for n in range(max(self.shapes, 1))]
        return float(np.mean([COARSE_FACES[family] for family in taken]))

    def family_names(self) -> tuple[str, ...]:
        """The families that the library has shapes of, each once."""
        made = self.families[: self.shapes]
        return tuple(dict.fromkeys([*made, *(mesh.family_name for mesh in self.meshes)]))


@checked
def make_library(spec: LibrarySpec, *, custom: tuple[CustomMesh, ...] = ()) -> RockLibrary:
    """Make the library; equal specs give equal bytes, and shape n does not depend on how many.

    Args:
        spec: What is wanted.
        custom: The user's own shapes, by the paths that the spec names.

    Raises:
        RecipeError: if a shape cannot be cut into parts as close as `spec` wants, or there is none.
        DataError: if a mesh that the spec names is not among `custom`.
    """
    if not spec.shapes and not spec.meshes:
        raise RecipeError("0 shapes and no meshes: a library needs one", key=("shapes",))
    missing = {own.file for own in spec.meshes} - {mesh.path for mesh in custom}
    if missing:
        raise DataError(f"make_library: custom has no mesh {min(missing)}")
    key = stage_key(spec.seed, "rock-library")
    spheres = (Sphere(), Sphere(close=True)) if spec.shapes else None

    def made(n: int) -> RockPrototype:
        assert spheres is not None
        family = spec.families[n % len(spec.families)]
        blank = FAMILIES[family](Generator(Philox(key=int(mix(key, n)))))
        meshes = *carve(blank, spheres[0]), carve_close(blank, spheres[1])
        return _prototype(family, lay_down(meshes, blank.axes), spec, name=f"shape {n} ({family})")

    files = {mesh.path: mesh.mesh for mesh in custom}
    with worker_threads(kernel_threads(), leave=True) as pool:
        prototypes = [*pool.map(made, range(spec.shapes))]
    for own in spec.meshes:
        close, *levels = levels_of_detail(files[own.file])
        laid = lay_down((*levels, close), upright=own.keep_up)
        prototypes.append(_prototype(own.family_name, laid, spec, name=own.file))
    tile = rock_surface()
    return RockLibrary(
        prototypes=tuple(prototypes),
        seed=spec.seed,
        texture=tile.brightness,
        normals=tile.normals,
        roughness=tile.roughness,
    )


def _prototype(
    family: str, laid: tuple[Mesh, ...], spec: LibrarySpec, *, name: str
) -> RockPrototype:
    """A shape of its levels of detail, finest first, and last its close mesh."""
    *levels, close = laid
    meshes, shape = tuple(levels), laid[0]
    solid = mass_properties(shape)
    collision = collision_parts(
        meshes,
        vertices=spec.hull_vertices,
        excess=spec.hull_excess,
        distance=spec.hull_distance,
        name=name,
    )
    # No outline differs by more, from any side, than the surfaces do: their Hausdorff distance.
    errors = [
        hausdorff_distance(mesh, shape, tolerance=_OUTLINE_TOLERANCE) + _OUTLINE_TOLERANCE
        for mesh in meshes[1:]
    ]
    reach, rise = bounds(shape)
    return RockPrototype(
        family=family,
        meshes=meshes,
        close=close if len(close.vertices) > len(shape.vertices) else None,
        hulls=collision.parts,
        volume=solid.volume,
        inertia=solid.inertia,
        hull_excess=collision.excess,
        hull_distance=collision.distance,
        uvs=tuple(box_projection(mesh) for mesh in meshes),
        outline_errors=(0.0, *errors),
        reach=reach,
        rise=rise,
    )


def lay_down(
    meshes: tuple[Mesh, ...], axes: Array | None = None, *, upright: bool = False
) -> tuple[Mesh, ...]:
    """Turn a rock onto its most stable side and give it its extents.

    The first mesh decides: z is up when it lies on the facet of its hull over which its centre of
    mass is lowest (which always projects into that facet), x is its longer horizontal principal
    axis. Stretching along these axes to the extents `axes` leaves that facet level and the centre
    of mass above it. Coarser meshes are grown to the volume of the first, all about its centre of
    mass, which becomes the origin.

    Args:
        meshes: The levels of detail, finest first.
        axes: The extents [m]; by default those of the mesh, scaled to a mean axis of 1 m.
        upright: Whether the rock stays as it is, whatever its most stable side.
    """
    solid = mass_properties(meshes[0])
    centred = [mesh.vertices - solid.centre for mesh in meshes]
    rotation = np.eye(3) if upright else lying_axes(centred[0], solid.inertia)
    turned = [projections(vertices, rotation) for vertices in centred]
    extents = np.ptp(turned[0], axis=0)
    laid = [
        mesh.replace(vertices=v / extents.mean() if axes is None else v * (axes / extents))
        for mesh, v in zip(meshes, turned, strict=True)
    ]
    volumes = [mass_properties(mesh).volume for mesh in laid]
    return tuple(
        mesh.replace(vertices=mesh.vertices * portable.cbrt(volumes[0] / volume))
        for mesh, volume in zip(laid, volumes, strict=True)
    )


def lying_axes(vertices: Array, inertia: Array) -> Array:
    """Axes, as rows, of a rock that lies on its most stable side: x long and level, z up.

    Vertices and inertia are relative to its centre of mass.
    """
    from scipy.spatial import ConvexHull

    equations = ConvexHull(vertices).equations
    up = -equations[np.argmin(-equations[:, 3]), :3]
    level = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    level /= portable.norm(level)
    across = np.cross(up, level)
    i_level, i_across, product = (
        float(np.einsum("i,ij,j->", one, inertia, other))
        for one, other in ((level, level), (across, across), (level, across))
    )
    # The long axis is the one of the smaller moment of inertia.
    angle = 0.5 * portable.arctan2(-2.0 * product, i_across - i_level)
    x = np.cos(angle) * level + np.sin(angle) * across
    return np.stack([x, np.cross(up, x), up])


def find_library(spec: LibrarySpec, *, custom: tuple[CustomMesh, ...] = ()) -> RockLibrary:
    """The library that `make_library` makes, to the bit, from the cache where it holds it.

    A cache that cannot be read or written is only logged: the library is then made.

    Args:
        spec: What is wanted.
        custom: The user's own shapes, by the paths that the spec names.

    Raises:
        RecipeError: if a shape cannot be cut into parts as close as `spec` wants.
    """
    folder = cache_folder()
    if folder is None:
        return make_library(spec, custom=custom)
    file = folder / f"rocks-{library_key(spec, custom)}.npz"
    state = _state(file)
    if state is not None and (file, state) in _at_hand:
        return _at_hand[file, state]
    library = _read(file)
    if library is None:
        library = make_library(spec, custom=custom)
        store(file, library)
    _at_hand.clear()
    if (state := _state(file)) is not None:
        _at_hand[file, state] = library
    return library


def is_library_kept(spec: LibrarySpec, *, custom: tuple[CustomMesh, ...] = ()) -> bool:
    """Whether the cache has the library."""
    folder = cache_folder()
    return folder is not None and (folder / f"rocks-{library_key(spec, custom)}.npz").is_file()


_at_hand: dict[tuple[Path, tuple[int, int]], RockLibrary] = {}
"""The library that was found last, by its file and the state of that: many worlds share one."""


def _state(file: Path) -> tuple[int, int] | None:
    """When a file was changed [ns], and its bytes; None where there is none."""
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def library_key(spec: LibrarySpec, custom: tuple[CustomMesh, ...]) -> str:
    """SHA-256 of all that a library follows from, hexadecimal: wishes, meshes, code, packages."""
    wishes = json.dumps(asdict(spec), sort_keys=True)
    digest = sha256(f"{wishes}\n{_origin()}".encode())
    for own in custom:
        digest.update(f"{own.path}\n{len(own.mesh.vertices)}\n".encode())
        digest.update(own.mesh.vertices.tobytes())
        digest.update(own.mesh.faces.tobytes())
    return digest.hexdigest()


@cache
def _origin() -> str:
    """The code that makes libraries, and what it runs on."""
    rocks, package = Path(__file__).parents[:2]
    sources = [*sorted((rocks / "shapes").glob("*.py")), rocks / "library.py"]
    sources += [rocks / "embedding" / f"{name}.py" for name in ("footprint", "outline")]
    sources += [package / "base" / f"{name}.py" for name in ("geometry", "heap", "seeds")]
    sources += [package / "model" / "mesh.py"]
    code = sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()
    return "\n".join([code, platform.machine(), *(f"{n} {version(n)}" for n in _MAKERS)])


def _read(file: Path) -> RockLibrary | None:
    if not file.is_file():
        return None
    try:
        arrays = read_arrays(file)
        plain = json.loads(arrays.pop("plain").tobytes())
        library = from_plain(plain["library"], arrays, RockLibrary)
        if library.content_hash == plain["content_hash"]:
            return library
        logger.info("rock cache: %s does not hold what it should", file)
    except _BROKEN as error:
        logger.info("rock cache: %s cannot be read (%s)", file, error)
    return None


def store(file: Path, library: RockLibrary) -> None:
    """Keep a library; readers see all of the file or none of it."""
    arrays: dict[str, NDArray[Any]] = {}
    plain = {"library": to_plain(library, arrays, "library"), "content_hash": library.content_hash}
    text = np.frombuffer(json.dumps(plain).encode(), dtype=np.uint8)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent, prefix="new-") as folder:
            new = Path(folder) / file.name
            np.savez(new, allow_pickle=False, plain=text, **arrays)  # type: ignore[arg-type]
            new.replace(file)
        kept = sorted(file.parent.glob("rocks-*.npz"), key=lambda one: one.stat().st_mtime)
        for old in kept[:-MOST_FILES]:
            old.unlink(missing_ok=True)
    except OSError as error:
        logger.info("rock cache: %s cannot be written (%s)", file, error)
