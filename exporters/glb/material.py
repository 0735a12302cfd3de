"""Materials: all of them matt, of one colour or with a texture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def matt(
    name: str,
    *,
    texture: int | None = None,
    rgb: Sequence[float] = (1.0, 1.0, 1.0),
    normals: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """A rough, non-metallic material.

    Args:
        name: Its name.
        texture: Index of its texture, whose colours `rgb` multiplies.
        rgb: Linear colour, 0 to 1.
        normals: Its normal map, as glTF describes one.
    """
    look: dict[str, Any] = {
        "baseColorFactor": [*rgb, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 1.0,
    }
    if texture is not None:
        look["baseColorTexture"] = {"index": texture}
    relief = {"normalTexture": normals} if normals else {}
    return {"name": name, "pbrMetallicRoughness": look, **relief}
