"""Prints mass and centre of mass of a URDF as PyBullet reads it, and how many joints turn."""

import json
import sys

import pybullet

pybullet.connect(pybullet.DIRECT)
rover = pybullet.loadURDF(sys.argv[1], flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
joints = range(pybullet.getNumJoints(rover))
# The base's pose, and a link's first, are those of its centre of mass.
base, _ = pybullet.getBasePositionAndOrientation(rover)
parts = [(pybullet.getDynamicsInfo(rover, -1)[0], base)]
parts += [
    (pybullet.getDynamicsInfo(rover, n)[0], pybullet.getLinkState(rover, n)[0]) for n in joints
]
mass = sum(m for m, _ in parts)
# It puts the base's centre of mass at the origin: told relative to that.
offset = pybullet.getDynamicsInfo(rover, -1)[3]
centre = [sum(m * (at[k] - base[k]) for m, at in parts) / mass + offset[k] for k in range(3)]
turning = sum(pybullet.getJointInfo(rover, n)[2] == pybullet.JOINT_REVOLUTE for n in joints)
sys.stdout.write(json.dumps({"mass": mass, "centre": centre, "turning": turning}))
