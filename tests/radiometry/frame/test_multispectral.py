"""A band has one name, however a camera, a data sheet or a person writes it."""

import pytest

from radiometry.frame.multispectral import name_band


@pytest.mark.parametrize(
    ("text", "band"),
    [
        ("Red edge", "red_edge"),
        ("NIR", "nir"),
        ("Blue-444", "blue_444"),
        ("RedEdge", "red_edge"),
        ("é", "unnamed"),
    ],
)
def test_bands_have_one_name(text, band):
    assert name_band(text) == band
