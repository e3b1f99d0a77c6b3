"""The certificate of a calibration: one document, given as JSON and typeset as PDF."""

from service.certificate.document import build_certificate
from service.certificate.pdf import render_pdf

__all__ = ["build_certificate", "render_pdf"]
