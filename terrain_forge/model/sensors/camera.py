"""A camera."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal, Self

from annotated_types import Interval, MinLen

from terrain_forge.base import Coordinate, Idle, Positive
from terrain_forge.model.camera_parts import (
    MOST_ELECTRONS,
    AnyExposure,
    AutoExposure,
    BrightnessOffAxis,
    CameraNoise,
    LensFlare,
)
from terrain_forge.model.distortion import AnyDistortion, Equidistant
from terrain_forge.model.sensor import Form, Near, Sdf, Sensor, Topic, View, white_noise

_BENT = {"": (), "radtan": ("sdf", "usd"), "equidistant": ("usd",)}
"""The formats that know a distortion."""
_PICTURE = {"width_px", "height_px", "horizontal_fov_deg", "focal_px", "centre_px"} | {
    "images", "channels", "depth_factor"
}  # fmt: skip
_NEAR = 0.02
"""What it sees at least in Gazebo [m]."""
_WIDEST = 170.0
"""Angle that a picture of a pinhole can show [degrees]."""

_MOST_UM = 1000.0
"""Side of the largest pixel [µm]."""

Channel = Literal["depth", "disparity", "normals", "instance", "class", "shadow", "flow"]

_PAPER = {
    **{"width_px": 1280, "height_px": 720, "horizontal_fov_deg": 80.0, "rate_hz": 30.0},
    "exposure": {"kind": "auto", "sky": "ignored"},
}
_NAVCAM = {
    "width_px": 1024,
    "height_px": 1024,
    "horizontal_fov_deg": 45.0,
    "rate_hz": 1.0,
    "bits": 12,
    "f_number": 12.0,
    "pixel_um": 12.0,
    "quantum_efficiency": 0.1,
    "exposure": {"kind": "auto", "longest_s": 0.5, "lag_s": 0.0},
    "noise": {"full_well_e": 170_000.0, "read_e": 25.0, "prnu": 0.003, "dsnu_e": 10.0},
}


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraSensor(Sensor):
    """A camera; by default one of a ZED at its 720p setting, its figures nominal.

    Presets: `zed-720p`; `paper`, that of the MarsSim paper's simulator, 1280 × 720 at 80° and 30
    Hz, which no sky darkens, and `paper-90`, at the 90° that the paper states; `navcam`, like those
    of the Mars rovers (Maki et al. 2012, doi:10.1007/s11214-012-9882-4).
    """

    title: ClassVar[str] = "camera"
    topics: ClassVar[tuple[Topic, ...]] = (
        Topic("image", "Image", "Image"),
        Topic("camera_info", "CameraInfo", "CameraInfo"),
    )
    # A level of their own, so that two cameras do not share camera_info.
    sdf_topic: ClassVar[str] = "/image"
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "zed-720p": {},
        "paper": _PAPER,
        "paper-90": {**_PAPER, "horizontal_fov_deg": 90.0},
        "navcam": _NAVCAM,
    }

    kind: Literal["camera"] = "camera"
    """A camera."""
    rate_hz: Annotated[float, Interval(ge=0.01, le=1000)] = 15.0
    """Images per second [Hz]."""
    width_px: Annotated[int, Interval(ge=8, le=10_000)] = 1280
    """Pixels of a row."""
    height_px: Annotated[int, Interval(ge=8, le=10_000)] = 720
    """Pixels of a column."""
    horizontal_fov_deg: Annotated[float, Interval(ge=1, le=240)] = 85.0
    """Angle between the left and the right edge [degrees], of the lens without its distortion: of
    a pinhole's picture, 170 at most, or with `equidistant` of a perfect fisheye's."""
    focal_px: tuple[Positive, Positive] | None = None
    """Focal lengths across and down [pixels], in place of the angle."""
    centre_px: tuple[Coordinate, Coordinate] | None = None
    """Principal point, column and row [pixels]: the first pixel's centre is at 0, as in OpenCV;
    without it the picture's middle, (width - 1) / 2, (height - 1) / 2."""
    distortion: AnyDistortion | None = None
    """How the lens bends raw pictures; null for a pinhole's."""
    images: Annotated[tuple[Literal["raw", "rectified"], ...], MinLen(1)] = ("raw",)
    """What is written: pictures through the lens, pictures without its distortion, or both."""
    colour: bool = False
    """Whether pixels have red, green and blue (no mosaic); else one grey value."""
    bits: Annotated[int, Interval(ge=8, le=16)] = 8
    """Bits of a pixel; from 9 on, files hold 16 and the values stay as they are."""
    gamma: Annotated[float, Interval(ge=1, le=4)] = 1.0
    """Values are intensities to the power of 1/gamma; 1 for linear ones."""
    exposure: AnyExposure = field(default_factory=AutoExposure)
    """Time of exposure and gain; `auto` by default."""
    f_number: Annotated[float, Interval(ge=0.5, le=100)] = 2.0
    """Focal length over aperture."""
    pixel_um: Annotated[float, Interval(ge=0.1, le=_MOST_UM)] = 4.0
    """Side of a pixel on the chip [µm]."""
    quantum_efficiency: Annotated[float, Interval(gt=0, le=1)] = 0.5
    """Electrons for each photon of visible light that comes to the lens."""
    noise: CameraNoise = field(default_factory=CameraNoise)
    """Noise of the chip."""
    vignetting: BrightnessOffAxis | None = (0.0, 0.0, 0.0)
    """a, b, c of 1 + a r² + b r⁴ + c r⁶, r from the principal point in half diagonals; but for
    fisheyes times cos⁴ of the angle off the axis. Null for no darkening towards the edge."""
    psf_px: Annotated[float, Interval(ge=0, le=20)] = 0.5
    """Standard deviation of the blur of the lens and the chip [pixels]."""
    motion_blur: Annotated[int, Interval(ge=1, le=64)] = 1
    """Moments of an exposure that a picture is the mean of; 1 for a sharp one."""
    rolling_shutter_s: Annotated[float, Interval(ge=0, le=10)] = 0.0
    """Time from the first row's exposure to the last one's [s]; 0 for all at once."""
    flare: LensFlare | None = field(default_factory=LensFlare)
    """Sunlight that goes astray in the lens; null for none."""
    near_m: Near = 0.005
    """What of the rover is nearer than this is not seen, such as the sensor's own housing [m]."""
    channels: tuple[Channel, ...] = ()
    """What is true of each pixel's centre, beside the pictures: of the rectified ones where there
    are any, else of the raw ones. Disparity is a stereo pair's."""
    depth_factor: Positive | None = 1000.0
    """Values of a depth image for a metre: 16 bits reach to 65.535 m at 1000, what is farther is 0;
    null writes 32-bit floats as .npy instead."""

    def idle(self) -> Iterator[Idle]:
        """What has no effect beside other figures of it."""
        if self.focal_px is not None:
            yield Idle("horizontal_fov_deg", "focal_px is given")
        if "depth" not in self.channels:
            yield Idle("depth_factor", "depth is not among the channels")

    def __post_init__(self) -> None:
        super().__post_init__()
        fisheye = isinstance(self.distortion, Equidistant)
        if not (fisheye or self.focal_px) and self.horizontal_fov_deg > _WIDEST:
            raise ValueError(
                f"horizontal_fov_deg {self.horizontal_fov_deg:g}: a pinhole shows {_WIDEST:g} at "
                "most, a lens with distortion {kind: equidistant} more"
            )
        self._check_fold()
        longest = self.exposure.longest + self.rolling_shutter_s
        if longest > (1.0 + 1e-9) / self.rate_hz:
            raise ValueError(
                f"exposure of up to {self.exposure.longest:g} s and rolling_shutter_s "
                f"{self.rolling_shutter_s:g}: longer than a picture has at rate_hz "
                f"{self.rate_hz:g}, {1.0 / self.rate_hz:.4g} s"
            )
        if "disparity" in self.channels and self.kind == "camera":
            raise ValueError("channels: disparity is a stereo pair's (kind: stereo)")
        if "disparity" in self.channels and self.distortion and "rectified" not in self.images:
            raise ValueError("channels: disparity is that of rectified pictures, see images")

    def _check_fold(self) -> None:
        """Refuse a lens that shows something twice, or nothing, within its picture."""
        if self.distortion is None or "raw" not in self.images:
            return
        (fx, fy), (cx, cy) = self.focal, self.centre
        corner = max(
            math.hypot((u - cx) / fx, (v - cy) / fy)
            for u in (-0.5, self.width_px - 0.5)
            for v in (-0.5, self.height_px - 0.5)
        )
        fold = self.distortion.fold
        reach = self.distortion.radius(fold)
        if reach <= corner:
            raise ValueError(
                f"distortion.k {list(self.distortion.k)}: folds {reach * fx:.0f} px from the "
                f"principal point, the picture's corner is {corner * fx:.0f} px away: it would "
                "show things twice"
            )

    @property
    def quick(self) -> Self:
        """A camera whose pixels are two by two of this one's, without channels."""
        focal, centre = self.focal_px, self.centre_px
        # As wide as figures may be: values are the same, and noise is that of so many pixels.
        side = min(
            2.0, math.sqrt(MOST_ELECTRONS / self.noise.full_well_e), _MOST_UM / self.pixel_um
        )
        return self.replace(
            width_px=max(self.width_px // 2, 8),
            height_px=max(self.height_px // 2, 8),
            focal_px=focal and (0.5 * focal[0], 0.5 * focal[1]),
            centre_px=centre and (0.5 * centre[0] - 0.25, 0.5 * centre[1] - 0.25),
            pixel_um=side * self.pixel_um,
            noise=self.noise.binned(side),
            psf_px=0.5 * self.psf_px,
            channels=(),
        )

    @property
    def focal(self) -> tuple[float, float]:
        """Focal lengths across and down [pixels]."""
        if self.focal_px:
            return self.focal_px
        half = math.radians(0.5 * self.horizontal_fov_deg)
        fisheye = isinstance(self.distortion, Equidistant)
        length = 0.5 * self.width_px / (half if fisheye else math.tan(half))
        return length, length

    @property
    def centre(self) -> tuple[float, float]:
        """Principal point, column and row [pixels]; the first pixel's centre is at 0."""
        return self.centre_px or (0.5 * (self.width_px - 1), 0.5 * (self.height_px - 1))

    @property
    def view(self) -> View:
        """The picture of a pinhole of its focal lengths, and how its lens bends it."""
        across = 2.0 * math.atan(0.5 * self.width_px / self.focal[0])
        (fx, fy), (u, v) = self.focal, self.centre
        middle = 0.5 * (self.width_px - 1), 0.5 * (self.height_px - 1)
        return View(
            self.width_px,
            self.height_px,
            across,
            aspect=fy / fx,
            offset_px=(u - middle[0], v - middle[1]),
            lens=self.distortion.kind if self.distortion else "",
            coefficients=self.distortion.k if self.distortion else (),
        )

    def sdf(self, *, classic: bool, far: float) -> Sdf:  # noqa: ARG002
        """A camera, with noise where it has any."""
        lens = {
            "horizontal_fov": self.view.horizontal_fov,
            "image": {"width": self.width_px, "height": self.height_px, "format": "R8G8B8"},
            "clip": {"near": max(_NEAR, self.near_m), "far": far},
        }
        told = lens | white_noise(self.noise.at_half) | self.view.sdf_lens()
        return "camera", {"camera": told}

    def said(self, form: Form) -> set[str]:
        """The picture, and how it is bent: by radii and tangents in SDF, either way in USD.

        What is only of recordings no format need say.
        """
        told = _PICTURE | {name for name in ("gamma", "motion_blur") if getattr(self, name) == 1}
        told |= {"rate_hz", "bits"} if form == "sdf" else set()
        return told | ({"distortion"} if form in _BENT[self.view.lens] else set())
