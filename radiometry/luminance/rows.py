"""Inputs of a luminance fit: parameters, frames with their statistics, meter readings."""

from dataclasses import dataclass
from typing import Literal

from radiometry.fitting.evidence import Exclusion, Quantity
from radiometry.frame.exposure import Exposure, Settings
from radiometry.frame.statistics import ChannelStatistics, measure_signal
from radiometry.frame.statistics import Signal as MeasuredSignal
from radiometry.frame.verdicts import Keeping
from radiometry.luminance.conditions import LABELS, LampKind
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.specification.stored import later
from radiometry.spectral.curves import list_lamps, list_responses, read_lamp, read_response

Model = Literal["proportional", "affine", "power", "semilog"]
Estimator = Literal["least_squares", "robust"]
Signal = Literal["green", "grey"]
Basis = Literal["nominal", "apex"]
Acceptance = Literal["simple", "guarded", "shared_risk"]


@dataclass(frozen=True, kw_only=True)
class Params(Keeping):
    """Parameters of a luminance fit; the defaults are the procedure's."""

    model: Model = parameter(
        "proportional",
        label="Model",
        description="Curve whose K is reported; all four are fitted.",
        labels={
            "proportional": "Proportional: N = K X",
            "affine": "Affine: N = K X + b",
            "power": "Power: ln N = ln K + g ln X",
            "semilog": "Semilog: only to reproduce an old report",
        },
    )
    estimator: Estimator = parameter(
        "least_squares",
        label="Estimator",
        description="How points that scatter are weighed. Robust: frames that lie apart from all others lose "
        "their weight; it costs little where there are none.",
        labels={"least_squares": "Least squares", "robust": "Robust against outliers"},
    )
    tolerance_rel: float = parameter(
        0.04,
        name="tolerance",
        label="Tolerance",
        description="Largest |L_fit - L_meter| / L_meter that passes; the procedure asks for 4 %.",
        bounds="(0, 1)",
    )
    channel: Signal = parameter(
        "green",
        label="Signal",
        description="Pixels whose mean is the signal of a region.",
        labels={"green": "Both greens", "grey": "All sites"},
    )
    exposure_basis: Basis = parameter(
        "nominal",
        label="Exposure values",
        description="Which values of a file are used for exposure time and f-number.",
        labels={"nominal": "Nominal (f/11, 1/60 s)", "apex": "APEX (f/11.3, 1/64 s)"},
    )
    meter_repeatability_rel: float | None = parameter(
        None,
        label="Meter repeatability",
        description="Relative standard uncertainty of one luminance reading apart from the meter's "
        "calibration: aim, spot, digits.",
        default_text="estimated from the scatter between scenes",
        example=0.01,
        bounds="[0, 1)",
    )
    f_number_u_rel: float | None = parameter(
        None,
        label="Uncertainty of the f-number",
        description="Relative standard uncertainty of a nominal f-number. Estimated only from three "
        "f-numbers on; else it is 1.5 %: nominal values are rounded by up to 2.8 % (f/11 for 11.314), "
        "which as a rectangular distribution is 2.8 / sqrt(3) %.",
        default_text="estimated from the scatter between f-numbers",
        example=0.015,
        bounds="[0, 1)",
    )
    exposure_time_u_rel: float = parameter(
        0.005,
        label="Uncertainty of the exposure time",
        description="Relative standard uncertainty of a nominal exposure time. Electronic shutters are "
        "timed by a quartz; what is left is the choice of 1/60 or 1/64 s (parameter exposure_basis).",
        bounds="[0, 1)",
    )
    lamp_drift_u_rel: float = parameter(
        0.012,
        label="Lamp drift",
        description="Relative standard uncertainty of the change of the lamp's luminance during a scene, "
        "where its readings do not show it. 0.012 is 2 %, the drift that is flagged, as a rectangular "
        "distribution.",
        bounds="[0, 1)",
    )
    dark_rate_u_rel: float = parameter(
        0.002,
        label="Plausible dark current",
        description="Standard uncertainty of the growth of the dark signal with exposure time where no dark "
        "frames of two times determine it: fraction of the span from black to white per second at ISO 100, "
        "in proportion at other ISO values. 0.002 is 50 e-/s of a full well of 25,000 e-.",
        unit="1/s",
        bounds="[0, 1)",
    )
    panel_rho: float | None = parameter(
        None,
        name="surface_reflectance",
        label="Luminance factor of the target",
        description="rho of the taped surface, for the cross-check L = rho E / pi.",
        default_text="no cross-check",
        example=0.18,
        given_by="campaign",
        bounds="(0, 1]",
    )
    exclude: tuple[Exclusion, ...] = ()
    vignetting: str | None = parameter(
        None,
        name="vignetting_id",
        later=True,
        label="Vignetting version",
        description="Vignetting version that the signals are divided by, or `in_force`: the one in force "
        "when the light frames were taken. Stored as the version's content hash.",
        default_text="no correction",
        example="in_force",
        version_of="vignetting",
    )

    lamp: str | None = parameter(
        None,
        later=True,
        kind="text",
        suggest=list_lamps,
        label="Lamp",
        description="Spectrum of the calibration's lamp: a lamp of the library, or a table of wavelength in "
        "nm and value.",
        default_text="unknown",
        example="A",
        given_by="campaign",
    )
    camera_response: str | None = parameter(
        None,
        later=True,
        kind="text",
        suggest=list_responses,
        label="Camera response",
        description="Spectral response of the camera: a model of the library, or a table of wavelength in "
        "nm, R, G and B.",
        default_text="the library's, if it has the camera's model",
        example="Hasselblad L2D-20c",
        given_by="campaign",
    )
    focus_distance_m: float | None = parameter(
        None,
        later=True,
        label="Focus distance",
        description="From the lens to the calibrated surface, to which the lens is focused.",
        default_text="unknown",
        example=1.5,
        given_by="campaign",
        unit="m",
        bounds="[0.1, 1e5]",
    )
    focal_length_mm: float | None = parameter(
        None,
        later=True,
        label="Focal length",
        description="Of the lens itself, not its 35 mm equivalent.",
        default_text="unknown",
        example=12.3,
        given_by="campaign",
        unit="mm",
        bounds="[0.5, 5000]",
    )
    lamp_kind: LampKind | None = parameter(
        None,
        later=True,
        label="Kind of lamp",
        description="Of the lights of this campaign: the lamp of a calibration, and what lights its field "
        "frames unless a measurement states another. It states how deep the light flickers and which "
        "spectra it may have.",
        labels=LABELS,
        default_text="anything",
        example="led",
        given_by="campaign",
    )
    mains_frequency_hz: float | None = parameter(
        None,
        later=True,
        label="Mains frequency",
        description="Of the supply of these lights; 0 for direct current, which does not flicker.",
        default_text="50 or 60 Hz",
        example=50.0,
        given_by="campaign",
        unit="Hz",
        bounds="[0, 500]",
    )
    lamp_modulation: float | None = parameter(
        None,
        later=True,
        label="Modulation depth",
        description="(L_max - L_min) / (L_max + L_min) of these lights over a period of their flicker, where "
        "it was measured.",
        default_text="that of the kind of lamp, else anything from 0 to 1",
        example=0.05,
        given_by="campaign",
        bounds="[0, 1]",
    )
    acceptance: Acceptance | None = parameter(
        None,
        later=True,
        label="Decision rule",
        description="How the verdict takes the expanded uncertainty U of K into account, as ILAC-G8 asks to "
        "agree beforehand.",
        labels={
            "simple": "Simple: the error passes, U is ignored",
            "guarded": "Guard band: error + U passes",
            "shared_risk": "Shared risk: the error passes and U is within the tolerance",
        },
        default_text="`simple`",
        example="guarded",
        given_by="campaign",
    )

    def __post_init__(self) -> None:
        check_parameters(self)
        if self.lamp is not None:
            read_lamp(self.lamp)
        if self.camera_response is not None:
            read_response(self.camera_response)


@dataclass(frozen=True, kw_only=True)
class FrameRow(Keeping):
    """One frame of a campaign as input of the fit."""

    frame: str
    role: str
    scene: str | None
    exposure: Exposure
    statistics: tuple[ChannelStatistics, ...] | None  # None until the frame is extracted or has its region
    has_region: bool = True
    rendered: bool = False
    from_table: bool = False  # a row of a table, without pixels
    assumes_black: bool = False  # the file states no black level, so that 0 is read for it
    taken_at: str | None = None  # RFC 3339, with or without offset
    gain_maps: tuple[str, ...] = ()  # hash of each GainMap opcode of the file
    lens_share: Quantity | None = None  # mean V of its region, if the fit corrects vignetting

    def measure(self, channel: str) -> MeasuredSignal:
        """Compute the signal of the frame's region once: verdicts, plan and fit all need it."""
        return self.keep(channel, None, lambda: measure_signal(self.statistics or (), channel=channel))

    def settings_on(self, basis: str) -> Settings:
        return self.keep("settings", basis, self.exposure.on_basis, basis)


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One meter reading of a scene."""

    scene: str
    quantity: str  # "luminance" [cd/m2] or "illuminance" [lx]
    value: float
    meter: str | None = None
    expanded_uncertainty_rel: float | None = None  # from the meter's certificate; None if there is none
    coverage_factor: float | None = None  # from the same certificate
    taken_at: str | None = later()  # RFC 3339 with its offset
