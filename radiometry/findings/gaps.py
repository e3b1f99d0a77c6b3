"""Items of ISO/IEC 17025:2017, 7.8, that a certificate of any method may lack; others are of a method."""

from radiometry.findings import Finding, declared


def _gap(code: str, sentence: str, remedy: str) -> Finding:
    return Finding(code, "warn", ("certificate",), sentence, remedy)


APPROVER_MISSING = _gap(
    "approver_missing",
    "Nobody has signed: the key that published states no person. The certificate is marked as a draft.",
    "State name and role with the key, on the page Organisation or with `stilb key change`, and publish "
    "again: an amendment is issued.",
)
AUTHOR_MISSING = _gap(
    "author_missing",
    "The person who fitted is missing: the key that fitted states none.",
    "State name and role with the key, on the page Organisation or with `stilb key change`, before you "
    "publish.",
)
LABORATORY_NAME_MISSING = _gap(
    "laboratory_name_missing",
    "The laboratory's name is missing: the organisation still has the name that it was founded with.",
    "Enter the name on the page Organisation, or with `stilb organisation --name`.",
)
LABORATORY_ADDRESS_MISSING = _gap(
    "laboratory_address_missing",
    "The address that is printed below the laboratory's name is missing.",
    "Enter the address on the page Organisation, or with `stilb organisation --address`.",
)
CUSTOMER_MISSING = _gap(
    "customer_missing",
    "The party for whom the calibration was made is missing; this can be your own department.",
    "Enter the `customer` with the details of the campaign.",
)
PLACE_MISSING = _gap(
    "place_missing",
    "The place where frames and readings were taken is missing.",
    "Enter the `place` with the details of the campaign.",
)
CONDITIONS_MISSING = _gap(
    "conditions_missing",
    "The ambient conditions that may affect the result are missing. The procedure requires a room without "
    "daylight and a steady lamp.",
    "Describe the `conditions` with the details of the campaign: the temperature and how "
    "long the lamp had been on.",
)
DATE_MISSING = _gap(
    "date_missing",
    "Neither readings nor campaign nor frames have a date.",
    "Enter the start (`started_at`) with the details of the campaign.",
)
RECORDER_MISSING = _gap(
    "recorder_missing",
    "The person who recorded the readings is missing.",
    "Enter the `recorder` with the details of the campaign.",
)
LENS_MISSING = _gap(
    "lens_missing",
    "The result is valid for a camera with its lens, which is missing. Reflectance and noise do not require "
    "it.",
    "Register the camera with `lens`.",
)
METER_UNKNOWN = _gap(
    "meter_unknown",
    "A reading was sent without `meter_id`, so that its traceability is unknown.",
    "Withdraw the reading, send it with its meter, and refit.",
)
METER_CERTIFICATE_EXPIRED = _gap(
    "meter_certificate_expired",
    "A meter was read after its certificate was due. Its indication may be right, but is not covered by a "
    "certificate.",
    "Have the meter calibrated.",
)
METER_CERTIFICATE_NOT_YET_ISSUED = _gap(
    "meter_certificate_not_yet_issued",
    "A meter was read before its registered certificate was issued.",
    "Register the certificate that was valid on that day, then refit.",
)
CHECKLIST_INCOMPLETE = _gap(
    "checklist_incomplete",
    "Items of the procedure's checklist are not ticked.",
    "Tick them on the campaign's page; items that the record proves are ticked automatically.",
)
CHECKLIST_UNSIGNED = _gap(
    "checklist_unsigned",
    "The operator has not signed the checklist.",
    "Sign it on the campaign's page.",
)

FINDINGS = declared(globals())
