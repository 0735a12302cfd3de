"""The field's terms: words of our own that hid them do not come back."""

from __future__ import annotations

import re

from tests.helpers.places import ROOT

TEXTS = {
    "for the eye": "visual-only",
    "portrait": "rover picture",
    "grip": "friction",
    "rework": "re-export",
    "lend": "borrow",
    "lent": "borrowed",
    "require_room": "check_capacity",
    "rock_looks": "rock_materials",
}
"""What nobody looks for, and what the field calls it."""
OLD = re.compile(rf"(?<![a-z])({'|'.join(TEXTS)})(s|ing)?(?![a-z])", re.IGNORECASE)
FOLDERS = "terrain_forge", "exporters", "docs", "recipes"


def told():
    """All texts that people read, and names of files, with the place of each."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".pyi", ".md", ".yaml"):
                place = path.relative_to(ROOT)
                yield place, path.stem
                yield from ((place, line) for line in path.read_text("utf-8").splitlines())


def test_old_words_stay_away():
    found = {
        f"{place}: {old[0]}: say {TEXTS[old[1].lower()]}"
        for place, text in told()
        if (old := OLD.search(text))
    }
    assert not found
