"""Exports as plain readers have them: XML, JSON and bytes by hand, nothing of our read-back."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from tests.helpers.plain_readers import CORNERS, glb_parts

_ROCK = re.compile(r"rock_(\d+)(?:_visual)?")
_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""glTF's axes (y up) as ours."""


@dataclass(kw_only=True)
class Plain:
    """What one export says of a world."""

    ground: list[np.ndarray] = field(default_factory=list)
    """Triangles that are the ground [m], shape [n, 3, 3]."""
    places: dict[int, np.ndarray] = field(default_factory=dict)
    """Turn and place of each rock by its id, shape [4, 4]."""
    tops: dict[int, float] = field(default_factory=dict)
    """The highest point of each rock's mesh [m]."""
    bodies: dict[int, tuple[float, np.ndarray, np.ndarray]] = field(default_factory=dict)
    """Mass [kg], centre of mass [m] and inertia about it [kg m²], both along the world's axes."""

    def put(self, rock: int, place: np.ndarray, scale: float, vertices: np.ndarray) -> None:
        """Put a rock's mesh to its place."""
        self.places[rock] = place
        self.tops[rock] = float((scale * vertices @ place[2, :3]).max() + place[2, 3])

    def weigh(self, rock: int, mass: float, place: np.ndarray, tensor: np.ndarray) -> None:
        """Give a rock its mass, whose axes and centre are at a place."""
        turn = place[:3, :3]
        self.bodies[rock] = mass, place[:3, 3], turn @ tensor @ turn.T


def _placed(rotation: Rotation, position: np.ndarray) -> np.ndarray:
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = rotation.as_matrix(), position
    return place


def _numbers(text: str | None, default: str = "") -> np.ndarray:
    return np.array((text or default).split(), np.float64)


def _pose(element: Element) -> np.ndarray:
    """The place that an SDF element's `<pose>` says, in x, y, z, roll, pitch, yaw."""
    values = _numbers(element.findtext("pose"), "0 0 0 0 0 0")
    return _placed(Rotation.from_euler("xyz", values[3:]), values[:3])


def _tensor(values: np.ndarray) -> np.ndarray:
    """Of ixx, iyy, izz, ixy, ixz, iyz."""
    xx, yy, zz, xy, xz, yz = values
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def read_sdf(folder: Path) -> Plain:
    """Of world.sdf, for Gazebo or Drake."""
    plain, known = Plain(), {}

    def corners(geometry: Element) -> np.ndarray:
        uri = geometry.findtext("mesh/uri", "")
        inside = uri.removeprefix("model://")
        path = folder / (uri if inside == uri else f"models/{inside}")
        if path not in known:
            known[path] = CORNERS[path.suffix](path)[:, :3]
        return known[path]

    world = ElementTree.parse(folder / "world.sdf").getroot().find("world")
    models = list(world.iter("model"))
    for include in world.iter("include"):
        name = include.findtext("uri").removeprefix("model://")
        models.append(ElementTree.parse(folder / "models" / name / "model.sdf").find("model"))
    for model, link in ((m, link) for m in models for link in m.findall("link")):
        base, movable = _pose(model) @ _pose(link), _ROCK.fullmatch(model.get("name"))
        for part in link.findall("collision"):
            if part.get("name").startswith("ground"):
                plain.ground.append(corners(part.find("geometry")).reshape(-1, 3, 3))
        for part in link.findall("visual"):
            named = movable or _ROCK.fullmatch(part.get("name"))
            if named:
                scale = _numbers(part.findtext("geometry/mesh/scale"), "1")[0]
                vertices = corners(part.find("geometry"))
                plain.put(int(named[1]), base @ _pose(part), scale, vertices)
        inertial = link.find("inertial")
        if movable and inertial is not None:
            names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            moments = np.array([float(inertial.findtext(f"inertia/{n}")) for n in names])
            place = base @ _pose(inertial)
            mass = float(inertial.findtext("mass"))
            plain.weigh(int(movable[1]), mass, place, _tensor(moments))
    return plain


def _mujoco_pose(element: Element) -> np.ndarray:
    turn = _numbers(element.get("quat"), "1 0 0 0")
    return _placed(
        Rotation.from_quat(turn, scalar_first=True), _numbers(element.get("pos"), "0 0 0")
    )


def read_mjcf(folder: Path) -> Plain:
    """Of world.xml, whose rocks are as they are touched, rounded in size by up to 1 %."""
    root, plain = ElementTree.parse(folder / "world.xml").getroot(), Plain()
    meshes = {mesh.get("name"): mesh for mesh in root.iter("mesh") if mesh.get("name")}
    fields = {f.get("name"): f for f in root.iter("hfield") if f.get("name")}
    known: dict[str, np.ndarray] = {}
    split = root.find(".//geom[@class='ground_block']") is not None
    touched = "ground_block" if split else "ground"
    for geom in root.iter("geom"):
        if geom.get("hfield") and geom.get("class") == touched:
            grid = _height_field(folder, fields[geom.get("hfield")], _numbers(geom.get("pos")))
            plain.ground.append(triangles_of(*grid))
    for body in [root.find("worldbody"), *root.iter("body")]:
        base = _mujoco_pose(body)
        for geom in body.findall("geom"):
            named = re.fullmatch(r"rock_(\d+)", geom.get("name", ""))
            if named:
                mesh = meshes[geom.get("mesh")]
                file = mesh.get("file")
                if file not in known:
                    known[file] = CORNERS[Path(file).suffix](folder / file)[:, :3]
                scale = _numbers(mesh.get("scale"), "1")[0]
                plain.put(int(named[1]), base @ _mujoco_pose(geom), scale, known[file])
        named, inertial = re.fullmatch(r"rock_(\d+)", body.get("name", "")), body.find("inertial")
        if named:
            tensor = _tensor(_numbers(inertial.get("fullinertia")))
            mass = float(inertial.get("mass"))
            plain.weigh(int(named[1]), mass, base @ _mujoco_pose(inertial), tensor)
    return plain


def _height_field(folder: Path, asset: Element, place: np.ndarray) -> tuple[np.ndarray, ...]:
    rows, columns = int(asset.get("nrow")), int(asset.get("ncol"))
    if asset.get("file"):
        data = (folder / asset.get("file")).read_bytes()
        assert np.frombuffer(data, "<i4", 2).tolist() == [rows, columns]
        samples = np.frombuffer(data, "<f4", offset=8).reshape(rows, columns)
    else:
        samples = _numbers(asset.get("elevation")).reshape(rows, columns)[::-1]
    half_east, half_north, height, _ = _numbers(asset.get("size"))
    spread = samples - samples.min()
    x = np.linspace(-half_east, half_east, columns) + place[0]
    y = np.linspace(-half_north, half_north, rows) + place[1]
    return x, y, spread / (spread.max() or 1.0) * height + place[2]


def triangles_of(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The triangles of heights on a grid, cut from south-west to north-east, shape [n, 3, 3]."""
    points = np.stack([*np.meshgrid(x, y), z], axis=-1)
    sw, se, nw, ne = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    return np.stack([sw, se, ne, sw, ne, nw], axis=-2).reshape(-1, 3, 3)


def read_glb(folder: Path) -> Plain:
    """Of world.glb."""
    text, arrays = glb_parts(folder / "world.glb")
    plain = Plain()

    def node_place(node: dict) -> tuple[np.ndarray, float]:
        turn = Rotation.from_quat(node.get("rotation", [0, 0, 0, 1]))
        scales = set(node.get("scale", [1.0]))
        assert len(scales) == 1
        return _placed(turn, node.get("translation", [0, 0, 0])), scales.pop()

    root = _Z_UP @ node_place(text["nodes"][0])[0]
    for node in (text["nodes"][child] for child in text["nodes"][0]["children"]):
        named = _ROCK.fullmatch(node["name"])
        if not named and not node["name"].startswith("ground"):
            continue
        place, scale = node_place(node)
        (primitive,) = text["meshes"][node["mesh"]]["primitives"]
        points = arrays[primitive["attributes"]["POSITION"]].astype(np.float64)
        if named:
            plain.put(int(named[1]), root @ place, scale, points)
        else:
            moved = points @ (root @ place)[:3, :3].T + (root @ place)[:3, 3]
            plain.ground.append(moved[arrays[primitive["indices"]].reshape(-1, 3)])
    return plain


def read_usd(folder: Path) -> Plain:
    """Of world.usda, by OpenUSD."""
    from pxr import Usd, UsdGeom

    stage, plain = Usd.Stage.Open(str(folder / "world.usda")), Plain()
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        path, kind = str(prim.GetPath()), prim.GetTypeName()
        value = {a.GetName(): a for a in prim.GetAuthoredAttributes()}
        if path.startswith("/World/Ground/") and kind == "Mesh":
            points, index = (np.array(value[n].Get()) for n in ("points", "faceVertexIndices"))
            place = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0.0)).T
            moved = points @ place[:3, :3].T + place[:3, 3]
            plain.ground.append(moved[index].reshape(-1, 3, 3))
        elif kind == "PointInstancer":
            _read_instances(plain, prim, value)
        elif "physics:mass" in value and _ROCK.fullmatch(prim.GetName()):
            rock = int(_ROCK.fullmatch(prim.GetName())[1])
            place = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0.0)).T
            plain.places[rock] = place
            axes = value["physics:principalAxes"].Get()
            own = _placed(
                Rotation.from_quat([*axes.imaginary, axes.real]),
                np.array(value["physics:centerOfMass"].Get()),
            )
            moments = np.diag(np.array(value["physics:diagonalInertia"].Get()))
            plain.weigh(rock, value["physics:mass"].Get(), place @ own, moments)
            shapes = [p for p in Usd.PrimRange(prim, Usd.TraverseInstanceProxies())]
            shapes = [p for p in shapes if p.GetTypeName() == "Mesh"]
            tops = []
            for shape in shapes:
                moved = np.array(UsdGeom.Xformable(shape).ComputeLocalToWorldTransform(0.0)).T
                points = np.array(shape.GetAttribute("points").Get(), np.float64)
                tops.append((points @ moved[2, :3]).max() + moved[2, 3])
            plain.tops[rock] = float(max(tops))
    return plain


def _read_instances(plain: Plain, prim, value: dict) -> None:
    from pxr import Usd

    names = ("ids", "protoIndices", "positions", "orientations", "scales")
    ids, kinds, positions, turns, scales = (value[name].Get() for name in names)
    points = []
    for target in prim.GetRelationship("prototypes").GetTargets():
        inside = Usd.PrimRange(prim.GetStage().GetPrimAtPath(target), Usd.TraverseInstanceProxies())
        (shape,) = (p for p in inside if p.GetTypeName() == "Mesh")
        points.append(np.array(shape.GetAttribute("points").Get(), np.float64))
    for row, rock in enumerate(ids):
        turn = Rotation.from_quat([*turns[row].imaginary, turns[row].real])
        place = _placed(turn, np.array(positions[row]))
        plain.put(int(rock), place, float(scales[row][0]), points[kinds[row]])


def read_ply(folder: Path) -> Plain:
    """Of world.ply, a ground without rocks."""
    data = (folder / "world.ply").read_bytes()
    head, _, body = data.partition(b"end_header\n")
    vertices, faces = (int(n) for n in re.findall(rb"element \w+ (\d+)", head))
    vertex = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])
    face = np.dtype([("count", "u1"), ("index", "<i4", 3)])
    points = np.frombuffer(body, vertex, vertices)["xyz"].astype(np.float64)
    index = np.frombuffer(body, face, faces, vertices * vertex.itemsize)["index"]
    return Plain(ground=[points[index]])


def read_corners(folder: Path) -> Plain:
    """Of world.stl or world.obj, a ground without rocks."""
    (path,) = (p for p in folder.iterdir() if p.suffix in CORNERS)
    return Plain(ground=[CORNERS[path.suffix](path)[:, :3].reshape(-1, 3, 3)])


def read_geotiff(folder: Path) -> Plain:
    """Of elevation.tif, whose pixels' middles are the nodes."""
    import rasterio

    with rasterio.open(folder / "elevation.tif") as file:
        heights, grid = file.read(1).astype(np.float64), file.transform
    rows, columns = heights.shape
    x, _ = grid @ (np.arange(columns) + 0.5, 0.5)
    _, y = grid @ (0.5, np.arange(rows) + 0.5)
    return Plain(ground=[triangles_of(x, y[::-1], heights[::-1])])


def read_points(folder: Path) -> Plain:
    """Of points.xyz, the nodes row by row."""
    x, y, z = np.loadtxt(folder / "points.xyz").T
    columns = len(np.unique(x))
    grid = z.reshape(-1, columns)
    return Plain(ground=[triangles_of(x[:columns], y[::columns], grid)])


def heights_under(triangles: np.ndarray, points: np.ndarray, spacing: float) -> np.ndarray:
    """Heights of a ground of two triangles per cell under points; NaN where none is."""
    low = triangles[..., :2].reshape(-1, 2).min(axis=0)
    columns = round(float(np.ptp(triangles[..., 0])) / spacing)

    def cell(xy: np.ndarray) -> np.ndarray:
        east, north = ((xy - low) / spacing).T.astype(np.int64)
        return north * columns + east

    cells = cell(triangles[..., :2].mean(axis=1))
    order = np.argsort(cells, kind="stable")
    assert np.array_equal(cells[order], np.repeat(np.arange(len(cells) // 2), 2))
    two = triangles[order].reshape(-1, 2, 3, 3)[cell(points)]
    a, ab, ac = two[..., 0, :], two[..., 1, :] - two[..., 0, :], two[..., 2, :] - two[..., 0, :]
    d = points[:, None] - a[..., :2]
    area = ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]
    u = (d[..., 0] * ac[..., 1] - d[..., 1] * ac[..., 0]) / area
    v = (ab[..., 0] * d[..., 1] - ab[..., 1] * d[..., 0]) / area
    inside = (u >= -1e-6) & (v >= -1e-6) & (u + v <= 1 + 1e-6)
    heights = np.where(inside, a[..., 2] + u * ab[..., 2] + v * ac[..., 2], np.nan)
    return np.nanmax(heights, axis=1)
