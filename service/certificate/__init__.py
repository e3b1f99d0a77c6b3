"""The certificate of a calibration, or of a rig: one document, whose pages service/press sets."""

from service.certificate.dataset import describe_dataset
from service.certificate.dcc import write_dcc
from service.certificate.document import build_certificate
from service.certificate.publishing import warn_of_gaps
from service.certificate.report import lay_out_report
from service.certificate.rig import build_rig_certificate, lay_out_rig

__all__ = [
    "build_certificate",
    "build_rig_certificate",
    "describe_dataset",
    "lay_out_report",
    "lay_out_rig",
    "warn_of_gaps",
    "write_dcc",
]
