// Lets Gazebo Fortress' physics (ign-physics5 with DART) run a world, as gz-sim would, without a display.
// Usage: gazebo_rest PLUGIN WORLD MODELS SECONDS. Prints the first link of each model that is not
// static, where it then is: name x y z qw qx qy qz.
#include <chrono>
#include <iostream>
#include <string>

#include <ignition/common/ImageHeightmap.hh>
#include <ignition/common/MeshManager.hh>
#include <ignition/math/eigen3/Conversions.hh>
#include <ignition/physics/ConstructEmpty.hh>
#include <ignition/physics/ForwardStep.hh>
#include <ignition/physics/FrameSemantics.hh>
#include <ignition/physics/GetEntities.hh>
#include <ignition/physics/RequestEngine.hh>
#include <ignition/physics/World.hh>
#include <ignition/physics/heightmap/HeightmapShape.hh>
#include <ignition/physics/mesh/MeshShape.hh>
#include <ignition/physics/sdf/ConstructModel.hh>
#include <ignition/physics/sdf/ConstructWorld.hh>
#include <ignition/plugin/Loader.hh>
#include <sdf/sdf.hh>

namespace math = ignition::math::eigen3;
namespace physics = ignition::physics;

struct Features
    : physics::FeatureList<physics::LinkFrameSemantics, physics::ForwardStep, physics::GetEntities,
                           physics::sdf::ConstructSdfWorld, physics::sdf::ConstructSdfModel,
                           physics::mesh::AttachMeshShapeFeature,
                           physics::heightmap::AttachHeightmapShapeFeature, physics::CollisionDetector> {};

template <typename LinkPtr>
bool AttachHeightmap(const LinkPtr &link, const sdf::Collision &collision, const std::string &path) {
  const auto *shape = collision.Geom()->HeightmapShape();
  ignition::common::ImageHeightmap data;
  if (data.Load(path) != 0) return false;
  // gz-sim hands over the collision's pose alone, whatever the heightmap's <pos> says.
  link->AttachHeightmapShape(collision.Name(), data, math::convert(collision.RawPose()),
                             math::convert(shape->Size()), shape->Sampling());
  return true;
}

// The physics library leaves meshes and heightmaps to its host: attach all of the world's.
template <typename WorldPtr>
bool AttachShapes(const WorldPtr &world, const sdf::World &description, const std::string &models) {
  const std::string scheme = "model://";
  for (uint64_t m = 0; m < description.ModelCount(); ++m) {
    const auto *model = description.ModelByIndex(m);
    for (uint64_t l = 0; l < model->LinkCount(); ++l) {
      const auto *link = model->LinkByIndex(l);
      auto body = world->GetModel(model->Name())->GetLink(link->Name());
      for (uint64_t c = 0; c < link->CollisionCount(); ++c) {
        const auto *collision = link->CollisionByIndex(c);
        if (const auto *map = collision->Geom()->HeightmapShape()) {
          const auto image = models + "/" + map->Uri().substr(scheme.size());
          if (!AttachHeightmap(body, *collision, image)) return false;
        }
        const auto *shape = collision->Geom()->MeshShape();
        if (!shape) continue;
        const auto path = models + "/" + shape->Uri().substr(scheme.size());
        const auto *mesh = ignition::common::MeshManager::Instance()->Load(path);
        if (!mesh) return false;
        body->AttachMeshShape(collision->Name(), *mesh, math::convert(collision->RawPose()),
                              math::convert(shape->Scale()));
      }
    }
  }
  return true;
}

int main(int argc, char **argv) {
  if (argc != 5) {
    std::cerr << "usage: gazebo_rest PLUGIN WORLD MODELS SECONDS\n";
    return 2;
  }
  ignition::plugin::Loader loader;
  for (const auto &name : loader.LoadLib(argv[1])) {
    auto engine = physics::RequestEngine3d<Features>::From(loader.Instantiate(name));
    if (!engine) continue;
    sdf::ParserConfig config;
    config.AddURIPath("model://", argv[3]);
    sdf::Root root;
    if (!root.Load(argv[2], config).empty()) return 1;
    const auto *description = root.WorldByIndex(0);
    // As gz-sim does: an empty world, the detector that the file asks for, then the models.
    sdf::World empty = *description;
    empty.ClearModels();
    auto world = engine->ConstructWorld(empty);
    const auto dart = description->PhysicsDefault()->Element()->FindElement("dart");
    if (dart) world->SetCollisionDetector(dart->Get<std::string>("collision_detector"));
    for (uint64_t m = 0; m < description->ModelCount(); ++m)
      world->ConstructModel(*description->ModelByIndex(m));
    if (!AttachShapes(world, *description, argv[3])) return 1;
    physics::ForwardStep::Input input;
    physics::ForwardStep::Output output;
    physics::ForwardStep::State state;
    const std::chrono::milliseconds step(2);
    input.Get<std::chrono::steady_clock::duration>() = step;
    for (int n = 0; n < std::stod(argv[4]) * 500; ++n) world->Step(output, state, input);
    std::cout.precision(9);
    for (uint64_t m = 0; m < description->ModelCount(); ++m) {
      const auto *model = description->ModelByIndex(m);
      if (model->Static()) continue;
      const auto pose = world->GetModel(model->Name())->GetLink(0)->FrameDataRelativeToWorld().pose;
      const Eigen::Quaterniond turn(pose.linear());
      std::cout << model->Name() << " " << pose.translation().transpose() << " " << turn.w() << " "
                << turn.vec().transpose() << "\n";
    }
    return 0;
  }
  return 1;
}
