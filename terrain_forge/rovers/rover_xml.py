"""XML that others wrote, read within bounds: no entities, no endless nesting, names as written."""

from __future__ import annotations

from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from terrain_forge.base import DataError

KEY = ("rover", "file")
_DEEPEST = 200
"""Elements within elements."""
_MOST = 200_000
"""Elements of a file."""


def parse_xml(data: bytes, name: str) -> Element:
    """The root element; names keep their prefix, comments are dropped.

    Raises:
        DataError: if it is not XML, declares entities, or holds too much.
    """
    builder = TreeBuilder()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    count = depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count, depth
        count, depth = count + 1, depth + 1
        if depth > _DEEPEST or count > _MOST:
            what = f"elements {_DEEPEST} deep" if depth > _DEEPEST else f"{_MOST} elements"
            raise DataError(f"{name} has more than {what}", key=KEY)
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: object) -> int:
        raise DataError(f"{name} declares XML entities, which are not read", key=KEY)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = parser.ExternalEntityRefHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise DataError(f"{name} is not XML: {error}", key=KEY) from None
    except (ValueError, LookupError) as error:  # an encoding that nobody knows
        raise DataError(f"{name} cannot be read as text: {error}", key=KEY) from None
    return builder.close()
