"""The web that terrain models are fetched from."""

from __future__ import annotations

import pytest

from tests.helpers.web import served


@pytest.fixture
def web(monkeypatch, tmp_path):
    """An empty cache, and a server in the place of the real ones."""
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("TERRAIN_FORGE_OFFLINE")
    with served() as site:
        monkeypatch.setattr("terrain_forge.dtm.products.HIRISE", site.address)
        yield site
