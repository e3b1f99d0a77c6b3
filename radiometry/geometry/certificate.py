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

RIG_CERTIFICATE: Final = CertificateText(
    procedure="Orientation of each camera against the reference, from pictures of one board taken together; "
    "poses of cameras and boards fitted by least squares over all corners, each camera as its certificate "
    "states it",
    equation="X_camera = R X_reference + t; the camera's axes in the reference's frame are "
    "Ry(yaw) Rx(pitch) Rz(roll), (x, y, z) is its centre there; x right, y down, z forward",
    headlines=frozenset({"yaw", "pitch", "roll", "boresight", "x", "y", "z"}),
    columns=(
        Column(name="camera", head="camera", form="text", share=1.6),
        FRAME,
        Column(name="trigger", head="trigger", form="text", share=1.6),
        Column(name="rms_px", head="rms [px]"),
    ),
    traceability="Angles depend on the board's shape, not on its size; no external standard enters. x, y "
    "and z are in the scale of the board's squares as stated: 0.1 % in a square is 0.1 % in each of them.",
)
