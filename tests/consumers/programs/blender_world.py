"""What Blender makes of exported files: run by a Python with bpy, which need not have ours.

Reads an order as JSON from standard input: `files` to import one by one, `points` [[east, north]]
[m], and `folder`, into which each file's scene is exported again in its format, or null. Prints the
answers as JSON in the last line: per file the seconds of import and export, the number of meshes,
the names of the objects, how many of what is drawn, instances too, have no material, lowest and
highest corner of the whole [m], and the heights of the ground under the points [m].
"""

import json
import sys
import time
from pathlib import Path

import bpy
from mathutils import Vector

ABOVE = 1.0
AXES = {"forward_axis": "Y", "up_axis": "Z"}
IMPORT = {
    ".obj": lambda path: bpy.ops.wm.obj_import(filepath=path, **AXES),
    ".stl": lambda path: bpy.ops.wm.stl_import(filepath=path, **AXES),
    ".ply": lambda path: bpy.ops.wm.ply_import(filepath=path, **AXES),
    ".glb": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".usda": lambda path: bpy.ops.wm.usd_import(filepath=path),
}
EXPORT = {
    ".obj": lambda path: bpy.ops.wm.obj_export(filepath=path, **AXES),
    ".stl": lambda path: bpy.ops.wm.stl_export(filepath=path, **AXES),
    ".ply": lambda path: bpy.ops.wm.ply_export(filepath=path, **AXES),
    ".glb": lambda path: bpy.ops.export_scene.gltf(filepath=path, export_format="GLB"),
    ".usda": lambda path: bpy.ops.wm.usd_export(filepath=path.replace(".usda", ".usdc")),
}


def timed(task, path):
    """Seconds of a task."""
    since = time.perf_counter()
    task(str(path))
    return time.perf_counter() - since


def height(ground, sky, east, north):
    """Height of the highest of the ground's meshes at a place; None where there is none."""
    found = []
    for thing in ground:
        back = thing.matrix_world.inverted()
        start = back @ Vector((east, north, sky))
        down = back.to_3x3() @ Vector((0.0, 0.0, -1.0))
        hit, place, _, _ = thing.ray_cast(start, down)
        if hit:
            found.append((thing.matrix_world @ place).z)
    return max(found, default=None)


def is_ground(thing):
    """Whether an object, or what it hangs from, is named after the ground."""
    while thing is not None:
        if thing.name.lower().startswith(("ground", "world", "tile")) and thing.type == "MESH":
            return True
        if thing.name.lower().startswith("ground"):
            return True
        thing = thing.parent
    return False


def bare():
    """How many things that are drawn have no material."""
    drawn = bpy.context.evaluated_depsgraph_get().object_instances
    meshes = (one.object for one in drawn if one.object.type == "MESH" and one.show_self)
    return sum(not any(slot.material for slot in mesh.material_slots) for mesh in meshes)


def answer(path, points, folder):
    """What Blender makes of one file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    seconds = timed(IMPORT[path.suffix], path)
    bpy.context.view_layer.update()
    meshes = [thing for thing in bpy.data.objects if thing.type == "MESH"]
    ground = [thing for thing in meshes if is_ground(thing)]
    corners = [thing.matrix_world @ Vector(c) for thing in meshes for c in thing.bound_box]
    high = [max(corner[axis] for corner in corners) for axis in range(3)]
    again = None
    if folder:
        again = timed(EXPORT[path.suffix], Path(folder) / f"again{path.suffix}")
    return {
        "import": seconds,
        "export": again,
        "meshes": len(meshes),
        "bare": bare(),
        "names": [thing.name for thing in bpy.data.objects],
        "low": [min(corner[axis] for corner in corners) for axis in range(3)],
        "high": high,
        "heights": [height(ground, high[2] + ABOVE, *point) for point in points],
    }


def main():
    """Carry out the order."""
    order = json.load(sys.stdin)
    answers = [answer(Path(file), order["points"], order["folder"]) for file in order["files"]]
    print("\n" + json.dumps({"version": bpy.app.version_string, "answers": answers}))  # noqa: T201


main()
