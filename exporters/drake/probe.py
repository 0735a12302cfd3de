"""What Drake makes of an SDF world: its parser, its contact geometry, and balls that come to rest.

Reads an order as JSON from standard input: `world`, `ground` (a world of the ground alone, for the
balls), `binary`, `gravity` [m/s²], `balls` [x, y, z], `radius` [m], `seconds`. The answer has a
line per fact with tabs between its parts, as probe.py reads it; meshes go into the binary file. It
runs in an interpreter of its own, which need not have terrain_forge.
"""

import json
import logging
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    Convex,
    DefaultProximityProperties,
    Mesh,
    ReadObjToTriangleSurfaceMesh,
    Role,
    SceneGraphConfig,
)
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

BALL = """<sdf version="1.9"><model name="probe_ball_{n}"><pose>{x} {y} {z} 0 0 0</pose>
<link name="ball"><inertial><mass>1</mass>
<inertia><ixx>{i}</ixx><iyy>{i}</iyy><izz>{i}</izz></inertia></inertial><collision name="ball">
<geometry><sphere><radius>{r}</radius></sphere></geometry></collision></link>
<joint name="slider" type="prismatic"><parent>world</parent><child>ball</child>
<axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""
TIME_STEP = 0.002


def tell(*parts):
    """A line of the answer."""
    sys.stdout.write("\t".join(repr(p) if isinstance(p, float) else str(p) for p in parts) + "\n")


def numbers(matrix):
    """The upper twelve numbers of a pose, or all of a smaller matrix."""
    return np.asarray(matrix, float)[:3].ravel().tolist()


def numbering(path):
    """A function that tells the number of a shape's mesh as Drake reads it, and writes new ones."""
    file, known = Path(path).open("wb"), {}

    def number(shape):
        source, scale = shape.source().path(), shape.scale3()
        key = (str(source), *np.ravel(scale).tolist())
        if key not in known:
            mesh = ReadObjToTriangleSurfaceMesh(source, scale3=scale)
            corners = [[triangle.vertex(n) for n in range(3)] for triangle in mesh.triangles()]
            file.write(np.asarray(mesh.vertices(), "<f8").tobytes())
            file.write(np.asarray(corners, "<i4").tobytes())
            file.flush()
            tell("mesh", len(mesh.vertices()), len(corners))
            known[key] = len(known)
        return known[key]

    return number


def tell_shapes(plant, scene_graph, own, number):
    """The meshes that are touched, and those that are seen."""
    inspector = scene_graph.model_inspector()
    for kind, role in (("touched", Role.kProximity), ("seen", Role.kIllustration)):
        for geometry in inspector.GetAllGeometryIds(role):
            shape = inspector.GetShape(geometry)
            if not isinstance(shape, (Convex, Mesh)):
                continue
            body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
            pose = plant.EvalBodyPoseInWorld(own, body) @ inspector.GetPoseInFrame(geometry)
            model, _, name = inspector.GetName(geometry).rpartition("::")
            matrix = numbers(pose.GetAsMatrix34())
            tell("shape", kind, model, name, number(shape), *matrix)


def tell_bodies(plant, own):
    """The free bodies with their masses, inertias about their centres of mass, and poses."""
    for index in plant.GetFloatingBaseBodies():
        body = plant.get_body(index)
        spatial = body.default_spatial_inertia()
        tensor = spatial.CalcRotationalInertia().CopyToFullMatrix3()
        pose = plant.EvalBodyPoseInWorld(own, body).GetAsMatrix34()
        name = plant.GetModelInstanceName(body.model_instance())
        tell("body", name, spatial.get_mass(), *numbers(tensor), *numbers(pose))


def plant_of(world, gravity, balls, radius):
    """Plant, scene graph and simulator of a world file with balls on vertical sliders in it."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, TIME_STEP)
    # A body that says nothing of its contact is hard, and fine enough for a ball.
    soft = DefaultProximityProperties(
        compliance_type="compliant", hydroelastic_modulus=1e8, resolution_hint=0.02
    )
    scene_graph.set_config(SceneGraphConfig(default_proximity_properties=soft))
    parser = Parser(plant)
    parser.SetStrictParsing()
    parser.AddModels(world)
    moment = 0.4 * radius**2
    for n, (x, y, z) in enumerate(balls):
        parser.AddModelsFromString(BALL.format(n=n, x=x, y=y, z=z, r=radius, i=moment), "sdf")
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -gravity])
    plant.Finalize()
    return plant, scene_graph, Simulator(builder.Build())


def main():
    """Carry out the order."""
    order = json.load(sys.stdin)
    complaints, handler = [], logging.Handler(logging.WARNING)
    handler.emit = lambda record: complaints.append(record.getMessage())
    logging.getLogger("drake").addHandler(handler)
    tell("consumer", f"Drake {version('drake')}")
    plant, scene_graph, simulator = plant_of(order["world"], order["gravity"], (), order["radius"])
    own = plant.GetMyContextFromRoot(simulator.get_mutable_context())
    for text in complaints:
        tell("finding", " ".join(text.split()))
    tell_shapes(plant, scene_graph, own, numbering(order["binary"]))
    tell_bodies(plant, own)
    plant, _, simulator = plant_of(
        order["ground"], order["gravity"], order["balls"], order["radius"]
    )
    simulator.AdvanceTo(order["seconds"])
    own = plant.GetMyContextFromRoot(simulator.get_context())
    for n in range(len(order["balls"])):
        model = plant.GetModelInstanceByName(f"probe_ball_{n}")
        pose = plant.EvalBodyPoseInWorld(own, plant.GetBodyByName("ball", model))
        tell("ball", float(pose.translation()[2]))


main()
