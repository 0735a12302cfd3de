"""A machine without a network is told what to do."""

import pytest
import requests

from terrain_forge.base import DataError
from terrain_forge.dtm import download


def test_a_server_that_is_not_reached_may_mean_offline(monkeypatch):
    def unreachable(*_, **__):
        raise requests.ConnectionError("Failed to resolve")

    monkeypatch.delenv(download.OFFLINE, raising=False)
    monkeypatch.setattr(requests.Session, "get", unreachable)
    with pytest.raises(DataError, match=r"dem cannot be had: x.org is not reached.*Offline.*copy"):
        download.ask("https://x.org/dem.tif", "dem", wish="dem")
