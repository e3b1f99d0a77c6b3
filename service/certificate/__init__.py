"""The certificate of a calibration, or of a rig: one document, whose pages service/press sets."""

from service.certificate.dcc import write_dcc
from service.certificate.document import build_certificate
from service.certificate.issuing import (
    Backlog,
    Prepared,
    build_issued,
    draw_preview,
    find_issued,
    gather,
    prepare,
)
from service.certificate.report import lay_out_report
from service.certificate.rig import build_rig_certificate, lay_out_rig

__all__ = [
    "Backlog",
    "Prepared",
    "build_certificate",
    "build_issued",
    "build_rig_certificate",
    "draw_preview",
    "find_issued",
    "gather",
    "lay_out_report",
    "lay_out_rig",
    "prepare",
    "write_dcc",
]
