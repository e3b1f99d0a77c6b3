import pytest

from tests.docs.method_names import find_in_python, find_in_script, main

BAD = [
    'if row.method == "geometry": pass',
    'if campaign["method"] in ("luminance", "noise"): pass',
    'if "sharpness" != said.get("method"): pass',
    'METHOD = "vignetting"',
    'find(method="noise")',
    'def find(*, method: str = "luminance"): pass',
    'match version.method:\n    case "reflectance": pass',
    'EXPORTS = {"geometry": 1, "vignetting": 2}',
    'DRAWN = ["noise", "geometry"]',
    "from radiometry.luminance.lens import name_channels",
    "from radiometry import reflectance",
    "import radiometry.noise.fit",
]
GOOD = [
    'if reading.quantity == "luminance": pass',
    'SI = {"luminance": "cd/m2", "illuminance": "lx"}',
    'if "vignetting" in row.parameters: pass',
    'feature = {"type": "Feature", "geometry": None}',
    'Literal["luminance", "illuminance"]',
    "from radiometry.methods import METHODS",
    "if spec.name == version.method: pass",
]
SCRIPTS = [
    ('if (method === "luminance") draw();', True),
    ("const able = ['vignetting', 'noise'];", True),
    ('{% if campaign.method == "luminance" %}', True),
    ('if ("geometry" !== room.method) return;', True),
    ('if (unit.kind === "luminance") draw();', False),
    ("if (method.tolerance_unit === '%') draw();", False),
]


@pytest.mark.parametrize("text", BAD)
def test_name_of_a_method_in_python_is_found(text):
    assert list(find_in_python(text))


@pytest.mark.parametrize("text", GOOD)
def test_quantity_or_column_of_the_same_name_is_allowed(text):
    assert not list(find_in_python(text))


@pytest.mark.parametrize(("text", "found"), SCRIPTS)
def test_scripts_and_templates(text, found):
    assert bool(list(find_in_script(text))) == found


def test_the_product_knows_no_method_by_its_name():
    assert main() == 0
