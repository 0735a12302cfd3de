"""Good input files of every kind, and recipes that use them; what fuzzers begin with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

RECIPES = Path(__file__).parents[2] / "recipes"
DTMS = Path(__file__).parents[2] / "dtm_samples"
Plain = dict[str, Any]

LAW = {"kind": "golombek", "k": 0.05}
STONES = {"name": "stones", "size_frequency": LAW, "diameter_m": [0.1, 0.5]}
WAY = {"name": "way", "route": {"points_m": [[-0.6, 0], [0.6, 0.2]]}, "speed_m_s": 0.3}
SENSORS = [
    {"name": "imu", "kind": "imu", "preset": "stim300", "rate_hz": 50},
    {"name": "wheels", "kind": "odometry", "rate_hz": 10},
    {"name": "lidar", "kind": "lidar", "elevations_deg": [-20, -7], "horizontal_samples": 30,
     "position_m": [0, 0, 0.9], "rate_hz": 5},
    {"name": "camera", "kind": "camera", "position_m": [0.2, 0, 0.6], "rpy_deg": [0, 12, 0],
     "rate_hz": 1, "width_px": 16, "height_px": 12},
]  # fmt: skip
CHECK = "check", "recipe.yaml"
SCORE = "evaluate", "--truth", "tum.txt", "--estimate", "estimate.txt", "--set", "stations_m=0"


def tiny(**changes: Any) -> Plain:
    """A recipe of a few nodes."""
    return {
        "schema": 1,
        "name": "tiny",
        "body": "moon",
        "dtm": {"kind": "flat", "size_m": [5, 4]},
        "terrain": {"spacing_m": 0.125},
        "rocks": {"library": {"shapes": 1}, "populations": []},
        "exports": ["geotiff"],
        **changes,
    }


def of_rocks(*populations: Plain, **more: Any) -> Plain:
    return tiny(rocks={"library": {"shapes": 1}, "populations": list(populations), **more})


def of_layer(**layer: Any) -> Plain:
    return tiny(terrain={"spacing_m": 0.125, "layers": [layer]})


def of_route(**route: Any) -> Plain:
    return tiny(paths=[{**WAY, "route": route}])


def of_raster(source: str, **more: Any) -> Plain:
    return tiny(body="mars", dtm={"source": source, "size_m": [5, 4], **more})


def of_rover(file: str) -> Plain:
    return tiny(rover={"kind": "file", "file": file}, paths=[WAY], validate={"drive": "way"})


def of_sensors() -> Plain:
    """A recipe whose world can be recorded."""
    return {**of_rocks(STONES), "rover": "skid4", "paths": [WAY], "sensors": SENSORS,
            "dataset": {"profile": "quick"}}  # fmt: skip


def of_tiles() -> Plain:
    """A recipe of a site in tiles."""
    return {**of_rocks(STONES), "dtm": {"kind": "flat", "size_m": [16, 16]}, "paths": [WAY],
            "tiles": {"size_m": 8}}  # fmt: skip


def of_worlds() -> Plain:
    """A recipe of two worlds."""
    vary = {
        "rocks.populations.0.size_frequency.k": {"difficulty": [0.01, 0.2]},
        "sun.elevation_deg": {"uniform": [5, 60]},
        "rover": {"choice": ["skid4", "morpheus"]},
    }
    return {**of_rocks(STONES), "worlds": {"count": 2, "vary": vary, "difficulty": {}},
            "sun": {"azimuth_deg": 10, "elevation_deg": 30}, "rover": "skid4"}  # fmt: skip


def schema_recipes() -> list[Plain]:
    """Recipes that need no file and together use most of what a recipe can say."""
    band = {"slope": {"below_deg": 20}, "height": {"above_m": -1, "fade_m": 0.2}}
    craters = {"production": {"kind": "neukum", "age_ga": 3.0}, "diameter_m": [0.5, 20]}
    hollow = {"above_m": 0.02, "fade_m": 0.02, "baseline_m": 1}
    soils = [
        {"kind": "sand", "mask": {"hollow": hollow}, "cover": 0.8, "patch_m": 1},
        *({"kind": kind, "cover": 0.3} for kind in ("dust", "lag", "bedrock")),
    ]
    placed = {"kind": "flat", "size_m": [5, 4], "lonlat_deg": [10, 20]}
    return [
        of_rocks(STONES, exclusion_zones=[{"centre_m": [0, 0], "radius_m": 0.4}]),
        of_rocks({**STONES, "size_frequency": {"kind": "power_law", "number_per_m2": 0.02,
                                               "exponent": 1.5}, "dynamic_m": [0.2, 0.5]}),
        of_rocks({**STONES, "arrangement": {"kind": "clustered", "clusters_per_m2": 0.2,
                                            "radius_m": 0.5}, "max_slope_deg": 20}),
        of_rocks({**STONES, "size_frequency": {"kind": "exponential", "number_per_m2": 2,
                                               "decay_per_m": 5}}),
        of_rocks({**STONES, "size_frequency": {
            "kind": "counts", "area_m2": 400, "bins": [[0.1, 0.2, 50], [0.2, 0.4, 9]]}}),
        of_rocks({**STONES, "size_frequency": {"kind": "golombek", "site": "gale"}},
                 library={"shapes": 2, "families": ["slab", "breccia"], "hull_vertices": 20}),
        of_layer(kind="fractal", hurst=0.7, deviation_1m_m=0.02, mask=band),
        of_layer(kind="ripples", wavelength_m=1.0, height_m=0.05, wind_from_deg=20),
        of_layer(kind="craters", **craters),
        tiny(
            terrain={"spacing_m": 0.125, "layers": [{"kind": "craters", **craters}]},
            rocks={"library": {"shapes": 1}, "populations": [
                {**STONES, "arrangement": {"kind": "craters", "craters": [
                    {"centre_m": [1, 1], "diameter_m": 30}]}}]},
        ),
        of_route(kind="spline", closed=True, points_m=[[-0.5, -0.4], [0.5, -0.4], [0, 0.5]]),
        of_route(kind="polyline", points_m=[[-0.5, -0.4], [0.5, -0.4], [0, 0.5]]),
        of_route(kind="spiral", length_m=4, turns=2),
        of_route(kind="lawnmower", rows=3, row_spacing_m=0.3, size_m=1),
        of_route(kind="figure_eight", size_m=1),
        of_route(kind="loop", length_m=3),
        of_route(kind="triangle", size_m=1),
        of_route(kind="planned", start_m=[-0.6, 0], goal_m=[0.6, 0.2]),
        tiny(paths=[{**WAY, "acceleration_m_s2": 0.2, "shake": {"rms_deg": 0.2},
                     "corridor": {"width_m": 1}}]),
        tiny(exports={"sdf": {}, "mjcf": {}, "usd": {}, "glb": {}, "mesh": {}, "drake": {},
                      "rover": {}}),
        tiny(rover={"kind": "skid4"}, sun={"azimuth_deg": 10, "elevation_deg": 3}),
        tiny(rover={"kind": "morpheus", "model": "detailed", "grousers": {"count": 20}},
             exports=["rover"]),
        tiny(dtm=placed, body="mars"),
        tiny(dtm=placed, body="mars", sun={"time": "2030-09-01", "ltst": "09:00"},
             sky={"tau": 0.6}, horizon={}, rover="skid4", exports={"usd": {}, "glb": {}}),
        tiny(body="mars", terrain={"spacing_m": 0.125, "materials": soils}),
        of_tiles(),
        tiny(rover="skid4", paths=[WAY], validate={"drive": {"path": "way"}, "drives": 2}),
        of_worlds(),
        of_sensors(),
        tiny(rover="morpheus", paths=[WAY], dataset={"motion": "drive", "formats": ["tum"]},
             sensors={"add": [
                 {"name": "sun", "kind": "sun_sensor"},
                 {"name": "tilt", "kind": "inclinometer", "link": "rocker_left"},
                 {"name": "stereo", "kind": "stereo", "position_m": [0.2, 0, 0.6],
                  "channels": ["depth"]}]}),
    ]  # fmt: skip


def file_recipes(folder: Path) -> list[tuple[Plain, tuple[str, ...], tuple[str, ...]]]:
    """Write good files of every kind.

    Returns recipes, each with the files of it that may be broken, and the command that reads them.
    """
    _rasters(folder)
    _tables(folder)
    _meshes(folder)
    _rovers(folder)
    image = {"image": "image.png", "height_m": 0.3}
    appearance = {"detail": {"image": "image.png", "size_m": 0.5}}
    rows: list[Any] = [
        *((of_raster(name), (name,)) for name in ("dem.tif", "dem_int.tif", "tiled.tif")),
        (of_raster("dem.img"), ("dem.img", "dem.hdr")),
        (of_raster("dem.asc", extent_m=[40, 40]), ("dem.asc",)),
        (of_raster("height.png", extent_m=[40, 40], height_range_m=[0, 5]), ("height.png",)),
        (of_raster("lola.LBL", destair=True) | {"body": "moon"}, ("lola.LBL", "lola.IMG")),
        (of_layer(kind="displacement_map", **image), ("image.png",)),
        (of_rocks({**STONES, "density_image": "image.png"}), ("image.png",)),
        (of_raster("dem.tif") | {"terrain": {"spacing_m": 0.125, "appearance": {
            "orthoimage": {"image": "ortho.tif"}}}}, ("ortho.tif",)),
        (tiny(terrain={"spacing_m": 0.125, "appearance": appearance}), ("image.png",)),
        (of_layer(kind="fractal", mask={"image": "mask.png"}), ("mask.png",)),
        (of_rocks(lists=[{"name": "mine", "file": "rocks.csv"}]), ("rocks.csv",)),
        (of_layer(kind="craters", file="craters.csv"), ("craters.csv",)),
        (of_rocks({**STONES, "size_frequency": {"kind": "counts", "file": "counts.csv",
                                                "area_m2": 100}}), ("counts.csv",)),
        (of_rocks({**STONES, "size_frequency": {"kind": "table", "file": "law.csv"}}),
         ("law.csv",)),
        *((of_route(kind="file", file=name), (name,)) for name in ("track.csv", "tum.txt")),
        (of_route(kind="file", file="tum.txt", timing="recorded", attitude="recorded"),
         ("tum.txt",)),
        *((of_rocks(STONES, library={"shapes": 0, "meshes": [{"file": f"rock.{kind}"}]}),
           (f"rock.{kind}",)) for kind in ("obj", "stl", "ply", "glb")),
        (of_rover("rover.urdf"), ("rover.urdf", "wheel.stl")),
        (of_rover("rover.xml"), ("rover.xml",)),
        (of_rover("rover.xacro"), ("rover.xacro",)),
        (tiny(), ("estimate.txt", "tum.txt"), SCORE),
        (tiny(), ("study.yaml",), ("study", "study.yaml", "--list")),
    ]  # fmt: skip
    return [(*row, CHECK)[:3] for row in rows]


def _rasters(folder: Path) -> None:
    import rasterio
    from PIL import Image

    rng = np.random.default_rng(1)
    heights = np.cumsum(np.cumsum(rng.normal(0, 0.02, (40, 40)), 0), 1).astype("float32")
    place: Plain = {
        "width": 40,
        "height": 40,
        "crs": "+proj=eqc +lat_ts=-4 +lat_0=0 +lon_0=137 +R=3396190 +units=m",
        "transform": rasterio.transform.from_origin(0.0, -240000.0, 1.0, 1.0),
    }
    for name, driver, kind, more in (
        ("dem.tif", "GTiff", "float32", {}),
        ("dem_int.tif", "GTiff", "int16", {"compress": "deflate", "nodata": -32768}),
        ("tiled.tif", "GTiff", "float32", {"tiled": True, "blockxsize": 16, "blockysize": 16}),
        ("dem.img", "ENVI", "float32", {}),
        ("ortho.tif", "GTiff", "uint8", {}),
    ):
        path = folder / name
        values = np.clip(heights * 20 + 100, 0, 255) if kind != "float32" else heights
        with rasterio.open(path, "w", driver=driver, dtype=kind, count=1, **place, **more) as file:
            file.write(values.astype(kind), 1)
    np.savetxt(
        folder / "dem.asc", heights, fmt="%.3f", comments="",
        header="ncols 40\nnrows 40\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999",
    )  # fmt: skip
    grey = np.clip(heights * 20 + 100, 0, 255).astype("uint8")
    Image.fromarray(grey).save(folder / "height.png")
    Image.fromarray(grey).save(folder / "image.png")
    Image.fromarray(grey[:32]).save(folder / "mask.png")
    for name in ("LBL", "IMG"):
        text = (DTMS / f"lola_ldem16_tranquillitatis.{name}").read_bytes()
        text = text.replace(b"lola_ldem16_tranquillitatis", b"lola")
        text = text.replace(b"LOLA_LDEM16_TRANQUILLITATIS", b"LOLA")
        (folder / f"lola.{name}").write_bytes(text)


def _tables(folder: Path) -> None:
    tables = {
        "rocks.csv": "x_m,y_m,diameter_m,yaw_deg\n0.5,0.5,0.2,10\n-0.5,-0.4,0.3,20\n",
        "craters.csv": "x_m,y_m,diameter_m,age_ga\n0,0,1.5,1\n1,0.5,0.8,2\n",
        "counts.csv": "low_m,high_m,count\n0.1,0.2,20\n0.2,0.4,5\n0.4,0.8,1\n",
        "law.csv": "diameter_m,number_per_m2\n0.1,1\n0.2,0.2\n0.5,0.01\n",
        "track.csv": "time_s,x_m,y_m,yaw_deg\n0,-0.5,0,0\n2,0,0.1,5\n4,0.5,0,0\n",
        "tum.txt": "0 -0.5 0 0 0 0 0 1\n2 0 0.1 0 0 0 0 1\n4 0.5 0 0 0 0 0 1\n",
    }
    poses = (f"{t} {0.1 * t} {0.01 * t * t} 0 0 0 0 1\n" for t in range(30))
    tables["estimate.txt"] = "".join(poses)
    study = {"shapes": {"one": {}, "two": {"rocks.library.shapes": 2}}, "seeds": 2}
    tables["study.yaml"] = json.dumps(
        {"recipe": "recipe.yaml", "study": study, "systems": ["imu"]}, indent=1
    )
    for name, text in tables.items():
        (folder / name).write_text(text)


def _meshes(folder: Path) -> None:
    import trimesh

    for kind in ("obj", "stl", "ply", "glb"):
        trimesh.creation.icosphere(subdivisions=1, radius=0.5).export(folder / f"rock.{kind}")
    wheel = trimesh.creation.cylinder(radius=0.16, height=0.08, sections=12)
    wheel.export(folder / "wheel.stl")


def _rovers(folder: Path) -> None:
    inertia = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    parts = [
        '<link name="base_link"><inertial><mass value="9"/>' + inertia + "</inertial><visual>"
        '<geometry><box size="0.4 0.3 0.1"/></geometry></visual><collision><geometry>'
        '<box size="0.4 0.3 0.1"/></geometry></collision></link>'
    ]
    bodies = []
    for n, (x, y) in enumerate(((0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2))):
        shape = '<geometry><mesh filename="wheel.stl"/></geometry>'
        parts.append(
            f'<link name="wheel_{n}"><inertial><mass value="1"/>{inertia}</inertial>'
            f'<visual><origin rpy="1.5708 0 0"/>{shape}</visual>'
            f'<collision><origin rpy="1.5708 0 0"/>{shape}</collision></link>'
            f'<joint name="wheel_{n}_joint" type="continuous"><parent link="base_link"/>'
            f'<child link="wheel_{n}"/><origin xyz="{x} {y} -0.05"/><axis xyz="0 1 0"/></joint>'
        )
        bodies.append(
            f'<body name="wheel_{n}" pos="{x} {y} -0.05"><joint name="wheel_{n}_joint" axis="0 1 0"'
            '/><geom type="cylinder" size="0.16 0.04" euler="90 0 0" mass="1"/></body>'
        )
    urdf = '<robot name="cart" {}>\n' + "\n".join(parts) + "\n</robot>\n"
    (folder / "rover.urdf").write_text(urdf.format(""))
    xacro = urdf.format('xmlns:xacro="http://www.ros.org/wiki/xacro"')
    xacro = xacro.replace('mass value="9"', 'mass value="${3*3}"')
    (folder / "rover.xacro").write_text(xacro)
    (folder / "rover.xml").write_text(
        '<mujoco model="cart"><worldbody><body name="base_link" pos="0 0 0.2"><freejoint/>'
        '<geom type="box" size="0.2 0.15 0.05" mass="9"/>' + "".join(bodies)
        + "</body></worldbody></mujoco>\n"
    )  # fmt: skip


def yaml_texts() -> list[str]:
    """The shipped recipes' text."""
    return [path.read_text(encoding="utf-8") for path in sorted(RECIPES.glob("*.yaml"))]


def write_recipe(recipe: Plain, folder: Path, name: str = "recipe.yaml") -> Path:
    """Write a recipe as JSON, which is YAML too."""
    path = folder / name
    path.write_text(json.dumps(recipe), encoding="utf-8")
    return path
