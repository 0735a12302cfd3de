"""The colour of the ground: its regolith or the user's picture, mottled by noise and by relief."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    Fraction,
    RecipeError,
    Spec,
    kernel,
    linear_from_srgb,
    over_chunks,
    returning,
    srgb_from_linear,
    stage_key,
)
from terrain_forge.model import BODIES, Appearance, GroundMaterial, Heightfield, Site, Soil, Window
from terrain_forge.terrain.detail import DetailSpec, ground_detail
from terrain_forge.terrain.ground import STRIP
from terrain_forge.terrain.layer import Layer
from terrain_forge.terrain.masks import mask_weight, stencil_cells
from terrain_forge.terrain.materials import (
    MaterialSpec,
    classify_ground,
    ground_materials,
    materials_reach,
    of_window,
    soil_tint,
)
from terrain_forge.terrain.noise import octaves
from terrain_forge.terrain.orthoimage import OrthoimageSpec, orthoimage_albedo

if TYPE_CHECKING:
    SoilName = str
else:
    SoilName = Literal[tuple(soil.name for body in BODIES.values() for soil in body.soils)]

Laid = tuple[NDArray[np.float32], str]
"""How much soil was laid on the nodes of a window [m], shape [rows, columns], and its kind."""

_STENCIL_M = 1.0
_HIDING = 0.01
"""Soil that hides the ground beneath it [m]."""
_WAVELENGTHS = 23.0 * 0.5 ** np.arange(7.0)
_AMPLITUDES = 0.68 ** np.arange(7.0)
_STEPS = 4096
_ENCODED = np.rint(255.0 * srgb_from_linear((np.arange(_STEPS) / (_STEPS - 1)) ** 2))
"""sRGB bytes of linear light, which is spaced by its square root as sRGB nearly is."""


@dataclass(frozen=True, kw_only=True)
class AppearanceSpec(Spec):
    """What the ground looks like."""

    regolith: SoilName | None = None
    """What the ground is made of; without it the body's usual regolith."""
    ground_rgb: tuple[Fraction, Fraction, Fraction] | None = None
    """sRGB colour of level ground, 0 to 1 each, instead of the regolith's."""
    variation: Fraction = 0.5
    """How much colour and brightness vary over the ground: 0 not at all, 1 strongly."""
    orthoimage: OrthoimageSpec | None = None
    """A picture of the ground from above that its colour is taken from."""
    detail: DetailSpec | None = None
    """A picture of soil close by that is laid in tiles; without it a procedural one."""

    def __post_init__(self) -> None:
        if self.regolith is not None and self.ground_rgb is not None:
            raise ValueError("regolith or ground_rgb, not both")


def check_appearance(spec: AppearanceSpec, site: Site) -> None:
    """Refuse a soil of another body.

    Raises:
        RecipeError: says which soils the body has.
    """
    known = [soil.name for soil in site.body.soils]
    if spec.regolith is not None and spec.regolith not in known:
        raise RecipeError(
            f"{spec.regolith} is no soil of {site.body.name}, which has {', '.join(known)}",
            key=("terrain", "appearance", "regolith"),
        )


def stencil_reach(
    site: Site, layers: tuple[Layer, ...] = (), materials: tuple[MaterialSpec, ...] = ()
) -> float:
    """How far around a node its colour looks at the ground [m]: the margin that a window needs."""
    masks = [layer.mask.reach(site) for layer in layers if layer.mask is not None]
    own = stencil_cells(_STENCIL_M, site.spacing) * site.spacing
    return max(own, materials_reach(materials, site), *masks)


def colour_ground(
    *,
    site: Site,
    window: Window,
    ground: Heightfield,
    spec: AppearanceSpec,
    layers: tuple[Layer, ...] = (),
    materials: tuple[GroundMaterial, ...] = (),
    material: NDArray[np.uint8] | None = None,
    laid: Laid | None = None,
) -> NDArray[np.uint8]:
    """The sRGB colour of the window's nodes, rows run north, shape [rows, columns, 3].

    Steep ground shows less of the bright dust, hollows hold darker sand, and noise that is
    addressed by position mottles all of it, so that nothing repeats. Layers brighten it, as fresh
    ejecta do; their masks are taken on the finished ground. `material` are indices into `materials`
    of the nodes, whose colours then count instead of the regolith's. Soil that was laid on the
    ground since has the colour of its kind.

    A node has the same colour in every window if the ground reaches `stencil_reach` beyond the
    window, or to the site's edge.
    """
    rgb = np.empty((window.rows + 1, window.columns + 1, 3), np.uint8)
    key = stage_key(site.seed, "appearance")
    column, row = site.first_node(ground)
    for strip in window.strips(STRIP):
        east, north = site.axes(strip)
        first = strip.row - window.row
        own = slice(first, first + strip.rows + 1)
        base = _base(site, strip, spec, materials, None if material is None else material[own])
        if laid is not None and laid[1] != "regolith":
            base = _covered(base, laid[0][own], soil_tint(laid[1], site.body))
        over_chunks(
            _paint,
            len(north),
            ground.elevation,
            strip.column - column,
            strip.row - row,
            stencil_cells(_STENCIL_M, site.spacing),
            site.spacing,
            octaves(key, east=east, north=north, wavelengths=_WAVELENGTHS, amplitudes=_AMPLITUDES),
            base,
            _brightness(site, strip, ground, layers),
            spec.variation,
            _ENCODED,
            rgb[own],
        )
    return rgb


def _covered(base: Array, thickness: NDArray[np.float32], tint: Array) -> Array:
    """Linear colour where soil of another tint lies on the ground, more or less of it."""
    return base * (1.0 + _covering(thickness)[..., None] * (tint - 1.0))


def _covering(thickness: NDArray[np.float32]) -> Array:
    """Share of the ground that so much soil hides."""
    return np.minimum(thickness.astype(np.float64) / _HIDING, 1.0)


def paint(
    site: Site, window: Window, ground: Heightfield, *, laid: Laid | None = None
) -> Appearance:
    """What the window's ground and the site's rocks look like, as the recipe wants it.

    The ground reaches `stencil_reach` around the window, within the site. `laid` is what lies on
    it since, by rocks.
    """
    terrain = site.recipe.terrain
    spec = terrain.appearance
    soil = _soil(site, spec)
    materials = ground_materials(terrain.materials, body=site.body, soil=soil)
    material = _classes(site, window, ground, terrain.materials)
    rock_rgb = soil.rock_rgb or site.body.rock_rgb
    colours = [group.rgb or rock_rgb for group in site.recipe.rocks.groups]
    return Appearance(
        ground_rgb=colour_ground(
            site=site,
            window=window,
            ground=ground,
            spec=spec,
            layers=terrain.layers,
            materials=materials,
            material=material,
            laid=laid,
        ),
        rock_rgb=np.round(255.0 * np.reshape(colours, (-1, 3))).astype(np.uint8),
        detail=ground_detail(spec.detail, site),
        materials=materials,
        material=material,
        drift=None if laid is None else np.rint(255.0 * _covering(laid[0])).astype(np.uint8),
    )


def _classes(
    site: Site, window: Window, ground: Heightfield, specs: tuple[MaterialSpec, ...]
) -> NDArray[np.uint8] | None:
    """Which of the materials each of the window's nodes is; None without any."""
    if not specs:
        return None
    classes = np.empty((window.rows + 1, window.columns + 1), np.uint8)
    reach = materials_reach(specs, site)
    for strip in window.strips(STRIP):
        around = site.padded(strip, reach)
        first = strip.row - window.row
        classes[first : first + strip.rows + 1] = classify_ground(
            specs, site=site, window=strip, around=around, heights=of_window(ground, site, around)
        )
    return classes


def _soil(site: Site, spec: AppearanceSpec) -> Soil:
    """The soil that a recipe names, or the body's usual one, in its colour or the recipe's."""
    named = {soil.name: soil for soil in site.body.soils}
    if spec.regolith:
        return named[spec.regolith]
    return Soil(name="", rgb=spec.ground_rgb or site.body.ground_rgb)


def _base(
    site: Site,
    window: Window,
    spec: AppearanceSpec,
    materials: tuple[GroundMaterial, ...],
    material: NDArray[np.uint8] | None,
) -> Array:
    """Linear colour before any variation, of each node, or of all where shape [1, 1, 3]."""
    colour = linear_from_srgb(spec.ground_rgb or _soil(site, spec).rgb).reshape(1, 1, 3)
    if material is not None:
        colour = linear_from_srgb([one.rgb for one in materials])[material]
    if site.orthoimage is None:
        return colour
    albedo = orthoimage_albedo(site.orthoimage, site=site, window=window)
    return albedo if albedo.shape[2] == 3 else albedo * colour


def _brightness(
    site: Site, window: Window, ground: Heightfield, layers: tuple[Layer, ...]
) -> Array:
    """What the layers multiply the linear colour by, of each node, or of all if shape [1, 1]."""
    product = np.ones((1, 1))
    for layer in layers:
        what = f"layer {layer.kind!r}: brightness"
        with returning(layer, what, "None, or a factor of at least 0 for each node"):
            factor = layer.brightness(site=site, window=window)
            if factor is None:
                continue
            if np.shape(factor) != (window.rows + 1, window.columns + 1):
                raise ValueError(f"found shape {np.shape(factor)}")
            if np.ma.is_masked(factor):
                raise ValueError("found numbers that are masked")
            if not (np.isfinite(factor).all() and factor.min() >= 0.0):
                raise ValueError("found numbers that are negative or not finite")
        if layer.mask is not None:
            around = site.padded(window, layer.mask.reach(site))
            heights = of_window(ground, site, around)
            weight = mask_weight(layer.mask, site=site, window=around, elevation=heights)
            factor = 1.0 + weight[window.nodes_in(around)] * (factor - 1.0)
        product = product * factor
    return product


@kernel
def _paint(  # type: ignore[no-untyped-def]
    first, last, elevation, column, row, cells, spacing, mottle, base, brightness, variation,
    encoded, rgb,
):  # fmt: skip
    """Colour each node; `elevation[row, column]` lies under the first node of `mottle`."""
    columns = mottle.shape[1]
    last_row, last_column = elevation.shape[0] - 1, elevation.shape[1] - 1
    varied, brightened = min(base.shape[0] - 1, 1), min(brightness.shape[0] - 1, 1)
    for j in range(first, last):
        south, north = max(row + j - cells, 0), min(row + j + cells, last_row)
        for i in range(columns):
            west, east = max(column + i - cells, 0), min(column + i + cells, last_column)
            here = np.float64(elevation[row + j, column + i])
            w, e = np.float64(elevation[row + j, west]), np.float64(elevation[row + j, east])
            s = np.float64(elevation[south, column + i])
            n = np.float64(elevation[north, column + i])
            slope_x = (e - w) / ((east - west) * spacing)
            slope_y = (n - s) / ((north - south) * spacing)
            hollow = (0.25 * (w + e + s + n) - here) / (cells * spacing)
            steep = min(1.0, slope_x * slope_x + slope_y * slope_y)
            dust = 0.8 * mottle[j, i] - 0.8 * steep - min(max(3.0 * hollow, -0.5), 0.5)
            bright = 1.0 + 0.30 * variation * dust
            bright *= bright * brightness[j * brightened, i * brightened]
            vivid = 1.0 + 0.3 * variation * dust
            colour = base[j * varied, i * varied]
            grey = (colour[0] + colour[1] + colour[2]) / 3.0
            for channel in range(3):
                value = bright * (grey + vivid * (colour[channel] - grey))
                light = np.sqrt(min(max(value, 0.0), 1.0))
                rgb[j, i, channel] = np.uint8(encoded[np.int64(light * (_STEPS - 1) + 0.5)])
