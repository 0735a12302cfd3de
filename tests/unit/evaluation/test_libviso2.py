"""The program for LibVISO2, compiled with headers that only look like its and those of png++."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest

from terrain_forge.evaluation import evaluate_recording
from terrain_forge.evaluation.catalogue import DRIVERS, with_binaries

_LIBRARY = """
#include <cstdint>
#include <fstream>
struct Matrix {
  double val[4][4] = {};
  static Matrix eye(int) { Matrix m; for (int n = 0; n < 4; n++) m.val[n][n] = 1; return m; }
  static Matrix inv(Matrix m) { for (int n = 0; n < 3; n++) m.val[n][3] *= -1; return m; }
  Matrix operator*(const Matrix& other) const {
    Matrix m = *this;
    for (int n = 0; n < 3; n++) m.val[n][3] += other.val[n][3];
    return m;
  }
};
struct VisualOdometryStereo {
  struct parameters { struct { double f, cu, cv; } calib; double base; };
  int frame = -1;
  VisualOdometryStereo(parameters p) {
    std::ofstream told("told.txt");
    told << p.calib.f << " " << p.calib.cu << " " << p.calib.cv << " " << p.base;
  }
  // a metre ahead a frame; it has nothing to go by in the first, and is lost in the third
  bool process(uint8_t* left, uint8_t* right, int32_t* dims) {
    std::ofstream("seen.txt", std::ios::app) << int(left[dims[0] * dims[1] - 1]) << " "
      << int(right[0]) << " " << dims[0] << " " << dims[1] << " " << dims[2] << "\\n";
    return ++frame != 0 && frame != 2;
  }
  Matrix getMotion() { Matrix m = Matrix::eye(4); m.val[2][3] = -1; return m; }
};
"""
"""Motions without a turn alone, by LibVISO2's own names."""
_PICTURES = """
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>
namespace png {
using gray_pixel = unsigned char;
template <class Pixel> struct image {
  std::vector<Pixel> values;
  image(const std::string& file) {
    std::ifstream bytes(file, std::ios::binary);
    if (!bytes) throw std::runtime_error(file);
    for (int n = 0; n < 6; n++) values.push_back(bytes.get());
  }
  int get_width() const { return 3; }
  int get_height() const { return 2; }
  Pixel get_pixel(int u, int v) const { return values[v * 3 + u]; }
};
}
"""
"""All pictures are of 3 by 2 pixels, the first bytes of their files."""


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The program, with the headers in the place of the libraries'."""
    if not shutil.which("g++"):
        pytest.skip("g++ is not installed")
    place = tmp_path_factory.mktemp("viso")
    (place / "png++").mkdir()
    (place / "viso_stereo.h").write_text(_LIBRARY)
    (place / "png++" / "png.hpp").write_text(_PICTURES)
    built = place / "program"
    source = DRIVERS / "libviso2.cc"
    command = ["g++", "-std=c++14", "-Wall", "-Werror", f"-I{place}", source, "-o", built]
    subprocess.run(command, check=True, timeout=120)
    return built


def _sequence(place, focal=(700.0, 700.0)):
    place.mkdir()
    rows = [f"P{n}: {focal[0]} 0 320 {-84.0 * n} 0 {focal[1]} 240 0 0 0 1 0" for n in (0, 1)]
    (place / "calib.txt").write_text("\n".join(rows) + "\n")
    (place / "times.txt").write_text("".join(f"{n / 10:.9f}\n" for n in range(5)))
    for camera in (0, 1):
        (place / f"image_{camera}").mkdir()
        for number in range(5):
            first = 10 * camera + number
            picture = place / f"image_{camera}" / f"{number:06d}.png"
            picture.write_bytes(bytes(range(first, first + 6)))
    return place


def test_it_reads_a_sequence_and_writes_a_pose_for_each_frame(program, tmp_path):
    sequence = _sequence(tmp_path / "00")
    done = subprocess.run([program, sequence, tmp_path / "poses.txt"], cwd=tmp_path, timeout=60,
                          capture_output=True, text=True, check=True)  # fmt: skip
    poses = np.loadtxt(tmp_path / "poses.txt").reshape(-1, 3, 4)
    np.testing.assert_allclose(poses[:, :, :3], np.broadcast_to(np.eye(3), (5, 3, 3)))
    np.testing.assert_allclose(poses[:, 2, 3], [0, 1, 1, 2, 3])
    assert done.stdout == "lost in frame 2\n"
    assert (tmp_path / "told.txt").read_text() == "700 320 240 0.12"
    seen = np.loadtxt(tmp_path / "seen.txt")
    np.testing.assert_array_equal(seen, [[5 + n, 10 + n, 3, 2, 3] for n in range(5)])


@pytest.mark.parametrize(
    ("focal", "missing", "why"),
    [
        ((700.0, 650.0), "", "one focal length"),
        ((700.0, 700.0), "calib.txt", "no P0 and P1"),
        ((700.0, 700.0), "image_1/000003.png", "000003.png"),
    ],
)
def test_what_it_cannot_do_is_told(program, tmp_path, focal, missing, why):
    sequence = _sequence(tmp_path / "00", focal)
    if missing:
        (sequence / missing).unlink()
    done = subprocess.run([program, sequence, tmp_path / "poses.txt"], cwd=tmp_path, timeout=60,
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 1
    assert why in done.stderr


def test_frames_in_which_it_is_lost_are_not_tracked(program, dataset):
    (result,) = evaluate_recording(dataset, with_binaries([], [f"libviso2={program}"]))
    assert result.run.status == "done", result.run.log
    assert len(result.run.estimate.time) == 5
    assert result.score.poses == 4
