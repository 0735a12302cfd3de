"""Recipes of level ground that tests share."""

from __future__ import annotations

import terrain_forge as tf


def flat(size, spacing, *, shapes=None, lonlat=None, terrain=None, **changes) -> tf.Recipe:
    """A recipe of level ground of a size and spacing [m], on Mars unless it says otherwise.

    Args:
        shapes: How many its rocks have.
        lonlat: Where it lies [degrees].
        terrain: What its terrain says besides.
        changes: What else it says.
    """
    rocks = {} if shapes is None else {"rocks": tf.RocksSpec(library=tf.LibrarySpec(shapes=shapes))}
    plain = {
        "name": "flat",
        "body": "mars",
        "dtm": tf.FlatDtm(size_m=size, lonlat_deg=lonlat),
        "terrain": tf.TerrainSpec(spacing_m=spacing, **(terrain or {})),
    }
    return tf.Recipe(**{**plain, **rocks, **changes})
