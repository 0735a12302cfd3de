"""Rover files that mean harm: none runs code, reads elsewhere, hangs, or raises more than a line."""
# ruff: noqa: E501 - the lines are those of files

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import pytest

from terrain_forge.base import DataError, RecipeError
from terrain_forge.rovers import FileRover, resolve_rover

SECRET = "mellon-7f3a"
HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
WHEEL = (
    '<link name="wheel_{n}"><inertial><mass value="1"/>' + INERTIA + "</inertial><collision>"
    '<origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.2" length="0.1"/></geometry></collision></link>'
    '<joint name="axle_{n}" type="continuous"><parent link="base_link"/><child link="wheel_{n}"/>'
    '<origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/></joint>'
)
CART = (
    '<link name="base_link"><inertial><mass value="8"/>' + INERTIA + "</inertial><collision>"
    '<geometry><box size="0.6 0.3 0.1"/></geometry></collision></link>'
    + "".join(WHEEL.format(n=n, x=0.2 - 0.4 * (n // 2), y=0.3 - 0.6 * (n % 2)) for n in range(4))
)

BACK = '<joint name="back" type="fixed"><parent link="{parent}"/><child link="base_link"/></joint></robot>'


def xacro(body):
    return HEAD + CART + body + "</robot>"


def urdf(*changes):
    text = '<robot name="r">' + CART + "</robot>"
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def mesh(name):
    return urdf(('<box size="0.6 0.3 0.1"/>', f'<mesh filename="{name}"/>'))


def mjcf(body="", head=""):
    return (
        f"<mujoco>{head}<worldbody><body name='base'><freejoint/><geom size='.1'/>{body}"
        "<body name='wheel'><joint/><geom size='.1'/></body></body></worldbody></mujoco>"
    )


def python(expression):
    return xacro(f'<x v="{expression}"/>')


def macros(count, body):
    """Macros of which each calls the next twice."""
    return (
        "".join(
            f'<xacro:macro name="m{n}" params=""><xacro:m{n + 1}/><xacro:m{n + 1}/></xacro:macro>'
            for n in range(count)
        )
        + f'<xacro:macro name="m{count}" params="">{body}</xacro:macro><xacro:m0/>'
    )


BOMB = (
    "<!DOCTYPE robot [<!ENTITY a 'aaaaaaaaaa'>"
    + "".join(f"<!ENTITY a{n} '{f'&a{n - 1 if n else str()};' * 10}'>" for n in range(12))
    + "]>"
)
DOUBLES = '<xacro:property name="s0" value="xxxxxxxxxxxxxxxx"/>' + "".join(
    f'<xacro:property name="s{n + 1}" value="${{s{n}}}${{s{n}}}"/>' for n in range(40)
)
COLLADA = (
    '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">{}'
    "<library_nodes>{}</library_nodes><library_visual_scenes><visual_scene id='v'><node>"
    "<instance_node url='#n0'/></node></visual_scene></library_visual_scenes>"
    "<scene><instance_visual_scene url='#v'/></scene></COLLADA>"
)
NODES = (
    "".join(
        f"<node id='n{n}'>" + f"<instance_node url='#n{n + 1}'/>" * 2 + "</node>" for n in range(60)
    )
    + "<node id='n60'/>"
)
PNG = b"\x89PNG\r\n\x1a\n" + b"".join(
    struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    for kind, data in (
        (b"IHDR", struct.pack(">IIBBBBB", 60000, 60000, 8, 2, 0, 0, 0)),
        (b"IEND", b""),
    )
)
GLB = b'{"asset":{"version":"2.0"},"accessors":[{"componentType":5126,"count":99999999999,"type":"VEC3"}]}'
GLTF_LOOP = b'{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"children":[1]},{"children":[0]}]}'
OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
PASSWORDS = "/etc/passwd"

# What the file says, its name's end, and what it is told; files beside it by their names.
ATTACKS = {
    # Python
    "import": (python("${__import__('os').system('touch pwned')}"), "xacro", "only arithmetic"),
    "lambda": (python("${(lambda: open('pwned', 'w'))()}"), "xacro", "only arithmetic"),
    "lambda in a list": (python("${[(lambda: 1)][0]()}"), "xacro", "only arithmetic"),
    "walk": (python("${().__class__.__base__.__subclasses__()}"), "xacro", "only arithmetic"),
    "walk of a function": (python("${sqrt.__self__.__loader__}"), "xacro", "unknown name"),
    "walk of a module": (python("${math.__loader__.load_module('os')}"), "xacro", "only arithmetic"),
    "walk by format": (python("${'{0.__class__}'.format(1)}"), "xacro", "unterminated"),
    "f-string": (python("${f'{().__class__}'}"), "xacro", "unterminated|never closed|f-string"),
    "percent": (python("${'%999999999d' % 1}"), "xacro", "is no number"),
    "comprehension": (python("${[c for c in [1]]}"), "xacro", "only arithmetic"),
    "generator": (python("${sum(i for i in [1])}"), "xacro", "only arithmetic"),
    "walrus": (python("${(a := 1)}"), "xacro", "only arithmetic"),
    "getattr": (python("${getattr(1, 'real')}"), "xacro", "only arithmetic"),
    "nested quotes": (python("${'$(eval __import__(&quot;os&quot;))'}"), "xacro", "invalid|only"),
    "eval": (python("$(eval __import__('os').system('touch pwned'))"), "xacro", "only arithmetic"),
    "eval of open": (python("$(eval open('/etc/passwd').read())"), "xacro", "only arithmetic"),
    "argument of code": (
        xacro('<xacro:arg name="a" default="__import__(\'os\')"/><x v="${$(arg a)}"/>'),
        "xacro", "only arithmetic"),
    "property of code": (
        xacro('<xacro:property name="p" value="${print.__self__}"/><x v="${p}"/>'),
        "xacro", "unknown name"),
    "macro default of code": (
        xacro('<xacro:macro name="m" params="a:=${exec(1)}"><x v="${a}"/></xacro:macro><xacro:m/>'),
        "xacro", "only arithmetic"),
    "condition of code": (xacro('<xacro:if value="${exit()}"/>'), "xacro", "only arithmetic"),
    "load_yaml": (python("${xacro.load_yaml('/etc/passwd')}"), "xacro", "outside"),
    "load_yaml bare": (python("${load_yaml('/etc/passwd')}"), "xacro", "outside"),
    "environment": (python("$(env HOME)"), "xacro", "environment is not read"),
    "environment in eval": (python("$(eval env('HOME'))"), "xacro", "only arithmetic"),
    "command": (python("$(command cat /etc/passwd)"), "xacro", "is not known"),
    "code in a urdf": (urdf(("0 1 0", "$(eval 1)")), "urdf", "must be 3 numbers; a file called .xacro is"),
    "xacro in a urdf": (xacro('<xacro:if value="${1}"/>'), "urdf", "name it .xacro"),
    # other files
    "include by absolute path": (
        xacro(f'<xacro:include filename="{PASSWORDS}"/>'), "xacro", "outside"),
    "include by url": (xacro('<xacro:include filename="file:///etc/passwd"/>'), "xacro", "outside"),
    "include from the net": (
        xacro('<xacro:include filename="http://localhost/x.xacro"/>'), "xacro", "is no file"),
    "include above": (xacro('<xacro:include filename="../../secret.xacro"/>'), "xacro", "outside"),
    "include by a link": (xacro('<xacro:include filename="link.xacro"/>'), "xacro", "outside"),
    "include below a link": (
        xacro('<xacro:include filename="folder/secret.xacro"/>'), "xacro", "outside"),
    "include of many": (xacro('<xacro:include filename="/etc/*"/>'), "xacro", "outside"),
    "include of a pipe": (xacro('<xacro:include filename="pipe"/>'), "xacro", "no regular file"),
    "include of a folder": (xacro('<xacro:include filename="meshes"/>'), "xacro", "directory"),
    "include of itself": (xacro('<xacro:include filename="rover.xacro"/>'), "xacro", "itself"),
    "include of no text": (
        xacro('<xacro:include filename="x.bin"/>'), "xacro", "not XML", {"x.bin": os.urandom(99)}),
    "include of a made name": (
        xacro('<xacro:include filename="${\'/etc\' + \'/passwd\'}"/>'), "xacro", "outside"),
    "include of nothing": (xacro('<xacro:include filename="a&#0;b"/>'), "xacro", "not XML"),
    "include of a long name": (
        xacro(f'<xacro:include filename="{"a" * 5000}"/>'), "xacro", "no path|cannot be read"),
    "find etc": (xacro('<xacro:include filename="$(find etc)/passwd"/>'), "xacro", "not found"),
    "find above": (xacro('<xacro:include filename="$(find ..)/secret.xacro"/>'), "xacro", "not found"),
    "find root": (xacro('<xacro:include filename="$(find /)/etc/passwd"/>'), "xacro", "not found"),
    "find tmp": (xacro(f'<xacro:include filename="$(find {Path("/tmp").name})/x"/>'), "xacro", "not found"),
    "find and leave": (
        xacro('<xacro:include filename="$(find kit)/../../secret.xacro"/>'), "xacro", "outside"),
    "find by a link": (xacro('<xacro:include filename="$(find folder)/x"/>'), "xacro", "not found"),
    "mesh by absolute path": (mesh("/etc/hostname"), "urdf", "outside"),
    "mesh by url": (mesh("file:///etc/passwd"), "urdf", "outside"),
    "mesh above": (mesh("../../secret.stl"), "urdf", "outside"),
    "mesh of a package": (mesh("package://etc/passwd"), "urdf", "not found"),
    "mesh outside of a package": (mesh("package://kit/../../secret.stl"), "urdf", "outside"),
    "mesh from the net": (mesh("https://localhost/x.stl"), "urdf", "is no file"),
    "mesh of a pipe": (mesh("pipe.stl"), "urdf", "no regular file"),
    "mesh of a device": (mesh("zero.stl"), "urdf", "outside"),
    "mesh of many names": (mesh("a" * 5000 + ".stl"), "urdf", "missing|no path|name too long"),
    "mesh of an archive": (mesh("x.zip"), "urdf", "allowed are stl", {"x.zip": b"PK"}),
    "mesh of a zae": (mesh("x.zae"), "urdf", "allowed are stl", {"x.zae": b"PK"}),
    "mesh of a 3mf": (mesh("x.3mf"), "urdf", "allowed are stl", {"x.3mf": b"PK"}),
    "material of a mesh": (
        mesh("x.obj"), "urdf", "", {"x.obj": b"mtllib /dev/zero\nusemtl a\n" + OBJ}),
    "entities of a mesh": (
        mesh("x.dae"), "urdf", "declares entities",
        {"x.dae": b"<!DOCTYPE x [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><x>&a;</x>"}),
    "MJCF includes": (mjcf(head=f"<include file='{PASSWORDS}'/>"), "xml", "outside"),
    "MJCF includes above": (mjcf(head="<include file='../../secret.xml'/>"), "xml", "outside"),
    "MJCF includes a pipe": (mjcf(head="<include file='pipe'/>"), "xml", "no regular file"),
    "MJCF includes itself": (mjcf(head="<include file='rover.xml'/>"), "xml", "MuJoCo cannot load"),
    "MJCF mesh": (
        mjcf(head="<asset><mesh name='m' file='/etc/hostname'/></asset>"), "xml", "outside"),
    "MJCF mesh folder": (
        mjcf(head="<compiler meshdir='/etc'/><asset><mesh file='hostname'/></asset>"), "xml",
        "outside"),
    "MJCF mesh of a pipe": (
        mjcf(head="<asset><mesh file='pipe.stl'/></asset>"), "xml", "no regular file"),
    "MJCF texture of a device": (
        mjcf(head="<asset><texture type='cube' fileright='zero.stl'/></asset>"), "xml", "outside"),
    "MJCF submodel": (
        mjcf(head="<asset><model name='m' file='../../secret.xml'/></asset>"), "xml", "outside"),
    # bombs
    "entities": (BOMB + urdf(("r", "&a11;")), "urdf", "entities|not XML"),
    "external entity": (
        "<!DOCTYPE r [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>" + urdf(('"r"', '"&a;"')), "urdf",
        "entities|not XML"),
    "depth": ('<robot name="r">' + "<a>" * 100_000 + "</a>" * 100_000 + "</robot>", "urdf", "200 deep"),
    "depth of MJCF": (mjcf("<body><geom size='.1'/>" * 5000 + "</body>" * 5000), "xml", "200 deep"),
    "elements": (urdf(("<link", "<a/>" * 250_000 + "<link")), "urdf", "200000 elements"),
    "size": ("<robot>" + " " * 20_000_001 + "</robot>", "urdf", "20 MB"),
    "pipe": (None, "urdf", "no regular file"),
    "macros double": (xacro(macros(60, "<a/>")), "xacro", "too many elements"),
    "empty macros double": (xacro(macros(60, "")), "xacro", "too many elements"),
    "macro without end": (
        xacro('<xacro:macro name="m" params=""><a><xacro:m/></a></xacro:macro><xacro:m/>'), "xacro",
        "250 deep"),
    "block without end": (
        xacro('<xacro:property name="b"><xacro:insert_block name="b"/></xacro:property>'
              '<xacro:insert_block name="b"/>'), "xacro", "2000 deep"),
    "texts double": (xacro(DOUBLES + '<x v="${s40}"/>'), "xacro", "100000 characters"),
    "texts add up": (
        xacro(DOUBLES + '<x v="${s11} "/>' * 5000), "xacro", "too many characters"),
    "texts in expressions add up": (
        xacro(DOUBLES + "".join(
            f'<xacro:property name="t{n}" value="${{s9 + \'{n}\'}}"/><x v="${{len(t{n})}}"/>'
            for n in range(4000))), "xacro", "too many characters"),
    "large files": (
        xacro("".join(f'<xacro:include filename="l{n}.xacro"/>' for n in range(30))), "xacro",
        "too many characters",
        {f"l{n}.xacro": b"<robot>" + b" " * 1_000_000 + b"</robot>" for n in range(30)}),
    "lists double": (
        xacro('<xacro:property name="l0" value="${[1, 2]}"/>' + "".join(
            f'<xacro:property name="l{n + 1}" value="${{[l{n}, l{n}]}}"/>' for n in range(40))
            + '<x v="${l40}"/>'), "xacro", "more than 10000"),
    "properties of properties": (
        xacro("".join(f'<xacro:property name="p{n}" value="${{p{n + 1}}}"/>' for n in range(900))
              + '<x v="${p0}"/>'), "xacro", "50 deep"),
    "expressions": (
        xacro('<xacro:property name="l" value="${[' + "1," * 400 + ']}"/>'
              + '<x v="${l == l and l == l and l == l}"/>' * 20_000), "xacro", "too many steps"),
    "power": (python("${9**9**9**9}"), "xacro", "math range error"),
    "product": (python("${" + "*".join(["99999999999999"] * 60) + "}"), "xacro", "128 bits"),
    "round": (python("${round(5, -10**9)}"), "xacro", "20 digits"),
    "digits": (
        xacro(f'<xacro:property name="n" value="{"9" * 100_000}"/><x v="${{n * 2}}"/>'), "xacro",
        "is no number"),
    "parentheses": (python("${" + "(" * 499 + "1" + ")" * 499 + "}"), "xacro", "parenthes"),
    "minus": (python("${" + "-" * 990 + "1}"), "xacro", "too deep"),
    "unclosed": (python("$(eval " + "(" * 20_000), "xacro", "has no end"),
    "parameters": (
        xacro(f'<xacro:macro name="m" params="a:={"${" * 20_000}"/>'), "xacro", "params"),
    "nodes of a mesh": (
        mesh("x.dae"), "urdf", "too often", {"x.dae": COLLADA.format("", NODES).encode()}),
    "loop of a mesh": (
        mesh("x.dae"), "urdf", "too often",
        {"x.dae": COLLADA.format("", "<node id='n0'><instance_node url='#n0'/></node>").encode()}),
    "numbers of a mesh": (mesh("x.gltf"), "urdf", "too many numbers", {"x.gltf": GLB}),
    "loop of a glTF": (mesh("x.gltf"), "urdf", "within themselves", {"x.gltf": GLTF_LOOP}),
    "counts of a mesh": (
        mesh("x.stl"), "urdf", "cannot be read|holds no",
        {"x.stl": bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50)}),
    "counts of a ply": (
        mesh("x.ply"), "urdf", "cannot be read|holds no",
        {"x.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\nproperty float x\n"
         b"property float y\nproperty float z\nend_header\n"}),
    "no mesh": (mesh("x.stl"), "urdf", "cannot be read|holds no", {"x.stl": b"\xff\x00" * 50}),
    "mesh that is no number": (
        mesh("x.obj"), "urdf", "vertices that are no numbers", {"x.obj": OBJ.replace(b"v 1", b"v nan")}),
    "mesh of a part that is no number": (
        mesh("x.obj"), "urdf", "vertices that are no numbers",
        {"x.obj": OBJ + b"v nan 0 0\nv 2 0 0\nf 2 5 6\n"}),
    "mesh of no size": (mesh('x.obj" scale="1 0 1'), "urdf", "scale 1 0 1, at least", {"x.obj": OBJ}),
    "mesh without thickness": (
        mesh("x.obj"), "urdf", "x.obj: a mesh that is flat", {"x.obj": OBJ.replace(b"0 0 1", b"1 1 0")}),
    "mesh of almost no thickness": (
        mesh("x.obj"), "urdf", "x.obj: a mesh that is flat", {"x.obj": OBJ.replace(b"0 0 1", b"1 1 5e-6")}),
    "leaning mesh without thickness": (
        mesh("x.obj"), "urdf", "x.obj: a mesh that is flat",
        {"x.obj": b"v 0 0 0\nv 1 0 1\nv 0 1 1\nv 1 1 2\nf 1 2 3\nf 2 4 3\n"}),
    "mesh that is far": (
        mesh("x.obj"), "urdf", "beyond", {"x.obj": OBJ.replace(b"v 1", b"v 1e300")}),
    "mesh of two dimensions": (
        mesh("x.off"), "urdf", "flat|cannot be read", {"x.off": b"OFF\n3 1 0\n0 0\n1 0\n0 1\n3 0 1 2\n"}),
    "mesh of wrong indices": (
        mesh("x.obj"), "urdf", "cannot be read", {"x.obj": OBJ + b"f 1 2 99999999\n"}),
    "replicate": (mjcf("<replicate count='1000000'><geom size='.1'/></replicate>"), "xml", "copies"),
    "replicate in replicate": (
        mjcf("<replicate count='99'>" * 5 + "<geom size='.1'/>" + "</replicate>" * 5), "xml", "copies"),
    "composite": (
        mjcf("<composite type='cable' count='9999 1 1' size='1'/>"), "xml", "copies"),
    "flexcomp": (mjcf("<flexcomp type='grid' count='999 999 9' name='f'/>"), "xml", "copies"),
    "models in models": (
        mjcf(head="<asset><model name='m' file='m0.xml'/></asset>", body="<attach model='m' prefix='a'/>"),
        "xml", "attaches others",
        {f"m{n}.xml": (f"<mujoco><asset><model name='m' file='m{n + 1}.xml'/></asset><worldbody><body>"
                       "<attach model='m' prefix='a'/><attach model='m' prefix='b'/></body></worldbody></mujoco>"
                       ).encode() for n in range(40)}),
    "texture": (
        mjcf(head="<asset><texture builtin='flat' width='99999' height='99999'/></asset>"), "xml",
        "at most 8192"),
    "picture": (
        mjcf(head="<asset><texture name='t' type='2d' file='x.png'/></asset>"), "xml", "too many",
        {"x.png": PNG}),
    "height field": (mjcf(head="<asset><hfield nrow='99999' ncol='99999'/></asset>"), "xml", "8192"),
    "memory": (mjcf(head="<size memory='900G'/>"), "xml", "4 GB"),
    "user data": (mjcf(head="<size nuser_body='100000000'/>"), "xml", "at most 1000"),
    "bodies": (mjcf("<body><geom size='.1'/></body>" * 2500), "xml", "2,502 bodies"),
    "nan in MJCF": (mjcf("<body><geom size='nan'/></body>"), "xml", "must be numbers"),
    "huge in MJCF": (mjcf("<body><geom size='1e200'/></body>"), "xml", "above"),
    "links": (
        urdf(("</robot>", "".join(f'<link name="l{n}"/>' for n in range(2500)) + "</robot>")), "urdf",
        "2,505 links"),
    "shapes": (
        urdf(("</collision>", "</collision>" + '<visual><geometry><sphere radius="1"/></geometry></visual>' * 10_001)),
        "urdf", "shapes"),
    "chain of wheels": (
        urdf(("</robot>", "".join(
            f'<link name="c{n}"/><joint name="wheel{n}" type="continuous"><parent link="c{n - 1}"/>'
            f'<child link="c{n}"/><axis xyz="0 1 0"/></joint>' for n in range(1, 1900)).join(
            ('<link name="c0"/><joint name="f" type="fixed"><parent link="base_link"/><child link="c0"/></joint>',
             "</robot>")))), "urdf", "no geometry|no mass"),
    # numbers and names
    "mass": (urdf(('mass value="8"', 'mass value="1e300"')), "urdf", "at most"),
    "loop of all": (
        urdf(("</robot>", BACK.format(parent="wheel_1"))), "urdf",
        "form a loop of the links (base_link, wheel_1|wheel_1, base_link)$"),
    "loop beside a root": (
        urdf(("</robot>", '<link name="a"/>' + BACK.format(parent="wheel_1"))), "urdf",
        "form a loop of the links (base_link, wheel_1|wheel_1, base_link)$"),
    "mass of other digits": (
        urdf(('mass value="8"', 'mass value="\u0663"')), "urdf", "must be a number"),
    "mass with underscores": (
        urdf(('mass value="8"', 'mass value="1_0"')), "urdf", "must be a number"),
    "mass nan": (urdf(('mass value="8"', 'mass value="nan"')), "urdf", "must be a number"),
    "inertia": (urdf(('ixx="1"', 'ixx="1e300"')), "urdf", "at most"),
    "origin": (urdf(('<origin xyz="0.2', '<origin xyz="1e300')), "urdf", "at most"),
    "axis": (urdf(("0 1 0", "1e300 1e300 0")), "urdf", "at most"),
    "box": (urdf(("0.6 0.3 0.1", "1e300 1 1")), "urdf", "must be 1e-06 to"),
    "thin box": (urdf(("0.6 0.3 0.1", "1e-300 1 1")), "urdf", "must be 1e-06 to"),
    "name of a newline": (urdf(('"wheel_0"', '"a&#10;b"')), "urdf", r"'a\\nb'"),
    "name of an escape": (
        xacro("<xacro:element xacro:name=\"link\" name=\"${'\\x1b[31m'}\"/>"), "xacro", r"\\x1b\[31m"),
    "long name": (urdf(('"r"', f'"{"r" * 5000}"')), "urdf", "at most 200 characters"),
    "encoding": ('<?xml version="1.0" encoding="no-such"?>' + urdf(), "urdf", "not XML|as text"),
    "no text": ("\0\1\2", "urdf", "not XML"),
    "nothing": ("", "urdf", "not XML"),
    "another root": ("<sdf/>", "urdf", "is a <sdf>"),
}  # fmt: skip


@pytest.fixture(scope="module")
def ground(tmp_path_factory):
    """A folder with secrets, and in it that of a package with what attacks need."""
    folder = tmp_path_factory.mktemp("ground")
    for end in ("xacro", "xml", "stl", "urdf"):
        text = f'<robot><link name="{SECRET}"/></robot>'
        (folder / f"secret.{end}").write_text(text)
    kit = folder / "kit" / "urdf"
    kit.mkdir(parents=True)
    (kit / "link.xacro").symlink_to(folder / "secret.xacro")
    (kit / "folder").symlink_to(folder)
    (kit / "zero.stl").symlink_to("/dev/zero")
    (kit / "meshes").mkdir()
    for name in ("pipe", "pipe.stl"):
        os.mkfifo(kit / name)
    return kit


@pytest.mark.parametrize("name", ATTACKS)
def test_it_is_one_line(ground, name, monkeypatch, capfd):
    monkeypatch.chdir(ground)
    text, end, why, *beside = ATTACKS[name]
    file = ground / ("pipe" if text is None else f"rover.{end}")
    if text is not None:
        file.write_text(text)
    for other, data in beside[0].items() if beside else ():
        (ground / other).write_bytes(data)
    before = sorted(ground.parent.rglob("*"))
    if why:
        with pytest.raises((DataError, RecipeError), match=why) as caught:
            resolve_rover(FileRover(file=file.name), ground)
        told = str(caught.value)
        assert told.isprintable()
        assert len(told) < 700
        assert SECRET not in told
    else:
        resolve_rover(FileRover(file=file.name), ground)
    assert sorted(ground.parent.rglob("*")) == before
    assert capfd.readouterr() == ("", "")


def test_there_are_many():
    assert len(ATTACKS) > 100
