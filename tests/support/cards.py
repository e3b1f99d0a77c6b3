"""A card as a field team brings it home: a folder a light level, one of dark frames, readings, a plan."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from tests.support.campaigns import LEVELS
from tests.support.fieldwork import Shot
from tests.support.house import CAMERA

PLAN = """
[camera]
make = "{make}"
model = "{model}"
serial = "{serial}"

[campaign]
method = "luminance"
project_number = "P-17"

[[meter]]
kind = "luminance"
make = "Gossen"
model = "Starlite 2"
serial = "8F0042"
certificate = {{ number = "1", laboratory = "PTB", issued_on = 2026-01-17, due_on = 2027-01-17,\
 expanded_uncertainty_rel = 0.02, coverage_factor = 2 }}

[[frames]]
pattern = "dark/*"
role = "dark"

[[frames]]
pattern = "{{scene}}/*"
role = "light"

[readings]
file = "readings.csv"

[region]
imagej = "makePolygon(8,8,88,8,88,56,8,56);"

[fit]
model = "proportional"
tolerance = 0.04
"""


def write_card(folder: Path, shots: Sequence[Shot]) -> Path:
    """The shots in their folders, and the readings."""
    for shot in shots:
        target = folder / (shot.scene or "dark")
        target.mkdir(parents=True, exist_ok=True)
        shutil.copy(shot.path, target / shot.path.name)
    rows = [f"{scene},luminance,{value * f},cd/m2" for scene, value in LEVELS.items() for f in (0.998, 1.002)]
    (folder / "readings.csv").write_text("\n".join(["scene,quantity,value,unit", *rows]) + "\n")
    return folder


def write_plan(folder: Path) -> Path:
    """A filled in campaign.toml."""
    path = folder / "campaign.toml"
    path.write_text(PLAN.format(**CAMERA))
    return path
