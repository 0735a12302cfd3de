"""The blocks that the page's sections are made of: values, each shown by templates/KIND.html."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import read_bytes

ANIMATED = (".gif", ".webp")
"""File names of animated pictures end so."""
LARGEST_ANIMATION = 5_000_000
"""Bytes of an animated picture that the page takes in; a larger one stays beside it."""
_STRIP, _NARROWEST = 0.015, 0.2
"""Width of the blank strip between the panels of a plot, and of a panel, in widths of the plot."""


@dataclass(frozen=True)
class Cell:
    """A label, whose terms the page explains, or a value with a coloured mark."""

    text: str
    """The label or value."""
    chip: str = ""
    """Its coloured mark: `good`, `bad` or `open`; none where empty."""
    note: str = ""
    """What stands below it."""


Shown = str | Cell


class Key(NamedTuple):
    """A colour of a picture's legend."""

    name: str
    """What it stands for."""
    colour: str
    """As `#rrggbb`, sRGB."""


class Block(SimpleNamespace):
    """A part of a section: what its template, templates/KIND.html, shows and escapes."""

    kind: str
    """Its template, which finds the values as `block`."""


def heading(text: str) -> Block:
    """A heading within a section.

    Raises:
        TypeError: if it is no text.
    """
    return Block(kind="heading", text=_text(text))


def paragraph(text: Shown, style: str = "") -> Block:
    """A paragraph, with a CSS class or none.

    Raises:
        TypeError: if it is neither text nor Cell.
    """
    return Block(kind="paragraph", text=_cell(text), style=style)


def facts(rows: Sequence[tuple[str, Shown]]) -> Block:
    """Names and what they are, in as many columns as fit.

    Raises:
        TypeError: for a row that is no such pair.
    """
    if odd := [row for row in rows if not isinstance(row, list | tuple) or len(row) != 2]:
        raise TypeError(f"a row of facts must be a name and what it is, found {odd[0]!r:.60}")
    return Block(kind="facts", rows=[(_text(name), _cell(value)) for name, value in rows])


def table(
    headings: Sequence[str],
    rows: Sequence[Sequence[Shown]],
    *,
    figures: str,
    style: str = "",
    folded: bool = False,
) -> Block:
    """A table; `figures` has a letter per column: `l` for words, `r` for numbers.

    Raises:
        TypeError: if what is to stand in a cell is neither text nor Cell.
        ValueError: if a row has not as many cells as there are letters.
    """
    kinds = ["num" if letter == "r" else "txt" for letter in figures]
    headings, rows = [*map(_text, headings)], [[*map(_cell, row)] for row in rows]
    if odd := [row for row in (headings, *rows) if len(row) != len(kinds)]:
        raise ValueError(f"a row of a table must have {len(kinds)} cells, found {odd[0]!r:.60}")
    return Block(
        kind="table", headings=headings, rows=rows, kinds=kinds, style=style, folded=folded
    )


def _text(found: object) -> str:
    if not isinstance(found, str):
        raise TypeError(f"must be text, found {found!r:.40}")
    return found


def _cell(found: object) -> Shown:
    if not isinstance(found, str | Cell):
        raise TypeError(f"must be text or a Cell, found {found!r:.40}")
    return found


def photograph(pixels: NDArray[np.uint8], description: str, caption: str = "") -> Block:
    """A picture as JPEG, a tenth of its PNG; pixels as sRGB, shape [height, width, 3]."""
    images = [(source(jpeg(pixels), "image/jpeg"), pixels.shape[1])]
    return _picture(images, description=description, caption=caption)


def plot(path: Path, *, description: str, caption: str = "") -> Block:
    """A plot (PNG), whose panels stand below each other on a phone, or an animated picture.

    Who wants no motion sees the first picture of an animated one (GIF, WebP).
    """
    content = read_bytes(path, f"{path.parent.name}/{path.name}")
    if path.suffix not in ANIMATED:
        return drawing(content, description=description, caption=caption)
    if len(content) > LARGEST_ANIMATION:
        return paragraph(f"{description}: {path.parent.name}/{path.name}, beside this page.")
    form, still = path.suffix[1:], read_picture(content)
    return animation(content, form, still, description=description, caption=caption)


def drawing(content: bytes, *, description: str, caption: str = "") -> Block:
    """A plot as PNG, whose panels stand below each other on a phone."""
    parts = panels(read_picture(content))
    images = [(source(_encoded(part, "PNG"), "image/png"), part.shape[1]) for part in parts]
    return _picture(images, description=description, caption=caption)


def animation(
    content: bytes,
    form: str,
    still: NDArray[np.uint8],
    *,
    description: str,
    caption: str = "",
    keys: Sequence[Key] = (),
) -> Block:
    """An animated picture (gif, webp); who wants no motion sees a still one."""
    return _picture(
        [(source(content, f"image/{form}"), 0)],
        description=description,
        caption=caption,
        still=source(jpeg(still), "image/jpeg"),
        keys=keys,
    )


def _picture(
    sources: list[tuple[str, int]],
    *,
    description: str,
    caption: str,
    still: str = "",
    keys: Sequence[Key] = (),
) -> Block:
    return Block(
        kind="picture", sources=sources, still=still, description=description, caption=caption,
        keys=keys,
    )  # fmt: skip


def panels(pixels: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """The parts of a plot that stand side by side: cut where a broad blank strip parts them."""
    width = pixels.shape[1]
    blank = np.all(pixels == pixels[:1, :1], axis=(0, 2))
    # The columns where blank strips begin and end, but for the margins.
    turns = np.flatnonzero(np.diff(np.pad(blank, 1).astype(np.int8))).reshape(-1, 2)
    inner = turns[(turns[:, 0] > 0) & (turns[:, 1] < width)]
    broad = inner[np.diff(inner)[:, 0] > _STRIP * width]
    cuts = [0]
    for cut in broad.mean(axis=1).astype(int).tolist():
        if min(cut - cuts[-1], width - cut) > _NARROWEST * width:
            cuts.append(cut)
    return np.split(pixels, cuts[1:], axis=1)


def source(content: bytes, media_type: str) -> str:
    """A file as an address that holds all of it."""
    return f"data:{media_type};base64,{b64encode(content).decode()}"


def jpeg(pixels: NDArray[np.uint8], quality: int = 88) -> bytes:
    """An sRGB image, shape [height, width, 3], as JPEG."""
    return _encoded(pixels, "JPEG", quality=quality)


def _encoded(pixels: NDArray[np.uint8], form: str, **options: int) -> bytes:
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(pixels).save(buffer, form, **options)
    return buffer.getvalue()


def read_picture(content: bytes) -> NDArray[np.uint8]:
    """The first picture of a file's bytes, sRGB, shape [height, width, 3]."""
    from PIL import Image

    with Image.open(BytesIO(content)) as image:
        return np.asarray(image.convert("RGB"))


def thousands(number: int) -> str:
    """A whole number with narrow spaces between thousands."""
    return f"{number:,}".replace(",", "\u202f")


def signed(value: float | None) -> str:
    """A deviation with its sign, or a dash."""
    return "–" if value is None else f"{value:+.2f}".replace("-", "\u2212")
