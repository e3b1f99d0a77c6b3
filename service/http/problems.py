"""Problems: every refusal of the service, as application/problem+json with a stable code (docs/errors.md)."""

from collections.abc import Callable, Iterable, Mapping
from json import JSONDecoder
from typing import Any, Final

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from radiometry.findings import Finding, InputRejected, interface
from store.blobs import BlobDamaged, StorageFull, StorageUnavailable
from store.database import Conflict
from store.files import describe_damage
from store.queries.usage import QuotaExceeded

SHA256 = r"^[0-9a-f]{64}$"
COUNTRY = r"^[A-Z]{2}$"
ADDRESS = r"^https?://[!-~]+$"
WRITTEN = r"^[ \t\r\n]*[^\s\x00-\x1f\x7f-\x9f][^\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]*$"
# a NUL cannot be stored in PostgreSQL, and no honest name is blank or holds a control character
NAMED = r"[^\x00-\x1f\x7f-\x9f]*[^\s\x00-\x1f\x7f-\x9f][^\x00-\x1f\x7f-\x9f]*"
LINES = r"^[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]*$"

_OBJECT = "must be a JSON object"
_WORDS = {
    "missing": "is missing",
    "extra_forbidden": "is not known here; check its spelling or leave it out",
    **dict.fromkeys(("model_attributes_type", "model_type", "dict_type"), _OBJECT),
    "list_type": "must be a list",
    "finite_number": "must be a finite number",
    **dict.fromkeys(("float_type", "float_parsing"), "must be a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "must be a whole number"),
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "string_pattern_mismatch": "must not be blank, nor hold control characters such as line breaks or tabs",
    "string_unicode": "must be text in Unicode",
    "timezone_aware": "needs a time zone: 2026-05-01T08:00:00Z or 2026-05-01T10:00:00+02:00",
    **dict.fromkeys(
        ("datetime_type", "datetime_parsing", "datetime_from_date_parsing", "datetime_object_invalid"),
        "must be a time such as 2026-05-01T08:00:00Z",
    ),
    **dict.fromkeys(
        ("date_parsing", "date_from_datetime_parsing", "date_from_datetime_inexact"),
        "must be a date such as 2026-05-01",
    ),
}
_PATTERNS = {
    SHA256: "must be a SHA-256: 64 digits, each 0 to 9 or a to f",
    COUNTRY: "must be two capital letters of ISO 3166, such as DE",
    ADDRESS: "must be an address such as https://example.org/hook",
    WRITTEN: "must be words, without control characters other than line breaks and tabs",
    LINES: "must not hold control characters other than line breaks and tabs",
}

AS_NUMBER, BY_NAME = "as a number", "by name"
"""Two forms of one field. Pydantic puts the form into the field's place, where nobody has sent one."""

_ASIDE = " after validation"  # what pydantic says of the length of a list, as if the team had validated it

_PREFIXES = ("Value error, ", "Input should ", "String should ", "List should ", "Dictionary should ")


def describe(error: Mapping[str, Any]) -> list[dict[str, str]]:
    """The fields that one of pydantic's errors is about, each with what is wrong with it."""
    field = ".".join(str(part)[:200] for part in error["loc"] if part not in (AS_NUMBER, BY_NAME))
    if error["type"] == "null":
        return [{"field": f"{field}.{name}", "message": error["msg"]} for name in error["ctx"]["names"]]
    message = (
        _PATTERNS.get(error.get("ctx", {}).get("pattern"))
        or _WORDS.get(error["type"])
        or _say_plainly(error["msg"])
    )
    if field == "body" and message == _OBJECT:
        message += ", sent with Content-Type: application/json"
    return [{"field": field, "message": message}]


def _say_plainly(message: str) -> str:
    message = message.replace(_ASIDE, "")
    for prefix in _PREFIXES:
        if message.startswith(prefix):
            rest = message.removeprefix(prefix)
            return rest if prefix == "Value error, " else f"must {rest}"
    return message[:1].lower() + message[1:]


_MOST_LISTED: Final = 100
_MORE: Final = {"type": "more", "loc": (), "msg": ""}
_DECODER: Final = JSONDecoder()
UNREADABLE: Final = (
    "The body cannot be read: send JSON in UTF-8, without excessive nesting or excessively long numbers."
)


class Problem(HTTPException):
    """A refusal, of the class that the framework lets through while a body is read."""

    def __init__(
        self,
        code: Finding,
        detail: str,
        *,
        status: int | None = None,
        retryable: bool | None = None,
        headers: Mapping[str, str] | None = None,
        **extra: Any,  # noqa: ANN401
    ) -> None:
        self.status = status or code.status or 500
        super().__init__(self.status, detail)
        self.code = code
        self.retryable = code.retryable if retryable is None else retryable
        self.headers: dict[str, str] = dict(headers or {})
        self.extra = extra


def problem_body(
    status: int,
    code: str,
    detail: str,
    *,
    retryable: bool = False,
    **extra: Any,  # noqa: ANN401
) -> dict[str, Any]:
    return {
        "type": f"/docs/errors#{code}",
        "title": code.replace("_", " ").capitalize(),
        "status": status,
        "detail": detail,
        "code": code,
        "retryable": retryable,
        **extra,
    }


def not_found(what: str) -> Problem:
    detail = f"There is no such {what}. Check the id, and that your key is of the organisation that owns it."
    return Problem(interface.NOT_FOUND, detail)


def install(app: FastAPI) -> None:
    """Turn every exception that can reach the top into a problem."""

    def turn(kind: type[Exception], say: Callable[[Request, Any], JSONResponse]) -> None:
        async def respond(request: Request, error: Exception) -> JSONResponse:
            return say(request, error)

        app.add_exception_handler(kind, respond)

    turn(Problem, lambda _, error: answer(error))
    turn(InputRejected, lambda _, error: _answer(problem_body(422, error.code, error.message)))
    turn(Conflict, lambda _, error: _answer(problem_body(409, error.code, error.message)))
    turn(QuotaExceeded, lambda _, error: answer(over_quota(error)))
    turn(RequestValidationError, lambda _, error: answer(invalid(error.errors())))
    turn(HTTPException, lambda request, error: answer(_of_the_framework(request, error)))
    turn(BlobDamaged, lambda _, error: answer(Problem(interface.STORED_FILE_DAMAGED, describe_damage(error))))
    for kind, (code, detail) in _SAID.items():
        turn(kind, lambda *_, code=code, detail=detail: answer(Problem(code, detail)))


_SAID: Final = {
    ClientDisconnect: (interface.UPLOAD_INCOMPLETE, "The connection was lost before the end of the body."),
    StorageFull: (interface.STORAGE_FULL, "The service has no space left for this file."),
    StorageUnavailable: (interface.STORAGE_UNAVAILABLE, "The file store does not answer. Try again."),
    Exception: (
        interface.INTERNAL_ERROR,
        "Internal error. It has been logged. Try again, and tell the operator if it persists.",
    ),
}
"""Of exceptions that say nothing to whoever asked."""


def _of_the_framework(request: Request, error: HTTPException) -> Problem:
    """Return the problem, in our words, of a request that the framework refused."""
    headers = dict(error.headers or {})
    match error.status_code:
        case 404:
            detail = "This address does not exist; /docs lists all addresses."
            return Problem(interface.NOT_FOUND, detail)
        case 405:
            allowed = ", ".join(request.app.state.addresses.methods_of(request.scope["path"]))
            detail = f"This address does not accept {request.method}; it accepts {allowed}."
            return Problem(interface.METHOD_NOT_ALLOWED, detail, headers={"Allow": allowed})
        case _:
            return Problem(interface.BAD_REQUEST, UNREADABLE, status=error.status_code, headers=headers)


def over_quota(error: QuotaExceeded) -> Problem:
    """Build the problem of a quota, with its number; waiting jobs become fewer on their own, files do not."""
    passes = error.quota == "jobs_waiting"
    what = error.quota.replace("_", " ")
    advice = "Wait until some are done." if passes else "Ask the operator of the service for more space."
    return Problem(
        interface.QUOTA_EXCEEDED,
        f"Your organisation may have {error.limit} {what} and has {error.used}"
        f"{'' if passes else ', unfinished uploads included'}; this request exceeds it. {advice}",
        status=429 if passes else 507,
        headers={"Retry-After": "10" if passes else "60"},
        quota=error.quota,
        limit=error.limit,
        used=error.used,
    )


def invalid(errors: Iterable[Mapping[str, Any]]) -> Problem:
    """Name each field that is wrong. The given value is not echoed: it may not even be JSON."""
    errors = list(errors)
    named = [member for error in errors[:_MOST_LISTED] for member in describe(error)]
    detail = "; ".join(f"{member['field']}: {member['message']}" for member in named[:5])
    count = len(named) + len(errors[_MOST_LISTED:])
    more = f"; and {count - 5} more" if count > 5 else ""
    return Problem(interface.VALIDATION_FAILED, f"{detail}{more}", errors=named[:_MOST_LISTED])


def wrong(field: str, message: str) -> Problem:
    return invalid([_find(field, message)])


def refuse(found: Iterable[tuple[str, str]]) -> None:
    """Refuse what is wrong, if anything is: each field by its path, with what is wrong with it."""
    if errors := [_find(field, message) for field, message in found]:
        raise invalid(errors)


def _find(field: str, message: str) -> dict[str, Any]:
    return {"type": "value", "loc": field.split("."), "msg": message}


def located(error: ValidationError, *place: str) -> list[dict[str, Any]]:
    """Return what pydantic found, and where; beyond a hundred only how many: a text is faster than a list."""
    count = error.error_count()
    if count <= _MOST_LISTED:
        found: list[Any] = error.errors(include_url=False)
    else:
        text, found, end = error.json(include_url=False, include_input=False), [], 0
        while len(found) < _MOST_LISTED:
            each, end = _DECODER.raw_decode(text, end + 1)
            found.append(each)
    listed = [{**each, "loc": (*place, *each["loc"])} for each in found]
    return listed + [_MORE] * (count - len(listed))


def answer(problem: Problem) -> JSONResponse:
    body = problem_body(
        problem.status, problem.code, problem.detail, retryable=problem.retryable, **problem.extra
    )
    return _answer(body, problem.headers)


def _answer(body: dict[str, Any], headers: Mapping[str, str] | None = None) -> JSONResponse:
    return JSONResponse(body, body["status"], headers, media_type="application/problem+json")
