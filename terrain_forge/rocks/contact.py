"""The recipe's `rocks.contact`: what the ground does where it meets the rocks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from terrain_forge.base import BY_KIND, Array, RecipeError, Spec, portable
from terrain_forge.model import Site
from terrain_forge.terrain import Ripples

USUAL_WIND_DEG = 29.0
"""Where the wind of the Pathfinder site's tails comes from (Greeley et al. 1999: towards 209°)."""
_LEAST_RATE, _RATE_DIAMETER = 0.2e-3, 0.05
_RATE_EXPONENT = 0.87
"""Abrasion of lunar rocks: 0.2 mm in 10⁶ years for centimetres, 20 mm for 10 m."""


@dataclass(frozen=True, kw_only=True)
class NoContact(Spec):
    """Nothing: rocks stand in the ground as it was."""

    kind: Literal["none"] = "none"


@dataclass(frozen=True, kw_only=True)
class WindContact(Spec):
    """Sand and dust that the wind lays at rocks: drifts against them, tails behind, moats before.

    Each rock has 0 to twice of it, drawn evenly, and a wind of its own within 15° of the site's.
    Drifts and tails: Greeley et al. 1999, doi:10.1029/98JE02553; moats: Pelletier et al. 2009,
    Geology 37, 55. No law of sizes was found: the shares below are assumptions.
    """

    kind: Literal["wind"] = "wind"
    wind_from_deg: Annotated[float, Interval(ge=-360, le=360)] | None = None
    """Where the wind comes from, clockwise from north [degrees]; without it that of the recipe's
    first layer of ripples, or 29 as at the Pathfinder site."""
    drift: Annotated[float, Interval(ge=0, le=0.3)] = 0.12
    """Mean height of the drift at a rock's lee side, in heights of the rock; it runs out towards
    the wind."""
    tail: Annotated[float, Interval(ge=0, le=10)] = 3.0
    """Mean length of the tail behind a rock, in heights of the rock; 0 for none."""
    moat: Annotated[float, Interval(ge=0, le=0.15)] = 0.03
    """Mean depth of the moat at a rock's windward side, in heights of the rock; 0 for none."""
    soil: Literal["regolith", "sand", "dust"] = "dust"
    """Colour of drifts and tails: the ground's own, or that of dark sand or bright dust."""


@dataclass(frozen=True, kw_only=True)
class FilletContact(Spec):
    """Fillets: what impacts wear off a rock lies about its foot.

    A rock wears by 0.2 mm in 10⁶ years if it is of centimetres and 20 mm if it is of 10 m, a power
    law between; what its sides lose makes a fillet that ends at the rock at 25°. Rüsch &
    Wöhler, "The fillet of a rock on the Moon", from the abstract; their fillets diffuse as well.
    """

    kind: Literal["fillets"] = "fillets"
    exposure_myr: Annotated[float, Interval(ge=0, le=1000)] = 20.0
    """Mean time for which the rocks have lain there [10⁶ years]; each rock's own is drawn evenly
    from 0 to twice that. Half of the rocks above 2 m last 40 to 80 (Basilevsky et al. 2013,
    Planet. Space Sci. 89, 118)."""


Contact = Annotated[NoContact | WindContact | FilletContact, BY_KIND]
"""What a recipe can name by its `kind`."""


def contact_of(site: Site) -> NoContact | WindContact | FilletContact:
    """What a site's recipe wants, or what is usual on its body."""
    wanted: NoContact | WindContact | FilletContact | None = site.recipe.rocks.contact
    if wanted is not None:
        return wanted
    return FilletContact() if site.body.airless else WindContact()


def check_contact(site: Site) -> None:
    """Refuse what the site's body cannot do.

    Raises:
        RecipeError: says what it can.
    """
    wanted, airless = site.recipe.rocks.contact, site.body.airless
    if isinstance(wanted, WindContact) and airless:
        why = "has no wind; allowed: fillets, none"
    elif isinstance(wanted, FilletContact) and not airless:
        why = "has air that stops the impacts which make fillets; allowed: wind, none"
    else:
        return
    raise RecipeError(f"{site.body.name} {why}", key=("rocks", "contact", "kind"))


def wind_from(contact: WindContact, site: Site) -> float:
    """Where the wind comes from that lays drifts, clockwise from north [degrees]."""
    if contact.wind_from_deg is not None:
        return contact.wind_from_deg
    layers = site.recipe.terrain.layers
    ripples = (layer.wind_from_deg for layer in layers if isinstance(layer, Ripples))
    return next(ripples, USUAL_WIND_DEG)


def wear_rate(diameter: Array) -> Array:
    """What rocks of some diameters [m] lose of their surface [m in 10⁶ years]."""
    return _LEAST_RATE * portable.power(diameter / _RATE_DIAMETER, _RATE_EXPONENT)


def drifted_soil(site: Site) -> str:
    """What kind of soil lies at the site's rocks."""
    contact = contact_of(site)
    return contact.soil if isinstance(contact, WindContact) else "regolith"


def contact_told(site: Site) -> str:
    """What lies at the site's rocks, for people."""
    contact = contact_of(site)
    if isinstance(contact, WindContact):
        return f"drifts of {contact.soil}, wind from {wind_from(contact, site):g}°"
    if isinstance(contact, FilletContact):
        return f"fillets of {contact.exposure_myr:g} · 10⁶ years in the mean"
    return "nothing"
