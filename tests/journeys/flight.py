"""A Sequoia's flight: a panel before and after, a field in between, and no file that states a time zone."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from simulation.camera import change
from simulation.multispectral_files import name_file, write_sequoia
from simulation.sequoia import SEQUOIA, capture
from tests.journeys.door import Door, conclude
from tests.journeys.plan import Corners, File, Plan
from tests.support.frames import forget_time

CAMERA = {"make": "Parrot", "model": "Sequoia", "serial": "PI040378AA6C000181"}
DAY, NEXT_DAY = "2018-04-13", "2018-04-14"
PANEL_U = 0.002
PANEL = {"green": 0.183, "red": 0.181, "red_edge": 0.180, "nir": 0.178}
MEADOW = {"green": 0.09, "red": 0.05, "red_edge": 0.28, "nir": 0.48}
K_TRUE = {name: band.reflectance_k for name, band in SEQUOIA.bands.items()}
PANEL_REGION: Corners = [(560, 400), (720, 400), (720, 560), (560, 560)]
MEADOW_REGION: Corners = [(100, 240), (540, 240), (540, 720), (100, 720)]

_SOIL = {"green": 0.14, "red": 0.20, "red_edge": 0.25, "nir": 0.30}
_ROWS, _COLS = 960, 1280
# noise of one size is drawn in a third of the time that counted electrons take
_CAMERA = change(SEQUOIA, photon_noise=False, read_noise_e=25.0)
# where, how long after the first, and the light
_CAPTURES = (
    ("panel-before", timedelta(0), 4300.0),
    ("panel-before", timedelta(seconds=20), 4310.0),
    ("field", timedelta(minutes=12), 4100.0),
    ("panel-after", timedelta(minutes=25), 4400.0),
)


@dataclass(frozen=True, kw_only=True)
class Flight:
    """The card: a folder for each visit to the panel and one of the field; ``field`` by band."""

    folder: Path
    files: list[File]
    field: dict[str, File]


def write_flight(folder: Path) -> Flight:
    """16 files of 2.4 MB. The left half of the field is a meadow, the right half soil."""
    random = np.random.default_rng(20180413)
    start = datetime(2018, 4, 13, 10, 0, tzinfo=UTC)
    left = np.broadcast_to(np.arange(_COLS) < _COLS // 2, (_ROWS, _COLS))
    field = {band: np.where(left, MEADOW[band], _SOIL[band]) for band in MEADOW}
    card = folder / "Sequoia 13 April"
    files, of_field = [], {}
    for number, (where, after, light) in enumerate(_CAPTURES):
        taken = capture(
            _CAMERA,
            random,
            reflectance=field if where == "field" else PANEL,
            i_ss=light,
            taken_at=start + after,
            capture_id=f"capture-{number}",
        )
        (card / where).mkdir(parents=True, exist_ok=True)
        for band, one in taken.items():
            path = card / where / name_file(number, one.header)
            write_sequoia(path, one)
            path.write_bytes(forget_time(path.read_bytes(), zone_only=True))
            files.append(File(path=path, role="field" if where == "field" else "panel"))
            if where == "field":
                of_field[band] = files[-1]
    return Flight(folder=card, files=files, field=of_field)


def plan_flight(flight: Flight, *, certified: bool) -> Plan:
    """The panel's certificate is what states the uncertainty of each band."""
    stated = {"standard_uncertainty": PANEL_U} if certified else {}
    bands = [{"band": band, "reflectance": value} | stated for band, value in PANEL.items()]
    return Plan(
        folder=flight.folder,
        camera=CAMERA,
        method="reflectance",
        number="FLIGHT-1",
        files=flight.files,
        region=PANEL_REGION,
        panel={"serial": "RP02-1603036-SC", "measured_on": "2018-03-01", "bands": bands},
    )


def travel(door: Door, flight: Flight, *, certified: bool) -> None:
    """From the card to the reflectance of a meadow, for the day of the flight alone."""
    plan = plan_flight(flight, certified=certified)
    door.register(plan)
    door.begin(plan)
    door.send(plan)
    door.set_region(plan)
    version = door.fit(plan)
    door.publish(version, valid_from=DAY, valid_to=NEXT_DAY, reason="panel before and after the flight")
    for band, truth in K_TRUE.items():
        found = door.look_up(plan, "reflectance_k", at=DAY, band=band)
        assert found.agrees(truth), (band, found)
    for band in ("red", "nir"):
        measured = door.measure(plan, flight.field[band], MEADOW_REGION)
        assert measured.agrees(MEADOW[band], within=2.0), (band, measured)
    conclude(door, version)
