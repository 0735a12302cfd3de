"""Draws docs/images/house.svg: the rooms of the code, their order, and who imports whom.

    python docs/make_house.py

Arrows that others imply are left out; imports for type checkers alone do not count.
"""

from __future__ import annotations

import ast
import textwrap
from pathlib import Path

import matplotlib as mpl
from matplotlib import pyplot as plt

ROOT = Path(__file__).parents[1]
FLOORS = (
    ("cli",),
    ("commands",),
    ("studies",),
    ("pipeline",),
    ("report", "terminal"),
    ("learning",),
    ("recording", "evaluation", "tiling", "variation", "illumination"),
    ("building", "exporters"),
    ("validation", "datasets"),
    ("driving", "sensors"),
    ("making",),
    ("recipe", "truth"),
    ("paths",),
    ("rocks", "geometry"),
    ("terrain", "scene"),
    ("dtm", "rovers", "writers", "sky"),
    ("model",),
    ("base",),
)
"""From the roof down: a room imports only from rooms below it."""


def rooms() -> dict[str, list[Path]]:
    """Files of each room that there is."""
    package = ROOT / "terrain_forge"
    found = {
        name: sorted((ROOT / name if name == "exporters" else package / name).rglob("*.py"))
        for floor in FLOORS
        for name in floor
    }
    found["cli"], found["pipeline"] = [package / "cli.py"], [package / "pipeline.py"]
    return {name: files for name, files in found.items() if files}


def arrows(files: dict[str, list[Path]]) -> set[tuple[str, str]]:
    """Pairs of rooms of which the first imports from the second at run time."""
    found = set()
    for room, paths in files.items():
        for path in paths:
            for name in _imports(ast.parse(path.read_text(encoding="utf-8"))):
                target = name.split(".")[1]
                if target in files and target != room:
                    found.add((room, target))
    return found


def _imports(tree: ast.AST) -> list[str]:
    if isinstance(tree, ast.If) and ast.unparse(tree.test) == "TYPE_CHECKING":
        return []
    if isinstance(tree, ast.ImportFrom) and tree.level == 0:
        package = tree.module or ""
        names = [f"{package}.{alias.name}" for alias in tree.names]
        return [name for name in names if name.startswith("terrain_forge.")]
    return [name for child in ast.iter_child_nodes(tree) for name in _imports(child)]


def needed(found: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """The arrows that no longer way implies."""
    below: dict[str, set[str]] = {}

    def reach(room: str) -> set[str]:
        if room not in below:
            direct = {target for source, target in found if source == room}
            below[room] = direct.union(*(reach(target) for target in direct))
        return below[room]

    return {
        (a, b)
        for a, b in found
        if not any(b in reach(c) for source, c in found if source == a and c != b)
    }


def _docstring(files: list[Path]) -> str:
    named = next((f for f in files if f.name == "__init__.py"), files[0])
    text = ast.get_docstring(ast.parse(named.read_text(encoding="utf-8"))) or ""
    return textwrap.fill(text.split("\n")[0].rstrip("."), 52)


def main() -> None:
    """Draw the house."""
    files = rooms()
    order = {name: level for level, floor in enumerate(FLOORS) for name in floor}
    down = {(a, b) for a, b in arrows(files) if order[a] < order[b]}
    mpl.rcParams["svg.hashsalt"] = "house"
    figure, axes = plt.subplots(figsize=(10, 11))
    place = {}
    for level, floor in enumerate(FLOORS):
        there = [name for name in floor if name in files]
        for n, name in enumerate(there):
            place[name] = ((n + 0.5) / len(there), -level)
    for a, b in sorted(needed(down)):
        (xa, ya), (xb, yb) = place[a], place[b]
        axes.annotate("", (xb, yb + 0.3), (xa, ya - 0.3),
                      arrowprops={"arrowstyle": "-|>", "color": "#8a97a8", "lw": 1.1})  # fmt: skip
    for name, (x, y) in place.items():
        box = {"boxstyle": "round,pad=0.6", "fc": "#eaf0f8", "ec": "#43546b"}
        text = f"$\\bf{{{name}}}$\n{_docstring(files[name])}"
        axes.text(x, y, text, ha="center", va="center", fontsize=7, bbox=box)
    axes.set(xlim=(0, 1), ylim=(-len(FLOORS) + 0.4, 0.6))
    axes.axis("off")
    figure.savefig(ROOT / "docs/images/house.svg", metadata={"Date": None}, bbox_inches="tight")


if __name__ == "__main__":
    main()
