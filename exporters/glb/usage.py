"""How Blender and viewers open a GLB."""

from __future__ import annotations

from pathlib import Path
from shlex import quote

from terrain_forge.model import Opening

from .options import Options


def opening(folder: Path, options: Options) -> Opening:
    """The lines for a terminal."""
    del options
    load = f'import bpy; bpy.ops.import_scene.gltf(filepath="{folder.name}/world.glb")'
    return Opening(
        title="Blender, glTF",
        commands=f"blender --python-expr {quote(load)}   # or any viewer of glTF",
    )
