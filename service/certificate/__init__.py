"""The certificate of a calibration: one document, given as JSON and typeset as PDF."""

from service.certificate.document import build_certificate
from service.certificate.pdf import draw_region, render_pdf
from service.certificate.publishing import warn_of_gaps

__all__ = ["build_certificate", "draw_region", "render_pdf", "warn_of_gaps"]
