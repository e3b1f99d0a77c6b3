"""Certificate text of each method: procedure, equation, traceability and the columns of its points."""

from dataclasses import dataclass
from typing import Literal

Form = Literal["text", "number", "percent"]


@dataclass(frozen=True, kw_only=True)
class Column:
    """One printed value of a point. ``name`` : its field; ``share`` : relative width of the column."""

    name: str
    head: str
    form: Form = "number"
    share: float = 1.0


@dataclass(frozen=True, kw_only=True)
class CertificateText:
    """Certificate text of one method.

    ``headlines`` : coefficients on the first page; all others have a table of their own
    ``traceability`` : "" where it depends on the meters or panels used
    ``holds_for_lens`` : the result is valid for one lens; a certificate without a lens then has a gap
    ``statements`` : statements that only this method makes
    """

    procedure: str
    equation: str
    headlines: frozenset[str]
    columns: tuple[Column, ...]
    traceability: str = ""
    holds_for_lens: bool = True
    statements: tuple[str, ...] = ()


def describe_method(method: str) -> CertificateText:
    """Return the certificate text of a method."""
    match method:
        case "luminance":
            return _LUMINANCE
        case "reflectance":
            return _REFLECTANCE
        case "vignetting":
            return _VIGNETTING
        case "sharpness":
            return _SHARPNESS
        case "geometry":
            return _GEOMETRY
        case "noise":
            return _NOISE
        case _:
            raise ValueError(method)


_FRAME = Column(name="frame", head="frame", form="text", share=2.4)

_LUMINANCE = CertificateText(
    procedure="Luminance coefficient K of a camera against a luminance meter, one per ISO value, "
    "following the standard operating procedure “Drone Camera Calibration”; K fitted by generalised least "
    "squares",
    equation="N - D = K X,  X = t S L / f²",
    headlines=frozenset({"luminance_k"}),
    columns=(),  # luminance has sheets of its own
    statements=(
        (
            "The verdict compares the largest deviation of a point from the luminance meter with the "
            "tolerance. Measurement uncertainty is not taken into account in this decision."
        ),
    ),
)

_REFLECTANCE = CertificateText(
    procedure="Reflectance coefficient K of each band of a camera with its sunshine sensor, from frames of a "
    "panel of known reflectance",
    equation="R cos θ = K I_sq / I_ss, where I_sq is the band's signal after black-level and vignetting "
    "correction, and I_ss the reading of the sunshine sensor",
    headlines=frozenset({"reflectance_k"}),
    columns=(
        _FRAME,
        Column(name="band", head="band", form="text"),
        Column(name="visit", head="capture", share=0.7),
        Column(name="i_sq", head="I_sq"),
        Column(name="i_ss", head="I_ss"),
        Column(name="sunshine_spread_rel", head="s(I_ss) / I_ss", form="percent"),
        Column(name="gradient_rel", head="gradient", form="percent"),
        Column(name="reflectance_k", head="K"),
        Column(name="residual_rel", head="deviation", form="percent"),
    ),
    holds_for_lens=False,
    statements=(
        (
            "K belongs to the camera and the sunshine sensor named here as a pair, and to the light of "
            "the day on which the panel was photographed."
        ),
        "Vignetting is corrected as stated in each file for its camera.",
    ),
)

_VIGNETTING = CertificateText(
    procedure="Light falloff over the frame, one per f-number and channel, from frames of a uniform surface; "
    "centre and coefficients fitted by weighted least squares",
    equation="(N - D) / A = 1 + k1 r² + k2 r⁴ + k3 r⁶, where r is the distance from the fitted centre in "
    "units of half the frame's diagonal",
    headlines=frozenset({"corner_falloff"}),
    columns=(
        _FRAME,
        Column(name="role", head="role", form="text", share=0.7),
        Column(name="f_number", head="f/", share=0.6),
        Column(name="signal_share", head="signal", form="percent"),
        Column(name="saturated_share", head="saturated", form="percent"),
        Column(name="gradient_rel", head="gradient", form="percent"),
        Column(name="gradient_standard_uncertainty_rel", head="u(gradient)", form="percent"),
    ),
    traceability="The result is a ratio of light within one frame; no external standard enters. The frames "
    "themselves are tested for non-uniform light, which is reported among the flags.",
)

_SHARPNESS = CertificateText(
    procedure="Modulation transfer function of the camera against spatial frequency, per position and "
    "channel, from slanted edges (ISO 12233, e-SFR) or Siemens stars",
    equation="MTF(f) = |F{LSF}(f)| / |F{LSF}(0)|, where f is in cycles per pixel of the whole sensor",
    headlines=frozenset({"mtf50_cycles_per_pixel", "resolving_power_cycles_per_pixel"}),
    columns=(
        _FRAME,
        Column(name="position", head="position", form="text", share=1.2),
        Column(name="channel", head="channel", form="text"),
        Column(name="f_number", head="f/", share=0.6),
        Column(name="value", head="f [c/px]"),
        Column(name="standard_uncertainty", head="u(f)"),
        Column(name="residual_rel", head="deviation", form="percent"),
    ),
    traceability="Lengths are counted in pixels of the camera itself; no external standard enters. Line "
    "pairs per millimetre depend on the pixel pitch that is stated for the camera.",
)

_GEOMETRY = CertificateText(
    procedure="Principal distance, principal point and distortion of the camera, from views of a plane "
    "board; camera parameters and poses fitted by least squares over all corners",
    equation="col = fx x' + cx, row = fy y' + cy, where (x', y') is the direction distorted by k1, k2, k3, "
    "p1, p2",
    headlines=frozenset({"fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "p1", "p2", "rms_px"}),
    columns=(
        _FRAME,
        Column(name="corners", head="corners", share=0.8),
        Column(name="rms_px", head="rms [px]"),
        Column(name="largest_px", head="largest [px]"),
        Column(name="tilt_deg", head="tilt [°]"),
        Column(name="distance_mm", head="distance [mm]"),
        Column(name="edge_rise_px", head="edge rise [px]"),
    ),
    traceability="Values in pixels depend on the board's shape, not on its size; no external standard "
    "enters. Distances depend on the stated square size and pixel pitch.",
)

_NOISE = CertificateText(
    procedure="Temporal noise, system gain, linearity and nonuniformity per ISO value and channel, from "
    "stacks of frames with equal settings, by the definitions of EMVA 1288",
    equation="var_y - var_dark = K (mu_y - mu_dark)",
    headlines=frozenset({"system_gain_dn_per_e", "read_noise_e", "full_well_e", "dynamic_range_stops"}),
    columns=(
        _FRAME,
        Column(name="channel", head="channel", form="text", share=0.8),
        Column(name="role", head="role", form="text", share=0.7),
        Column(name="iso", head="ISO", share=0.8),
        Column(name="exposure_time_s", head="t [s]"),
        Column(name="mean_dn", head="mean [DN]", share=1.2),
        Column(name="clipped_share", head="clipped", form="percent"),
        Column(name="frames_of_setting", head="frames in stack"),
    ),
    traceability="Numbers of electrons follow from the statistics of the light itself; no external standard "
    "enters.",
    holds_for_lens=False,
)
