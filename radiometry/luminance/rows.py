"""Inputs of a luminance fit and of a measurement: parameters, frames, readings, light and surroundings."""

import math
from collections.abc import Sequence
from typing import Literal

from radiometry.fitting.evidence import Acceptance, Exclusion, Quantity
from radiometry.frame.exposure import Exposure, Settings
from radiometry.frame.statistics import ChannelStatistics, measure_signal
from radiometry.frame.statistics import Signal as MeasuredSignal
from radiometry.frame.verdicts import Keeping
from radiometry.records import Record, about, later
from radiometry.specification.parameters import check_parameters, parameter
from radiometry.spectral.lamps import LABELS, LampKind
from radiometry.spectral.mismatch import list_lamps, list_responses, read_lamp, read_response

Colour = tuple[float, float]


class CalibrationConditions(Record):
    """Lamp and distance of a calibration, as its campaign states them; None for what is not known."""

    lamp: str | None = about("Spectrum: a name of the library, or a table.", default=None)
    camera_response: str | None = about("A name of the library, or a table.", default=None)
    colour: Colour | None = about(
        "R/G and B/G above dark of the light frames; the median over them.", default=None
    )
    focus_distance_m: float | None = about("From the lens to the calibrated surface [m].", default=None)
    focal_length_mm: float | None = None
    lamp_kind: LampKind | None = later("All that is known of the lamp's spectrum if `lamp` is None.")


LensFocus = Literal["surface", "unchanged"]


class FieldConditions(Record):
    """Light and surroundings of a measurement, as it states them; None for what is not known."""

    light_source: str | None = parameter(
        None,
        kind="text",
        suggest=list_lamps,
        label="Light source",
        description="Spectrum of the light on the surface: a lamp of the library, or a table of wavelength "
        "in nm and value.",
        default_text="unknown",
        example="LED-B3",
    )
    spectral_mismatch_u_rel: float | None = parameter(
        None,
        label="Uncertainty of the spectral mismatch",
        description="Relative standard uncertainty of L from the spectrum, in place of the one that is "
        "estimated.",
        default_text="estimated, or 10 % where a spectrum is unknown",
        example=0.05,
        bounds="[0, 1)",
    )
    distance_m: float | None = parameter(
        None,
        label="Distance",
        description="From the lens to the measured surface, to which the lens is focused.",
        default_text="unknown",
        unit="m",
        example=30.0,
        bounds="[0.1, 1e5]",
    )
    lamp_kind: LampKind | None = parameter(
        None,
        label="Kind of lamp",
        description="Of the measured light. It states how deep the light flickers, and which spectra it may "
        "have.",
        labels=LABELS,
        default_text="the campaign's, else anything",
        example="led",
        displaced_by=("lamp_kind", "light_source"),
    )
    mains_frequency_hz: float | None = parameter(
        None,
        label="Mains frequency",
        description="Of the supply of the measured light, which flickers at twice this frequency; 0 for "
        "direct current.",
        default_text="the campaign's, else 50 or 60 Hz",
        unit="Hz",
        example=50.0,
        displaced_by=("lamp_kind",),
        bounds="[0, 500]",
    )
    flicker_modulation: float | None = parameter(
        None,
        name="lamp_modulation",
        label="Modulation depth",
        description="(L_max - L_min) / (L_max + L_min) of the measured light over a period of its flicker, "
        "where it was measured.",
        default_text="the campaign's, else that of the kind of lamp, else anything from 0 to 1",
        example=0.3,
        displaced_by=("lamp_kind", "light_source"),
        bounds="[0, 1]",
    )
    glare_share: float | None = parameter(
        None,
        label="Glare",
        description="Luminance of a black trap in such a scene, as the camera shows it, over the mean of the "
        "whole frame.",
        default_text="unknown",
        example=0.02,
        bounds="[0, 0.5]",
    )

    lens_focus: LensFocus | None = parameter(
        None,
        label="Focus",
        description="Where the lens is focused. Unchanged: as in the calibration, so that it loses no other "
        "light than there.",
        labels={"surface": "On the measured surface", "unchanged": "As in the calibration"},
        default_text="surface",
        example="unchanged",
    )
    reflectance_u_rel: float | None = parameter(
        None,
        label="Uncertainty of the reflectance",
        description="Relative standard uncertainty of the surface's reflectance, for its illuminance.",
        default_text="10 %",
        example=0.03,
        bounds="[0, 1)",
    )

    def __post_init__(self) -> None:
        check_parameters(self)
        if self.light_source is not None:
            read_lamp(self.light_source)


def measure_colour(
    statistics: Sequence[ChannelStatistics], *, dark_above_black_dn: float, most_u_rel: float = math.inf
) -> Colour | None:
    """Compute R/G and B/G of a region; None if a channel is missing, not above dark or too uncertain.

    ``dark_above_black_dn`` is the same in all channels, ``most_u_rel`` the largest relative standard error
    that the mean of a channel may have.
    """
    means: dict[str, list[float]] = {"R": [], "G": [], "B": []}
    for row in statistics:
        if row.channel[0] in means:
            mean = row.mean_dn - row.black_level_dn - dark_above_black_dn
            if row.std_dn > most_u_rel * mean * math.sqrt(row.n):
                return None
            means[row.channel[0]].append(mean)
    if not all(values and min(values) > 0.0 for values in means.values()):
        return None
    red, green, blue = (sum(values) / len(values) for values in means.values())
    return red / green, blue / green


Model = Literal["proportional", "affine", "power", "semilog"]
Estimator = Literal["least_squares", "robust"]
Signal = Literal["green", "grey"]
Basis = Literal["nominal", "apex"]


class Params(Record, Keeping):
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
            "simple": "Simple: the residuals pass, u(K) is ignored",
            "guarded": "Guarded: 1.645 u(K) is within the tolerance",
            "shared_risk": "Shared risk: the residuals pass and U is within the tolerance",
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


class FrameRow(Record, Keeping):
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


class Reading(Record):
    """One meter reading of a scene."""

    scene: str
    quantity: str  # "luminance" [cd/m2] or "illuminance" [lx]
    value: float
    meter: str | None = None
    expanded_uncertainty_rel: float | None = None  # from the meter's certificate; None if there is none
    coverage_factor: float | None = None  # from the same certificate
    taken_at: str | None = later()  # RFC 3339 with its offset
    reason: str | None = later()  # why it is right although its frames speak against it
