"""Inputs of a reflectance fit: parameters, panel frames with features, the panel's reflectances."""

from dataclasses import dataclass, field
from typing import Literal

from radiometry.fitting.evidence import Exclusion
from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.reflectance.features import Features
from radiometry.reflectance.sunshine import Choice
from radiometry.reflectance.tilt import TiltParams
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.specification.stored import LATER

Normalisation = Literal["sunshine", "panel_only"]
Surface = Literal["level", "oriented"]
Interpolation = Literal["constant", "linear"]


@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of a reflectance fit."""

    normalisation: Normalisation = parameter(
        "sunshine",
        label="Normalised by",
        description="With the sunshine sensor K holds while the light changes; by the panel alone K holds "
        "for the light of the panel capture.",
        labels={"sunshine": "The sunshine sensor", "panel_only": "The panel alone: holds for one light"},
    )
    sunshine_choice: Choice = parameter(
        "mean",
        label="Sunshine reading",
        description="Which of a file's valid readings of the sunshine sensor is used.",
        labels={"mean": "Mean of the valid ones", "last": "The last", "nearest": "The nearest in time"},
    )
    interpolation: Interpolation = parameter(
        "linear",
        label="Between panel captures",
        description="Linear: K(t) between them, by the time of each frame. Constant: the mean of all panel "
        "captures, with their difference in u(K).",
        labels={"constant": "One K", "linear": "K linear in time"},
    )
    drift_half_hour_rel: float = parameter(
        0.02,
        label="Assumed change of K",
        description="Relative standard deviation of K's change in half an hour, by drift and by light that "
        "is not modelled. It counts as four degrees of freedom, and the difference of two panel captures as "
        "one more.",
        bounds="[0, 1]",
        later=True,
    )
    incidence_angle_deg: float = parameter(
        0.0,
        label="Incidence angle",
        description="Angle between the panel's normal and the sun. The procedure calls it the angle of "
        "observation; for a diffuse panel the cosine belongs to the incoming light. 0: the panel lies as the "
        "sunshine sensor does, which is the usual way, and both see the same cosine. A measurement takes the "
        "same angle unless it states another.",
        unit="deg",
        bounds="[0, 90)",
    )
    incidence_angle_u_deg: float = parameter(
        2.0,
        label="Uncertainty of the incidence angle",
        description="Its standard uncertainty; 2 degrees is a panel levelled by eye. Its effect is that of "
        "the sun's zenith angle where the incidence angle is 0 and the file states position and time.",
        unit="deg",
        bounds="[0, 90)",
    )
    sunshine_surface: Surface = parameter(
        "level",
        label="Surface of the sunshine reading",
        description="Level: by the sensor's attitude and the sun's position, wherever the file states "
        "attitude, time and position.",
        labels={"level": "A level surface", "oriented": "As the sensor was oriented"},
    )
    tilt: TiltParams | None = parameter(
        None,
        label="Tilt correction",
        description="Assumptions about sky and sensor for a reading on a level surface.",
        default_text="a clear sky, a PTFE diffuser, an attitude known to 2 degrees",
    )
    panel_measured_on: str | None = parameter(
        None,
        label="Measurement of the panel",
        description="Day of the one measurement of the panel to use, where several are registered.",
        kind="text",
        default_text="on the day of each panel frame, interpolated between the measurements",
        example="2026-03-14",
        later=True,
    )
    exclude: tuple[Exclusion, ...] = ()

    def __post_init__(self) -> None:
        """Check every parameter against its range and choices."""
        check_parameters(self)

    @property
    def levelling(self) -> TiltParams | None:
        """Assumptions with which readings are converted to a level surface; None if they are not."""
        return None if self.sunshine_surface == "oriented" else self.tilt or TiltParams()


@dataclass(frozen=True, kw_only=True)
class FrameRow:
    """One frame of a campaign as input of the fit: one band of one capture.

    Attributes
    ----------
    frame : str
        Name of the frame in messages and points.
    role : str
        "panel"; other roles are not used.
    header : FrameHeader
        Metadata of the file.
    exposure : Exposure
        Exposure of the frame.
    features : Features or None
        Features of `extract`; None until the frame is extracted.
    has_region : bool, default: True
        False if no region is drawn for it.
    panel_serial : str or None, default: None
        Serial number of the panel, as its code in the image states it.
    """

    frame: str
    role: str
    header: FrameHeader
    exposure: Exposure
    features: Features | None
    has_region: bool = True
    panel_serial: str | None = None


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Reflectance of the panel in one band, as its certificate states it.

    Attributes
    ----------
    panel : str
        Name of the panel.
    band : str
        Name of the band.
    reflectance : float
        Reflectance of the panel under these directions, (0, 1.2].
    standard_uncertainty : float or None, default: None
        Absolute standard uncertainty; None if it is not stated.
    measured_on : str or None, default: None
        Day of the measurement, ISO 8601; None if it is not known.
    from_file : bool or None, default: None
        True if a camera, or the panel's code, states the reflectance: its day is not
        known, and any measurement goes before it.
    """

    panel: str
    band: str
    reflectance: float
    standard_uncertainty: float | None = None
    measured_on: str | None = field(default=None, metadata=LATER)
    from_file: bool | None = field(default=None, metadata=LATER)

    def __post_init__(self) -> None:
        """Check what every caller must have checked at its interface."""
        uncertainty = self.standard_uncertainty or 0.0
        if not (0.0 < self.reflectance <= 1.2 and 0.0 <= uncertainty < 1.0):
            raise ValueError(f"a reflectance that cannot be: {self}")
