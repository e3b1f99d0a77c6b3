"""Falloff as an XMP sidecar, as MicaSense cameras state it."""

from radiometry.frame.xmp import write_sidecar
from radiometry.vignetting.results import Coefficient


def export_xmp(curve: Coefficient) -> str:
    """Write VignettingCenter and VignettingPolynomial.

    Parameters
    ----------
    curve : Coefficient
        Falloff of one f-number and channel.

    Notes
    -----
    MicaSense's model [1]_ is V = 1 + c0 r + c1 r^2 + ... + c5 r^6, by which the signal above black is
    divided, with r in pixels from the centre (x, y) and the first pixel's centre at (0, 0). The fitted curve
    is of this form: c1, c3 and c5 are its k1, k2 and k3 over the powers of its radius, the others are 0.

    References
    ----------
    .. [1] MicaSense, "RedEdge Camera Radiometric Calibration Model"
    """
    k1, k2, k3 = (k / curve.radius_px**power for k, power in zip(curve.k, (2, 4, 6), strict=True))
    return write_sidecar(
        {
            "VignettingCenter": (curve.centre_col_px, curve.centre_row_px),
            "VignettingPolynomial": (0.0, k1, 0.0, k2, 0.0, k3),
        },
        description=f"{curve.width_px} x {curve.height_px} px, f/{curve.f_number:g}, channel "
        f"{curve.channel}; divide the signal above black by 1 + c0 r + ... + c5 r^6, r in pixels from the "
        "centre (x, y), the first pixel's centre at (0, 0)",
    )
