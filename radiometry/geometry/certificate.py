"""Certificate text of a geometry calibration."""

from typing import Final

from radiometry.specification.certificate import FRAME, CertificateText, Column

CERTIFICATE: Final = CertificateText(
    procedure="Principal distance, principal point and distortion of the camera, from views of a plane "
    "board; camera parameters and poses fitted by least squares over all corners",
    equation="col = fx x' + cx, row = fy y' + cy, where (x', y') is the direction distorted by k1, k2, k3, "
    "p1, p2",
    headlines=frozenset({"fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "p1", "p2", "rms_px"}),
    columns=(
        FRAME,
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
