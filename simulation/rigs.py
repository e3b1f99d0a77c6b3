"""Rigs of MicaSense and DJI: a sensor for each band, and a light sensor that states an irradiance."""

import math
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from radiometry.frame import exposure, multispectral
from radiometry.records import Record
from simulation import sequoia, targets
from simulation.camera import Body, Camera, Lamp, Plane, Shot, Taken, change, take

_FULL_SCALE = 65_536.0
_ELECTRONS = 6000.0
# Of the half diagonal: the falloff of a lens about its centre.
_FALLOFF = (0.0, -0.25, 0.0, -0.05)
_PIXELS_PER_MM = 256.0
_DIRECT, _SUN_DEG = 0.7, (45.0, 180.0)


class Channel(Record):
    """True values of a band: K, wavelength and width [nm], exposure time [s], and where it is in the rig."""

    reflectance_k: float
    wavelength_nm: float
    width_nm: float
    exposure_time_s: float
    rig_camera_index: int
    offset_px: tuple[float, float] = (0.0, 0.0)


class Rig(Record):
    """A camera of several bands."""

    system: str  # Its dialect
    camera: Camera
    bands: Mapping[str, Channel]
    iso: float
    i_ss: float  # Light of a clear noon, in the unit that the light sensor's reading has
    sunshine_serial: str
    light_noise_rel: float = 0.003  # Relative standard deviation of the light sensor's reading
    row_growth: float = 0.01  # Relative growth of the exposure along all rows of a radiance camera


def _camera(body: Body, size: tuple[int, int], *, black_dn: float, bits: int) -> Camera:
    full_dn = float(((1 << bits) - 1) << (16 - bits))
    return change(
        Camera(body=body),
        height_px=size[0],
        width_px=size[1],
        cfa="grey",
        gain_dn_per_e=full_dn / _ELECTRONS,
        read_noise_e=5.0,
        black_level_dn=black_dn,
        white_level_dn=full_dn,
        step_dn=float(1 << (16 - bits)),
    )


def _channels(ks: Mapping[str, float], exposures: Mapping[str, float] | float) -> dict[str, Channel]:
    waves = {"blue": (475.0, 32.0), "green": (560.0, 27.0), "red": (668.0, 16.0)}
    waves |= {"nir": (842.0, 57.0), "red_edge": (717.0, 12.0)}
    return {
        name: Channel(
            reflectance_k=k,
            wavelength_nm=waves[name][0],
            width_nm=waves[name][1],
            exposure_time_s=exposures if isinstance(exposures, float) else exposures[name],
            rig_camera_index=number,
            offset_px=(0.0, 0.0) if name == "nir" else (1.0 + number, -2.0),
        )
        for number, (name, k) in enumerate(ks.items())
    }


REDEDGE = Rig(
    system="micasense",
    camera=_camera(
        Body(make="MicaSense", model="RedEdge-M", serial="RM01-1808077-SC", software="v2.1.2"),
        (960, 1280),
        black_dn=4800.0,
        bits=12,
    ),
    bands=_channels({"blue": 3.2, "green": 3.1, "red": 3.15, "nir": 3.05, "red_edge": 3.2}, 0.001),
    iso=100.0,
    i_ss=1.1,
    sunshine_serial="DL03-1706120-SC",
)
REDEDGE_P = replace(
    REDEDGE,
    system="micasense_2d",
    camera=_camera(
        Body(make="MicaSense", model="RedEdge-P", serial="PR01-2203001-MS", software="v1.3.1"),
        (1088, 1456),
        black_dn=3840.0,
        bits=12,
    ),
    sunshine_serial="DA05-2209245-WC",
)
P4M = Rig(
    system="dji",
    camera=_camera(
        Body(make="DJI", model="FC6360", serial="43e53d2eaaae3536b0fd1499da1d4389", software="v01.17.2006"),
        (1300, 1600),
        black_dn=4096.0,
        bits=10,
    ),
    bands=_channels(
        {"blue": 2.9, "green": 3.0, "red": 3.1, "red_edge": 3.0, "nir": 3.1},
        {"blue": 0.00035, "green": 0.0003, "red": 0.0003, "red_edge": 0.000328, "nir": 0.000384},
    ),
    iso=200.0,
    i_ss=7000.0,
    sunshine_serial="43e53d2eaaae3536b0fd1499da1d4389",
)
RIGS = {"rededge": REDEDGE, "rededge-p": REDEDGE_P, "p4m": P4M}

_A1, _ADJUSTMENT = 1.9e-4, 0.95
_F_NUMBER = 2.2


def capture(
    rig: Rig,
    random: np.random.Generator,
    *,
    reflectance: Mapping[str, float | Plane],
    light: float = 1.0,
    taken_at: datetime = datetime(2024, 6, 13, 11, 0, tzinfo=UTC),
    capture_id: str = "capture",
) -> dict[str, Taken]:
    """Expose the bands of a level surface under one light, relative to that of a clear noon.

    ``reflectance`` has one value per band to expose, or (row, col) for the whole frame. The makers' own
    equations, solved for the mean raw value of a pixel::

        MicaSense  p = B + 2^16 V L g t (1 + growth y) / a1          L = R I_ss / K
        DJI        p = B + 2^16 / G  gain t R I_ss / (K p_cam)

    V, G and the growth along the rows are part of the surface that the camera sees.
    """
    taken = {}
    for name, surface in reflectance.items():
        channel, true = rig.bands[name], rig.i_ss * light
        taken[name] = _expose(rig, channel, surface, true, random)
        stated = true * (1.0 + rig.light_noise_rel * random.standard_normal())
        header = replace(
            taken[name].header,
            container="tiff",
            white_level_origin="camera",
            taken_at=taken_at.isoformat(),
            software=rig.camera.body.software,
            latitude_deg=50.85,
            longitude_deg=4.35,
            multispectral=_describe(rig, name, channel, stated, capture_id),
        )
        taken[name] = replace(taken[name], name=name, header=header)
    return taken


def _expose(
    rig: Rig, channel: Channel, surface: float | Plane, light: float, random: np.random.Generator
) -> Taken:
    sensor, time_s = rig.camera.sensor, channel.exposure_time_s
    scale = _ADJUSTMENT if rig.system == "dji" else _A1 / (rig.iso / 100.0)
    # the chain divides by f^2 and multiplies by t
    sensitivity_e = _FULL_SCALE * _F_NUMBER**2 / (scale * channel.reflectance_k * sensor.gain_dn_per_e)
    camera = change(rig.camera, sensitivity_e=sensitivity_e, base_iso=rig.iso)
    rows = np.arange(sensor.height_px) / sensor.height_px
    growth = 1.0 + (0.0 if rig.system == "dji" else rig.row_growth) * rows
    seen = np.broadcast_to(surface, (sensor.height_px, sensor.width_px)) * _shade(rig) * growth[:, None]
    shot = Shot(
        frame="",
        role="",
        settings=exposure.Settings(exposure_time_s=time_s, f_number=_F_NUMBER, iso=rig.iso),
        lamp=Lamp(luminance_cd_m2=light),
        target=targets.Picture(seen),
    )
    return take(camera, shot, random)


def _shade(rig: Rig) -> Plane:
    """Return V of every pixel, term by term."""
    sensor = rig.camera.sensor
    cols, rows = np.arange(sensor.width_px)[None, :], np.arange(sensor.height_px)[:, None]
    if rig.system == "micasense_2d":
        pairs = zip(sequoia.LENS.exponents, sequoia.LENS.coefficients, strict=True)
        x, y = cols / sensor.width_px, rows / sensor.height_px
        return np.asarray(sum(c * x**i * y**j for (i, j), c in pairs))
    x0, y0 = _centre(rig)
    radius = np.sqrt((cols - x0) ** 2 + (rows - y0) ** 2) / _half_diagonal(rig)
    falloff = 1.0 + sum(term * radius ** (power + 1) for power, term in enumerate(_FALLOFF))
    return np.asarray(1.0 / (2.0 - falloff) if rig.system == "dji" else falloff)


def _centre(rig: Rig) -> tuple[float, float]:
    return rig.camera.sensor.width_px / 2.0, rig.camera.sensor.height_px / 2.0


def _half_diagonal(rig: Rig) -> float:
    return math.hypot(*_centre(rig))


def _describe(
    rig: Rig, name: str, channel: Channel, light: float, capture_id: str
) -> multispectral.Multispectral:
    """Return what a reader gets of the band's file."""
    sensor, dji, flat = rig.camera.sensor, rig.system == "dji", rig.system == "micasense_2d"
    sign = -1.0 if dji else 1.0  # DJI's polynomial is G = 1 - (V - 1)
    terms = tuple(sign * term / _half_diagonal(rig) ** (power + 1) for power, term in enumerate(_FALLOFF))
    x, y = _centre(rig)
    radial = multispectral.RadialVignetting(centre_x_px=x, centre_y_px=y, coefficients=terms)
    time_s = channel.exposure_time_s
    radiance = multispectral.RadianceModel(a1=_A1, a2=time_s * rig.row_growth / sensor.height_px, a3=0.0)
    gain = multispectral.GainModel(gain=1.0, exposure_time_s=time_s, adjustment=_ADJUSTMENT)
    return multispectral.Multispectral(
        system=rig.system,
        band=name,
        band_name=name,
        wavelength_nm=channel.wavelength_nm,
        width_nm=channel.width_nm,
        rig_camera_index=channel.rig_camera_index,
        capture_id=capture_id,
        full_scale_dn=sensor.white_level_dn,
        vignetting_polynomial=sequoia.LENS if flat else None,
        radial_vignetting=None if flat or dji else radial,
        radial_gain=radial if dji else None,
        radiance_model=None if dji else radiance,
        gain_model=gain if dji else None,
        black_dn=sensor.black_level_dn if dji else None,
        sunshine_serial=rig.sunshine_serial,
        irradiance=_state_light(rig, light),
        geometry=multispectral.RigGeometry(
            model="perspective",
            principal_point_px=(x, y),
            focal_length_px=1.2 * sensor.width_px,
            focal_length_y_px=1.2 * sensor.width_px if dji else None,
            distortion=(0.0, 0.0, 0.0, 0.0, 0.0),
            rotation_deg=(0.0, 0.0, 0.0) if flat else None,
            pixels_per_mm=(_PIXELS_PER_MM, _PIXELS_PER_MM),
            offset_px=channel.offset_px if dji else None,
            calibrated_on="2019-03-07" if dji else None,
        ),
    )


def _state_light(rig: Rig, light: float) -> multispectral.SunshineIrradiance:
    if rig.system == "dji":
        stated = multispectral.SunshineIrradiance(
            relative_irradiance=light, quantity="spectral", unit_origin="own", file_unit="DJI's own"
        )
    elif rig.system == "micasense":
        stated = multispectral.SunshineIrradiance(
            irradiance_w_m2_nm=light,
            quantity="spectral",
            unit_origin="dls1",
            file_unit="W/m2/nm",
            spectral_w_m2_nm=light,
        )
    else:
        stated = multispectral.SunshineIrradiance(
            irradiance_w_m2_nm=light,
            quantity="horizontal",
            unit_origin="model",
            file_unit="uW/cm2/nm",
            spectral_w_m2_nm=light,
            horizontal_w_m2_nm=light,
            direct_w_m2_nm=_DIRECT * light / math.sin(math.radians(_SUN_DEG[0])),
            scattered_w_m2_nm=(1.0 - _DIRECT) * light,
            solar_elevation_deg=_SUN_DEG[0],
            solar_azimuth_deg=_SUN_DEG[1],
        )
    return replace(stated, yaw_deg=0.0, pitch_deg=0.0, roll_deg=0.0)
