// Reads the levels of an SDF world with libsdformat, as gz-sim's level manager reads them.
// Usage: gazebo_levels WORLD MODELS. Prints "model NAME x y z" for each model of the world, and
// "level NAME x y z dx dy dz buffer MODEL ..." for each level.
#include <iostream>
#include <set>
#include <string>

#include <sdf/sdf.hh>

int main(int argc, char **argv) {
  if (argc != 3) {
    std::cerr << "usage: gazebo_levels WORLD MODELS\n";
    return 2;
  }
  sdf::ParserConfig config;
  config.SetWarningsPolicy(sdf::EnforcementPolicy::ERR);
  config.AddURIPath("model://", argv[2]);
  sdf::Root root;
  for (const auto &error : root.Load(argv[1], config)) {
    std::cerr << "finding: " << error.Message() << "\n";
    return 1;
  }
  const auto *world = root.WorldByIndex(0);
  std::cout.precision(12);
  for (uint64_t m = 0; m < world->ModelCount(); ++m) {
    const auto *model = world->ModelByIndex(m);
    std::cout << "model " << model->Name() << " " << model->RawPose().Pos() << "\n";
  }
  const std::set<std::string> names{"gz::sim", "ignition::gazebo"};
  sdf::ElementPtr simulator;
  for (auto plugin = world->Element()->FindElement("plugin"); plugin;
       plugin = plugin->GetNextElement("plugin"))
    if (names.count(plugin->Get<std::string>("name"))) simulator = plugin;
  if (!simulator) return 1;
  for (auto level = simulator->FindElement("level"); level; level = level->GetNextElement("level")) {
    sdf::Geometry geometry;
    if (!geometry.Load(level->FindElement("geometry")).empty() || !geometry.BoxShape()) return 1;
    std::cout << "level " << level->Get<std::string>("name") << " "
              << level->Get<ignition::math::Pose3d>("pose").Pos() << " "
              << geometry.BoxShape()->Size() << " " << level->Get<double>("buffer");
    for (auto ref = level->FindElement("ref"); ref; ref = ref->GetNextElement("ref"))
      std::cout << " " << ref->GetValue()->GetAsString();
    std::cout << "\n";
  }
  return 0;
}
