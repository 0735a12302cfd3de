"""The look of the report page and the pieces of HTML that it is made of."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape


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


def section(title: str, *parts: Html) -> Html:
    """A headed part of the page."""
    return Html(f"<section><h2>{escape(title)}</h2>\n{join(parts).text}\n</section>")


def paragraph(text: Cell, kind: str = "") -> Html:
    """A paragraph, with a CSS class or none."""
    return Html(f'<p class="{kind}">{html(text)}</p>' if kind else f"<p>{html(text)}</p>")


def facts(rows: Sequence[tuple[str, Cell]]) -> Html:
    """Names and what they are, in as many columns as fit."""
    items = (f"<div><dt>{escape(name)}</dt><dd>{html(value)}</dd></div>" for name, value in rows)
    return Html(f'<dl class="facts">{"".join(items)}</dl>')


def table(headings: Sequence[str], rows: Sequence[Sequence[Cell]], *, figures: str) -> Html:
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
    return Html(f'<div class="wide">{whole}</div>')


def picture(image: bytes, *, media_type: str, description: str, caption: Cell = "") -> Html:
    """An image within the page."""
    source = f"data:{media_type};base64,{b64encode(image).decode()}"
    below = f"<figcaption>{html(caption)}</figcaption>" if caption else ""
    return Html(f'<figure><img src="{source}" alt="{escape(description)}">{below}</figure>')


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


def page(title: str, *, accent: str, body: Html) -> str:
    """The whole document; it needs nothing but itself."""
    style = STYLE.replace("ACCENT", accent)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{style}</style>\n</head>\n"
        f"<body>\n{body.text}\n</body>\n</html>\n"
    )


STYLE = """
:root { --ink: #26211d; --soft: #6d645b; --line: #e3dcd3; --paper: #fbf9f6; --card: #fff;
  --accent: ACCENT; --good: #2f7a3f; --bad: #b3261e; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); line-height: 1.5;
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
header, section, footer { max-width: 1080px; margin: 0 auto; padding: 0 20px; }
header { padding-top: 36px; }
h1 { margin: 0; font-size: 2.2rem; letter-spacing: -.02em; line-height: 1.15;
  overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 44px 0 14px; padding-bottom: 6px;
  border-bottom: 2px solid var(--accent); }
h3 { font-size: 1rem; margin: 22px 0 6px; }
p { margin: 8px 0; }
.lead { color: var(--soft); font-size: 1.05rem; margin: 8px 0 18px; }
.note { color: var(--soft); font-size: .9rem; }
figure { margin: 0 0 12px; }
img { display: block; width: 100%; height: auto; border-radius: 8px; }
figcaption { color: var(--soft); font-size: .88rem; margin-top: 6px; }
.pair { display: grid; gap: 28px; align-items: start;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 380px), 1fr)); }
.facts { display: grid; gap: 0 28px; margin: 0;
  grid-template-columns: repeat(auto-fill, minmax(min(100%, 300px), 1fr)); }
.facts div { display: flex; justify-content: space-between; gap: 14px; padding: 7px 0;
  border-bottom: 1px solid var(--line); }
dt { color: var(--soft); white-space: nowrap; }
dd { margin: 0; text-align: right; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; }
th { font-weight: 600; color: var(--soft); }
th, td { padding: 7px 10px 7px 0; border-bottom: 1px solid var(--line); vertical-align: baseline; }
.txt { text-align: left; }
.num { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.chip { display: inline-block; padding: 0 8px; border-radius: 99px; font-size: .82rem;
  font-weight: 600; white-space: nowrap; border: 1px solid currentColor; }
.good { color: var(--good); } .bad { color: var(--bad); } .open { color: var(--soft); }
pre { background: #2a2521; color: #f3ede5; padding: 12px 14px; border-radius: 8px; overflow-x: auto;
  font-size: .86rem; margin: 6px 0 14px; }
code { font-family: ui-monospace, SFMono-Regular, Menlo, Consolas, "DejaVu Sans Mono", monospace; }
.bars { display: block; width: 100%; height: auto; margin: 10px 0; }
.bars rect { fill: var(--accent); } .bars line { stroke: var(--soft); }
.bars text { fill: var(--soft); font-size: 14px; }
footer { color: var(--soft); font-size: .88rem; margin-top: 52px; padding-bottom: 40px; }
@media (max-width: 520px) { h1 { font-size: 1.7rem; } header { padding-top: 22px; } }
@media print { body { background: #fff; font-size: 11px; } section { break-inside: auto; }
  figure, tr, pre, .facts div { break-inside: avoid; } h2 { break-after: avoid; margin-top: 24px; }
  pre { background: #fff; color: #000; border: 1px solid #999; white-space: pre-wrap; } }
"""
