"""What the ground is made of, place by place: bedrock, lag, sand, dust on the body's regolith.

Each material lies where its mask and its patches let it, a later one on those before it. It has a
colour, a grain and a friction of its own. All of it is addressed by position, so that it never
repeats and is the same in every window.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    FileName,
    Fraction,
    Key,
    Positive,
    RecipeError,
    Spec,
    linear_from_srgb,
    srgb_from_linear,
    stage_key,
)
from terrain_forge.model import Body, GroundMaterial, Heightfield, Site, Soil, Window
from terrain_forge.terrain.masks import Mask, mask_weight
from terrain_forge.terrain.noise import octaves

MOST_MATERIALS = 15
"""Materials that a recipe may have, besides the regolith."""
WIDEST_PATCH = 10
"""Lengths of the site that a patch may have at most."""
_OCTAVES = 6
_FALL = 0.6
_SAMPLES, _QUANTILES = 256, 2048
"""Of the patches' noise: places each way that it is known from, and steps of its distribution."""

MaterialKind = Literal["regolith", "bedrock", "lag", "sand", "dust", "own"]


class _Kind(NamedTuple):
    """What a kind of ground is like where the recipe does not say."""

    windy: tuple[float, float, float]
    """Linear colour over the regolith's on a body with wind."""
    airless: tuple[float, float, float]
    """As `windy`, on one without."""
    pebbles: float
    """Share of places that hold a small stone."""
    roughness: float
    """Rise of its fine relief over that of the body's regolith."""
    slabs: float
    """How much it is jointed into slabs."""
    surface: Literal["usual", "loose", "bedrock"]
    """Whose friction it has: the regolith's, the lowest of it, or bedrock's."""


_KINDS: dict[str, _Kind] = {
    "regolith": _Kind((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), 0.6, 1.0, 0.0, "usual"),
    "bedrock": _Kind((1.10, 1.16, 1.20), (1.25, 1.25, 1.25), 0.25, 0.7, 1.0, "bedrock"),
    "lag": _Kind((0.72, 0.80, 0.86), (1.08, 1.08, 1.08), 1.0, 1.2, 0.0, "usual"),
    "sand": _Kind((0.60, 0.71, 0.80), (0.96, 0.96, 0.96), 0.02, 0.45, 0.0, "loose"),
    "dust": _Kind((1.43, 1.30, 1.23), (1.04, 1.04, 1.04), 0.12, 0.6, 0.0, "loose"),
    "own": _Kind((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), 0.4, 1.0, 0.0, "usual"),
}


@dataclass(frozen=True, kw_only=True)
class MaterialSpec(Spec):
    """One kind of ground, and where it lies."""

    kind: MaterialKind
    """What it is. `bedrock`: slabs flush with the soil, between joints; `lag`: pebbles that the
    wind has left; `sand`: dark and fine; `dust`: bright and fine; `regolith`: as elsewhere; `own`:
    nothing is assumed, so that it needs a colour and a friction."""
    name: FileName | None = None
    """What truth calls it; without it, its kind."""
    mask: Mask | None = None
    """Where it lies; without it, everywhere that its patches let it."""
    cover: Annotated[float, Interval(gt=0, le=1)] = 1.0
    """Share of that place which it covers, in patches with edges."""
    patch_m: Positive = 4.0
    """Size of its largest patches [m], at most ten times the site's longer side; each has finer
    ones at its edge."""
    rgb: tuple[Fraction, Fraction, Fraction] | None = None
    """sRGB colour of it where it is level, 0 to 1 each; without it by its kind, from the ground's.
    """
    friction: Positive | None = None
    """Coefficient of sliding friction of wheels on it; without it by its kind, from the body's:
    bedrock's, the lower end of the regolith's for sand and dust, the regolith's."""
    pebbles: Fraction | None = None
    """Share of places that hold a pebble, which says how many crumbs its soil has too, in pictures
    alone; without it by its kind."""

    def __post_init__(self) -> None:
        if self.mask is None and self.cover == 1.0:
            raise ValueError("a material needs a mask or a cover below 1: it would hide all others")
        if self.kind == "own":
            missing = [name for name in ("rgb", "friction") if getattr(self, name) is None]
            if missing:
                raise ValueError(f"kind own needs {' and '.join(missing)}: nothing else tells them")

    @property
    def label(self) -> str:
        """What truth calls it."""
        return self.name or self.kind


def check_materials(specs: tuple[MaterialSpec, ...], site: Site) -> None:
    """Refuse materials that a site cannot have, too many of them, or two with one name.

    Raises:
        RecipeError, DataError: for the first that is wrong.
    """
    if len(specs) > MOST_MATERIALS:
        raise RecipeError(
            f"{len(specs)} materials, at most {MOST_MATERIALS}", key=("terrain", "materials")
        )
    named = set[str]()
    for number, spec in enumerate(specs):
        key: Key = ("terrain", "materials", number)
        if spec.label.lower() == "ground":
            raise RecipeError(
                "'ground' is what the ground without materials is called: give it another name",
                key=(*key, "name"),
            )
        if spec.label.lower() in named:
            raise RecipeError(
                f"a material before is called {spec.label!r} too: give each a name of its own",
                key=(*key, "name"),
            )
        named.add(spec.label.lower())
        widest = WIDEST_PATCH * max(site.size)
        if spec.patch_m > widest:
            raise RecipeError(
                f"{spec.patch_m:g} m: at most {widest:g} m, {WIDEST_PATCH} times the longer side "
                "of the site, which would lie wholly in a patch or beside it",
                key=(*key, "patch_m"),
            )
        if spec.mask is not None:
            spec.mask.check(site=site, key=(*key, "mask"))


def ground_materials(
    specs: tuple[MaterialSpec, ...], *, body: Body, soil: Soil
) -> tuple[GroundMaterial, ...]:
    """The regolith, which is such soil, and the materials on it."""
    usual = MaterialSpec(kind="regolith", name="ground", cover=0.5)
    return tuple(_made(spec, body, soil) for spec in (usual, *specs))


def soil_tint(kind: str, body: Body) -> Array:
    """Linear colour of a kind of ground over that of the regolith, shape [3]."""
    found = _KINDS[kind]
    return np.array(found.airless if body.airless else found.windy)


def _made(spec: MaterialSpec, body: Body, soil: Soil) -> GroundMaterial:
    kind, friction = _KINDS[spec.kind], body.friction
    if spec.kind == "regolith":
        kind = kind._replace(pebbles=soil.pebbles, roughness=soil.roughness)
    of_kind = {
        "usual": friction.regolith.coefficient,
        "loose": friction.regolith.lowest,
        "bedrock": friction.bedrock.coefficient,
    }[kind.surface]
    of_soil = linear_from_srgb(soil.rgb) * soil_tint(spec.kind, body)
    own = linear_from_srgb(spec.rgb) if spec.rgb else of_soil
    return GroundMaterial(
        name=spec.label,
        kind=spec.kind,
        rgb=tuple(srgb_from_linear(np.clip(own, 0.0, 1.0)).tolist()),
        friction=of_kind if spec.friction is None else spec.friction,
        pebbles=kind.pebbles if spec.pebbles is None else spec.pebbles,
        roughness=kind.roughness,
        slabs=kind.slabs,
    )


def classify_ground(
    specs: tuple[MaterialSpec, ...], *, site: Site, window: Window, around: Window, heights: Array
) -> NDArray[np.uint8]:
    """Which material lies at the window's nodes: 0 for the regolith, n for the nth of `specs`.

    A node has the same one in every window.

    Args:
        specs: The materials.
        site: The site.
        window: The nodes that are wanted.
        around: The nodes of `heights`, which reach `Mask.reach` beyond the window or to the site's
            edge.
        heights: Heights [m], shape [rows, columns] of `around`.
    """
    found = np.zeros((window.rows + 1, window.columns + 1), np.uint8)
    east, north = site.axes(window)
    own = window.nodes_in(around)
    for number, spec in enumerate(specs, 1):
        share = np.full(found.shape, spec.cover)
        if spec.mask is not None:
            weight = mask_weight(spec.mask, site=site, window=around, elevation=heights)
            share *= weight[own]
        rank = patch_ranks(spec, site=site, east=east, north=north, cell=site.spacing)
        found[rank < share] = number
    return found


def patch_ranks(
    spec: MaterialSpec,
    *,
    site: Site,
    east: Array,
    north: Array,
    cell: float,
    turn: Array | None = None,
) -> Array:
    """Where a material lies first: it covers the nodes of a grid whose rank is below its share.

    Args:
        spec: The material.
        site: The site.
        east: Of the columns [m].
        north: Of the rows [m].
        cell: How closely the nodes lie [m]: finer patches are left out.
        turn: 2 × 2 matrix from the two to the site's east and north; none where they are that.

    Returns:
        Ranks, evenly spread over 0 to 1, shape [rows, columns].
    """
    key = stage_key(site.seed, f"material/{spec.label}")
    count = max(int(np.count_nonzero(_waves(spec.patch_m, _OCTAVES) >= cell)), 1)
    noise = _patches(key, east, north, spec.patch_m, count, turn)
    ranks = (np.arange(_QUANTILES) + 0.5) / _QUANTILES
    return np.asarray(np.interp(noise, _quantiles(count), ranks))


def _waves(patch: float, count: int) -> Array:
    return np.asarray(patch * 0.5 ** np.arange(float(count)))


def _patches(
    key: np.uint64,
    east: Array,
    north: Array,
    patch: float,
    count: int,
    turn: Array | None = None,
) -> Array:
    """Noise of some octaves, the longest as wide as a patch [m]."""
    fall, waves = _FALL ** np.arange(float(count)), _waves(patch, count)
    return octaves(key, east=east, north=north, wavelengths=waves, amplitudes=fall, turn=turn)


@cache
def _quantiles(count: int) -> Array:
    """Values of the patches' noise that equal shares of all places lie below."""
    key, apart = stage_key(0, "material-quantiles"), 0.5 * (1.0 + np.sqrt(5.0))
    at = apart * np.arange(float(_SAMPLES))  # in patches, never twice at one place of the lattice
    noise = np.sort(_patches(key, at, at, 1.0, count), axis=None)
    return np.asarray(noise.reshape(_QUANTILES, -1).mean(axis=1))


def materials_reach(specs: tuple[MaterialSpec, ...], site: Site) -> float:
    """How far around a node its material looks at the ground [m]."""
    return max((spec.mask.reach(site) for spec in specs if spec.mask is not None), default=0.0)


def of_window(ground: Heightfield, site: Site, window: Window) -> Array:
    """The ground's heights at the nodes of a window that lies in it [m]."""
    column, row = site.first_node(ground)
    rows = slice(window.row - row, window.row - row + window.rows + 1)
    columns = slice(window.column - column, window.column - column + window.columns + 1)
    return ground.elevation[rows, columns].astype(np.float64)
