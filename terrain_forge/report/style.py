"""The pieces of HTML that the report page is made of; bundle/page.css is their look."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from html import escape
from importlib.resources import files
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ANIMATED = (".gif", ".webp")
"""File names of animated pictures end so."""
LARGEST_ANIMATION = 5_000_000
"""Bytes of an animated picture that the page takes in; a larger one stays beside it."""


@dataclass(frozen=True)
class Html:
    """Text that is HTML already; everything else is escaped."""

    text: str
    """The markup."""


Cell = str | Html


def html(cell: Cell) -> str:
    """Markup of a cell: escaped unless it is HTML."""
    return cell.text if isinstance(cell, Html) else escape(cell)


def join(parts: Sequence[Html]) -> Html:
    """Pieces one after another."""
    return Html("\n".join(part.text for part in parts if part.text))


def section(title: str, *parts: Html, anchor: str) -> Html:
    """A headed part of the page, which links to `anchor` lead to."""
    heading = f"<h2>{escape(title)}</h2>"
    return Html(f'<section id="{anchor}">{heading}\n{join(parts).text}\n</section>')


def paragraph(text: Cell, kind: str = "") -> Html:
    """A paragraph, with a CSS class or none."""
    return Html(f'<p class="{kind}">{html(text)}</p>' if kind else f"<p>{html(text)}</p>")


def facts(rows: Sequence[tuple[str, Cell]]) -> Html:
    """Names and what they are, in as many columns as fit."""
    items = (f"<div><dt>{escape(name)}</dt><dd>{html(value)}</dd></div>" for name, value in rows)
    return Html(f'<dl class="facts">{"".join(items)}</dl>')


def table(
    headings: Sequence[str], rows: Sequence[Sequence[Cell]], *, figures: str, kind: str = ""
) -> Html:
    """A table; `figures` has a letter per column: `l` for words, `r` for numbers."""
    kinds = ["num" if letter == "r" else "txt" for letter in figures]
    head = "".join(
        f'<th class="{kind}">{escape(heading)}</th>'
        for kind, heading in zip(kinds, headings, strict=True)
    )
    body = "".join(
        "<tr>"
        + "".join(f'<td class="{k}">{html(c)}</td>' for k, c in zip(kinds, row, strict=True))
        + "</tr>\n"
        for row in rows
    )
    whole = f"<table><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>"
    return Html(f'<div class="{f"wide {kind}".strip()}" tabindex="0">{whole}</div>')


def picture(image: bytes, *, media_type: str, description: str, caption: Cell = "") -> Html:
    """An image within the page."""
    shown = f'<img src="{source(image, media_type)}" alt="{escape(description)}">'
    return _figure(shown, caption)


def photograph(pixels: NDArray[np.uint8], description: str, caption: Cell = "") -> Html:
    """A picture as JPEG, a tenth of its PNG; pixels as sRGB, shape [height, width, 3]."""
    return picture(jpeg(pixels), media_type="image/jpeg", description=description, caption=caption)


def plot(path: Path, *, description: str, caption: Cell = "") -> Html:
    """A plot (PNG), which a phone scrolls rather than shrinks, or an animated picture (GIF, WebP).

    Who wants no motion sees the first of its pictures.
    """
    content, words = path.read_bytes(), escape(description)
    if path.suffix not in ANIMATED:
        shown = f'<img src="{source(content, "image/png")}" alt="{words}">'
        return _figure(f'<div class="plot" tabindex="0">{shown}</div>', caption)
    if len(content) > LARGEST_ANIMATION:
        return paragraph(f"{description}: {path.parent.name}/{path.name}, beside this page.")
    still = source(_first_picture(path), "image/jpeg")
    moving = source(content, f"image/{path.suffix[1:]}")
    shown = (
        f'<picture><source media="(prefers-reduced-motion: reduce)" srcset="{still}">'
        f'<img src="{moving}" alt="{words}"></picture>'
    )
    return _figure(shown, caption)


def _figure(shown: str, caption: Cell) -> Html:
    below = f"<figcaption>{html(caption)}</figcaption>" if caption else ""
    return Html(f"<figure>{shown}{below}</figure>")


def source(content: bytes, media_type: str) -> str:
    """A file as an address that holds all of it."""
    return f"data:{media_type};base64,{b64encode(content).decode()}"


def jpeg(pixels: NDArray[np.uint8], quality: int = 88) -> bytes:
    """An sRGB image, shape [height, width, 3], as JPEG."""
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def _first_picture(path: Path) -> bytes:
    from PIL import Image

    with Image.open(path) as animation:
        return jpeg(np.asarray(animation.convert("RGB")))


def thousands(number: int) -> str:
    """A whole number with narrow spaces between thousands."""
    return f"{number:,}".replace(",", "\u202f")


def signed(value: float | None) -> str:
    """A deviation with its sign, or a dash."""
    return "–" if value is None else f"{value:+.2f}".replace("-", "\u2212")


def command(lines: str) -> Html:
    """Lines to type into a shell."""
    return Html(f"<pre><code>{escape(lines)}</code></pre>")


def chip(text: str, kind: str) -> Html:
    """A coloured mark: `good`, `bad` or `open`."""
    return Html(f'<span class="chip {kind}">{escape(text)}</span>')


def bars(heights: Sequence[float], *, labels: Sequence[str], description: str) -> Html:
    """A histogram, scaled to its highest bar, with a label (or none) for each edge of a bar."""
    width, height, foot = 600, 170, 24
    step = width / len(heights)
    highest = max(heights) or 1.0
    shapes = [
        f'<rect x="{n * step + 1:.2f}" y="{height * (1 - value / highest):.2f}" '
        f'width="{step - 2:.2f}" height="{height * value / highest:.2f}"/>'
        for n, value in enumerate(heights)
    ]
    words = [
        f'<text x="{n * step:.2f}" y="{height + 18}" text-anchor="{_anchor(n, len(labels))}">'
        f"{escape(label)}</text>"
        for n, label in enumerate(labels)
        if label
    ]
    return Html(
        f'<svg class="bars" viewBox="0 0 {width} {height + foot}" role="img" '
        f'aria-label="{escape(description)}">{"".join(shapes)}'
        f'<line x1="0" y1="{height}" x2="{width}" y2="{height}"/>{"".join(words)}</svg>'
    )


def _anchor(place: int, places: int) -> str:
    return "start" if place == 0 else "end" if place == places - 1 else "middle"


def page(title: str, *, accent: str, body: Html, scripts: Sequence[str]) -> str:
    """The whole document; it needs nothing but itself.

    Its policy keeps a browser from loading anything else and from running any other script.

    Args:
        title: What a browser's tab says.
        accent: A colour of the page, as `#rrggbb`.
        body: What the page shows, the scripts among it.
        scripts: Those scripts, to the letter.
    """
    allowed = " ".join(f"'sha256-{_digest(script)}'" for script in scripts) or "'none'"
    policy = (
        f"default-src 'none'; img-src data: blob:; connect-src blob:; "
        f"style-src 'unsafe-inline'; script-src {allowed}"
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en" style="--ground: {accent}">\n<head>\n'
        '<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{escape(title)}</title>\n<style>{part('page.css')}</style>\n</head>\n"
        f"<body>\n{body.text}\n</body>\n</html>\n"
    )


def part(name: str) -> str:
    """A file of the page's bundle: its style, its script, the library that draws in 3-D."""
    return (files("terrain_forge.report") / "bundle" / name).read_text(encoding="utf-8")


def _digest(script: str) -> str:
    return b64encode(sha256(script.encode()).digest()).decode()
