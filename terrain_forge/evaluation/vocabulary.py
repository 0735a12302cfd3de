"""A vocabulary of ORB features as DBoW2 reads it: a tree of binary words, trained on our worlds.

ORB-SLAM's own has 139 MB and lies in no package registry. Words are trained on worlds that nobody
evaluates on, so that loops of the evaluated one are not known beforehand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    DataError,
    OutputError,
    Progress,
    Stopwatch,
    cache_folder,
    silent,
    write_whole,
)
from terrain_forge.evaluation.visual_odometry import opencv

Descriptors = NDArray[np.uint8]
_BRANCHES, _LEVELS = 10, 6
"""As ORB-SLAM's own."""
_ROUNDS = 11
_FEATURES = 1500
_RECIPES = "hello", "mars_ripples", "moon_mare"
_SEED = 20_260_101
"""Of the training worlds: no recipe of ours has it."""
_MAST, _PITCH, _FIELD = 0.9, 0.2, 1.4
_SIZE = 640, 360
_VIEWS = 10
"""Of each world."""
_WHAT = "a vocabulary"
_NAME = f"orb-vocabulary-{_SEED}.txt"


def vocabulary_file() -> Path:
    """Where the vocabulary is kept.

    Raises:
        OutputError: if there is no cache folder.
    """
    folder = cache_folder()
    if folder is None:
        raise OutputError("TERRAIN_FORGE_CACHE is off: the vocabulary needs a folder")
    return folder / "systems" / _NAME


def make_vocabulary(progress: Progress = silent) -> Path:
    """Train the vocabulary on pictures of our training worlds, unless it is there; its file.

    Raises:
        DataError: if OpenCV is missing.
        OutputError: if there is no cache folder.
    """
    path = vocabulary_file()
    if path.is_file():
        return path
    opencv(_WHAT)  # before worlds are made
    text = train_vocabulary([orb_descriptors(image) for image in _pictures(progress)])
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text)
    return path


def orb_descriptors(image: NDArray[np.uint8]) -> Descriptors:
    """ORB descriptors of a grey picture, shape [features, 32].

    Raises:
        DataError: if OpenCV is missing.
    """
    finder = opencv(_WHAT).ORB_create(nfeatures=_FEATURES, fastThreshold=10)
    _, found = finder.detectAndCompute(image, None)
    return np.zeros((0, 32), np.uint8) if found is None else np.asarray(found, np.uint8)


def _pictures(progress: Progress) -> Iterator[NDArray[np.uint8]]:
    """Grey pictures from a mast over the training worlds, the same ones each time."""
    from importlib.resources import files

    from terrain_forge.making import make_world, plan
    from terrain_forge.recipe import load_recipe
    from terrain_forge.scene import open_scene, pinhole_camera, take_picture

    folder = Path(str(files("terrain_forge.recipes")))
    places = np.random.default_rng(_SEED)
    for count, name in enumerate(_RECIPES):
        progress("training pictures", count / len(_RECIPES))
        recipe = load_recipe(folder / f"{name}.yaml", changes=(f"seed={_SEED}",)).recipe
        site = plan(recipe, folder=folder)
        world = make_world(site, site.window, settled=False, progress=Stopwatch(silent))
        west, south, east, north = world.ground.bounds
        with open_scene(world) as scene:
            for _ in range(_VIEWS):
                x, y, turn = places.uniform((0.2, 0.2, 0.0), (0.8, 0.8, 2.0 * math.pi)).tolist()
                x, y = west + x * (east - west), south + y * (north - south)
                foot = float(world.ground.height_at(x, y))
                camera = pinhole_camera(
                    position=np.array([x, y, foot + _MAST]), yaw=turn, pitch=_PITCH,
                    field_of_view=_FIELD, width=_SIZE[0], height=_SIZE[1],
                )  # fmt: skip
                colour = take_picture(scene, camera).astype(np.uint16)
                yield ((colour.sum(axis=2) + 1) // 3).astype(np.uint8)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Node:
    parent: int
    centre: NDArray[np.bool_]
    members: NDArray[np.intp]
    level: int


def train_vocabulary(
    images: Sequence[Descriptors], *, branches: int = _BRANCHES, levels: int = _LEVELS
) -> str:
    """A vocabulary of the descriptors of some images, as DBoW2's text; the same each time.

    Nodes are clusters under the Hamming distance whose centres are majorities of each bit
    (k-majority: Grana et al. 2013, Proc. SPIE 8667, 866709); a word weighs the logarithm of the
    images over those in which it is (Gálvez-López & Tardós 2012, doi:10.1109/TRO.2012.2197158).

    Args:
        images: Descriptors of each image, shape [features, 32].
        branches: Children of a node at most.
        levels: How deep the tree is at most.

    Raises:
        DataError: for fewer descriptors than branches.
    """
    whole = np.concatenate([np.zeros((0, 32), np.uint8), *images])
    if len(whole) < branches:
        raise DataError(f"a vocabulary of {len(whole)} descriptors: at least {branches} are needed")
    owner = np.repeat(np.arange(len(images)), [len(one) for one in images])
    bits = np.unpackbits(whole, axis=1).astype(bool)
    draw = np.random.default_rng(_SEED)
    nodes = [_Node(parent=-1, centre=bits[0], members=np.arange(len(bits)), level=0)]
    lines = [f"{branches} {levels} 0 0"]
    for number, node in enumerate(nodes):  # which grows: parents come before their children
        children = []
        if node.level < levels and (number == 0 or len(node.members) >= 2 * branches):
            children = _clusters(bits[node.members], branches, draw)
        for centre, rows in children:
            members = node.members[rows]
            nodes.append(_Node(parent=number, centre=centre, members=members, level=node.level + 1))
        if number:
            seen = len(np.unique(owner[node.members]))
            weight = 0.0 if children else math.log(len(images) / seen)
            word = " ".join(map(str, np.packbits(node.centre).tolist()))
            lines.append(f"{node.parent} {int(not children)} {word} {weight:.6g}")
    return "\n".join(lines)  # no newline at the end: DBoW2 would read one more node


def _clusters(
    bits: NDArray[np.bool_], count: int, draw: np.random.Generator
) -> list[tuple[NDArray[np.bool_], NDArray[np.intp]]]:
    """Centres and rows of clusters; none where all descriptors are alike."""
    centres = [bits[draw.integers(len(bits))]]
    nearest = _distances(bits, centres[0][None])[:, 0]
    while len(centres) < count and nearest.any():
        sums = np.cumsum(nearest * nearest)
        row = int(np.searchsorted(sums, draw.integers(sums[-1]), side="right"))
        centres.append(bits[row])
        nearest = np.minimum(nearest, _distances(bits, bits[row][None])[:, 0])
    if len(centres) < 2:
        return []
    middle = np.array(centres)
    label = np.argmin(_distances(bits, middle), axis=1)
    for _ in range(_ROUNDS):
        for one in range(len(middle)):
            if len(mine := bits[label == one]):
                middle[one] = 2 * mine.sum(axis=0) > len(mine)
        before, label = label, np.argmin(_distances(bits, middle), axis=1)
        if np.array_equal(before, label):
            break
    found = [(middle[one], np.flatnonzero(label == one)) for one in range(len(middle))]
    found = [(centre, rows) for centre, rows in found if len(rows)]
    return found if len(found) > 1 else []


def _distances(bits: NDArray[np.bool_], centres: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Hamming distances, shape [rows, centres]; whole numbers, which float32 holds exactly."""
    first, second = bits.astype(np.float32), centres.astype(np.float32)
    apart = first.sum(axis=1)[:, None] + second.sum(axis=1) - 2.0 * (first @ second.T)
    return np.asarray(apart, np.int64)
