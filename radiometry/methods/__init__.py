"""The calibration methods. A new method is one package and one name in `METHODS`."""

from typing import Final

from radiometry import geometry, luminance, noise, reflectance, sharpness, vignetting
from radiometry.specification.method import MethodSpec

METHODS: Final[tuple[MethodSpec, ...]] = (
    luminance.SPEC,
    reflectance.SPEC,
    vignetting.SPEC,
    sharpness.SPEC,
    geometry.SPEC,
    noise.SPEC,
)

_BY_NAME: Final = {spec.name: spec for spec in METHODS}


def get_method(name: str) -> MethodSpec:
    return _BY_NAME[name]
