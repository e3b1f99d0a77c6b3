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
{of_method}
# What the files are; the first that fits decides. Names may also be given as a range, without a pattern:
# {{ first = "DJI_0001.DNG", last = "DJI_0012.DNG" }}
{frames}
# The region in pixels of the frame: corners, or what ImageJ's macro recorder writes. It may be drawn later.
# [region]
{region}
[fit]
{fit}
"""

_LUMINANCE = """\
# surface_reflectance = 0.18  # of the taped surface, where it is known

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
"""
_REFLECTANCE = """
# The panel as it was measured on a day: what it reflects in each band, and with what standard uncertainty.
# [panel]
# serial = "RP04-1832179-SC"
# measured_on = 2026-03-14
# bands = [\
{{ band = "green", reflectance = 0.49, standard_uncertainty = 0.005 }},\
 {{ band = "nir", reflectance = 0.48, standard_uncertainty = 0.005 }}]
"""
_SHARPNESS = """
# What is photographed: slanted edges, or stars of so many pairs of sectors.
# [target]
# kind = "siemens_star"
# cycles = 48
"""
_GEOMETRY = """
# The board that is photographed, by its inner corners.
# [target]
# kind = "checkerboard"
# columns = 9
# rows = 6
# square_size_mm = 25.0
"""
_OF_METHOD = {
    "luminance": _LUMINANCE,
    "reflectance": _REFLECTANCE,
    "sharpness": _SHARPNESS,
    "geometry": _GEOMETRY,
}

# By method, each role's folder.
_FOLDERS = {
    "luminance": {"dark": "dark", "field": "field", "light": "{scene}"},
    "reflectance": {"panel": "panel", "field": "field"},
    "vignetting": {"dark": "dark", "flat": "flat"},
    "sharpness": {"chart": "chart"},
    "geometry": {"chart": "chart"},
    "noise": {"dark": "dark", "flat": "flat"},
}
METHODS = tuple(_FOLDERS)
_REMARKS = {"light": "  # a folder a light level: level-1/, level-2/, ..."}
_ONE = '# imagej = "makePolygon(2200,1600,3100,1600,3100,2300,2200,2300);"\n'
_PARTS = """\
# [region.parts]
# centre = [[2200, 1600], [2400, 1600], [2400, 1800], [2200, 1800]]
# top-left = [[200, 160], [400, 160], [400, 360], [200, 360]]
"""
_FITS = {"luminance": 'model = "proportional"\ntolerance = 0.04'}


def write_template(said: Mapping[str, str], *, folder: str, has_readings: bool) -> str:
    """The text; ``said``: make, model, serial, method, project_number, each "" where nobody has said it."""
    method, mark = said["method"], "" if has_readings else "# "
    readings = f'{mark}[readings]\n{mark}file = "readings.csv"'
    return _TEXT.format(
        folder=folder,
        of_method=_OF_METHOD.get(method, "").format(readings=readings),
        frames="\n".join(_rule(role, name) for role, name in _FOLDERS[method].items()),
        region=_PARTS if method == "sharpness" else _ONE,
        fit=_FITS.get(method, "# as docs/ of the method say"),
        # A JSON text is a TOML text too.
        **{name: json.dumps(value, ensure_ascii=False) for name, value in said.items()},
    )


def _rule(role: str, folder: str) -> str:
    return f'[[frames]]\npattern = "{folder}/*"{_REMARKS.get(role, "")}\nrole = "{role}"\n'
