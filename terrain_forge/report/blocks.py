"""The blocks that the page's sections are made of: values, each shown by templates/KIND.html."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

ANIMATED = (".gif", ".webp")
"""File names of animated pictures end so."""
LARGEST_ANIMATION = 5_000_000
"""Bytes of an animated picture that the page takes in; a larger one stays beside it."""


@dataclass(frozen=True)
class Cell:
    """A value with a mark or with a note below it."""

    text: str
    """The value."""
    chip: str = ""
    """Its coloured mark: `good`, `bad` or `open`; none where empty."""
    note: str = ""
    """What stands below it."""


Shown = str | Cell


class Block(SimpleNamespace):
    """A part of a section: what its template, templates/KIND.html, shows and escapes."""

    kind: str
    """Its template, which finds the values as `block`."""


def heading(text: str) -> Block:
    """A heading within a section."""
    return Block(kind="heading", text=text)


def paragraph(text: Shown, style: str = "") -> Block:
    """A paragraph, with a CSS class or none."""
    return Block(kind="paragraph", text=text, style=style)


def facts(rows: Sequence[tuple[str, Shown]]) -> Block:
    """Names and what they are, in as many columns as fit."""
    return Block(kind="facts", rows=rows)


def table(
    headings: Sequence[str],
    rows: Sequence[Sequence[Shown]],
    *,
    figures: str,
    style: str = "",
    folded: bool = False,
) -> Block:
    """A table; `figures` has a letter per column: `l` for words, `r` for numbers."""
    kinds = ["num" if letter == "r" else "txt" for letter in figures]
    return Block(
        kind="table", headings=headings, rows=rows, kinds=kinds, style=style, folded=folded
    )


def photograph(pixels: NDArray[np.uint8], description: str, caption: str = "") -> Block:
    """A picture as JPEG, a tenth of its PNG; pixels as sRGB, shape [height, width, 3]."""
    image = source(jpeg(pixels), "image/jpeg")
    return Block(
        kind="picture", source=image, still="", plot=False, description=description, caption=caption
    )


def plot(path: Path, *, description: str, caption: str = "") -> Block:
    """A plot (PNG), which a phone scrolls rather than shrinks, or an animated picture (GIF, WebP).

    Who wants no motion sees the first of its pictures.
    """
    content, still = path.read_bytes(), ""
    if path.suffix in ANIMATED:
        if len(content) > LARGEST_ANIMATION:
            return paragraph(f"{description}: {path.parent.name}/{path.name}, beside this page.")
        still = source(jpeg(read_picture(path)), "image/jpeg")
    image = source(content, f"image/{path.suffix[1:]}")
    return Block(
        kind="picture", source=image, still=still, plot=not still, description=description,
        caption=caption,
    )  # fmt: skip


def source(content: bytes, media_type: str) -> str:
    """A file as an address that holds all of it."""
    return f"data:{media_type};base64,{b64encode(content).decode()}"


def jpeg(pixels: NDArray[np.uint8], quality: int = 88) -> bytes:
    """An sRGB image, shape [height, width, 3], as JPEG."""
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def read_picture(path: Path) -> NDArray[np.uint8]:
    """The first picture of a file, sRGB, shape [height, width, 3]."""
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def thousands(number: int) -> str:
    """A whole number with narrow spaces between thousands."""
    return f"{number:,}".replace(",", "\u202f")


def signed(value: float | None) -> str:
    """A deviation with its sign, or a dash."""
    return "–" if value is None else f"{value:+.2f}".replace("-", "\u2212")
