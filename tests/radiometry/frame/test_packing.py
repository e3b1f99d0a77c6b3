"""Arrays as text: whole again, and refused where type, shape and data do not belong together."""

import dataclasses

import numpy as np
import pytest

from radiometry.frame.packing import Packed, pack, unpack


@pytest.mark.parametrize("dtype", ["<u2", "<i4", "<f2", "<f4"])
def test_arrays_survive_packing(dtype):
    array = np.arange(12).reshape(3, 4)
    np.testing.assert_array_equal(unpack(pack(array, dtype=dtype)), array)


@pytest.mark.parametrize("change", [{"shape": (3, 5)}, {"shape": (3, 3)}, {"dtype": "<f8"}, {"dtype": "|O"}])
def test_an_array_that_does_not_fit_its_description_is_refused(change):
    packed = dataclasses.replace(pack(np.zeros((3, 4)), dtype="<u2"), **change)
    assert isinstance(packed, Packed)
    with pytest.raises(ValueError, match=r"is none of|do not fill"):
        unpack(packed)
