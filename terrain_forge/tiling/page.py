"""The page of a site in tiles: what it is, how its rocks came out, a map to look around in."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import numpy as np

from terrain_forge import __version__
from terrain_forge.base import size_text
from terrain_forge.model import Trajectory
from terrain_forge.tiling.driving import checks_of_drive
from terrain_forge.tiling.order import TileOrder
from terrain_forge.tiling.picture import PICTURE, write_map

PAGE = "report.html"
_STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem;
color:#221e1a;background:#faf8f5}h1{margin-bottom:0}table{border-collapse:collapse}
td,th{padding:.2rem .8rem .2rem 0;text-align:left;border-bottom:1px solid #ddd5cb}
#map{position:relative;overflow:hidden;height:70vh;background:#2a2622;border-radius:6px;
touch-action:pan-x pan-y;cursor:grab}#closer{position:absolute;right:.5rem;top:.5rem;z-index:2}
#closer button{width:2.4rem;height:2.4rem;font-size:1.2rem;margin-left:.3rem}.wide{overflow-x:auto}
.panels{display:flex;flex-wrap:wrap}.panels img{flex:1 1 21rem;min-width:0;object-fit:cover;
object-position:0}.panels img+img{object-position:100%}
#plane{position:absolute;left:0;top:0;transform-origin:0 0}
#plane svg{position:absolute;left:0;top:0;z-index:1;pointer-events:none}
polyline{fill:none;stroke:#f2c230;stroke-width:var(--line)}
#plane img{position:absolute;display:block}#place{font-variant-numeric:tabular-nums}
figure{margin:1rem 0}figure img{max-width:100%}code{background:#efe9e1;padding:0 .2rem}
@media(prefers-color-scheme:dark){body{color:#eee7de;background:#1c1916}code{background:#332d27}
td,th{border-color:#443c34}}
"""
_FIGURE, _SHAPE = "truth/size_frequency.png", "660/576"
"""The plot of sizes, and the shape of each of its two panels."""
_QUOTED = re.compile("`([^`]*)`")
_POINTS = 4000
"""Points of a path on the map."""
_SCRIPT = """
const map=document.getElementById('map'),plane=document.getElementById('plane'),
told=document.getElementById('place'),d=map.dataset,cells=+d.cells,across=+d.across,up=+d.up,
columns=+d.columns,rows=+d.rows,spacing=+d.spacing,shown=new Map();
let scale=1,x=0,y=0,least=1;
const pad=n=>String(n).padStart(3,'0');
function fit(){least=Math.min(map.clientWidth/columns,map.clientHeight/rows);scale=least;
x=(map.clientWidth-columns*scale)/2;y=(map.clientHeight-rows*scale)/2;draw()}
function draw(){plane.style.transform=`translate(${x}px,${y}px) scale(${scale})`;
plane.style.setProperty('--line',3/scale);
const near=scale*cells>160,wanted=new Set();
if(near){const west=Math.max(Math.floor(-x/scale/cells),0),
east=Math.min(Math.floor((map.clientWidth-x)/scale/cells),across-1);
for(let c=west;c<=east;c++)for(let r=0;r<up;r++){
const top=rows-Math.min((r+1)*cells,rows),bottom=rows-r*cells;
if(top*scale+y>map.clientHeight||bottom*scale+y<0)continue;
const name=`${pad(r)}/${pad(c)}`;wanted.add(name);
if(!shown.has(name)){const i=new Image();i.src=`tiles/${name}/map.png`;i.alt='';
i.style.left=c*cells+'px';i.style.top=top+'px';i.width=Math.min(cells,columns-c*cells);
i.height=bottom-top;plane.append(i);shown.set(name,i)}}}
for(const [name,i] of shown)if(!wanted.has(name)){i.remove();shown.delete(name)}}
function closer(f,px,py){const s=Math.min(Math.max(scale*f,least/2),16);
x=px-(px-x)*s/scale;y=py-(py-y)*s/scale;scale=s;draw()}
for(const [name,f] of [['in',1.6],['out',1/1.6]])document.getElementById(name).addEventListener(
'click',()=>closer(f,map.clientWidth/2,map.clientHeight/2));
map.addEventListener('wheel',e=>{e.preventDefault();const b=map.getBoundingClientRect();
closer(Math.exp(-e.deltaY/400),e.clientX-b.left,e.clientY-b.top)},{passive:false});
let two=null;function pinched(e){if(e.touches.length!==2){two=null;return}e.preventDefault();
const b=map.getBoundingClientRect(),[p,q]=e.touches,px=(p.clientX+q.clientX)/2-b.left,
py=(p.clientY+q.clientY)/2-b.top,apart=Math.hypot(p.clientX-q.clientX,p.clientY-q.clientY);
if(two){x+=px-two[0];y+=py-two[1];closer(apart/two[2],px,py)}two=[px,py,apart]}
for(const name of ['touchstart','touchmove','touchend','touchcancel'])
map.addEventListener(name,pinched,{passive:false});
let held=null;map.addEventListener('pointerdown',e=>{
if(e.pointerType==='touch'||e.target.tagName==='BUTTON')return;held=[e.clientX-x,e.clientY-y];
map.setPointerCapture(e.pointerId)});
map.addEventListener('pointermove',e=>{const b=map.getBoundingClientRect(),
c=(e.clientX-b.left-x)/scale,r=rows-(e.clientY-b.top-y)/scale;
if(c>=0&&r>=0&&c<columns&&r<rows)told.textContent=
`${((c-columns/2)*spacing).toFixed(1)} m east, ${((r-rows/2)*spacing).toFixed(1)} m north, `+
`tiles/${pad(Math.floor(r/cells))}/${pad(Math.floor(c/cells))}`;
if(held){x=e.clientX-held[0];y=e.clientY-held[1];draw()}});
for(const name of ['pointerup','pointercancel'])map.addEventListener(name,()=>held=null);
let wide=0;function resized(){if(map.clientWidth!==wide){wide=map.clientWidth;fit()}}
addEventListener('resize',resized);resized();
"""


def write_page(
    order: TileOrder,
    verification: dict[str, Any],
    manifest: dict[str, Any],
    paths: Sequence[Trajectory] = (),
) -> None:
    """Write map.png and report.html; the page loads pictures of tiles as one looks closer."""
    write_map(order.grid, order.out)
    title = escape(order.site.name)
    digest = base64.b64encode(hashlib.sha256(_SCRIPT.encode()).digest()).decode()
    policy = (
        "default-src 'none'; img-src 'self' file: data:; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{digest}'"
    )
    body = (
        f"<h1>{title}</h1><p>{_lead(order, manifest)}</p>"
        f"{_map(order, paths)}{_paths(order, paths)}{_rocks(verification)}{_exports(manifest)}"
        f"<footer><p>World frame: x east, y north, z up, in metres. Made by terrain-forge "
        f"{__version__}.</p></footer>"
    )
    page = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>{title}</title><style>{_STYLE}</style></head><body>{body}"
        f"<script>{_SCRIPT}</script></body></html>\n"
    )
    (order.out / PAGE).write_text(page, encoding="utf-8", newline="\n")


def _lead(order: TileOrder, manifest: dict[str, Any]) -> str:
    site, grid = order.site, order.grid
    return (
        f"{escape(site.body.name)}, {site.size[0]:g} × {site.size[1]:g} m at {site.spacing:g} m: "
        f"{len(grid):,} tiles of {grid.cells * site.spacing:g} m ({grid.across} × {grid.up}), "
        f"{manifest['tiles']['rocks']:,} rocks, seed {site.seed}."
    )


def _map(order: TileOrder, paths: Sequence[Trajectory]) -> str:
    grid = order.grid
    data = {
        "cells": grid.cells, "across": grid.across, "up": grid.up, "columns": grid.columns,
        "rows": grid.rows, "spacing": order.site.spacing,
    }  # fmt: skip
    told = " ".join(f'data-{name}="{value!r}"' for name, value in data.items())
    return (
        f'<h2>Map</h2><div id="map" role="group" aria-label="Map of the site from above" {told}>'
        f'<div id="plane"><img src="{PICTURE}" alt="" width="{grid.columns}" '
        f'height="{grid.rows}">{_lines(order, paths)}</div><div id="closer">'
        '<button id="out" aria-label="Farther">−</button>'
        '<button id="in" aria-label="Closer">+</button></div></div>'
        '<p id="place">Turn the wheel to look closer, drag to move; on a touch screen both with '
        "two fingers.</p>"
    )


def _lines(order: TileOrder, paths: Sequence[Trajectory]) -> str:
    """The paths over the map, in cells."""
    if not paths:
        return ""
    site, grid = order.site, order.grid
    drawn = ""
    for path in paths:
        chosen = np.linspace(0, len(path.time) - 1, min(len(path.time), _POINTS)).astype(np.int64)
        places = (path.position[chosen, :2] - (site.west, site.south)) / site.spacing
        points = " ".join(f"{column:.1f},{grid.rows - row:.1f}" for column, row in places.tolist())
        drawn += f'<polyline points="{points}"><title>{escape(path.name)}</title></polyline>'
    return f'<svg width="{grid.columns}" height="{grid.rows}">{drawn}</svg>'


def _paths(order: TileOrder, paths: Sequence[Trajectory]) -> str:
    if not paths:
        return ""
    rows = [(path.name, f"{path.length:,.1f} m", f"{path.time[-1]:,.0f} s") for path in paths]
    told = f"<h2>Paths</h2>{_table(('path', 'length', 'takes'), rows)}"
    checks = [
        (
            check.name,
            "–" if check.figure is None else f"{check.figure:.4g} {check.unit}",
            "–" if check.limit is None else f"{check.limit:.4g}",
            "passed" if check.passed else "failed",
            check.note,
        )
        for check in checks_of_drive(order)
    ]
    head = ("check", "found", "limit", "", "")
    return told + (f"<h2>Drive</h2>{_table(head, checks)}" if checks else "")


def _rocks(verification: dict[str, Any]) -> str:
    if not verification["populations"]:
        return ""
    head = ("population", "rocks", "expected", "z", "cover", "expected", "K-S distance", "p")
    rows = []
    for part in verification["populations"]:
        count, cover, test = part["count"], part["cover"], part["kolmogorov_smirnov"]
        rows.append((
            part["name"], f"{count['observed']:,}", f"{count['expected']:,.0f}", _z(count["z"]),
            f"{cover['observed']:.3%}", f"{cover['expected']:.3%}",
            f"{test['distance']:.2g}" if test else "–", f"{test['p_value']:.2g}" if test else "–",
        ))  # fmt: skip
    return (
        f"<h2>Rocks</h2>{_table(head, rows)}<p>Overlapping pairs: "
        f"{verification['overlaps']['pairs']}. Sizes are counted in classes, so the distance is "
        'that at their ends.</p><figure class="panels">'
        f'<img src="{_FIGURE}" style="aspect-ratio:{_SHAPE}" '
        'alt="Number and cover of rocks over diameter, against the law">'
        f'<img src="{_FIGURE}" style="aspect-ratio:{_SHAPE}" alt=""></figure>'
    )


def _z(value: float | None) -> str:
    return "–" if value is None else f"{value:+.2f}"


def _exports(manifest: dict[str, Any]) -> str:
    told = ""
    for folder, export in manifest["exports"].items():
        told_apart = (_QUOTED.sub(r"<code>\1</code>", escape(one)) for one in export["losses"])
        lost = "".join(f"<li>{sentence}</li>" for sentence in told_apart)
        told += f"<h3>{escape(folder)}</h3><ul>{lost}</ul>"
    size = size_text(manifest["tiles"]["bytes"])
    return (
        f"<h2>Files</h2><p>The tiles have {size}. A part of the site becomes a world of its own, "
        "in any format, by <code>terrain-forge cut</code>.</p>" + told
    )


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    cells = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows
    )
    return f'<div class="wide"><table><tr>{cells}</tr>{body}</table></div>'
