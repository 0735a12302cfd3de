"""A four-wheeled rover as another project would write it, to be put onto our grounds."""

from __future__ import annotations

WHEEL = 0.12
"""Radius of a wheel [m]."""
HUB = -0.05
"""Height of the wheels' axles in the chassis' frame [m]."""

_WHEEL = """<link name="wheel_{n}"><pose>{x} {y} {hub} 1.570796327 0 0</pose>
<inertial><mass>0.8</mass>
<inertia><ixx>.004</ixx><iyy>.004</iyy><izz>.006</izz></inertia></inertial>
<collision name="tyre"><geometry>{shape}</geometry>
<surface><friction><ode><mu>0.9</mu><mu2>0.9</mu2></ode></friction></surface></collision>
</link>
<joint name="axle_{n}" type="revolute"><parent>chassis</parent><child>wheel_{n}</child>
<axis><xyz>0 0 1</xyz></axis></joint>"""

_SHAPES = {
    "cylinder": f"<cylinder><radius>{WHEEL}</radius><length>0.08</length></cylinder>",
    "sphere": f"<sphere><radius>{WHEEL}</radius></sphere>",
    "mesh": "<mesh><uri>model://wheel.stl</uri></mesh>",
}


def four_wheeler(x: float, y: float, z: float, *, wheels: str) -> str:
    """A free rover whose wheels turn freely, at a place [m].

    Args:
        x: East of its chassis.
        y: North of it.
        z: Height of it.
        wheels: `cylinder`, `sphere`, or `mesh` of the file wheel.stl among the models.
    """
    corners = [(0.25, 0.2), (0.25, -0.2), (-0.25, 0.2), (-0.25, -0.2)]
    parts = "".join(
        _WHEEL.format(n=n, x=dx, y=dy, hub=HUB, shape=_SHAPES[wheels])
        for n, (dx, dy) in enumerate(corners)
    )
    return f"""<model name="foreign_rover"><pose>{x} {y} {z} 0 0 0</pose><link name="chassis">
<inertial><mass>8</mass><inertia><ixx>.12</ixx><iyy>.2</iyy><izz>.3</izz></inertia></inertial>
<collision name="body"><geometry><box><size>0.5 0.3 0.06</size></box></geometry></collision>
</link>{parts}</model>"""
