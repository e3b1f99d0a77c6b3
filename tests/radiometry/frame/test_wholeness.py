"""What is missing in an image is told from what is dark."""

from dataclasses import replace

import numpy as np
import pytest

from radiometry.frame.multispectral import name_band
from radiometry.frame.packing import Packed, pack, unpack
from radiometry.frame.proof import EmptyBlock, WholenessCheck, describe_empty

ROWS, COLS = 240, 400


def _look(samples, *, black=256.0, lowest=0.0, rendered=False, band=32):
    check = WholenessCheck(
        height_px=len(samples),
        width_px=samples.shape[1],
        channels=samples.shape[2] if samples.ndim == 3 else 1,
        black_dn=black,
        lowest_dn=lowest,
        rendered=rendered,
    )
    for row0 in range(0, len(samples), band):
        check.add(row0, samples[row0 : row0 + band])
    return check.conclude()


def _noisy(mean, sigma, *, rows=ROWS, cols=COLS, seed=1):
    noise = np.random.default_rng(seed).normal(mean, sigma, (rows, cols))
    return np.clip(np.rint(noise), 0, 4095).astype(np.uint16)


def _zeroed(samples, *slices):
    changed = samples.copy()
    changed[slices] = 0
    return changed


@pytest.mark.parametrize(
    ("slices", "block"),
    [
        ((slice(120, 240), slice(None)), EmptyBlock(row0=120, col0=0, rows=120, cols=400)),
        ((slice(30, 32), slice(None)), EmptyBlock(row0=30, col0=0, rows=2, cols=400)),
        ((slice(50, 114), slice(128, 256)), EmptyBlock(row0=50, col0=128, rows=64, cols=128)),
        ((slice(None), slice(320, 400)), EmptyBlock(row0=0, col0=320, rows=240, cols=80)),
        ((slice(77, 78), slice(100, 200)), EmptyBlock(row0=77, col0=128, rows=1, cols=64)),
        ((slice(None), slice(None)), EmptyBlock(row0=0, col0=0, rows=240, cols=400)),
    ],
    ids=["lower half", "two rows", "tile", "columns", "part of a row", "all"],
)
def test_zeros_below_a_black_level_are_missing_data(slices, block):
    found = _look(_zeroed(_noisy(900, 20), *slices))
    assert found.empty == (block,)
    first = block.row0 // found.group_rows
    assert found.zero_share[first] > 0


def test_where_zeros_lie_is_said():
    found = _look(_zeroed(_noisy(900, 20), slice(120, 240)))
    assert describe_empty(found.empty, height_px=ROWS, width_px=COLS).startswith(
        "the image is empty in rows 120 to 239, 50.00% of it"
    )
    assert sum(found.zero_share) == pytest.approx(120 / found.group_rows)
    assert not describe_empty((), height_px=ROWS, width_px=COLS)


def test_values_far_below_black_are_missing_data_too():
    """As is the first value of a linearization table, which stands for zero."""
    samples = _noisy(900, 20)
    samples[100:110] = 100
    found = _look(samples)
    assert found.empty == (EmptyBlock(row0=100, col0=0, rows=10, cols=400),)
    assert sum(found.below_share) > 0 == sum(found.zero_share)
    samples[100:] = 30
    whole = (EmptyBlock(row0=100, col0=0, rows=140, cols=400),)
    assert _look(samples, black=64.0, lowest=30.0).empty == whole


@pytest.mark.parametrize(
    ("mean", "sigma", "black"),
    [
        *((256.0, sigma, 256.0) for sigma in (0.0, 1.0, 5.0, 40.0, 200.0)),
        *((256.0 + offset, 4.0, 256.0) for offset in (-40, -3, 3)),
        *((mean, 1.0, 0.0) for mean in (-3.0, -1.0, 0.0, 1.0, 4.0)),
    ],
)
def test_dark_frame_is_dark_however_it_varies_or_drifts(mean, sigma, black):
    """A lens cap: noise may reach below black, or the camera subtracts it itself and writes mere zeros."""
    dark = _noisy(mean, sigma)
    assert _look(dark, black=black).empty == ()
    assert black or _look(np.zeros_like(dark), black=0.0).empty == ()


def test_light_that_fades_into_clipped_black():
    """A lamp's pool on a road at night: below and above it nothing, without an edge."""
    distance = np.linspace(0, 12, ROWS)[:, None]
    mean = 900 * np.exp(-((distance - 3.0) ** 2) / 2) - 4.0
    fading = np.clip(np.rint(np.random.default_rng(2).normal(mean, 1.0, (ROWS, COLS))), 0, 4095)
    samples = fading.astype(np.uint16)
    assert not samples[-30:].any()
    assert _look(samples, black=0.0).empty == ()


@pytest.mark.parametrize(
    ("slices", "block"),
    [
        ((slice(120, 240), slice(None)), EmptyBlock(row0=120, col0=0, rows=120, cols=400)),
        ((slice(64, 90), slice(None)), EmptyBlock(row0=64, col0=0, rows=26, cols=400)),
        ((slice(None), slice(192, 256)), EmptyBlock(row0=0, col0=192, rows=240, cols=64)),
    ],
    ids=["lower half", "band", "columns"],
)
def test_zeros_that_begin_beside_light_are_missing_also_where_black_is_zero(slices, block):
    assert _look(_zeroed(_noisy(300, 15), *slices), black=0.0).empty == (block,)


@pytest.mark.parametrize(("dark_cols", "is_seen"), [(64, True), (128, False)], ids=["86 %", "71 %"])
def test_light_beside_the_zeros_must_fill_three_quarters_of_a_row(dark_cols, is_seen):
    """A night scene whose lit part is narrower may end in black by itself, and is not flagged."""
    samples = _zeroed(_noisy(300, 15), slice(None), slice(0, dark_cols))
    found = _look(_zeroed(samples, slice(120, 240)), black=0.0).empty
    assert any(block.row0 == 120 for block in found) == is_seen


@pytest.mark.parametrize("left", [40, 62, 150, 390])
@pytest.mark.parametrize("at_end", [False, True])
def test_one_row_cut_in_its_middle_proves_that_the_rest_is_missing(left, at_end):
    """Of the whole image only a part of its first row is left, or of its last one."""
    samples = _noisy(300, 15).reshape(-1)
    samples[slice(0, -left) if at_end else slice(left, None)] = 0
    block = EmptyBlock(row0=0 if at_end else 1, col0=0, rows=ROWS - 1, cols=COLS)
    assert _look(samples.reshape(ROWS, COLS), black=0.0).empty == (block,)


def test_row_cut_in_its_middle_between_empty_rows():
    samples = np.zeros(ROWS * COLS, np.uint16)
    samples[50 * COLS : 50 * COLS + 150] = 300
    assert len(_look(samples.reshape(ROWS, COLS), black=0.0).empty) == 1


@pytest.mark.parametrize("row", [0, ROWS - 1])
@pytest.mark.parametrize("cols", [slice(0, 16), slice(120, 280), slice(0, 300, 150)])
def test_marks_in_a_border_row_of_a_black_frame_are_no_cut(row, cols):
    """A camera's counter, a defect amid the row, and single hot pixels."""
    dark = np.zeros((ROWS, COLS), np.uint16)
    dark[row, cols] = 50
    assert _look(dark, black=0.0).empty == ()


def test_dark_noise_that_ends_at_once_is_cut_off():
    """A dark frame of a camera without black level: noise above, nothing at all below."""
    dark = _noisy(1.0, 2.0)
    assert _look(_zeroed(dark, slice(120, 240)), black=0.0).empty


def test_what_a_sensor_or_its_driver_leaves_is_no_damage():
    samples = _noisy(900, 20)
    samples[:, 37] = 0
    samples[55] = 0
    samples[:4] = 0
    samples[100:104, 200:230] = 0
    assert _look(samples).empty == ()


def test_picture_set_in_black_is_whole_but_one_that_ends_in_black_is_not():
    framed = _zeroed(_zeroed(_noisy(900, 20), slice(0, 30)), slice(210, 240))
    assert _look(framed, black=0.0, rendered=True).empty == ()
    ending = _zeroed(_noisy(900, 20), slice(210, 240))
    assert _look(ending, black=0.0, rendered=True).empty


def test_colours_are_looked_at_together_and_a_narrow_image_is_one_span():
    samples = np.repeat(_noisy(900, 20)[:, :, None], 3, axis=2)
    samples[200:] = 0
    assert _look(samples, black=0.0).empty == (EmptyBlock(row0=200, col0=0, rows=40, cols=400),)
    narrow = _zeroed(_noisy(900, 20, cols=20), slice(100, 200))
    assert _look(narrow).empty == (EmptyBlock(row0=100, col0=0, rows=100, cols=20),)


@pytest.mark.parametrize("band", [1, 7, 240])
def test_bands_of_any_height_say_the_same(band):
    samples = _zeroed(_noisy(900, 20), slice(33, 50), slice(64, 256))
    assert _look(samples, band=band) == _look(samples)


# --- Arrays as text: whole again, and refused where type, shape and data do not belong together


@pytest.mark.parametrize("dtype", ["<u2", "<i4", "<f2", "<f4"])
def test_arrays_survive_packing(dtype):
    array = np.arange(12).reshape(3, 4)
    np.testing.assert_array_equal(unpack(pack(array, dtype=dtype)), array)


@pytest.mark.parametrize("change", [{"shape": (3, 5)}, {"shape": (3, 3)}, {"dtype": "<f8"}, {"dtype": "|O"}])
def test_an_array_that_does_not_fit_its_description_is_refused(change):
    packed = replace(pack(np.zeros((3, 4)), dtype="<u2"), **change)
    assert isinstance(packed, Packed)
    with pytest.raises(ValueError, match=r"is none of|do not fill"):
        unpack(packed)


# --- A band has one name, however a camera, a data sheet or a person writes it


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
