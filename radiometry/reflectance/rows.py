"""Inputs of a reflectance fit: parameters, panel frames with features, the panel's reflectances."""

from dataclasses import dataclass
from typing import Literal

from radiometry.fitting.evidence import Exclusion
from radiometry.frame import FrameHeader
from radiometry.frame.exposure import Exposure
from radiometry.reflectance.imaging import Features
from radiometry.reflectance.sun import TiltParams
from radiometry.reflectance.sunshine import Choice
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.specification.stored import later

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
        check_parameters(self)

    @property
    def levelling(self) -> TiltParams | None:
        """Assumptions with which readings are converted to a level surface; None if they are not."""
        return None if self.sunshine_surface == "oriented" else self.tilt or TiltParams()


@dataclass(frozen=True, kw_only=True)
class FrameRow:
    """One frame of a campaign as input of the fit: one band of one capture."""

    frame: str
    role: str
    header: FrameHeader
    exposure: Exposure
    features: Features | None  # None until the frame is extracted
    has_region: bool = True
    panel_serial: str | None = None  # as the panel's code in the image states it


@dataclass(frozen=True, kw_only=True)
class Reading:
    """Reflectance of the panel in one band, as its certificate states it."""

    panel: str
    band: str
    reflectance: float  # under these directions, (0, 1.2]
    standard_uncertainty: float | None = None  # absolute
    measured_on: str | None = later()  # ISO 8601
    # True if a camera, or the panel's code, states it: any measurement goes before it
    from_file: bool | None = later()

    def __post_init__(self) -> None:
        uncertainty = self.standard_uncertainty or 0.0
        if not (0.0 < self.reflectance <= 1.2 and 0.0 <= uncertainty < 1.0):
            raise ValueError(f"a reflectance that cannot be: {self}")
