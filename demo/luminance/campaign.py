"""The campaign that the demo calibrates: what is photographed and measured, all from one seed.

The sensor, the light levels and the errors of settings and meter come from `simulation.luminance`.
Added here is what a campaign has besides: files with names, windowed readouts, a region, a light monitor.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from demo.dng import Camera
from radiometry.frame.roi import Polygon, Window
from simulation.luminance import Errors, Sensor, simulate_campaign
from simulation.luminance import Shot as Exposed

TOLERANCE_REL = 0.04  # the procedure's
SURFACE_REFLECTANCE = 0.18  # of the grey target

_SENSOR = Sensor(seed=7)
_WHOLE = Window(row0=0, col0=0, height=_SENSOR.height_px, width=_SENSOR.width_px)
# Even corners, so that a readout begins with the same colour as the sensor.
_READOUT = Window(row0=1500, col0=2900, height=480, width=640)
# The taped rectangle as a hand draws it: (x, y) [px] of the whole sensor.
_ROI = ((2976.0, 1560.0), (3460.0, 1571.0), (3455.0, 1902.0), (2971.0, 1891.0))
_ERRORS = Errors(repeatability=0.01, calibration=0.01, f_number=0.01, exposure_time=0.003)
_LUMINANCE_READINGS = 5
_MONITOR_READINGS = 4
_MONITOR_REPEATABILITY_REL = 0.003
_MONITOR_CALIBRATION_REL = 0.01

Points = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One frame to take. ``own_roi`` is the region in its own pixels; None: the campaign's holds."""

    filename: str
    exposed: Exposed
    window: Window
    own_roi: Points | None


@dataclass(frozen=True, kw_only=True)
class Meter:
    """A meter with its certificate."""

    kind: str
    make: str
    model: str
    serial: str
    certificate_number: str
    expanded_uncertainty_rel: float
    coverage_factor: float = 2.0


@dataclass(frozen=True, kw_only=True)
class MeterReading:
    """What a meter of a kind showed of a scene, with that meter's error."""

    scene: str
    quantity: str  # luminance | illuminance, as the meter's kind
    value: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """Everything that a field team brings home, and the truth that it never knows."""

    seed: int
    project_number: str
    started_at: datetime
    camera: Camera
    sensor: Sensor
    roi: Points
    shots: tuple[Shot, ...]
    meters: tuple[Meter, ...]
    readings: tuple[MeterReading, ...]
    true_luminance_k: Mapping[int, float]  # by ISO, of the region [DN*m2/(cd*s)]


def plan_campaign(seed: int) -> Campaign:
    """Plan the frames, draw the readings. The same seed gives the same campaign, and the same files."""
    random = np.random.default_rng(seed)
    simulated = simulate_campaign(_SENSOR, random, errors=_ERRORS, readings_per_scene=_LUMINANCE_READINGS)
    luminance = tuple(
        MeterReading(scene=r.scene, quantity="luminance", value=float(f"{r.value:.4g}"), unit="cd/m2")
        for r in simulated.readings
    )
    true_k = _SENSOR.true_k(Polygon.from_points(_ROI))
    return Campaign(
        seed=seed,
        project_number=f"DEMO-{seed}",
        started_at=datetime(2025, 3, 1, 20, 30, tzinfo=UTC),
        camera=Camera(
            black_level_dn=round(_SENSOR.black_level_dn),
            white_level_dn=round(_SENSOR.white_level_dn),
            serial="0K8TF1A0010042",
            cfa=_SENSOR.cfa,
        ),
        sensor=_SENSOR,
        roi=_ROI,
        shots=_choose(simulated.shots),
        meters=(
            _meter("luminance", "LS-150", "30011942", "L-2025-0117", _ERRORS.calibration),
            _meter("illuminance", "T-10A", "40027731", "E-2025-0118", _MONITOR_CALIBRATION_REL),
        ),
        readings=luminance + _monitor(simulated.truth_cd_m2, random),
        true_luminance_k={round(shot.stated.iso): true_k for shot in simulated.shots},
    )


def _choose(exposed: tuple[Exposed, ...]) -> tuple[Shot, ...]:
    """Take what the demo has time for. The first frame of each ISO is a full one, the rest are readouts."""
    shots: list[Shot] = []
    for iso in sorted({one.stated.iso for one in exposed}):
        own = [one for one in exposed if one.stated.iso == iso]
        dark = [one for one in own if one.scene is None]
        for number, one in enumerate(_light(own) + dark):
            whole = number == 0
            shots.append(
                Shot(
                    filename=f"DJI_{len(shots) + 1:04}.DNG",
                    exposed=one,
                    window=_WHOLE if whole else _READOUT,
                    own_roi=None if whole else _seen_from(_READOUT, _ROI),
                )
            )
    return tuple(shots)


def _light(exposed: list[Exposed]) -> list[Exposed]:
    """Take every second aperture, of one level the first, third, ..., of the next the others."""
    chosen: list[Exposed] = []
    scenes = sorted({one.scene for one in exposed if one.scene is not None})
    for turn, scene in enumerate(scenes):
        chosen += [one for one in exposed if one.scene == scene][turn % 2 :: 2]
    return chosen


def _seen_from(window: Window, points: Points) -> Points:
    """Give points (x, y) of the whole sensor in the window's own pixels."""
    return tuple((x - window.col0, y - window.row0) for x, y in points)


def _meter(kind: str, model: str, serial: str, number: str, calibration_rel: float) -> Meter:
    return Meter(
        kind=kind,
        make="Konica Minolta",
        model=model,
        serial=serial,
        certificate_number=number,
        expanded_uncertainty_rel=2 * calibration_rel,
    )


def _monitor(truth_cd_m2: Mapping[str, float], random: np.random.Generator) -> tuple[MeterReading, ...]:
    """Watch the lamp with an illuminance meter beside the target: E = pi L / rho."""
    calibration = random.normal(1.0, _MONITOR_CALIBRATION_REL)
    return tuple(
        MeterReading(
            scene=scene,
            quantity="illuminance",
            value=float(f"{illuminance * random.normal(1.0, _MONITOR_REPEATABILITY_REL):.4g}"),
            unit="lx",
        )
        for scene, luminance in truth_cd_m2.items()
        for illuminance in [math.pi * luminance / SURFACE_REFLECTANCE * calibration] * _MONITOR_READINGS
    )
