"""What Newton makes of an MJCF or USD world: its importer, its shapes, and balls that come to rest.

Reads an order as JSON from standard input: `world`, `binary`, `answer`, `balls` [x, y, z], `radius`
[m], `seconds`. The answer, a file since Newton prints too, has a line per fact with tabs between
its parts, as probe.py reads it; meshes go into the binary file. It runs in an interpreter of its
own, which need not have terrain_forge.
"""

import json
import re
import sys
from importlib.metadata import version
from pathlib import Path

import newton
import numpy as np
import warp as wp

TIME_STEP = 0.002
ROCK = re.compile(r"(?:^|/)rock_(\d+)(?:$|_|/)")


class Answer:
    """The lines of the answer, and the meshes that they speak of."""

    def __init__(self, text, binary):
        self._text, self._binary = text, binary
        self._number = {}

    def tell(self, *parts):
        """Add a line."""
        words = (repr(float(p)) if isinstance(p, (float, np.floating)) else str(p) for p in parts)
        self._text.write("\t".join(words) + "\n")

    def mesh(self, source, vertices, faces):
        """The number of a mesh; `source` tells whether it is known."""
        if id(source) not in self._number:
            self._binary.write(np.asarray(vertices, "<f8").tobytes())
            self._binary.write(np.asarray(faces, "<i4").tobytes())
            self.tell("mesh", len(vertices), len(faces))
            self._number[id(source)] = len(self._number)
        return self._number[id(source)]


def matrix_of(transform):
    """The matrix, shape [4, 4], of position and quaternion (x, y, z, w)."""
    values = np.array(list(transform), float)
    x, y, z, w = values[3:]
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = values[:3]
    return matrix


def triangles(source):
    """Vertices and faces of a mesh or of a height field, whose cells Newton cuts as we do."""
    if not isinstance(source, newton.Heightfield):
        return np.array(source.vertices, float), np.array(source.indices, int).reshape(-1, 3)
    z = source.min_z + np.array(source.data, float) * (source.max_z - source.min_z)
    rows, columns = source.nrow, source.ncol
    x, y = np.linspace(-source.hx, source.hx, columns), np.linspace(-source.hy, source.hy, rows)
    vertices = np.dstack([*np.meshgrid(x, y), z.reshape(rows, columns)]).reshape(-1, 3)
    southwest = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    southeast, northwest = southwest + 1, southwest + columns
    northeast = northwest + 1
    faces = np.stack([southwest, southeast, northeast, southwest, northeast, northwest], axis=-1)
    return vertices, faces.reshape(-1, 3)


def tell_shapes(builder, answer):
    """The meshes and height fields that are touched."""
    kinds = (newton.GeoType.MESH, newton.GeoType.CONVEX_MESH, newton.GeoType.HFIELD)
    for n in range(builder.shape_count):
        if builder.shape_type[n] not in kinds:
            continue
        if not builder.shape_flags[n] & newton.ShapeFlags.COLLIDE_SHAPES:
            continue
        body = builder.shape_body[n]
        place = matrix_of(builder.shape_transform[n])
        if body >= 0:
            place = matrix_of(builder.body_q[body]) @ place
        place[:3, :3] *= np.array(list(builder.shape_scale[n]), float)
        source, label = builder.shape_source[n], builder.shape_label[n]
        rock = ROCK.search(label)
        ground = isinstance(source, newton.Heightfield) or any(
            part.lower().startswith("ground") for part in label.split("/")
        )
        name = f"rock_{rock[1]}" if rock else "ground" if ground else "merged"
        number = answer.mesh(source, *triangles(source))
        answer.tell("shape", "touched", label, name, number, *place[:3].ravel().tolist())


def tell_bodies(builder, answer):
    """The bodies with masses, inertias about their centres of mass, and poses."""
    for n in range(builder.body_count):
        tensor = np.array(builder.body_inertia[n], float).reshape(3, 3)
        place = matrix_of(builder.body_q[n])
        place[:3, 3] += place[:3, :3] @ np.array(list(builder.body_com[n]), float)
        values = [*tensor.ravel().tolist(), *place[:3].ravel().tolist()]
        answer.tell("body", builder.body_label[n], builder.body_mass[n], *values)


def add_balls(builder, order):
    """Balls of 1 kg on vertical sliders; returns their bodies."""
    bodies = []
    moment = 0.4 * order["radius"] ** 2
    for n, start in enumerate(order["balls"]):
        place = wp.transform(wp.vec3(*start), wp.quat_identity())
        body = builder.add_link(
            xform=place, mass=1.0, inertia=wp.mat33(np.eye(3) * moment), lock_inertia=True
        )
        shape = newton.ModelBuilder.ShapeConfig(density=0.0)
        builder.add_shape_sphere(body, radius=order["radius"], cfg=shape)
        slider = builder.add_joint_prismatic(
            -1, body, parent_xform=place, axis=newton.Axis.Z, label=f"slider_{n}"
        )
        builder.add_articulation([slider])
        bodies.append(body)
    return bodies


def rest(model, bodies, seconds):
    """Heights of the balls after some time."""
    solver = newton.solvers.SolverXPBD(model, iterations=8)
    state, after, control = model.state(), model.state(), model.control()
    newton.eval_fk(model, model.joint_q, model.joint_qd, state)
    contacts = model.contacts()
    for _ in range(round(seconds / TIME_STEP)):
        state.clear_forces()
        model.collide(state, contacts)
        solver.step(state, after, control, contacts, TIME_STEP)
        state, after = after, state
    return state.body_q.numpy()[bodies, 2].tolist()


def main():
    """Carry out the order."""
    order = json.load(sys.stdin)
    paths = Path(order["answer"]), Path(order["binary"])
    with paths[0].open("w", encoding="utf-8") as text, paths[1].open("wb") as binary:
        answer = Answer(text, binary)
        answer.tell("consumer", f"Newton {version('newton')}")
        whole = load(order["world"], ())
        answer.tell("gravity", *map(float, np.ravel(whole.gravity)))
        tell_shapes(whole, answer)
        tell_bodies(whole, answer)
        binary.flush()
        # No ball is near a rock, and rocks would only take time.
        builder = load(order["world"], (r".*rock_.*", r".*/Rocks(/.*)?"))
        bodies = add_balls(builder, order)
        for height in rest(builder.finalize(), bodies, order["seconds"]):
            answer.tell("ball", height)


def load(world, ignored):
    """A builder with a world in it."""
    builder = newton.ModelBuilder()
    if world.endswith(".xml"):
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        builder.add_mjcf(world, ignore_names=ignored)
    else:
        builder.add_usd(world, ignore_paths=list(ignored))
    return builder


main()
