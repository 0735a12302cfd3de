"""What `${…}` in a rover's file may say, and what of xacro is known."""

import math

import pytest

from terrain_forge.base import DataError
from terrain_forge.rovers.expressions import evaluate, substitute
from terrain_forge.rovers.macros import read_macros

NAMES = {"width": 0.5, "size": (1.0, 2.0, 3.0), "detailed": True, "side": "left"}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * width - 3 / 4", 1.25),
        ("-width ** 2", -0.25),
        ("size[1] + size[2]", 5.0),
        ("sqrt(16) + cos(pi) + max(1, 2)", 5.0),
        ("radians(180) == pi", True),
        ("0.1 if not detailed else 0.2", 0.2),
        ("detailed and width < 1 or 1 / 0 > 2", True),
        ("side == 'left'", True),
    ],
)
def test_arithmetic(text, value):
    assert evaluate(text, NAMES) == value


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("lambda: 1", "only arithmetic"),
        ("(lambda: 1)()", "only arithmetic"),
        ("size.__class__", "only arithmetic"),
        ("().__class__.__bases__", "only arithmetic"),
        ("__import__('os')", "only arithmetic"),
        ("sqrt.__self__", "only arithmetic"),
        ("eval('1')", "only arithmetic"),
        ("[x for x in size]", "only arithmetic"),
        ("f'{width}'", "only arithmetic"),
        ("(a := 1)", "only arithmetic"),
        ("max(*size)", "only arithmetic"),
        ("size[-1]", "only arithmetic"),
        ("size[0:2]", "only arithmetic"),
        ("1j", "only arithmetic"),
        ("1 < 2 < 3", "only arithmetic"),
        ("side * 1000", "is no number"),
        ("9 ** 9 ** 9", "math range error"),
        ("(-1) ** 0.5", "math domain error"),
        ("1 / 0", "division by zero"),
        ("1e308 * 10", "no finite value"),
        ("size[7]", "out of range"),
        ("width[0]", "not subscriptable"),
        ("height", "unknown name 'height'"),
        ("1 +", "invalid syntax"),
        ("", "invalid syntax"),
        ("+".join(["1"] * 300), "more than 500"),
        ("(" * 240 + "1" + ")" * 240, "parenthes"),
        ("-" * 499 + "1", ""),
    ],
)
def test_what_is_more_than_arithmetic_is_refused(text, why):
    if text.startswith("---"):  # deep, but no more than arithmetic
        assert evaluate(text, NAMES) == -1
        return
    with pytest.raises(ValueError, match=why):
        evaluate(text, NAMES)


def test_texts_take_values():
    assert substitute("${width} 0 ${2 * width}", NAMES) == "0.5 0 1.0"
    assert substitute(" ${size} ", NAMES) == NAMES["size"]
    assert substitute("wheel_${side}", NAMES) == "wheel_left"
    assert substitute("$5", NAMES) == "$5"


ROBOT = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'


def expanded(folder, body, **names):
    file = folder / "robot.xacro"
    file.write_text(ROBOT.format(body))
    return read_macros(file, names, library=folder)


def test_macros_properties_and_conditions(tmp_path):
    (tmp_path / "more.xml").write_text(ROBOT.format('<xacro:property name="z" value="0.25"/>'))
    robot = expanded(
        tmp_path,
        """<xacro:include filename="more.xml"/>
        <xacro:macro name="leg" params="name at length:=${2*z}">
          <xacro:property name="hidden" value="${at + 1}"/>
          <link name="leg_${name}" x="${at}" l="${length}" h="${hidden}">
            <xacro:if value="${at &lt; 0}"><back/></xacro:if>
            <xacro:unless value="false"><mass>${tall}</mass></xacro:unless>
          </link>
        </xacro:macro>
        <xacro:leg name="front" at="1"/>
        <xacro:leg name="rear" at="-1" length="${z}"/>""",
        tall=2.5,
    )
    front, rear = robot.findall("link")
    assert front.attrib == {"name": "leg_front", "x": "1", "l": "0.5", "h": "2.0"}
    assert rear.attrib == {"name": "leg_rear", "x": "-1", "l": "0.25", "h": "0.0"}
    assert [child.tag for child in front] == ["mass"]
    assert [child.tag for child in rear] == ["back", "mass"]
    assert rear.findtext("mass") == "2.5"
    assert math.isclose(float(front.findtext("mass")), 2.5)


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ('<link name="${nobody}"/>', "unknown name 'nobody'"),
        ("<xacro:foo/>", "<xacro:foo>"),
        ('<xacro:include filename="../none.xml"/>', "No such file"),
        ('<xacro:macro name="m" params="a"><link/></xacro:macro><xacro:m/>', "lacks 'a'"),
        ('<xacro:macro name="m" params=""><xacro:m/></xacro:macro><xacro:m/>', "30 deep"),
        ('<xacro:property name="a"/>', "value"),
    ],
)
def test_what_is_wrong_names_the_file(tmp_path, body, why):
    with pytest.raises(DataError, match=f"robot.xacro: .*{why}"):
        expanded(tmp_path, body)
