// LibVISO2's stereo odometry over a sequence of KITTI: PROGRAM SEQUENCE POSES. A pose that repeats
// the one before is of a frame in which it was lost. Compiled with that library's sources.

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <png++/png.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include <viso_stereo.h>

using Pixels = std::vector<uint8_t>;

// Grey values of a picture, row by row; dims: width, height, bytes of a row.
static Pixels picture(const std::string& file, int32_t* dims) {
  png::image<png::gray_pixel> image(file);
  dims[0] = dims[2] = image.get_width();
  dims[1] = image.get_height();
  Pixels pixels;
  for (int32_t v = 0; v < dims[1]; v++)
    for (int32_t u = 0; u < dims[0]; u++) pixels.push_back(image.get_pixel(u, v));
  return pixels;
}

// Focal length and centre [pixels] and base [m] of calib.txt.
static VisualOdometryStereo::parameters calibration(const std::string& file) {
  std::ifstream lines(file);
  std::string name;
  double p[2][12];
  for (auto& row : p) {
    lines >> name;
    for (double& value : row) lines >> value;
  }
  if (!lines) throw std::runtime_error(file + ": no P0 and P1");
  if (std::abs(p[0][0] - p[0][5]) > 1e-6 * p[0][0])
    throw std::runtime_error(file + ": LibVISO2 knows one focal length, not one across and one down");
  VisualOdometryStereo::parameters parameters;
  parameters.calib.f = p[0][0];
  parameters.calib.cu = p[0][2];
  parameters.calib.cv = p[0][6];
  parameters.base = -p[1][3] / p[1][0];
  return parameters;
}

static void run(const std::string& sequence, const char* target) {
  VisualOdometryStereo odometry(calibration(sequence + "/calib.txt"));
  std::ifstream times(sequence + "/times.txt");
  std::ofstream poses(target);
  poses.precision(9);
  Matrix pose = Matrix::eye(4);
  double time;
  for (int number = 0; times >> time; number++) {
    char file[32];
    std::snprintf(file, sizeof file, "%06d.png", number);
    int32_t dims[3];
    Pixels left = picture(sequence + "/image_0/" + file, dims);
    Pixels right = picture(sequence + "/image_1/" + file, dims);
    if (odometry.process(left.data(), right.data(), dims))
      pose = pose * Matrix::inv(odometry.getMotion());
    else if (number)
      std::cout << "lost in frame " << number << "\n";
    for (int n = 0; n < 12; n++) poses << pose.val[n / 4][n % 4] << (n < 11 ? ' ' : '\n');
  }
  if (!poses.flush()) throw std::runtime_error(std::string(target) + " cannot be written");
}

int main(int argc, char** argv) {
  try {
    if (argc != 3) throw std::runtime_error("needs SEQUENCE POSES");
    run(argv[1], argv[2]);
  } catch (const std::exception& error) {
    std::cerr << argv[0] << ": " << error.what() << "\n";
    return 1;
  }
  return 0;
}
