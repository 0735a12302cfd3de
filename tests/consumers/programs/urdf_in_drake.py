"""Prints mass, centre of mass, inertia about it and the motors of a URDF or SDF as Drake has it."""

import json
import sys

from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

plant, scene = MultibodyPlant(0.001), SceneGraph()
plant.RegisterAsSourceForSceneGraph(scene)
(model,) = Parser(plant).AddModels(sys.argv[1])
plant.Finalize()
context = plant.CreateDefaultContext()
plant.SetFreeBodyPose(context, plant.GetBodyByName("base_link"), RigidTransform())
bodies = plant.GetBodyIndices(model)
about = plant.CalcSpatialInertia(context, plant.world_frame(), bodies)
inertia = about.Shift(about.get_com()).CalcRotationalInertia()
found = {
    "mass": about.get_mass(),
    "centre": about.get_com().tolist(),
    "inertia": inertia.CopyToFullMatrix3().tolist(),
    "actuators": plant.num_actuators(),
}
sys.stdout.write(json.dumps(found))
