// Loads an SDF world with libsdformat, treating every warning and unknown element as an error.
// Usage: sdf_check WORLD MODELS. Prints what the world holds and the most memory that was taken; exit status 1 on any finding.
#include <fstream>
#include <iostream>
#include <string>

#include <sdf/sdf.hh>

int main(int argc, char **argv) {
  if (argc != 3) {
    std::cerr << "usage: sdf_check WORLD MODELS\n";
    return 2;
  }
  sdf::ParserConfig config;
  config.SetWarningsPolicy(sdf::EnforcementPolicy::ERR);
  config.SetUnrecognizedElementsPolicy(sdf::EnforcementPolicy::ERR);
  config.AddURIPath("model://", argv[2]);
  sdf::Root root;
  const auto errors = root.Load(argv[1], config);
  for (const auto &error : errors) std::cout << "finding: " << error.Message() << "\n";
  for (uint64_t n = 0; n < root.WorldCount(); ++n) {
    const auto *world = root.WorldByIndex(n);
    std::cout << "gravity " << world->Gravity() << "\n"
              << "models " << world->ModelCount() << "\n"
              << "lights " << world->LightCount() << "\n";
    for (uint64_t a = 0; a < world->ActorCount(); ++a) {
      const auto *actor = world->ActorByIndex(a);
      std::cout << "actor " << actor->Name() << " waypoints "
                << actor->TrajectoryByIndex(0)->WaypointCount() << "\n";
    }
  }
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == "VmHWM:" && status >> word) std::cout << "kilobytes " << word << "\n";
  return errors.empty() && root.WorldCount() == 1 ? 0 : 1;
}
