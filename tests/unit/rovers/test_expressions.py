"""What `${…}` in a rover's file may say."""

import pytest

from terrain_forge.rovers.expressions import evaluate

NAMES = {
    "width": 0.5,
    "size": (1.0, 2.0, 3.0),
    "detailed": True,
    "side": "left",
    "text": "'" * 4000,
}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * width - 3 / 4", 1.25),
        ("-width ** 2", -0.25),
        ("size[1] + size[2]", 5.0),
        ("size[-1]", 3.0),
        ("sqrt(16) + math.cos(math.pi) + max(1, 2)", 5.0),
        ("radians(180) == pi", True),
        ("0.1 if not detailed else 0.2", 0.2),
        ("detailed and width < 1 or 1 / 0 > 2", True),
        ("side == 'left' and 1 < 2 < 3", True),
        ("7 // 2 + 7 % 3", 4),
        ("{'a': [1, 2]}['a'][1]", 2),
        ("int('7') + len(side)", 11),
        ("(" * 190 + "1" + ")" * 190, 1),
    ],
)
def test_arithmetic(text, value):
    assert evaluate(text, NAMES) == value
    assert type(evaluate(text, NAMES)) is type(value)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("lambda: 1", "only arithmetic"),
        ("(lambda: 1)()", "only arithmetic"),
        ("size.__class__", "only arithmetic"),
        ("().__class__.__bases__", "only arithmetic"),
        ("'{0.__class__}'.format(1)", "only arithmetic"),
        ("'%s' % side", "is no number"),
        ("__import__('os')", "only arithmetic"),
        ("sqrt.__self__", "unknown name"),
        ("math.__dict__", "only arithmetic"),
        ("math.factorial(10**9)", "only arithmetic"),
        ("eval('1')", "only arithmetic"),
        ("open('/etc/passwd')", "only arithmetic"),
        ("type(1)", "only arithmetic"),
        ("getattr(size, 'count')", "only arithmetic"),
        ("[x for x in size]", "only arithmetic"),
        ("f'{width}'", "only arithmetic"),
        ("(a := 1)", "only arithmetic"),
        ("max(*size)", "only arithmetic"),
        ("dict(**size)", "only arithmetic"),
        ("int(x=1)", "only arithmetic"),
        ("size[0:2]", "only arithmetic"),
        ("1j", "only arithmetic"),
        ("b'1'", "only arithmetic"),
        ("1 << 10 ** 9", "only arithmetic"),
        ("side * 1000", "is no number"),
        ("9 ** 9 ** 9", "math range error"),
        ("2 ** 63 * 2 ** 63 * 8", "128 bits"),
        ("(-1) ** 0.5", "math domain error"),
        ("1 / 0", "division by zero"),
        ("1e308 * 10", "no finite value"),
        ("round(5, -10 ** 9)", "20 digits"),
        ("text + text + text", "more than 10000"),
        ("size[7]", "out of range"),
        ("width[0]", "has no items"),
        ("height", "unknown name 'height'"),
        ("1 +", "invalid syntax"),
        ("", "invalid syntax"),
        ("+".join(["1"] * 600), "more than 1000"),
        ("(" * 240 + "1" + ")" * 240, "parenthes"),
        ("-" * 999 + "1", "too deep"),
        ("\0", "null bytes"),
    ],
)  # fmt: skip
def test_what_is_more_than_arithmetic_is_refused(text, why):
    with pytest.raises(ValueError, match=why):
        evaluate(text, NAMES)
