"""A camera's pictures, and what is true of their pixels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from terrain_forge.base import Array, Mask, RecipeError, portable
from terrain_forge.model import CameraSensor, mix
from terrain_forge.scene import MISSED
from terrain_forge.sensors import channels
from terrain_forge.sensors.exposure import Chip, Image, Picture, Shutter
from terrain_forge.sensors.flare import SunSeen, add_sun, aperture_seen, visible_part
from terrain_forge.sensors.instrument import NANOSECONDS, Frames, Setting, Stream
from terrain_forge.sensors.labels import Labels, labels_of
from terrain_forge.sensors.lens import OPTICAL, Lens, calibration_of, lens_of, rays_of, unproject
from terrain_forge.sensors.metering import LOOK, Meter
from terrain_forge.sensors.picture import Exposure, take_exposure, tracked
from terrain_forge.sky import beam
from terrain_forge.writers import encode_png

_PICTURE, _PATTERN, _FLARE = 1, 2, 3
_STYLES = "raw", "rectified"


class Eye(NamedTuple):
    """Where a camera is at each row of a picture."""

    time: float
    """Time of the middle row [s]."""
    times: Array
    """Time of each row [s], within the motion, shape [height]."""
    position: Array
    """Its place in the world [m], shape [height, 3]."""
    rotation: Array
    """From the optical frame to the world, shape [height, 3, 3]."""

    @property
    def middle(self) -> tuple[Array, Array]:
        """Place and rotation at the middle row."""
        half = len(self.position) // 2
        return self.position[half], self.rotation[half]


class CameraFrames(Frames):
    """Pictures of one camera; the stamp is the middle of the middle row's exposure."""

    kind: ClassVar[str] = "camera"
    folder: ClassVar[str] = "cam"
    sensor: CameraSensor

    def __init__(
        self, sensor: CameraSensor, setting: Setting, *, sensitivity: float = 1.0,
        leader: CameraFrames | None = None, other: tuple[float, float] | None = None,
    ) -> None:  # fmt: skip
        """Prepare a camera.

        Args:
            sensor: The camera.
            setting: What it measures.
            sensitivity: Times what the sensor says.
            leader: The camera that meters for it; itself by default.
            other: Of an eye of a stereo pair that writes disparity: the baseline [m], and the other
                eye's place along the optical frame's x axis [m].
        """
        super().__init__(sensor, setting)
        self._sensitivity, self._leader, self.other = sensitivity, leader, other

    def check(self) -> None:
        """Refuse a lens that bends parts of its picture out of any direction."""
        for lens in (self.lens(style) for style in self.sensor.images):
            if not np.isfinite(rays_of(lens)).all():
                raise RecipeError(
                    f"sensor {self.sensor.name!r}: its distortion folds within the picture",
                    key=("sensors", self.sensor.name, "distortion"),
                )

    def lens(self, style: str) -> Lens:
        """The lens of raw or rectified pictures."""
        return lens_of(self.sensor, rectified=style == "rectified")

    @property
    def styles(self) -> dict[str, str]:
        """Whether the pictures of each stream are raw or rectified; the first one's is `data`."""
        given = [style for style in _STYLES if style in self.sensor.images]
        return {"data" if style == given[0] else style: style for style in given}

    @property
    def channels(self) -> tuple[str, ...]:
        """Streams beside the pictures."""
        own = tuple(dict.fromkeys(self.sensor.channels))
        return (*own, "disparity", "occlusion") if self.other else own

    def streams(self) -> tuple[Stream, ...]:
        """Pictures and channels."""
        bits = {"bits": self.sensor.bits, "colour": self.sensor.colour}
        pictures = [
            Stream(name=name, suffix=".png", figures={"images": style, **bits})
            for name, style in self.styles.items()
        ]
        factor, wide = self.sensor.depth_factor, channels.wide_ids(self._labels)
        return *pictures, *(
            Stream(
                name=name,
                suffix=".npy" if name == "depth" and factor is None else ".png",
                figures={
                    "of": self.truth_style,
                    **channels.stream_figures(name, factor=factor, wide=wide),
                },
            )
            for name in self.channels
        )

    @property
    def truth_style(self) -> str:
        """Which pictures the channels belong to."""
        return "rectified" if "rectified" in self.sensor.images else "raw"

    def calibration(self) -> dict[str, Any]:
        """As in EuRoC's sensor.yaml, of `data`; of rectified pictures too where both are written.

        The camera's frame is the optical one: x right, y down, z forward.
        """
        first, *more = self.styles.values()
        found = calibration_of(self.sensor, rectified=first == "rectified")
        for style in more:
            found[style] = calibration_of(self.sensor, rectified=True)
        if self.other:
            found["baseline_m"] = self.other[0]
        shutter = {"rolling_shutter_s": self.sensor.rolling_shutter_s}
        return {
            **found,
            "frame": "optical",
            "electronics": {**self._chip(first).figures(), **shutter},
        }

    def shutter(self, number: int) -> Shutter:
        """How a picture is exposed."""
        return (self._leader or self)._meter.shutter(number)

    def eye(self, time: float) -> Eye:
        """Where the camera is when the picture of a time [s] is exposed, row by row."""
        height, readout = self.sensor.height_px, self.sensor.rolling_shutter_s
        late = (np.arange(height) - 0.5 * (height - 1)) / (height - 1) if readout else np.zeros(1)
        times = np.clip(time + readout * late, 0.0, self.setting.motion.end)
        state = self.state(times)
        turn = portable.product(state.rotation, OPTICAL)
        return Eye(
            float(np.clip(time, 0.0, self.setting.motion.end)),
            np.broadcast_to(times, height),
            np.broadcast_to(state.position, (height, 3)),
            np.broadcast_to(turn, (height, 3, 3)),
        )

    def picture(self, number: int, *, style: str = "") -> Image:
        """The values of a picture, raw or rectified; as those of `data` by default.

        Shape [height, width], of a colour camera [height, width, 3].
        """
        self.require(number)
        return self._picture(number, style or self.styles["data"])[0]

    def measure(self, number: int) -> dict[str, bytes]:
        """The pictures of a number and their channels, as files."""
        self.require(number)
        files, truth = {}, None
        for name, style in self.styles.items():
            image, exposure = self._picture(number, style)
            files[name] = encode_png(image, noisy=True)
            if style == self.truth_style:
                truth = exposure
        assert truth is not None
        if self.channels:
            files |= self._truth(number, truth)
        return files

    def tables(self, numbers: Sequence[int]) -> Mapping[str, Mapping[str, Array]]:
        """How pictures were exposed: what their values must be divided by to be compared."""
        shutters = np.array([self.shutter(number) for number in numbers]).reshape(-1, 2)
        return {"exposure": {"exposure [s]": shutters[:, 0], "gain []": shutters[:, 1]}}

    def exposure(self, style: str, time: float) -> Exposure:
        """What a raw or rectified picture sees at a moment [s], before its lens and its chip."""
        eye = self.eye(time)
        return self._see(rays_of(self.lens(style)), eye)

    def _see(self, rays: Picture, eye: Eye) -> Exposure:
        return take_exposure(
            self.setting,
            rays=rays,
            position=eye.position,
            rotation=eye.rotation,
            time=eye.times,
            colour=self.sensor.colour,
            tracks_behind=tracked(self.setting, eye.time),
            near=self.sensor.near_m,
        )

    def _picture(self, number: int, style: str) -> tuple[Image, Exposure]:
        """The values of a picture, and what is seen in its middle."""
        middle, shutter = float(self.times[number]) / NANOSECONDS, self.shutter(number)
        seen: Exposure | None = None
        light: Picture | None = None
        for time in self._moments(middle, shutter.time):
            exposure = self.exposure(style, time)
            radiance = self._with_sun(exposure, style, time)
            light = radiance if light is None else light + radiance
            if time == middle:
                seen = exposure
        assert light is not None
        if seen is None:
            seen = self.exposure(style, middle)
        light = light / np.float32(self.sensor.motion_blur)
        key = self._key(_PICTURE, number, _STYLES.index(style))
        return self._chip(style).read(light, shutter, key), seen

    def _moments(self, middle: float, time: float) -> Iterator[float]:
        count = self.sensor.motion_blur
        for n in range(count):
            yield middle if 2 * n + 1 == count else middle + time * ((n + 0.5) / count - 0.5)

    def _with_sun(self, exposure: Exposure, style: str, time: float) -> Picture:
        """A picture's radiance and that of the Sun and its stray light."""
        world, eye = self.setting.world, self.eye(time)
        light, (position, rotation) = world.lighting, eye.middle
        towards = portable.product(light.towards_sun, rotation)
        if light.towards_sun[2] <= 0.0 or aperture_seen(self.lens("raw"), towards) == 0.0:
            return exposure.radiance
        radius = 0.5 * world.sun_diameter
        part = visible_part(
            self.setting.scenery,
            position,
            light.towards_sun,
            radius=radius,
            time=eye.time,
            near=self.sensor.near_m,
        )
        sun = SunSeen(towards, radius, light.irradiance * beam(light), part)
        radiance = np.array(exposure.radiance)
        sky = exposure.instance == MISSED
        key = self._key(_FLARE)
        lens, glass = self.lens(style), self.lens("raw")
        add_sun(radiance, sky, lens, sun, self.sensor.flare, key, glass=glass)
        return radiance

    def _truth(self, number: int, exposure: Exposure) -> dict[str, bytes]:
        """The files of the channels."""
        time, lens = float(self.times[number]) / NANOSECONDS, self.lens(self.truth_style)
        eye = self.eye(time)
        points = channels.points_of(exposure, lens, eye.position, eye.rotation)
        return {name: self._channel(name, number, exposure, eye, points) for name in self.channels}

    def _channel(
        self, name: str, number: int, exposure: Exposure, eye: Eye, points: Array
    ) -> bytes:
        lens = self.lens(self.truth_style)
        if name == "depth":
            return channels.depth_file(exposure.depth, self.sensor.depth_factor)
        if name == "normals":
            return channels.normals_file(exposure, eye.rotation)
        if name == "instance":
            return channels.id_file(exposure, self._labels)
        if name == "class":
            behind = tracked(self.setting, eye.time)
            return channels.class_file(exposure, points, self._labels, behind)
        if name == "shadow":
            return channels.shadow_file(exposure)
        if name == "flow":
            if number + 1 >= len(self.times):
                return channels.no_flow_file(lens)
            then = self.eye(float(self.times[number + 1]) / NANOSECONDS)
            return channels.flow_file(
                exposure, points, lens, then.position, then.rotation, eye.rotation
            )
        assert self.other is not None
        baseline, aside = self.other
        if name == "disparity":
            return channels.disparity_file(exposure.depth, lens.focal[0], baseline)
        places = eye.position + aside * eye.rotation[:, :, 0]
        return channels.occlusion_file(
            self.setting.scenery, exposure, points, places, lens, eye.rotation, eye.times,
            self.sensor.near_m,
        )  # fmt: skip

    def _key(self, *words: int) -> np.uint64:
        """What chance at an address hangs on."""
        key = self.setting.key(self.sensor)
        for word in words:
            key = np.uint64(mix(key, word))
        return key

    @cached_property
    def _labels(self) -> Labels:
        return labels_of(self.setting)

    @cached_property
    def _chips(self) -> dict[str, Chip]:
        return {}

    def _chip(self, style: str) -> Chip:
        if style not in self._chips:
            key = self._key(_PATTERN, _STYLES.index(style))
            lens = self.lens(style)
            self._chips[style] = Chip(self.sensor, lens, key, sensitivity=self._sensitivity)
        return self._chips[style]

    @cached_property
    def _meter(self) -> Meter:
        per_second = self._chip(self.styles["data"]).per_radiance
        return Meter(
            self.sensor.exposure,
            rate=self.sensor.rate_hz,
            enough=self.sensor.noise.full_well_e / per_second,
            look=self._look,
        )

    def _look(self, number: int) -> tuple[Picture, Mask]:
        """A small picture of what a picture's number sees, and where it is sky."""
        lens, (columns, rows) = self.lens(self.styles["data"]), LOOK
        x = (np.arange(columns) + 0.5) * lens.width / columns - 0.5
        y = (np.arange(rows) + 0.5) * lens.height / rows - 0.5
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        rays = unproject(lens, places).reshape(rows, columns, 3).astype(np.float32)
        time = float(self.times[number]) / NANOSECONDS
        eye = self.eye(time)
        position, rotation = eye.middle
        still = np.tile(position, (rows, 1)), np.tile(rotation, (rows, 1, 1))
        seen = self._see(rays, Eye(eye.time, np.full(rows, eye.time), *still))
        return seen.radiance, seen.instance == MISSED
