"""The vocabulary of ORB features: DBoW2's text, a tree in which alike features are one word."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from terrain_forge.base import DataError, OutputError
from terrain_forge.evaluation.vocabulary import make_vocabulary, orb_descriptors, train_vocabulary


def _alike(rng, centre, count, flips):
    """Descriptors that differ from a centre in some bits."""
    bits = np.repeat(np.unpackbits(centre)[None], count, axis=0)
    for row in bits:
        row[rng.choice(256, flips, replace=False)] ^= 1
    return np.packbits(bits, axis=1)


def _read(text):
    """Nodes as DBoW2 reads them: parent, whether it is a word, its bits, its weight."""
    head, *rows = text.split("\n")
    nodes = [row.split() for row in rows]
    parsed = [
        (int(n[0]), n[1] == "1", np.unpackbits(np.array(n[2:34], np.uint8)), float(n[34]))
        for n in nodes
    ]
    assert all(len(node) == 35 for node in nodes)
    return [int(word) for word in head.split()], parsed


def _word(nodes, bits):
    """The word of a descriptor: down the tree, always to the nearest child."""
    number = 0
    while children := [n for n, node in enumerate(nodes, 1) if node[0] == number]:
        number = min(children, key=lambda n: int((nodes[n - 1][2] != bits).sum()))
    return number


def test_alike_features_are_one_word_which_weighs_by_its_images():
    rng = np.random.default_rng(1)
    centres = rng.integers(0, 256, (5, 32), np.uint8)
    images = [
        np.concatenate([_alike(rng, centre, 4, 6) for centre in centres[: 2 + number]])
        for number in range(4)
    ]
    text = train_vocabulary(images, branches=5, levels=1)
    assert text == train_vocabulary(images, branches=5, levels=1)
    head, nodes = _read(text)
    assert head == [5, 1, 0, 0]
    found = {_word(nodes, np.unpackbits(centre)) for centre in centres}
    assert found == {1, 2, 3, 4, 5}
    for number, centre in enumerate(centres):
        _, word, bits, weight = nodes[_word(nodes, np.unpackbits(centre)) - 1]
        assert word
        assert (bits != np.unpackbits(centre)).sum() <= 3  # the majority, not one of them
        seen = 4 - max(0, number - 1)
        assert weight == pytest.approx(math.log(4 / seen), abs=1e-5)


def test_it_is_a_tree_whose_parents_come_first():
    rng = np.random.default_rng(2)
    images = [rng.integers(0, 256, (200, 32), np.uint8) for _ in range(3)]
    head, nodes = _read(train_vocabulary(images, branches=4, levels=3))
    assert head[:2] == [4, 3]
    children = [sum(node[0] == n for node in nodes) for n in range(len(nodes) + 1)]
    for number, (parent, word, _, _) in enumerate(nodes, 1):
        assert parent < number
        assert word == (children[number] == 0)
    assert max(children) <= 4
    assert sum(node[1] for node in nodes) > 30


def test_features_that_are_all_alike_or_too_few():
    same = np.full((50, 32), 7, np.uint8)
    assert train_vocabulary([same], branches=4) == "4 6 0 0"
    with pytest.raises(DataError, match="of 3 descriptors: at least 10"):
        train_vocabulary([same[:3]])


def test_without_opencv_no_world_is_made_in_vain(monkeypatch, tmp_path):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(DataError, match=r"pip install 'terrain-forge\[slam\]'"):
        make_vocabulary(progress=pytest.fail)  # which is told of each world
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", "off")
    with pytest.raises(OutputError, match="TERRAIN_FORGE_CACHE is off"):
        make_vocabulary()


@pytest.mark.slow
def test_it_is_trained_on_worlds_of_ours_once(monkeypatch, tmp_path):
    pytest.importorskip("cv2", reason="OpenCV is not installed")
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    path = make_vocabulary()
    head, nodes = _read(path.read_text())
    assert head == [10, 6, 0, 0]
    assert len(nodes) > 5000
    path.write_text("kept")
    assert make_vocabulary().read_text() == "kept"


def test_descriptors_of_a_picture():
    pytest.importorskip("cv2", reason="OpenCV is not installed")
    noise = np.random.default_rng(0).integers(0, 256, (120, 160), np.uint8)
    found = orb_descriptors(noise)
    assert found.shape[1] == 32
    assert len(found) > 50
    assert orb_descriptors(np.zeros((120, 160), np.uint8)).shape == (0, 32)
