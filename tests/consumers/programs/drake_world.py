"""Drake as a consumer: load a world strictly, ask it for geometry, drop balls on it.

Reads JSON from standard input: world [path], gravity [m/s²], balls [[x, y, z], …] of radius 0.2 m
on vertical sliders, rovers [paths], seconds. Writes JSON: heights where the balls end, places where
the free bodies end, and the geometries' friction.
"""

import json
import logging
import sys

from pydrake.geometry import DefaultProximityProperties, Role, SceneGraphConfig
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

BALL = """<sdf version="1.9"><model name="ball_{n}"><pose>{x} {y} {z} 0 0 0</pose><link name="ball">
<inertial><mass>1</mass><inertia><ixx>.016</ixx><iyy>.016</iyy><izz>.016</izz></inertia></inertial>
<collision name="ball"><geometry><sphere><radius>0.2</radius></sphere></geometry></collision></link>
<joint name="slider" type="prismatic"><parent>world</parent><child>ball</child>
<axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""


class Complaints(logging.Handler):
    """What Drake logs."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.texts = []

    def emit(self, record):
        self.texts.append(record.getMessage())


order = json.load(sys.stdin)
complaints = Complaints()
logging.getLogger("drake").addHandler(complaints)
builder = DiagramBuilder()
plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.002)
# A body that says nothing of its contact is as hard as rubber, and fine enough for a ball.
soft = DefaultProximityProperties(
    compliance_type="compliant", hydroelastic_modulus=1e8, resolution_hint=0.02
)
scene_graph.set_config(SceneGraphConfig(default_proximity_properties=soft))
parser = Parser(plant)
parser.SetStrictParsing()
parser.AddModels(order["world"])
for n, (x, y, z) in enumerate(order.get("balls", ())):
    parser.AddModelsFromString(BALL.format(n=n, x=x, y=y, z=z), "sdf")
# Files of others may say what Drake does not know, which strict parsing would refuse.
for path in order.get("rovers", ()):
    Parser(plant).AddModels(path)
plant.mutable_gravity_field().set_gravity_vector([0, 0, -order["gravity"]])
plant.Finalize()
diagram = builder.Build()
simulator = Simulator(diagram)
own = plant.GetMyContextFromRoot(simulator.get_mutable_context())

inspector = scene_graph.model_inspector()
frictions = {
    inspector.GetName(geometry): inspector.GetProximityProperties(geometry)
    .GetProperty("material", "coulomb_friction")
    .dynamic_friction()
    for geometry in inspector.GetAllGeometryIds(Role.kProximity)
}
simulator.AdvanceTo(order.get("seconds", 0.0))
ends = [
    plant.EvalBodyPoseInWorld(own, plant.GetBodyByName("ball", plant.GetModelInstanceByName(name)))
    for name in (f"ball_{n}" for n in range(len(order.get("balls", ()))))
]
places = {
    plant.GetModelInstanceName(body.model_instance()): plant.EvalBodyPoseInWorld(own, body)
    for body in map(plant.get_body, plant.GetFloatingBaseBodies())
}
answer = {
    "complaints": complaints.texts,
    "balls": [pose.translation()[2] for pose in ends],
    "places": {name: pose.translation().tolist() for name, pose in places.items()},
    "frictions": frictions,
}
sys.stdout.write(json.dumps(answer))
