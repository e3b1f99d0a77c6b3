"""Falloff as an entry of Lensfun's database."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np

from radiometry.findings import InputRejected, shared
from radiometry.vignetting.expansion import average_share, fit_even_powers, sample_frame
from radiometry.vignetting.results import Coefficient

_TERMS = 3
_FULL_FRAME_DIAGONAL_MM = math.hypot(36.0, 24.0)
_DATABASE_VERSION = 1


@dataclass(frozen=True, kw_only=True)
class LensfunNames:
    """Entries that Lensfun's database requires and that raw files do not reliably contain.

    Attributes
    ----------
    camera_make, camera_model, lens_make, lens_model : str
        Names of the camera and of the lens.
    mount : str
        Mount; for a fixed lens, a name of its own that begins in lower case, as in
        Lensfun's own database.
    focal_length_mm : float
        Focal length [mm].
    sensor_width_mm, sensor_height_mm : float
        Size of the visible area [mm], from which the crop factor follows.
    distance_m : float, default: 1000.0
        Distance to which the lens was focused [m]; Lensfun's 1000 for infinity.
    widest_f_number : float or None, default: None
        Widest f-number of the lens, as in its name; otherwise Lensfun does not find the
        lens by that name. None: that of the flats.
    """

    camera_make: str
    camera_model: str
    lens_make: str
    lens_model: str
    mount: str
    focal_length_mm: float
    sensor_width_mm: float
    sensor_height_mm: float
    distance_m: float = 1000.0
    widest_f_number: float | None = None

    def __post_init__(self) -> None:
        """Check for values that the schema would refuse."""
        widest = 1.0 if self.widest_f_number is None else self.widest_f_number
        sizes = (self.focal_length_mm, self.sensor_width_mm, self.sensor_height_mm)
        numbers = (*sizes, self.distance_m, widest)
        if not all(math.isfinite(number) and number > 0.0 for number in numbers):
            raise ValueError("focal length, sensor size, distance and f-number must be positive numbers")
        if not all((self.camera_make, self.camera_model, self.lens_make, self.lens_model, self.mount)):
            raise ValueError("Lensfun wants names for camera, lens and mount")

    @property
    def crop_factor(self) -> float:
        """The diagonal of 36 mm x 24 mm over the sensor's."""
        return _FULL_FRAME_DIAGONAL_MM / math.hypot(self.sensor_width_mm, self.sensor_height_mm)


def export_lensfun(
    coefficients: Sequence[Coefficient], *, channels: Sequence[str], names: LensfunNames
) -> str:
    """Write a Lensfun database with the camera, the lens, and one vignetting element per f-number.

    Parameters
    ----------
    coefficients : sequence of Coefficient
        Coefficients of one version.
    channels : sequence of str
        Channels whose mean V is taken.
    names : LensfunNames
        Names and sizes of camera and lens.

    Raises
    ------
    InputRejected
        `vignetting_not_calibrated` if the calibration lacks a channel.

    Notes
    -----
    Model "pa" is V itself [1]_: light times 1 + k1 r^2 + k2 r^4 + k3 r^6, r = 1 at the half diagonal, from
    the middle of the frame: the database's schema has no centre for a lens [2]_. V is therefore refitted
    about the middle; a comment beside each element states the remaining error. V is the mean over channels.

    References
    ----------
    .. [1] Lensfun manual, "Lens calibration data format"
    .. [2] lensfun-database.xsd of Lensfun's database
    """
    elements = [
        _write_element(coefficients, f_number, channels, names)
        for f_number in sorted({each.f_number for each in coefficients})
    ]
    widest = names.widest_f_number or min(each.f_number for each in coefficients)
    crop = f"{names.crop_factor:.6g}"
    sides = sorted((coefficients[0].width_px, coefficients[0].height_px))
    ratio = f"{sides[1]}:{sides[0]}"
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<lensdatabase version="{_DATABASE_VERSION}">',
        "    <mount>",
        f"        <name>{_text(names.mount)}</name>",
        f"        <compat>{_text(names.mount)}</compat>",
        "    </mount>",
        "    <camera>",
        f"        <maker>{_text(names.camera_make)}</maker>",
        f"        <model>{_text(names.camera_model)}</model>",
        f"        <mount>{_text(names.mount)}</mount>",
        f"        <cropfactor>{crop}</cropfactor>",
        "    </camera>",
        "    <lens>",
        f"        <maker>{_text(names.lens_make)}</maker>",
        f"        <model>{_text(names.lens_model)}</model>",
        f"        <mount>{_text(names.mount)}</mount>",
        f'        <focal value="{names.focal_length_mm:.9g}"/>',
        f'        <aperture min="{widest:.9g}"/>',
        f"        <cropfactor>{crop}</cropfactor>",
        f"        <aspect-ratio>{ratio}</aspect-ratio>",
        "        <calibration>",
        *elements,
        "        </calibration>",
        "    </lens>",
        "</lensdatabase>",
    ]
    return "\n".join(lines) + "\n"


def _write_element(
    coefficients: Sequence[Coefficient], f_number: float, channels: Sequence[str], names: LensfunNames
) -> str:
    first = coefficients[0]
    rows, cols = sample_frame(first)
    wanted = average_share(coefficients, rows, cols, channels=channels, f_number=f_number)
    middle_row, middle_col = (first.height_px - 1) / 2.0, (first.width_px - 1) / 2.0
    # Lensfun's r is 1 at the centre of the corner pixel
    squared = ((rows - middle_row) ** 2 + (cols - middle_col) ** 2) / (middle_row**2 + middle_col**2)
    # about another point V is not 1: the level there is divided out, as a correction may
    level = float(
        average_share(
            coefficients, middle_row * _ONE, middle_col * _ONE, channels=channels, f_number=f_number
        )[0]
    )
    (k1, k2, k3), error = fit_even_powers(np.asarray(squared), wanted / level, terms=_TERMS)
    return (
        f"            <!-- f/{f_number:g}: largest error of the curve about the middle {error:.2%} -->\n"
        f'            <vignetting model="pa" focal="{names.focal_length_mm:.9g}" aperture="{f_number:.9g}" '
        f'distance="{names.distance_m:.9g}" k1="{k1:.9g}" k2="{k2:.9g}" k3="{k3:.9g}"/>'
    )


def _text(text: str) -> str:
    """Escape text, without characters that XML cannot hold."""
    if not text.isprintable():
        raise InputRejected(
            shared.VIGNETTING_NOT_CALIBRATED,
            f"{text!r} holds characters that XML cannot: type the name again.",
        )
    return escape(text)


_ONE = np.ones(1)
