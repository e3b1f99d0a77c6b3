"""Exports of a version, the database of Lensfun, and rigs: cameras mounted together."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Literal
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import interface
from radiometry.fitting.evidence import Quantity
from radiometry.records import Record


class ExportOption(Record):
    """Option of an export: a positive number or a text."""

    name: str
    kind: Literal["number", "text"]
    description: str | None = None
    required: bool = True


class ExportSubject(Record):
    """Camera and version that an export is of; what is not registered of the camera is None."""

    calibration_id: str
    make: str
    model: str
    serial: str
    lens_make: str | None
    lens_model: str | None
    pixel_pitch_um: float | None

    @property
    def pitch_um(self) -> float:
        """Registered pixel pitch [um], for an export that needs it."""
        if self.pixel_pitch_um is None:
            raise ValueError("an export without `needs_pixel_pitch` has used the pixel pitch")
        return self.pixel_pitch_um


class Picture(Record):
    """Export as an image of float32, with the text that describes it, None if there is none."""

    samples: NDArray[np.float32]
    description: str | None = None


class Export(Record):
    """Form in which another program reads a version."""

    filename: str  #: Last part of its address, label on pages, and type of its content
    label: str
    media_type: str
    operation: str  #: Name of the operation in the OpenAPI document, and its text
    description: str
    #: `(fitted, subject, options) -> str or Picture`. Raises InputRejected.
    write: Callable[[Any, ExportSubject, dict[str, Any]], str | Picture]
    options: tuple[ExportOption, ...] = ()
    needs_pixel_pitch: bool = False  #: True if the camera's pixel pitch must be registered


class RigMember(Record):
    """Version of one camera of a rig, with the frames that it was made from."""

    serial: str  #: Serial number of the camera
    fitted: Any  #: Result of the version
    params: Any  #: Parameters of the version
    rows: tuple[Any, ...]  #: Frames, as the fit read them


class RigExport(Record):
    """Form in which another program reads a rig.

    ``write`` : ``(orientation, members, name) -> str``
    """

    filename: str
    media_type: str
    operation: str
    description: str
    label: str
    write: Callable[[Any, Sequence[RigMember], str], str]


class RigSpec(Record):
    """Orientation of rigs by a method."""

    result: type[Any]  # Type of an orientation
    # `(members) -> orientation`, the reference first. Raises InputRejected.
    orient: Callable[[Sequence[RigMember]], Any]
    # `(member, member) -> int`, how many triggers have a picture of both
    count_shared: Callable[[RigMember, RigMember], int]
    # `(orientation) -> mapping` from (camera, name) to Quantity, what is compared between sets
    list_quantities: Callable[[Any], Mapping[tuple[str, str], Quantity]]
    exports: tuple[RigExport, ...]  # Forms in which other programs read an orientation


FULL_FRAME_DIAGONAL_MM: Final = math.hypot(36.0, 24.0)
FORBIDDEN_IN_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_DATABASE_VERSION: Final = 1


class LensfunNames(Record):
    """Entries that Lensfun's database requires and that raw files do not reliably contain."""

    camera_make: str  # Names of the camera and of the lens
    camera_model: str
    lens_make: str
    lens_model: str
    # Mount; for a fixed lens, a name of its own that begins in lower case, as in Lensfun's own database
    mount: str
    focal_length_mm: float
    sensor_width_mm: float  # Size of the visible area [mm], from which the crop factor follows
    sensor_height_mm: float
    distance_m: float = 1000.0  # Distance to which the lens was focused [m]; Lensfun's 1000 for infinity
    # Widest f-number of the lens, as in its name; otherwise Lensfun does not find the lens by that name.
    # None: that of the flats.
    widest_f_number: float | None = None

    def __post_init__(self) -> None:
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
        return FULL_FRAME_DIAGONAL_MM / math.hypot(self.sensor_width_mm, self.sensor_height_mm)


def list_options(*, needs_widest: bool) -> tuple[ExportOption, ...]:
    """Return the options of an export that no raw file states reliably."""
    mount = "Of a fixed lens a name of its own, in lower case."
    widest = "Of the lens, as in its name."
    return (
        ExportOption(name="focal_length_mm", kind="number"),
        ExportOption(name="mount", kind="text", description=mount),
        ExportOption(name="widest_f_number", kind="number", description=widest, required=needs_widest),
    )


def name_for_lensfun(
    subject: ExportSubject, options: dict[str, Any], *, width_px: int, height_px: int
) -> LensfunNames:
    """Return the names of the camera and lens of a version."""
    pitch_mm = subject.pitch_um / 1000.0
    return LensfunNames(
        camera_make=subject.make,
        camera_model=subject.model,
        lens_make=subject.lens_make or subject.make,
        lens_model=subject.lens_model or f"{subject.model} lens",
        sensor_width_mm=width_px * pitch_mm,
        sensor_height_mm=height_px * pitch_mm,
        **options,
    )


def write_database(
    names: LensfunNames,
    elements: Sequence[str],
    *,
    width_px: int,
    height_px: int,
    widest_f_number: float,
    centre: tuple[float, float] | None = None,
) -> str:
    """Write a database with the camera, the lens, and the elements of its calibration."""
    widest = names.widest_f_number or widest_f_number
    crop = f"{names.crop_factor:.6g}"
    ratio = f"{max(width_px, height_px)}:{min(width_px, height_px)}"
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
        *([f'        <center x="{centre[0]:.9g}" y="{centre[1]:.9g}"/>'] if centre else []),
        "        <calibration>",
        *elements,
        "        </calibration>",
        "    </lens>",
        "</lensdatabase>",
    ]
    return "\n".join(lines) + "\n"


def _text(text: str) -> str:
    """Escape text, without characters that XML cannot hold."""
    if FORBIDDEN_IN_XML.search(text):
        detail = f"{text!r} holds characters that XML cannot: type the name again."
        raise interface.VALIDATION_FAILED.reject(detail)
    return escape(text)
