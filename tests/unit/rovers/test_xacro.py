"""Our expansion of xacro files makes what the package xacro makes, feature by feature."""
# ruff: noqa: E501 - the lines are those of files

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from terrain_forge.base import DataError
from terrain_forge.rovers.macros import expand_trusted, expand_xacro
from terrain_forge.rovers.packages import Packages
from tests.helpers.places import DATA

ROBOT = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
LEG = '<xacro:macro name="leg" params="name x:=1 y:=${2*2}"><leg n="${name}" x="${x}" y="${y}"/></xacro:macro>'
FEATURES = {
    "numbers stay what they are": """<xacro:property name="i" value="1"/>
        <a n="wheel_${i+1}" f="${i/2}" g="${7//2} ${-7//2} ${7%3} ${2**3} ${2**-1} ${2.0*3}"/>
        <b x="${1e-3}" y="${0.1+0.2}" z="${10**15}" s="${-i} ${+i} ${not i}" t="${pi}"/>""",
    "texts": """<xacro:property name="side" value="left"/><xacro:property name="n" value="'7'"/><q n="${n + 1}"/>
        <a n="${side}_${'wheel'}" m="${side + '_arm'}" eq="${side == 'left'}" i="${side[0]}"/>
        <b l="${len(side)}" in="${'ef' in side} ${'x' not in side}" u="1_000"/>""",
    "lists, tuples and dicts": """<xacro:property name="l" value="${[1, 2.5, 'x']}"/>
        <xacro:property name="d" value="${dict(a=1, b=[2, 3])}"/>
        <a i="${l[0]}" j="${l[-1]}" all="${l}" t="${(1, 2)}" in="${2.5 in l}" n="${len(l)}"/>
        <b a="${d['a']}" b="${d['b'][1] + 1}" c="${(l + [4])[3]}" m="${max([1, 5, 2])}"/>""",
    "functions": """<a s="${sqrt(16)}" c="${cos(0)}" m="${math.sin(pi/2)} ${math.pi}" r="${round(2.567, 1)}"
        h="${hypot(3, 4)}" x="${max(1, 2)} ${min(3, 2.5)} ${python.abs(-2)}" d="${degrees(pi)} ${radians(180)}"
        i="${int(3.7)} ${float(2)} ${str(5) + 'x'} ${bool(0)} ${floor(2.5)} ${ceil(2.1)} ${int('4')}"/>""",
    "choices": """<xacro:property name="n" value="3"/>
        <a v="${1 if n > 2 else 2}" w="${1 &lt; n &lt; 4}" o="${0 or 5}" p="${n and 'yes'}" q="${n is None}"/>
        <xacro:if value="${n == 3}"><yes/></xacro:if><xacro:unless value="true"><no/></xacro:unless>
        <xacro:if value="1"><one/></xacro:if><xacro:if value="False"><no/></xacro:if>
        <xacro:if value="${n}"><three/></xacro:if>""",
    "properties are evaluated when they are asked for": """<xacro:property name="a" value="${b*2}"/>
        <xacro:property name="b" value="3"/><x a="${a}"/><xacro:property name="b" value="4"/><x a="${a} ${b}"/>""",
    "eager properties": """<xacro:property name="b" value="3"/>
        <xacro:property name="a" value="${b*2}" lazy_eval="false"/><xacro:property name="b" value="4"/>
        <x a="${a}"/>""",
    "names of properties may be made": """<xacro:property name="k" value="len"/>
        <xacro:property name="${k}gth" value="2"/><x a="${length}"/>""",
    "defaults and removal": """<xacro:property name="a" value="1"/><xacro:property name="a" default="2"/>
        <xacro:property name="b" default="${a + 4}"/><x a="${a}" b="${b}"/>
        <xacro:property name="a" remove="true"/><xacro:property name="a" default="9"/><x a="${a}"/>""",
    "blocks": """<xacro:property name="o"><origin xyz="${1+1} 0 0"/><more/></xacro:property>
        <a><xacro:insert_block name="o"/></a><b><xacro:insert_block name="o"/></b>""",
    "scopes": """<xacro:macro name="m" params="v"><xacro:property name="p" value="${v}" scope="parent"/>
        <xacro:property name="g" value="${v+1}" scope="global"/><xacro:property name="own" value="5"/></xacro:macro>
        <xacro:macro name="outer" params=""><xacro:m v="7"/><in p="${p}"/></xacro:macro>
        <xacro:property name="own" value="1"/><xacro:outer/><out g="${g}" own="${own}"/><xacro:m v="2"/>
        <out p="${p}" g="${g}"/>""",
    "macros see their caller's names": """<xacro:macro name="m" params="a"><x s="${a} ${t}"/></xacro:macro>
        <xacro:macro name="n" params="t"><xacro:m a="1"/></xacro:macro><xacro:n t="2"/>""",
    "parameters": LEG.replace("y:=${2*2}", "y:=${2+1} p:='' z:='a b'")
    .replace("${y}", "${y} ${z}${p}") + '<xacro:leg name="a"/><xacro:leg name="b" x="${1/2}" y="u"/>',
    "parameters with = and spaces": """<xacro:macro name="m" params="a=1 b := 2 c:='x y' d"><x v="${a} ${b} ${c} ${d}"/>
        </xacro:macro><xacro:m d="true"/><xacro:m a="0.50" d="${'q'}" b="007"/>""",
    "forwarded parameters": """<xacro:macro name="m" params="a:=^ b:=^|2 c:=^|${3*2}"><x v="${a} ${b} ${c}"/></xacro:macro>
        <xacro:property name="a" value="1"/><xacro:m/><xacro:property name="b" value="9"/><xacro:m c="4"/>""",
    "block parameters": """<xacro:macro name="m" params="n *origin **more"><l n="${n}"><xacro:insert_block name="origin"/>
        <xacro:insert_block name="more"/></l></xacro:macro><xacro:property name="x" value="2"/>
        <xacro:m n="a"><origin xyz="${x} 0 0"/><ignored><one/><two v="${x}"/></ignored></xacro:m>""",
    "blocks are expanded by the caller": LEG + """<xacro:macro name="m" params="*b"><l><xacro:insert_block name="b"/></l>
        </xacro:macro><xacro:m><origin><xacro:leg name="k"/><xacro:if value="0"><no/></xacro:if></origin></xacro:m>""",
    "loops": """<xacro:macro name="loop" params="i n"><xacro:if value="${i &lt; n}"><w n="w_${i}" x="${i*0.5}"/>
        <xacro:loop i="${i+1}" n="${n}"/></xacro:if></xacro:macro><xacro:loop i="0" n="12"/>""",
    "macros in macros": """<xacro:macro name="outer" params=""><xacro:macro name="inner" params="v"><x v="${v}"/></xacro:macro>
        <xacro:inner v="1"/></xacro:macro><xacro:outer/>
        <xacro:macro name="m" params=""><one/></xacro:macro><xacro:m/>
        <xacro:macro name="m" params=""><two/></xacro:macro><xacro:m/>""",
    "call": LEG + '<xacro:property name="which" value="leg"/><xacro:call macro="${which}" name="a" x="3"/>',
    "element and attribute": """<xacro:element xacro:name="${'link'}" name="a"><xacro:attribute name="x" value="x${1+1}"/>
        <in/></xacro:element><b><xacro:attribute name="${'k'}" value="v"/><xacro:if value="1">
        <xacro:attribute name="lost" value="v"/></xacro:if></b>""",
    "arguments": """<xacro:arg name="gpu" default="false"/><xacro:arg name="n" default="${1+1}"/>
        <xacro:arg name="n" default="9"/><x v="$(arg n)" w="a_$(arg n)_b" e="${$(arg n) * 3}" f="${xacro.arg('n')}"/>
        <xacro:if value="$(arg gpu)"><gpu/></xacro:if><xacro:unless value="$(arg gpu)"><cpu/></xacro:unless>
        <xacro:property name="p" value="$(arg n)"/><y v="${p + 1}" s="${'$(arg gpu)' == 'false'}"/>""",
    "eval and optenv": """<xacro:arg name="n" default="4"/><x v="$(eval n * 2)" w="$(eval 1 + 2 > 2)"
        o="$(optenv NO_SUCH_THING 1 2 3)" e="$(optenv NO_SUCH_THING)."/>""",
    "dollars": """<x a="$${b}" c="$$(d)" e="5$" f="a $b c"/><t>$${x} 3$</t>""",
    "comments and text": """<!-- ${nobody} $(arg none) --><a>${1+1} m<b/></a><hardware> x/${'y'} </hardware>""",
    "attributes of xacro": """<a xacro:note="n" v="1"/>""",
    "constants can be hidden": """<xacro:property name="e" value="2"/><x v="${e}" t="${tau}"/>""",
}  # fmt: skip
FILES = {
    "kit.yaml": "wheels: [{radius: 0.1}, {radius: 0.25}]\nlit: yes\narm:\n  name: long\n"
    "  limits: {turn: !degrees 180/2, free: true}\n",
    "merged.yaml": "a: &a {b: 1}\nc: {<<: *a}\n",
    "tagged.yaml": "a: !!python/name:os.system\n",
    "more.xacro": ROBOT.format(
        '<xacro:property name="z" value="0.25"/>' + LEG + "<more z='${z}'/>"
    ),
    "arm.xacro": ROBOT.format(
        '<xacro:property name="size" value="2"/><xacro:property name="twice" value="${size*2}"/>'
        '<xacro:macro name="arm" params="n"><arm n="${n}" s="${size}"/></xacro:macro>'
    ),
    "package.xml": "<package/>",
    "parts/wheel_a.xacro": ROBOT.format("<a/>"),
    "parts/wheel_b.xacro": ROBOT.format('<b/><xacro:include filename="sub/c.xacro"/>'),
    "parts/sub/c.xacro": ROBOT.format("<c/>"),
}
INCLUDES = {
    "files of YAML": """<xacro:property name="k" value="${xacro.load_yaml('kit.yaml')}"/>
        <x r="${k['wheels'][1]['radius']} ${k.wheels[1].radius * 2}" n="${len(k['wheels'])}" on="${k['lit']}"/>
        <xacro:if value="${k.arm.limits.free}"><y name="${k.arm.name}" turn="${k.arm.limits.turn}"/></xacro:if>""",
    "beside": '<xacro:include filename="more.xacro"/><xacro:leg name="a" x="${z}"/>',
    "twice": '<xacro:include filename="more.xacro"/><xacro:include filename="more.xacro"/>',
    "in a package": '<xacro:include filename="$(find kit)/more.xacro"/>'
    '<xacro:include filename="${\'$(find kit)\'}/parts/wheel_b.xacro"/>',
    "many": '<xacro:include filename="parts/wheel_*.xacro"/>',
    "a namespace": '<xacro:include filename="arm.xacro" ns="left"/><xacro:include filename="arm.xacro" '
    'ns="right"/><xacro:left.arm n="1"/><xacro:call macro="right.arm" n="2"/><x s="${left.twice + right.size}"/>',
    "within a condition": '<xacro:if value="1"><xacro:include filename="more.xacro"/></xacro:if><x v="${z}"/>',
    "what may be missing": '<xacro:include filename="none.xacro" optional="true"/><x/>',
}  # fmt: skip


def canonical(element):
    """A tree without what is written differently: order of attributes, blanks, namespaces."""
    texts = [element.text, *(child.tail for child in element)]
    own = {k: v for k, v in element.attrib.items() if not k.startswith("xmlns")}
    text = "".join("".join(filter(None, texts)).split())
    return element.tag, sorted(own.items()), text, [canonical(child) for child in element]


def compare(file, packages):
    ours, included = expand_xacro(file, packages)
    text, theirs = expand_trusted(file, packages)
    assert canonical(ours) == canonical(ET.fromstring(text))
    assert {path.resolve() for path in included} <= {path.resolve() for path in theirs}
    return ours


@pytest.fixture
def kit(tmp_path):
    folder = tmp_path / "kit"
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


@pytest.mark.filterwarnings("ignore")  # what the package says of old words
@pytest.mark.parametrize("name", [*FEATURES, *INCLUDES])
def test_it_expands_as_the_package_does(kit, name):
    pytest.importorskip("xacro")
    file = kit / "robot.xacro"
    file.write_text(ROBOT.format({**FEATURES, **INCLUDES}[name]))
    robot = compare(file, Packages({}, file))
    assert len(robot)


@pytest.mark.parametrize("file", sorted((DATA / "rover").rglob("*.xacro")), ids=lambda f: f.stem)
def test_real_files_expand_as_the_package_does(file):
    pytest.importorskip("xacro")
    packages = Packages({}, file)
    try:
        expand_trusted(file, packages)
    except DataError:
        with pytest.raises(DataError):  # a part that is nothing without the others
            expand_xacro(file, packages)
        return
    compare(file, packages)


def test_what_the_package_cannot_say(kit):
    """The folder of a file, a dict, parentheses in $(eval …), a loop of 200."""
    file = kit / "robot.xacro"
    loop = FEATURES["loops"].replace('n="12"', 'n="200"')
    file.write_text(ROBOT.format(f'<x v="$(dirname)"/>{loop}'))
    robot, _ = expand_xacro(file, Packages({}, file))
    assert robot[0].get("v") == str(kit.resolve())
    assert len(robot) == 201


def test_the_environment_is_never_read(kit, monkeypatch):
    monkeypatch.setenv("SECRET", "password")
    file = kit / "robot.xacro"
    file.write_text(ROBOT.format('<x v="$(optenv SECRET no)" w="$(eval optenv(\'SECRET\', 3))"/>'))
    assert expand_xacro(file, Packages({}, file))[0][0].attrib == {"v": "no", "w": "3"}


WRONG = {
    '<link name="${nobody}"/>': "unknown name 'nobody'",
    "<xacro:foo/>": "<xacro:foo>: there is no macro",
    '<xacro:include filename="none.xml"/>': "no such file: none.xml",
    '<xacro:macro name="m" params="a"><l/></xacro:macro><xacro:m/>': "<xacro:m> lacks 'a'",
    '<xacro:macro name="m" params="a:=^"><l/></xacro:macro><xacro:m/>': "lacks 'a', and so does",
    '<xacro:macro name="m" params="*a"><l/></xacro:macro><xacro:m/>': "lacks the block",
    '<xacro:macro name="m" params=""><l/></xacro:macro><xacro:m><x/></xacro:m>': "no use for <x>",
    '<xacro:macro name="m" params=""><l/></xacro:macro><xacro:m b="1"/>': "no parameter 'b'",
    '<xacro:macro name="m" params="a:=\'b"/>': "params .* cannot be read",
    '<xacro:macro name="m" params=""><xacro:m/></xacro:macro><xacro:m/>': "250 deep",
    '<xacro:property name="a" value="${a}"/><x v="${a}"/>': "'a' is defined by itself",
    '<xacro:property name="a" value="${b}"/><xacro:property name="b" value="${a}"/><x v="${a}"/>':
        "defined by itself",
    '<xacro:property name="1a" value="1"/>': "is no name of a property",
    '<xacro:property name="__a" value="1"/>': "is no name of a property",
    "<xacro:property value='1'/>": "lacks 'name'",
    '<xacro:if value="maybe"><x/></xacro:if>': "'maybe', neither true nor false",
    '<xacro:insert_block name="b"/>': "there is no block 'b'",
    '<x v="${1"/>': "has no end",
    '<x v="$(arg nobody)"/>': "no <xacro:arg> 'nobody'",
    '<x v="$(env HOME)"/>': "environment is not read",
    '<x v="$(cwd)"/>': "not known",
    '<xacro:left.arm/>': "no namespace 'left'",
    "<x v=\"${xacro.load_yaml('missing.yaml')}\"/>": "no such file: missing.yaml",
    "<x v=\"${xacro.load_yaml('merged.yaml')}\"/>": "merges .* are not read",
    "<x v=\"${xacro.load_yaml('tagged.yaml')}\"/>": "could not determine a constructor",
    "<x v=\"${xacro.load_yaml('kit.yaml').items()}\"/>": "only arithmetic",
}  # fmt: skip


@pytest.mark.parametrize("body", WRONG)
def test_what_is_wrong_names_the_file(kit, body):
    file = kit / "robot.xacro"
    file.write_text(ROBOT.format(body))
    with pytest.raises(DataError, match=WRONG[body]) as caught:
        expand_xacro(file, Packages({}, file))
    assert "robot.xacro" in str(caught.value) or "no such file" in str(caught.value)


def test_names_from_outside_are_known(tmp_path):
    file = Path(tmp_path / "r.xacro")
    file.write_text(ROBOT.format('<x v="${tall * 2}" w="${size[1]}"/>'))
    robot, _ = expand_xacro(file, Packages({}, file), names={"tall": 2.5, "size": (1.0, 2.0)})
    assert robot[0].attrib == {"v": "5.0", "w": "2.0"}
