"""Items of ISO/IEC 17025:2017, 7.8, that a certificate of any method may lack; others are of a method."""

from radiometry.findings import Finding, declared


def _gap(code: str, sentence: str, remedy: str) -> Finding:
    return Finding(code, "warn", ("certificate",), sentence, remedy)


LABORATORY_ADDRESS_MISSING = _gap(
    "laboratory_address_missing",
    "The address that is printed below the laboratory's name is missing.",
    "`PATCH /v1/organisation` with the `address`.",
)
CUSTOMER_MISSING = _gap(
    "customer_missing",
    "The party for whom the calibration was made is missing; this can be your own department.",
    "`PATCH /v1/campaigns/{id}` with `customer`.",
)
PLACE_MISSING = _gap(
    "place_missing",
    "The place where frames and readings were taken is missing.",
    "`PATCH /v1/campaigns/{id}` with `place`.",
)
CONDITIONS_MISSING = _gap(
    "conditions_missing",
    "The ambient conditions that may affect the result are missing. The procedure requires a room without "
    "daylight and a steady lamp.",
    "`PATCH /v1/campaigns/{id}` with `conditions`: add the temperature and how long the lamp had been on.",
)
DATE_MISSING = _gap(
    "date_missing",
    "Neither readings nor campaign nor frames have a date.",
    "`PATCH /v1/campaigns/{id}` with `started_at`.",
)
RECORDER_MISSING = _gap(
    "recorder_missing",
    "The person who recorded the readings is missing.",
    "`PATCH /v1/campaigns/{id}` with `recorder`.",
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
    "`PATCH /v1/campaigns/{id}/checklist`; items that the record proves are ticked automatically.",
)
CHECKLIST_UNSIGNED = _gap(
    "checklist_unsigned",
    "The operator has not signed the checklist.",
    "`PATCH /v1/campaigns/{id}/checklist` with `signature`.",
)

FINDINGS = declared(globals())
