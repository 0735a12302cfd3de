// What Gazebo Fortress makes of an SDF world: libsdformat reads it, ign-common loads its meshes,
// ign-physics with DART lets balls rest on it. No display and no server are needed.
//
// Usage: gazebo_probe read FILE MODELS BINARY     tells what FILE holds; meshes go into BINARY;
//                                                 where that is empty, static models are left out
//        gazebo_probe rest FILE MODELS PLUGIN SECONDS   tells where models `probe_ball_N` rest
//
// The answer has a line per fact with tabs between its parts, as probe.py reads it.
#include <chrono>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include <ignition/common/Image.hh>
#include <ignition/common/ImageHeightmap.hh>
#include <ignition/common/MeshManager.hh>
#include <ignition/common/SubMesh.hh>
#include <ignition/math/Matrix3.hh>
#include <ignition/math/eigen3/Conversions.hh>
#include <ignition/physics/ConstructEmpty.hh>
#include <ignition/physics/ForwardStep.hh>
#include <ignition/physics/FrameSemantics.hh>
#include <ignition/physics/GetEntities.hh>
#include <ignition/physics/RequestEngine.hh>
#include <ignition/physics/World.hh>
#include <ignition/physics/config.hh>
#include <ignition/physics/heightmap/HeightmapShape.hh>
#include <ignition/physics/mesh/MeshShape.hh>
#include <ignition/physics/sdf/ConstructModel.hh>
#include <ignition/physics/sdf/ConstructWorld.hh>
#include <ignition/plugin/Loader.hh>
#include <sdf/sdf.hh>

namespace common = ignition::common;
namespace math = ignition::math;
namespace physics = ignition::physics;

struct Features
    : physics::FeatureList<physics::LinkFrameSemantics, physics::ForwardStep, physics::GetEntities,
                           physics::sdf::ConstructSdfWorld, physics::sdf::ConstructSdfModel,
                           physics::mesh::AttachMeshShapeFeature,
                           physics::heightmap::AttachHeightmapShapeFeature,
                           physics::CollisionDetector> {};

static std::string models;
static bool classic = false;  // whether the file was written for Gazebo Classic

std::string Resolve(const std::string &uri) {
  const std::string scheme = "model://";
  return uri.rfind(scheme, 0) == 0 ? models + "/" + uri.substr(scheme.size()) : uri;
}

sdf::ParserConfig Strict() {
  sdf::ParserConfig config;
  config.SetWarningsPolicy(sdf::EnforcementPolicy::ERR);
  config.SetUnrecognizedElementsPolicy(sdf::EnforcementPolicy::ERR);
  config.AddURIPath("model://", models);
  return config;
}

// ---- read

class Meshes {
 public:
  explicit Meshes(const std::string &path) : of_static_(!path.empty()) {
    if (of_static_) file_.open(path, std::ios::binary);
  }

  // Whether the meshes of this model are asked for.
  bool Wants(const sdf::Model &model) const { return of_static_ || !model.Static(); }

  // The number of the mesh of a file, which is written where it is asked for first; -1 if it
  // cannot be loaded.
  int Of(const std::string &uri) {
    const auto known = numbers_.find(uri);
    if (known != numbers_.end()) return known->second;
    const auto *mesh = common::MeshManager::Instance()->Load(Resolve(uri));
    if (!mesh) {
      std::cout << "finding\tno mesh in " << uri << "\n";
      return numbers_[uri] = -1;
    }
    std::vector<double> points;
    std::vector<int32_t> corners;
    for (unsigned int n = 0; n < mesh->SubMeshCount(); ++n) {
      const auto part = mesh->SubMeshByIndex(n).lock();
      // Gazebo's physics drops parts without normals without a word.
      if (part->NormalCount() == 0) std::cout << "finding\tno normals in " << uri << "\n";
      const auto first = static_cast<int32_t>(points.size() / 3);
      for (unsigned int v = 0; v < part->VertexCount(); ++v)
        for (int axis = 0; axis < 3; ++axis) points.push_back(part->Vertex(v)[axis]);
      for (unsigned int c = 0; c < part->IndexCount(); ++c) corners.push_back(first + part->Index(c));
    }
    return numbers_[uri] = Write(points, corners);
  }

  // The number of a mesh that is the heightmap's grid, in the frame of its collision.
  int Of(const sdf::Heightmap &map) {
    common::ImageHeightmap image;
    const auto path = Resolve(map.Uri());
    if (image.Load(path) != 0) {
      std::cout << "finding\tno heightmap in " << map.Uri() << "\n";
      return -1;
    }
    // Fortress takes the brightest pixel of 16 bits for 0; newer ones read it, and it is 1 here.
    const bool deep = common::Image(path).BPP() == 16;
    const double brightest = deep ? 1.0 : std::max(1e-12f, image.MaxElevation());
    const int across = static_cast<int>(image.Width());
    const auto size = map.Size();
    // DART spreads the samples over less than the size, and gz-sim leaves out <pos>; Gazebo
    // Classic's ODE spreads them over all of it, and of <pos> takes z.
    const double spread = classic ? across - 1 : across;
    const math::Vector3d step(size.X() / spread, size.Y() / spread, size.Z() / brightest);
    const double lifted = classic ? map.Position().Z() : 0.0;
    std::vector<float> heights;
    image.FillHeightMap(1, across, size, step, false, heights);
    std::cout << "heightmap\t" << size.Z() << "\t" << (deep ? 65535 : 255) << "\n";
    std::vector<double> points;
    std::vector<int32_t> corners;
    // The first row of an image is the northern one.
    for (int j = 0; j < across; ++j)
      for (int i = 0; i < across; ++i) {
        points.push_back((i - 0.5 * (across - 1)) * step.X());
        points.push_back((0.5 * (across - 1) - j) * step.Y());
        points.push_back(lifted + heights[j * across + i]);
      }
    for (int j = 0; j + 1 < across; ++j)
      for (int i = 0; i + 1 < across; ++i) {
        const int nw = j * across + i, ne = nw + 1, sw = nw + across, se = sw + 1;
        for (int corner : {sw, se, ne, sw, ne, nw}) corners.push_back(corner);
      }
    return Write(points, corners);
  }

 private:
  int Write(const std::vector<double> &points, const std::vector<int32_t> &corners) {
    file_.write(reinterpret_cast<const char *>(points.data()), points.size() * sizeof(double));
    file_.write(reinterpret_cast<const char *>(corners.data()), corners.size() * sizeof(int32_t));
    std::cout << "mesh\t" << points.size() / 3 << "\t" << corners.size() / 3 << "\n";
    return written_++;
  }

  const bool of_static_;
  std::ofstream file_;
  std::map<std::string, int> numbers_;
  int written_ = 0;
};

math::Pose3d Placed(const math::Pose3d &parent, const sdf::SemanticPose &pose,
                    const std::string &relative_to) {
  math::Pose3d own;
  for (const auto &error : pose.Resolve(own, relative_to))
    std::cout << "finding\t" << error.Message() << "\n";
  return parent * own;
}

// Three rows of rotation, scaled column by column, and translation.
void TellPlace(const math::Pose3d &pose, const math::Vector3d &scale) {
  const math::Matrix3d turn(pose.Rot());
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      std::cout << "\t" << turn(row, column) * scale[column];
    std::cout << "\t" << pose.Pos()[row];
  }
  std::cout << "\n";
}

template <typename Part>
void TellShape(const char *kind, const sdf::Model &model, const Part &part,
               const math::Pose3d &link, const std::string &link_name, Meshes &meshes) {
  const auto *mesh = part.Geom()->MeshShape();
  const auto *map = part.Geom()->HeightmapShape();
  if (!mesh && !map) return;
  const int number = mesh ? meshes.Of(mesh->Uri()) : meshes.Of(*map);
  if (number < 0) return;
  std::cout << "shape\t" << kind << "\t" << model.Name() << "\t" << part.Name() << "\t" << number;
  TellPlace(Placed(link, part.SemanticPose(), link_name), mesh ? mesh->Scale() : math::Vector3d::One);
}

void TellBody(const sdf::Model &model, const sdf::Link &link, const math::Pose3d &pose) {
  const auto &inertial = link.Inertial();
  const auto moments = inertial.Moi();
  std::cout << "body\t" << model.Name() << "\t" << inertial.MassMatrix().Mass();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) std::cout << "\t" << moments(row, column);
  TellPlace(pose, math::Vector3d::One);
}

void TellModel(const sdf::Model &model, Meshes &meshes) {
  const auto place = Placed(math::Pose3d::Zero, model.SemanticPose(), "");
  for (uint64_t n = 0; n < model.LinkCount(); ++n) {
    const auto *link = model.LinkByIndex(n);
    const auto pose = Placed(place, link->SemanticPose(), "__model__");
    if (!model.Static()) TellBody(model, *link, pose);
    if (!meshes.Wants(model)) continue;
    for (uint64_t c = 0; c < link->CollisionCount(); ++c)
      TellShape("touched", model, *link->CollisionByIndex(c), pose, link->Name(), meshes);
    for (uint64_t v = 0; v < link->VisualCount(); ++v)
      TellShape("seen", model, *link->VisualByIndex(v), pose, link->Name(), meshes);
  }
}

void TellActor(const sdf::Actor &actor) {
  for (uint64_t n = 0; n < actor.TrajectoryCount(); ++n) {
    const auto *trajectory = actor.TrajectoryByIndex(n);
    for (uint64_t w = 0; w < trajectory->WaypointCount(); ++w) {
      const auto *waypoint = trajectory->WaypointByIndex(w);
      const auto pose = waypoint->Pose();
      std::cout << "waypoint\t" << actor.Name() << "\t" << waypoint->Time() << "\t" << pose.X()
                << "\t" << pose.Y() << "\t" << pose.Z() << "\t" << pose.Rot().W() << "\t"
                << pose.Rot().X() << "\t" << pose.Rot().Y() << "\t" << pose.Rot().Z() << "\n";
    }
  }
}

int Read(const std::string &path, const std::string &binary) {
  sdf::Root root;
  for (const auto &error : root.Load(path, Strict()))
    std::cout << "finding\t" << error.Message() << "\n";
  std::cout << "consumer\tlibsdformat " << SDF_VERSION_FULL << "\n";
  if (root.WorldCount() != 1) {
    std::cout << "finding\t" << root.WorldCount() << " worlds\n";
    return 0;
  }
  const auto *world = root.WorldByIndex(0);
  classic = world->Element()->OriginalVersion() == "1.6";
  const auto gravity = world->Gravity();
  std::cout << "gravity\t" << gravity.X() << "\t" << gravity.Y() << "\t" << gravity.Z() << "\n";
  Meshes meshes(binary);
  for (uint64_t n = 0; n < world->ModelCount(); ++n) TellModel(*world->ModelByIndex(n), meshes);
  for (uint64_t n = 0; n < world->ActorCount(); ++n) TellActor(*world->ActorByIndex(n));
  return 0;
}

// ---- rest

// ign-physics leaves meshes and heightmaps to its host: attach each to its link, as gz-sim does.
template <typename WorldPtr>
void Attach(const WorldPtr &world, const sdf::Model &model) {
  auto bodies = world->GetModel(model.Name());
  for (uint64_t l = 0; l < model.LinkCount(); ++l) {
    const auto *link = model.LinkByIndex(l);
    auto body = bodies->GetLink(link->Name());
    for (uint64_t c = 0; c < link->CollisionCount(); ++c) {
      const auto *collision = link->CollisionByIndex(c);
      const auto pose = math::eigen3::convert(collision->RawPose());
      if (const auto *shape = collision->Geom()->MeshShape()) {
        const auto *mesh = common::MeshManager::Instance()->Load(Resolve(shape->Uri()));
        if (!mesh) continue;
        body->AttachMeshShape(collision->Name(), *mesh, pose, math::eigen3::convert(shape->Scale()));
      } else if (const auto *map = collision->Geom()->HeightmapShape()) {
        common::ImageHeightmap image;
        if (image.Load(Resolve(map->Uri())) != 0) continue;
        body->AttachHeightmapShape(collision->Name(), image, pose,
                                   math::eigen3::convert(map->Size()), map->Sampling());
      }
    }
  }
}

int Rest(const std::string &path, const std::string &plugin, double seconds) {
  ignition::plugin::Loader loader;
  for (const auto &name : loader.LoadLib(plugin)) {
    auto engine = physics::RequestEngine3d<Features>::From(loader.Instantiate(name));
    if (!engine) continue;
    sdf::ParserConfig config;
    config.AddURIPath("model://", models);
    sdf::Root root;
    const auto errors = root.Load(path, config);  // those of newer SDF do not hinder it
    if (root.WorldCount() != 1) {
      for (const auto &error : errors) std::cerr << error.Message() << "\n";
      return 1;
    }
    const auto *description = root.WorldByIndex(0);
    // As gz-sim does: an empty world, the detector that the file asks for, then the models.
    sdf::World empty = *description;
    empty.ClearModels();
    auto world = engine->ConstructWorld(empty);
    const auto dart = description->PhysicsDefault()->Element()->FindElement("dart");
    if (dart) world->SetCollisionDetector(dart->Get<std::string>("collision_detector"));
    std::vector<std::string> balls;
    for (uint64_t n = 0; n < description->ModelCount(); ++n) {
      const auto *model = description->ModelByIndex(n);
      const bool ball = model->Name().rfind("probe_ball_", 0) == 0;
      if (ball) balls.push_back(model->Name());
      if (!ball && !model->Static()) continue;  // dynamic rocks would only take time
      world->ConstructModel(*model);
      Attach(world, *model);
    }
    physics::ForwardStep::Input input;
    physics::ForwardStep::Output output;
    physics::ForwardStep::State state;
    const std::chrono::milliseconds step(2);
    input.Get<std::chrono::steady_clock::duration>() = step;
    for (int n = 0; n < seconds * 500; ++n) world->Step(output, state, input);
    std::cout << "consumer\tign-physics " << IGNITION_PHYSICS_VERSION_FULL << " with DART\n";
    for (const auto &ball : balls) {
      const auto pose = world->GetModel(ball)->GetLink(0)->FrameDataRelativeToWorld().pose;
      std::cout << "ball\t" << pose.translation().z() << "\n";
    }
    return 0;
  }
  std::cerr << "no physics engine in " << plugin << "\n";
  return 1;
}

int main(int argc, char **argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  std::cout.precision(17);
  if (words.size() == 4 && words[0] == "read") {
    models = words[2];
    return Read(words[1], words[3]);
  }
  if (words.size() == 5 && words[0] == "rest") {
    models = words[2];
    return Rest(words[1], words[3], std::stod(words[4]));
  }
  std::cerr << "usage: gazebo_probe read FILE MODELS BINARY | rest FILE MODELS PLUGIN SECONDS\n";
  return 2;
}
