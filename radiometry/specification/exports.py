"""Exports of a version, and rigs: cameras mounted together, whose orientation a method finds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from radiometry.fitting.evidence import Quantity
from radiometry.specification.certificate import CertificateText

__all__ = ["Export", "ExportOption", "ExportSubject", "Picture", "RigExport", "RigMember"]


@dataclass(frozen=True, kw_only=True)
class ExportOption:
    """Option of an export: a positive number or a text."""

    name: str
    kind: Literal["number", "text"]
    description: str | None = None
    required: bool = True


@dataclass(frozen=True, kw_only=True)
class ExportSubject:
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


@dataclass(frozen=True, kw_only=True)
class Picture:
    """Export as an image of float32, with the text that describes it, None if there is none."""

    samples: NDArray[np.float32]
    description: str | None = None


@dataclass(frozen=True, kw_only=True)
class Export:
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


@dataclass(frozen=True, kw_only=True)
class RigMember:
    """Version of one camera of a rig, with the frames that it was made from."""

    serial: str  #: Serial number of the camera
    fitted: Any  #: Result of the version
    params: Any  #: Parameters of the version
    rows: tuple[Any, ...]  #: Frames, as the fit read them


@dataclass(frozen=True, kw_only=True)
class RigExport:
    """Form in which another program reads a rig.

    ``write`` : ``(orientation, members, name) -> str``
    """

    filename: str
    media_type: str
    operation: str
    description: str
    label: str
    write: Callable[[Any, Sequence[RigMember], str], str]


@dataclass(frozen=True, kw_only=True)
class RigSpec:
    """Orientation of rigs by a method."""

    result: type[Any]  # Type of an orientation
    # `(members) -> orientation`, the reference first. Raises InputRejected.
    orient: Callable[[Sequence[RigMember]], Any]
    # `(member, member) -> int`, how many triggers have a picture of both
    count_shared: Callable[[RigMember, RigMember], int]
    # `(orientation) -> mapping` from (camera, name) to Quantity, what is compared between sets
    list_quantities: Callable[[Any], Mapping[tuple[str, str], Quantity]]
    certificate: CertificateText
    exports: tuple[RigExport, ...]  # Forms in which other programs read an orientation
