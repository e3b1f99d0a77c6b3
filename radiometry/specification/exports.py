"""Exports of a version: the forms in which other programs read it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray


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
    """Form in which another program reads a version.

    Attributes
    ----------
    filename, label, media_type : str
        Last part of its address, label on pages, and type of its content.
    operation, description : str
        Name of the operation in the OpenAPI document, and its text.
    write : callable
        ``(fitted, subject, options) -> str or Picture``. Raises InputRejected.
    needs_pixel_pitch : bool
        True if the camera's pixel pitch must be registered.
    """

    filename: str
    label: str
    media_type: str
    operation: str
    description: str
    write: Callable[[Any, ExportSubject, dict[str, Any]], str | Picture]
    options: tuple[ExportOption, ...] = ()
    needs_pixel_pitch: bool = False
