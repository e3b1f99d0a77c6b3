"""A night of the procedure S1: a flat card of 54 DNGs, two of which belong to no scene, and two meters.

No file states a time zone. The card is a folder of one evening with blanks in its name, as it was copied from
the camera: DJI_0001.DNG and so on, whatever they show.
"""

from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from radiometry.frame.exposure import Settings
from simulation.camera import Camera, change
from simulation.dng import write_dng
from tests.journeys.door import Door, conclude
from tests.journeys.plan import Corners, File, Plan, describe_meter
from tests.support.frames import forget_time

CAMERA = {"make": "DJI", "model": "FC6520", "serial": "0K1XE8"}
BORROWED_SERIAL = "0K1XE9"  # of the camera whose frame lies on the card too
K_TRUE = 33.0
TARGET_REFLECTANCE = 0.18
LEVELS = {"level-1": 54.4, "level-2": 20.0, "level-3": 7.0, "level-4": 2.94, "level-5": 1.28}
STREET_CD_M2 = 5.0
REGION: Corners = [(360, 260), (660, 265), (655, 500), (355, 495)]
STREET_REGION: Corners = [(2000, 1500), (3300, 1500), (3300, 2500), (2000, 2500)]
DAY = "2026-05-01"

_SHAPE, _STREET_SHAPE = (768, 1024), (3956, 5280)
_BLACK, _WHITE, _GAIN, _READ_DN = 256, 4095, 0.15, 2.0
_F_NUMBERS = (2.8, 4.0, 5.6, 8.0)
_TIMES_S = {400: (1 / 60, 1 / 4), 1600: (1 / 250, 1 / 15)}  # of the two bright levels, of the others
# by how much a marking, a reading and the meter err: the same wherever they occur
_OPENED = {2.8: 1.004, 4.0: 0.994, 5.6: 1.007, 8.0: 0.995}
_READ = {"level-1": 1.004, "level-2": 0.995, "level-3": 1.003, "level-4": 0.996, "level-5": 1.002}
_METER_SCALE = 1.003


@dataclass(frozen=True, kw_only=True)
class Night:
    """The card; ``strays`` are the frame of another camera, and one that is white all over."""

    folder: Path
    files: list[File]
    strays: list[File]
    street: File


def write_night(folder: Path) -> Night:
    """53 files of 1.6 MB, one of 42 MB, and what else lies on a card."""
    card = _Card(folder / "S1 night 1 May")
    files: list[File] = []
    for level, luminance in LEVELS.items():
        card.wait(minutes=20)
        for iso, times in _TIMES_S.items():
            time_s = times[level not in {"level-1", "level-2"}]
            settings = Settings(exposure_time_s=time_s, f_number=4.0, iso=iso)
            files += [
                card.take("light", luminance, replace(settings, f_number=f_number), level)
                for f_number in (_F_NUMBERS if (level, iso) != ("level-5", 400) else _F_NUMBERS[:3])
            ]
        if level == "level-2":
            name = "DJI_0012 (1).DNG"
            borrowed = card.take("light", luminance, settings, level, name=name, serial=BORROWED_SERIAL)
        if level == "level-3":
            white = card.take("light", luminance, replace(settings, exposure_time_s=1.0), level)
    card.wait(minutes=10)
    files += [
        card.take("dark", 0.0, Settings(exposure_time_s=time_s, f_number=8.0, iso=iso))
        for iso, times in _TIMES_S.items()
        for time_s in times
        for _ in range(3)
    ]
    card.wait(minutes=30)
    settings = Settings(exposure_time_s=1 / 4, f_number=4.0, iso=400)
    street = card.take("field", STREET_CD_M2, settings, shape=_STREET_SHAPE)
    (card.folder / "DJI_0001.JPG").write_bytes(b"\xff\xd8\xff")
    (card.folder / "DJI_0060.MP4").write_bytes(b"video")
    return Night(folder=card.folder, files=files, strays=[borrowed, white], street=street)


class _Card:
    def __init__(self, folder: Path):
        self.folder = folder
        folder.mkdir()
        self._random = np.random.default_rng(20260501)
        # one field of noise for all frames, each of which begins elsewhere in it
        self._noise = self._random.standard_normal(2**22, dtype=np.float32)
        self._taken, self._at = 0, datetime(2026, 5, 1, 19, 0, tzinfo=UTC)

    def wait(self, *, minutes: int) -> None:
        self._at += timedelta(minutes=minutes)

    def take(
        self,
        role: str,
        luminance_cd_m2: float,
        settings: Settings,
        scene: str | None = None,
        *,
        shape: tuple[int, int] = _SHAPE,
        name: str = "",
        serial: str = CAMERA["serial"],
    ) -> File:
        self._at += timedelta(seconds=10)
        if not name:
            self._taken += 1
        path = self.folder / (name or f"DJI_{self._taken:04}.DNG")
        f_number = settings.f_number * _OPENED[settings.f_number]
        signal = K_TRUE * settings.exposure_time_s * settings.iso * luminance_cd_m2 / f_number**2
        scatter = np.float32(np.hypot(_READ_DN, np.sqrt(_GAIN * signal)))
        start, size = int(self._random.integers(2**21)), shape[0] * shape[1]
        noise = np.resize(self._noise[start : start + size], shape)
        drawn = np.float32(_BLACK + signal + 0.5) + scatter * noise
        mosaic = np.clip(drawn, 0, _WHITE).astype(np.uint16)
        height, width = shape
        camera = change(Camera(), serial=serial, lens_serial="L1", height_px=height, width_px=width)
        write_dng(path, mosaic, camera=camera, settings=settings, taken_at=self._at)
        path.write_bytes(forget_time(path.read_bytes(), zone_only=True))
        return File(path=path, role=role, scene=scene)


def plan_night(night: Night, *, certified: bool) -> Plan:
    return Plan(
        folder=night.folder,
        camera=CAMERA,
        method="luminance",
        number="P-2026-014",
        files=[*night.files, *night.strays, night.street],
        region=REGION,
        meters=[
            describe_meter("luminance", "LS-150", "30011942", certified=certified),
            describe_meter("illuminance", "T-10A", "40027731", certified=certified),
        ],
        readings=[
            {"scene": level, "quantity": "luminance", "value": round(value * error, 4), "unit": "cd/m2"}
            for level, value in LEVELS.items()
            for error in (_METER_SCALE * _READ[level], _METER_SCALE * _READ[level] * 1.002)
        ]
        + [
            {
                "scene": "level-2",
                "quantity": "illuminance",
                "value": round(np.pi * LEVELS["level-2"] / TARGET_REFLECTANCE, 1),
                "unit": "lx",
            }
        ],
        details={"recorder": "A. Meier", "surface_reflectance": TARGET_REFLECTANCE},
        params={"model": "proportional", "tolerance": 0.04},
    )


def travel(door: Door, night: Night, *, certified: bool) -> None:
    """From the card to a measured street."""
    plan = plan_night(night, certified=certified)
    door.register(plan)
    door.begin(plan)
    door.send(plan)
    door.set_region(plan)
    door.type_readings(plan)
    version = door.fit(plan)
    door.publish(version, valid_from=DAY, reason="spring campaign")
    for iso in _TIMES_S:
        found = door.look_up(plan, "luminance_k", at="2026-05-02", iso=iso)
        assert found.agrees(K_TRUE), (iso, found)
    measured = door.measure(plan, night.street, STREET_REGION)
    assert measured.agrees(STREET_CD_M2, within=2.0), measured
    conclude(door, version)
