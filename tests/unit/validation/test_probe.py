"""What the answer of a consumer's probe is read as."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from terrain_forge.validation.probe import read_answer

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
PLACED = np.array([2.0, 3.0, 4.0])
PLACE = "1\t0\t0\t2\t0\t1\t0\t3\t0\t0\t1\t4"
ANSWER = f"""consumer\tNewton 1
mesh\t3\t1
mesh\t3\t1
shape\ttouched\trock_7\tcollision\t0\t{PLACE}
shape\tseen\trock_7\tvisual\t1\t{PLACE}
shape\tseen\trock_8\tvisual\t1\t{PLACE}
shape\ttouched\tworld\tground_0\t0\t{PLACE}
"""


def test_what_is_touched_and_what_is_seen_are_told_apart(tmp_path):
    binary = tmp_path / "meshes.bin"
    faces = np.array([[0, 1, 2]], np.int32).tobytes()
    binary.write_bytes(CORNERS.tobytes() + faces + (2.0 * CORNERS).tobytes() + faces)
    reading = read_answer(SimpleNamespace(rocks=(7,)), ANSWER, binary)
    assert reading.touched.rock == reading.seen.rock == [7]
    assert np.array_equal(reading.touched.vertices, CORNERS + PLACED)
    assert np.array_equal(reading.seen.vertices, 2.0 * CORNERS + PLACED)
    (ground,) = reading.ground
    assert np.array_equal(ground.vertices, CORNERS + PLACED)
