"""The Sun by date against other ephemerides, where they are installed."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from terrain_forge.model import BODIES
from terrain_forge.sky import days_of, look_up
from tests.helpers.ephemerides import MODULES, rows

pytestmark = pytest.mark.consumer


def test_random_moments_and_places_agree():
    for module in MODULES:
        pytest.importorskip(module)
    for row in rows(400, 11, days_of):
        lonlat = tuple(np.radians(row["lonlat_deg"]))
        days = days_of(datetime.fromisoformat(row["time"]))
        above = look_up(BODIES[row["body"]].ephemeris, lonlat, np.array([days]))
        for name in {"sun", "earth"} & set(row):
            apart = np.linalg.norm(getattr(above, name)[0] - row[name])
            assert np.degrees(apart) < 0.06, row


def test_time_scales_agree_with_astropy():
    time = pytest.importorskip("astropy.time")
    for year in range(1972, 2027):
        for month in (1, 2, 7, 8):
            moment = datetime(year, month, 1, 0, 0, 1, tzinfo=UTC)
            terrestrial = time.Time(moment.replace(tzinfo=None), scale="utc").tt
            days = (terrestrial.jd1 - 2451545.0) + terrestrial.jd2
            assert days_of(moment) == pytest.approx(days, abs=1e-8)
