"""Findings of requests, jobs and certificates: refusals, and what a certificate lacks."""

from radiometry.findings import Finding, declare


def _refusal(status: int, sentence: str, remedy: str, *, retryable: bool = False) -> Finding:
    return Finding("", "error", ("request",), sentence, remedy, status, retryable)


def _failure(sentence: str, remedy: str, *, retryable: bool = False) -> Finding:
    return Finding("", "error", ("job",), sentence, remedy, None, retryable)


# of any request
UNAUTHENTICATED = _refusal(
    401,
    "No key was sent, or the key is unknown, revoked or expired, as `detail` states; or the session has "
    "ended.",
    "Send `Authorization: Bearer <key>`.",
)
SCOPE_MISSING = _refusal(
    403,
    "The key is known but may not do this.",
    "Use one with the scope that `detail` names, or ask an admin for it.",
)
CSRF_TOKEN_WRONG = _refusal(
    403,
    "A change came with the cookie of a session and without the token of its page.",
    "Reload the page and try again. Programs send a key instead: `Authorization: Bearer <key>`.",
)
NOT_FOUND = _refusal(
    404,
    "There is no such thing for this key's organisation.",
    "Check the id; what belongs to other organisations answers the same.",
)
METHOD_NOT_ALLOWED = _refusal(
    405,
    "The address exists, but not with this HTTP method.",
    "Use one of the methods that the header `Allow` names.",
)
VALIDATION_FAILED = _refusal(
    422,
    "A field is missing, unknown, given twice, of the wrong kind or out of range.",
    "Correct it: `errors` names each field. Numbers in tables and addresses have the digits 0 to "
    "9, a sign, a point and an exponent only.",
)
BAD_REQUEST = _refusal(
    400,
    "The request cannot be read: its form, its encoding, or the hash that it announces.",
    "Correct what `detail` names.",
)
TOO_MANY_REQUESTS = _refusal(
    429,
    "Your organisation sends more requests than `STILB_QUOTA_REQUESTS_PER_MINUTE` (`limit`).",
    "Wait for `Retry-After` seconds, as the client does; ask less often, or have the limit raised.",
    retryable=True,
)
TOO_MANY_STREAMS = _refusal(
    429,
    "The key follows as many jobs and campaigns as one key may.",
    "Close a stream, or follow the campaign instead of each of its jobs.",
    retryable=True,
)
QUOTA_EXCEEDED = _refusal(
    507,
    "Your organisation would use more than it may: `quota` names what (`stored_bytes`, `frames`, "
    "or, with the status 429, `jobs_waiting`), `limit` and `used` how much. Nothing was kept.",
    "Wait for `Retry-After` seconds while waiting jobs get fewer; for files ask the operator for more space "
    "(`STILB_QUOTA_BYTES`, `STILB_QUOTA_FRAMES`).",
    retryable=True,
)
TOO_MANY_ATTEMPTS = _refusal(
    429,
    "Too many attempts to sign in failed, from this address or with a key that was revoked, "
    "expired or may not read.",
    "Try again after `Retry-After`; the wait doubles up to five minutes. A key that was used "
    "lately is not delayed.",
    retryable=True,
)
HOST_NOT_ALLOWED = _refusal(
    421,
    "The service does not answer under the name of this address.",
    "Ask its operator for the right one (`STILB_ALLOWED_HOSTS`).",
)
CONFLICT = _refusal(
    409, "It contradicts what is recorded, such as a name that is taken.", "Change what `detail` names."
)
CHANGED_MEANWHILE = _refusal(
    409,
    "A frame is no longer as `expected` states, as `detail` says. Nothing was changed.",
    "Look at the frame as it is now, and repeat the change if it is still wanted.",
)
IDEMPOTENCY_KEY_REUSED = _refusal(
    422, "This `Idempotency-Key` came with another request before.", "Make a new key for each new request."
)
INTERNAL_ERROR = Finding(
    "",
    "error",
    ("request", "job"),
    "Our fault: the log, or the job's record, contains the reason. The upload is safe.",
    "Tell the operator if it persists. A failed job with this code is not worth a retry.",
    500,
    True,
)

# while files are sent
UPLOAD_TOO_LARGE = _refusal(
    413,
    "The file is larger than 2 GiB, or the readings larger than 4 MiB.",
    "Send less.",
)
UPLOAD_INCOMPLETE = _refusal(
    400,
    "The connection was lost, or the form ended early. Nothing was stored.",
    "Send it again.",
    retryable=True,
)
DIGEST_MISMATCH = _refusal(
    422,
    "The bytes that arrived are not those that `Repr-Digest` or `X-Content-SHA256` announced. Nothing was "
    "kept.",
    "Send it again; if it persists, check the disk and memory of the sender.",
    retryable=True,
)
UPLOAD_OFFSET_DIFFERS = _refusal(
    409,
    "A piece of a file does not begin where what has arrived ends (`Upload-Offset`), or another "
    "connection has taken the upload over.",
    "Ask with `HEAD` how far it is, and continue from there.",
    retryable=True,
)
UPLOAD_CHECKSUM_DIFFERS = _refusal(
    460,
    "A piece of a file is not the one that `Upload-Checksum` announced. The piece was not kept.",
    "Send the piece again.",
    retryable=True,
)
PRECONDITION_FAILED = _refusal(
    412,
    "A change was asked for with `If-Match` or `If-None-Match: *`, and its address has no entity tag. "
    "Nothing was changed.",
    "Send it without the header. `expected` of `PATCH /v1/campaigns/{id}/frames` changes frames "
    "only as you saw them.",
)
UPLOAD_VERSION = _refusal(
    412, "The request does not speak tus 1.0.0 (`Tus-Resumable: 1.0.0`).", "Use a client of tus."
)
RANGE_OUTSIDE = _refusal(
    416,
    "The header `Range` asks for bytes behind the end of the file.",
    "The file may be complete already: ask for bytes within the size that `Content-Range` states.",
)
UPLOAD_TYPE = _refusal(
    415,
    "A piece of a file comes as another media type than `application/offset+octet-stream`.",
    "Send that `Content-Type`.",
)
CONTENT_ENCODED = _refusal(
    415,
    "The body is compressed (`Content-Encoding`); a file is stored as it is sent.",
    "Send the body as it is, without `Content-Encoding`.",
)
TOO_MANY_UPLOADS = _refusal(
    429,
    "Your organisation has 10,000 uploads that were begun and not finished.",
    "Finish them, or end them with `DELETE`; after a week they expire.",
    retryable=True,
)
STORAGE_FULL = _refusal(
    507, "No space is left for the file. Nothing was kept.", "Ask the operator to free space.", retryable=True
)
STORAGE_UNAVAILABLE = _refusal(503, "The file store does not answer.", "Try again.", retryable=True)
STORED_FILE_DAMAGED = Finding(
    "",
    "error",
    ("request", "job"),
    "The disk of the service has changed or lost a stored file. Nothing is handed out or computed from it.",
    "Upload the same file again (`stilb push` does): it replaces the damaged one, and every job "
    "that failed for it runs again. Repeat the measurement of a lost map, and the reading of a "
    "frame without its preview.",
    500,
)
DATABASE_UNAVAILABLE = _refusal(
    503, "The database does not answer.", "Try again after `Retry-After`.", retryable=True
)
SCHEMA_MISMATCH = _refusal(
    503,
    "The database has the schema of another version of the service. Nothing is written.",
    "Try again later; the operator finishes the upgrade or starts the version that fits.",
    retryable=True,
)
SERVICE_STOPPING = _refusal(
    503,
    "The service is being stopped or restarted; what it could not finish in time was not kept.",
    "Try again after `Retry-After`: the same `Idempotency-Key` makes it safe.",
    retryable=True,
)
PREVIEW_NOT_READY = _refusal(
    404,
    "The frame has no preview: it has not been read yet, or it was refused.",
    "Wait for its job. Retry only while the frame is `received`.",
    retryable=True,
)

# of campaigns and versions
CAMPAIGN_INCOMPLETE = _refusal(
    422,
    "A fit cannot start yet. `missing` names each thing: frames that are not read, scenes without a reading, "
    "too few scenes.",
    "Wait for the frames' jobs, or add what is missing.",
)
MEASUREMENTS_ONLY = _refusal(
    409,
    "The campaign is a night of measurements: it takes field frames, and nothing is fitted from them.",
    "Fit and publish a campaign of the kind `calibration`, and measure this one: `POST "
    "/v1/campaigns/{id}/measurements`.",
)
MANIFEST_INCOMPLETE = _refusal(
    409,
    "Files of the manifest are not stored, or no manifest was sent. `missing` names up to 100 of "
    "them. Keep the card.",
    "Send these files, then ask for the receipt again.",
)
PANEL_DIFFERS = Finding(
    "",
    "error",
    ("verdict", "request"),
    "A panel frame shows another panel than the campaign's, by its tags or its code; or a panel of this "
    "serial number and day of measurement is registered with other reflectances.",
    "Name the panel that was photographed in the campaign, or leave out the frames of the other "
    "one. Register new values with the day of their measurement.",
    409,
)
RIG_DIFFERS = _refusal(
    409,
    "A rig of this name is registered with other cameras, or in another order.",
    "Send another name: a rig whose cameras were exchanged is another rig.",
)
METHOD_MISMATCH = _refusal(
    409, "It belongs to another method than the one asked for.", "Name one of the same method."
)
CHECKLIST_SIGNED = _refusal(
    409,
    "The campaign's checklist has been signed.",
    "Send a new signature with the change; it then holds for the list as changed.",
)
STEP_NOT_DONE = _refusal(
    409,
    "The record shows that a step of the checklist is not done.",
    "Do what it lacks: the step is then ticked from the record.",
)
NO_CHECKLIST = _refusal(
    409,
    "The printed checklist is that of the luminance procedure: a campaign of another method has none.",
    "Leave it out.",
)
RECALL_OUTDATED = _refusal(
    409,
    "The cause of a recall now finds other versions than when it was reviewed. Nothing was revoked.",
    "Propose the recall again and review it.",
)
NO_CALIBRATION_IN_FORCE = _refusal(
    404,
    "No published version holds at that time for that camera, method and configuration; `detail` states what "
    "there is. When a frame is measured, the status is 409.",
    "Publish one, or ask for another time.",
)
CERTIFICATE_INCOMPLETE = _refusal(
    409,
    "Your organisation publishes no version whose certificate lacks what ISO/IEC 17025 asks for. "
    "`gaps` lists it.",
    "Fill it in and publish again, or let an admin change `refuses_incomplete_certificates`.",
)
REGIONS_DIFFER = _refusal(
    409,
    "Two measurements are compared whose outlines in the image differ; `detail` names both.",
    "Measure both with the same `roi` or `grid`, or ask with `other_region=true`.",
)

# of jobs
TEMPORARILY_UNAVAILABLE = _failure(
    "Something that the job needs did not serve: `waits_for` is `blobs` (the file store), `database` or "
    "`decoder`. The job is tried again at its `next_attempt_at` or sooner; after a day it is `failed`.",
    "Retry a failed job (`stilb retry --state failed --code temporarily_unavailable`) when the cause is "
    "gone.",
    retryable=True,
)
WORKER_LOST = _failure(
    "Three workers were lost while they ran this job, so it is `quarantined`. Usually one file is at fault.",
    "Examine the file with care; a corrected frame is read again.",
)
JOB_CANCELLED = _failure(
    "The operator has cancelled this job, by revoking its Celery task.",
    "Ask the operator why; then retry it.",
)


def _gap(sentence: str, remedy: str) -> Finding:
    return Finding("", "warn", ("certificate",), sentence, remedy)


APPROVER_MISSING = _gap(
    "Nobody signs it.", "State your name and role with your key (page Organisation, stilb key change)."
)
AUTHOR_MISSING = _gap(
    "Who fitted is missing.", "State name and role with the key (page Organisation, stilb key change)."
)
LABORATORY_NAME_MISSING = _gap(
    "The laboratory's name is missing.", "Enter it on the page Organisation (stilb organisation)."
)
LABORATORY_ADDRESS_MISSING = _gap(
    "The laboratory's address is missing.", "Enter it on the page Organisation (stilb organisation)."
)
CUSTOMER_MISSING = _gap("The customer is missing.", "Enter it on the campaign.")
PLACE_MISSING = _gap("The place of the measurements is missing.", "Enter it on the campaign.")
CONDITIONS_MISSING = _gap(
    "The conditions (temperature, lamp, daylight) are missing.", "Describe them on the campaign."
)
DATE_MISSING = _gap("The day of the measurements is missing.", "Enter the start of the campaign.")
RECORDER_MISSING = _gap("The recorder of the measurements is missing.", "Enter the name on the campaign.")
LENS_MISSING = _gap(
    "The lens is missing, and the result is valid for one lens only.", "Register it with the camera."
)
METER_UNKNOWN = _gap(
    "A reading was sent without `meter_id`, so that its traceability is unknown.",
    "Withdraw the reading, send it with its meter, and refit.",
)
METER_CERTIFICATE_EXPIRED = _gap(
    "A meter was read after its certificate was due. Its indication may be right, but is not covered by a "
    "certificate.",
    "Have the meter calibrated.",
)
METER_CERTIFICATE_NOT_YET_ISSUED = _gap(
    "A meter was read before its registered certificate was issued.",
    "Register the certificate that was valid on that day, then refit.",
)
CHECKLIST_INCOMPLETE = _gap(
    "Items of the procedure's checklist are not ticked.",
    "Tick them on the campaign's page; items that the record proves are ticked automatically.",
)
CHECKLIST_UNSIGNED = _gap("The operator has not signed the checklist.", "Sign it on the campaign's page.")

FINDINGS = declare(globals())
