"""Materials for OBJ files: matt ones, of one colour or with a texture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class MattMaterial:
    """A matt material."""

    name: str
    """What `usemtl` calls it."""
    rgb: Sequence[float] = (1.0, 1.0, 1.0)
    """Colour as viewers show it (sRGB, 0 to 1), which multiplies the texture."""
    texture: str = ""
    """File of its texture beside the material file; empty for none."""


def write_mtl(path: Path, materials: Iterable[MattMaterial]) -> None:
    """Write a material file, which OBJ files name in an `mtllib` line."""
    path.write_text("\n".join(map(_text, materials)), encoding="utf-8", newline="\n")


def _text(material: MattMaterial) -> str:
    colour = " ".join(f"{channel:.6g}" for channel in material.rgb)
    texture = f"map_Kd {material.texture}\n" if material.texture else ""
    return f"newmtl {material.name}\nKa 0 0 0\nKd {colour}\nKs 0 0 0\nillum 1\n{texture}"
