// Interpolates an actor's waypoints as Gazebo does (ign-common's PoseAnimation).
// Usage: actor_spline TENSION < NUMBERS: the count of waypoints, then time x y z roll pitch yaw of
// each, then times. Prints x y z qw qx qy qz at each of the times.
#include <array>
#include <iostream>
#include <string>
#include <vector>

#include <ignition/common/Animation.hh>
#include <ignition/common/KeyFrame.hh>
#include <ignition/math.hh>

namespace math = ignition::math;

int main(int argc, char **argv) {
  if (argc != 2) return 2;
  size_t count = 0;
  std::cin >> count;
  std::vector<std::array<double, 7>> waypoints(count);
  for (auto &waypoint : waypoints)
    for (auto &number : waypoint) std::cin >> number;
  ignition::common::PoseAnimation animation("path", waypoints.back()[0], false, std::stod(argv[1]));
  for (const auto &w : waypoints) {
    auto *key = animation.CreateKeyFrame(w[0]);
    key->Translation(math::Vector3d(w[1], w[2], w[3]));
    key->Rotation(math::Quaterniond(w[4], w[5], w[6]));
  }
  std::cout.precision(12);
  for (double time; std::cin >> time;) {
    animation.Time(time);
    ignition::common::PoseKeyFrame frame(0);
    animation.InterpolatedKeyFrame(frame);
    // Gazebo's own printing of vectors stops at six decimals.
    const auto &p = frame.Translation();
    const auto &q = frame.Rotation();
    std::cout << p.X() << " " << p.Y() << " " << p.Z() << " " << q.W() << " " << q.X() << " " << q.Y() << " " << q.Z()
              << "\n";
  }
  return 0;
}
