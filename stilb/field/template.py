"""The campaign.toml that `stilb campaign init` writes: to be filled in, with what there is said in it."""

import json
from collections.abc import Mapping

_TEXT = """\
# One campaign: one camera, one method. Then: stilb campaign run {folder}

[camera]  # by the names that it writes into its files
make = {make}
model = {model}
serial = {serial}
# pixel_pitch_um = 3.28

[campaign]
method = {method}
project_number = {project_number}  # the same number again is the same campaign
# recorder = "A. Meier"
# place = "hangar 2"
# started_at = 2026-05-01T20:30:00Z
# surface_reflectance = 0.18  # of the taped surface, where it is known

# What the files are; the first that fits decides. Names may also be given as a range: first = "DJI_0001.DNG",
# last = "DJI_0012.DNG", scene = "level-1".
[[frames]]
pattern = "dark/*"
role = "dark"

[[frames]]
pattern = "field/*"
role = "field"

[[frames]]
pattern = "{{scene}}/*"  # a folder a light level: level-1/, level-2/, ...
role = "light"

# The meter, with its certificate where it has one; one table a meter.
# [[meter]]
# kind = "luminance"
# make = "Konica Minolta"
# model = "LS-150"
# serial = "30011942"
# certificate = {{ number = "L-2026-0117", laboratory = "PTB", issued_on = 2026-01-17, due_on = 2027-01-17,\
 expanded_uncertainty_rel = 0.02, coverage_factor = 2 }}

# The readings: a spreadsheet saved as CSV with the columns scene, quantity, value, unit (cd/m2, fL, lx, fc).
{readings}

# The region in pixels of the frame: corners, or what ImageJ's macro recorder writes. It may be drawn later.
# [region]
# imagej = "makePolygon(2200,1600,3100,1600,3100,2300,2200,2300);"

[fit]
{fit}
"""
_FITS = {"luminance": 'model = "proportional"\ntolerance = 0.04'}


def write_template(said: Mapping[str, str], *, folder: str, has_readings: bool) -> str:
    """The text; ``said``: make, model, serial, method, project_number, each "" where nobody has said it."""
    mark = "" if has_readings else "# "
    return _TEXT.format(
        folder=folder,
        readings=f'{mark}[readings]\n{mark}file = "readings.csv"',
        fit=_FITS.get(said["method"], "# as docs/ of the method say"),
        # A JSON text is a TOML text too.
        **{name: json.dumps(value, ensure_ascii=False) for name, value in said.items()},
    )
