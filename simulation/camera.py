"""A camera of parts, and the chain that exposes it."""

from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from radiometry.frame import Frame, FrameHeader
from radiometry.frame.exposure import Exposure, Settings
from radiometry.frame.roi import Window
from radiometry.reflectance.imaging import FrameSize, evaluate_polynomial
from radiometry.vignetting.blocks import Grid
from radiometry.vignetting.falloff import evaluate_curve
from simulation.light import Lamp
from simulation.parts import Body, Lens, Plane, Sensor, Shutter

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Whole = TypeVar("Whole", bound="DataclassInstance")


def change(whole: Whole, **changes: Any) -> Whole:  # noqa: ANN401  of any field
    """Return a copy with fields replaced, in whichever of its parts they are."""
    mine: dict[str, Any] = {}
    for name, part in _list_fields(whole).items():
        inner = {key: changes.pop(key) for key in list(changes) if name != key and key in _list_names(part)}
        if name in changes:
            mine[name] = changes.pop(name)
        elif inner:
            mine[name] = change(part, **inner)
    if changes:
        raise TypeError(f"no part of {type(whole).__name__} has {', '.join(changes)}")
    return replace(whole, **mine)


def _list_fields(part: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return the fields of a part of the simulation; those of foreign dataclasses are values."""
    ours = type(part).__module__.startswith("simulation.") and is_dataclass(part)
    return {each.name: getattr(part, each.name) for each in fields(part)} if ours else {}


def _list_names(part: Any) -> set[str]:  # noqa: ANN401
    own = _list_fields(part)
    return own.keys() | {name for inner in own.values() for name in _list_names(inner)}


@dataclass(frozen=True, kw_only=True)
class Camera:
    """A camera of parts."""

    body: Body = field(default_factory=Body)
    lens: Lens = field(default_factory=Lens)
    shutter: Shutter = field(default_factory=Shutter)
    sensor: Sensor = field(default_factory=Sensor)

    @property
    def window(self) -> Window:
        """The whole frame."""
        return Window(row0=0, col0=0, height=self.sensor.height_px, width=self.sensor.width_px)

    @property
    def centre_px(self) -> tuple[float, float]:
        """Row and column of the falloff's centre [px]."""
        return self.lens.centre_px or Grid.over(self.sensor.height_px, self.sensor.width_px).middle_px

    def share(self, f_number: float, window: Window | None = None) -> Plane:
        """Return the share V of the light that the lens passes to each pixel, (row, col)."""
        window, sensor, lens = window or self.window, self.sensor, self.lens
        if lens.polynomial is not None:
            size = FrameSize(height_px=sensor.height_px, width_px=sensor.width_px)
            return evaluate_polynomial(lens.polynomial, window, size=size)
        rows = np.arange(window.row0, window.row0 + window.height) - self.centre_px[0]
        cols = np.arange(window.col0, window.col0 + window.width) - self.centre_px[1]
        radius = Grid.over(sensor.height_px, sensor.width_px).half_diagonal_px
        squared = (rows[:, None] ** 2 + cols[None, :] ** 2) / radius**2
        return evaluate_curve(squared, lens.falloffs.get(f_number, lens.falloff))

    def set_truly(self, nominal: Settings) -> Settings:
        """Return the true settings behind nominal ones."""
        time_s, f_number = nominal.exposure_time_s, nominal.f_number
        return Settings(
            exposure_time_s=time_s * self.shutter.time_errors.get(time_s, 1.0) + self.shutter.extra_s,
            f_number=f_number * self.lens.f_number_errors.get(f_number, 1.0),
            iso=nominal.iso,
        )

    def collect(self, settings: Settings, *, luminance_cd_m2: float = 1.0) -> float:
        """Return the mean electrons of the strongest colour on the axis, E = T q t L / f^2 [e]."""
        true = self.set_truly(settings)
        rate_e_s = self.lens.transmission * self.sensor.sensitivity_e * luminance_cd_m2 / true.f_number**2
        return rate_e_s * true.exposure_time_s

    def find_luminance(self, signal_dn: float, settings: Settings) -> float:
        """Return the luminance [cd/m2] that gives a signal above black on the axis [DN]."""
        return signal_dn / self.sensor.gain(settings.iso) / self.collect(settings)

    def describe(self, settings: Settings | None = None) -> FrameHeader:
        """Return the header that a decoder reads from this camera's files."""
        sensor = self.sensor
        return FrameHeader(
            container="dng",
            decoder="stilb",
            rendered=sensor.cfa == "rgb",
            compression="none",
            bits_per_sample=16,
            width_px=sensor.width_px,
            height_px=sensor.height_px,
            cfa=sensor.cfa,
            black_level_dn=(sensor.black_level_dn,) * sensor.sites,
            black_level_origin="tag",
            white_level_dn=(sensor.white_level_dn,) * sensor.sites,
            white_level_origin="tag",
            exposure_time_s=settings.exposure_time_s if settings else None,
            f_number=settings.f_number if settings else None,
            iso=settings.iso if settings else None,
            make=self.body.make,
            model=self.body.model,
            serial=self.body.serial,
        )


class Target(Protocol):
    """Anything that can be photographed."""

    def draw(self, camera: Camera, window: Window) -> Plane:
        """Return the share of the lamp's luminance that each pixel sees, (row, col) or one for all.

        A lens whose colours differ gives (row, col, colour), red first.
        """


def expose(
    camera: Camera,
    target: Target,
    lamp: Lamp,
    settings: Settings,
    random: np.random.Generator,
    *,
    window: Window | None = None,
    after_s: float = 0.0,
) -> Frame:
    """Photograph a target.

    Parameters
    ----------
    camera, target, lamp : Camera, Target, Lamp
        What takes the picture, of what, in which light.
    settings : Settings
        Nominal exposure time [s], f-number and ISO value.
    random : numpy.random.Generator
        Source of photon noise and then of read noise.
    window : Window, optional
        Part of the frame to read out; the whole frame if None.
    after_s : float
        Time since the lamp had its luminance [s].

    Returns
    -------
    Frame
        Digital numbers of the window, black not subtracted.

    Notes
    -----
    The mean number of electrons of a pixel is::

        e = T q t L / f^2 * scatter(share) * V * colour * (1 + PRNU) + dark current * t

    with the true settings t and f; ``Sensor.read_out`` makes digital numbers of it.

    """
    sensor, window = camera.sensor, window or camera.window
    centre_e = camera.collect(settings, luminance_cd_m2=lamp.shine(after_s))
    light = np.asarray(target.draw(camera, window))
    light = np.broadcast_to(light, (window.height, window.width, *light.shape[2:]))
    share = camera.share(settings.f_number, window)
    light = centre_e * camera.lens.scatter(light) * (share[:, :, None] if light.ndim == 3 else share)
    if light.ndim == 3 and sensor.cfa != "rgb":
        light = sensor.pick(light, window)
    colour = sensor.filter_light(window, temperature_k=lamp.temperature_k)
    mean_e = (
        (light[:, :, None] if sensor.cfa == "rgb" and light.ndim == 2 else light)
        * colour
        * sensor.pattern(window)
    )
    dark_e = sensor.dark_current_e_s * camera.set_truly(settings).exposure_time_s
    samples = sensor.read_out(mean_e + dark_e, random, window=window, dark_e=dark_e, iso=settings.iso)
    return Frame(
        samples_dn=samples,
        row0=window.row0,
        col0=window.col0,
        height_px=sensor.height_px,
        width_px=sensor.width_px,
        cfa=sensor.cfa,
        black_level_dn=(sensor.black_level_dn,) * sensor.sites,
        white_level_dn=(sensor.white_level_dn,) * sensor.sites,
    )


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One photograph to take.

    Attributes
    ----------
    frame, role, scene : str
        Its name, its role in a campaign, and the light level that it shows.
    window : Window or None
        Part of the frame to read out; the whole frame if None.
    rows_at_once : int or None
        Rows that are exposed together, for even surfaces of many megapixels; all if None.
    after_s : float
        Time since the lamp had its luminance [s].

    """

    frame: str
    role: str
    settings: Settings
    lamp: Lamp
    target: Target
    scene: str | None = None
    window: Window | None = None
    rows_at_once: int | None = None
    after_s: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Taken:
    """A photograph: name, role, header, settings and all of its pixels."""

    name: str
    role: str
    header: FrameHeader
    exposure: Exposure
    frame: Frame


def take(camera: Camera, shot: Shot, random: np.random.Generator) -> Taken:
    """Expose one shot."""
    window = shot.window or camera.window
    step = shot.rows_at_once or window.height
    strips = [
        expose(
            camera,
            shot.target,
            shot.lamp,
            shot.settings,
            random,
            window=replace(window, row0=window.row0 + row, height=min(step, window.height - row)),
            after_s=shot.after_s,
        )
        for row in range(0, window.height, step)
    ]
    return Taken(
        name=shot.frame,
        role=shot.role,
        header=camera.describe(shot.settings),
        exposure=Exposure(**asdict(shot.settings)),
        frame=replace(strips[0], samples_dn=np.concatenate([strip.samples_dn for strip in strips])),
    )
