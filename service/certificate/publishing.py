"""Check whether a version may be published with the certificate that it has."""

from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.certificate.document import build_certificate
from service.problems import Problem
from service.schemas.calibrations import Gap
from store.queries.calibration_record import read_calibration_record
from store.queries.checklist import RecordState
from store.tables import Calibration, Organisation


def warn_of_gaps(session: Session, calibration: Calibration, state: RecordState | None) -> list[Gap]:
    """The gaps of a version's certificate; 409 when its organisation publishes nothing that has any."""
    gaps = build_certificate(read_calibration_record(session, calibration, state)).gaps
    organisation = session.get_one(Organisation, calibration.organisation_id)
    if gaps and organisation.refuses_incomplete_certificates:
        raise Problem(
            interface.CERTIFICATE_INCOMPLETE,
            "Your organisation refuses to publish a version whose certificate lacks items of ISO/IEC 17025. "
            f"Add them, then publish again: {' '.join(gap.message for gap in gaps)}",
            gaps=[gap.dump() for gap in gaps],
        )
    return gaps
