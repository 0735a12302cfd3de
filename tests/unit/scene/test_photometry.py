"""Light comes back as Hapke's law says: its closed forms, the table for it, and pictures of it."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.model import BODIES, Heightfield, Lighting, Photometry
from terrain_forge.scene import Instances, RayScene, Subject, look, prepare_stage
from terrain_forge.scene.photometry import STANDARD, hapke, photometric_law, reflected
from terrain_forge.scene.stage import SUN

_PLAIN = Photometry(
    albedo=0.5, lobe=0.0, back=0.0, surge=0.0, surge_width=0.05, roughness=0.0, source="isotropic"
)
_BODIES = [name for name, body in BODIES.items() if body.photometry is not None]


def angles(count, *, least=0.05, seed=1):
    """Cosines of incidence, emission and phase of some geometries."""
    chance = np.random.default_rng(seed)
    mu0, mu = chance.uniform(least, 1.0, (2, count))
    flat = np.sqrt((1.0 - mu0**2) * (1.0 - mu**2))
    return mu0, mu, mu0 * mu + flat * np.cos(chance.uniform(0.0, np.pi, count))


@pytest.mark.parametrize("albedo", [0.2, 0.6, 0.95])
@pytest.mark.parametrize("mu0", [0.2, 0.6, 1.0])
def test_isotropic_particles_reflect_what_the_closed_form_says(albedo, mu0):
    """(1 - γ) / (1 + 2 γ μ₀) of the light on it, γ² = 1 - w, as near as Hapke's H functions are."""
    mu = (np.arange(2000) + 0.5) / 2000
    seen = hapke(_PLAIN.replace(albedo=albedo), mu0, mu, mu0 * mu)
    gamma = np.sqrt(1.0 - albedo)
    assert 2.0 * (seen * mu).mean() / mu0 == pytest.approx(
        (1.0 - gamma) / (1.0 + 2.0 * gamma * mu0), rel=0.11
    )


@pytest.mark.parametrize("body", _BODIES)
def test_light_and_eye_may_change_places(body):
    photometry = BODIES[body].photometry
    mu0, mu, phase = angles(400)
    there, back = hapke(photometry, mu0, mu, phase) / mu0, hapke(photometry, mu, mu0, phase) / mu
    assert there == pytest.approx(back, rel=1e-9)
    law = photometric_law(photometry)
    for one in zip(mu0[:50], mu, phase, strict=False):
        other = reflected(law, one[1], one[0], one[2])
        assert reflected(law, *one) / one[0] == pytest.approx(other / one[1], rel=1e-9)


def test_the_surge_is_as_high_and_as_wide_as_its_figures_say():
    dark = _PLAIN.replace(albedo=1e-6)
    surging = dark.replace(surge=1.5, surge_width=0.04)
    for phase, wanted in ((0.0, 2.5), (2.0 * np.arctan(0.04), 1.75), (np.pi / 2, 1.06)):
        angle = 0.5 * phase
        given = np.cos(angle), np.cos(angle), np.cos(phase)
        found = hapke(surging, *given) / hapke(dark, *given)
        assert found == pytest.approx(wanted, rel=0.005)


@pytest.mark.parametrize("body", _BODIES)
def test_the_table_is_near_the_law(body):
    photometry = BODIES[body].photometry
    law, (mu, mu0) = photometric_law(photometry), STANDARD
    mu0s, mus, phase = angles(600, least=0.1)
    scale = mu0 / hapke(photometry, mu0, mu, mu0)
    wanted = scale * hapke(photometry, mu0s, mus, phase)
    found = np.array([reflected(law, *one) for one in zip(mu0s, mus, phase, strict=True)])
    off = found / wanted - 1.0
    assert np.sqrt((off**2).mean()) < 0.07
    assert abs(off.mean()) < 0.03
    # Straight behind the light it is exact: there only one angle is left.
    for cosine in (0.3, 0.6, 0.9):
        exact = scale * hapke(photometry, cosine, cosine, 1.0)
        assert reflected(law, cosine, cosine, 1.0) == pytest.approx(exact, rel=0.02)


def test_without_figures_it_is_lamberts():
    law = photometric_law(None)
    for mu0, mu, phase in np.transpose(angles(20)):
        assert reflected(law, mu0, mu, phase) == mu0


@pytest.mark.parametrize("body", ["moon", None])
def test_pictures_show_it(body):
    """Level ground from so high that none of its grain shows, with the Sun behind the camera."""
    light = Lighting(sun_azimuth=0.7, sun_elevation=0.9, irradiance=1361.0, sky_rgb=(0.0, 0.0, 0.0))
    photometry = BODIES[body].photometry if body else None
    none = Instances(
        meshes=(), mesh=np.zeros(0, np.int32), position=np.zeros((0, 3)),
        rotation=np.zeros((0, 3, 3)), scale=np.zeros(0), grain=np.zeros(0), rgb=np.zeros((0, 3)),
    )  # fmt: skip
    subject = Subject(
        ground=Heightfield(elevation=np.zeros((65, 65)), spacing=100.0, origin=(-3200.0, -3200.0)),
        ground_rgb=np.full((65, 65, 3), 120, np.uint8),
        instances=none,
        lighting=light,
        sun_diameter=0.0093,
        seed=3,
        photometry=photometry,
    )
    ahead = -light.towards_sun
    right = np.cross(ahead, [0.0, 0.0, 1.0]) / np.linalg.norm(ahead[:2])
    turn = np.column_stack([right, np.cross(ahead, right), ahead])
    x, y = np.meshgrid(np.linspace(-0.7, 0.7, 33), np.linspace(-0.3, 0.3, 25))
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    with RayScene(subject) as scene:
        stage = prepare_stage(scene, light, 1)
        seen = look(
            scene, stage, rays=rays.astype(np.float32),
            position=np.tile([0.0, 0.0, 900.0], (25, 1)), rotation=np.tile(turn, (25, 1, 1)),
        )  # fmt: skip
    law, mu0 = photometric_law(photometry), float(light.towards_sun[2])
    towards = rays @ turn.T
    wanted = [
        reflected(law, mu0, -look[2], float(light.towards_sun @ -look))
        for look in towards.reshape(-1, 3)
    ]
    scale = float(stage.colours[SUN, 0])
    albedo = ((120 / 255 + 0.055) / 1.055) ** 2.4
    assert seen.sunlit.all()
    assert seen.direct.ravel() == pytest.approx(np.array(wanted) * scale * albedo, rel=0.01)
    bright = seen.direct[12, 16, 0] / seen.direct[12, 0, 0]
    assert bright > 1.7 if body else bright == pytest.approx(1.0, rel=1e-3)
