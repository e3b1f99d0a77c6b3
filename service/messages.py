"""A wrong field in words that a field team can act on, from the ones that pydantic chose for programmers."""

from collections.abc import Mapping
from typing import Any

SHA256 = r"^[0-9a-f]{64}$"
COUNTRY = r"^[A-Z]{2}$"
ADDRESS = r"^https?://[!-~]+$"

_OBJECT = "must be a JSON object"
_INSTANT = "must be a time such as 2026-05-01T08:00:00Z"
_WORDS = {
    "missing": "is missing",
    "extra_forbidden": "is not known here; check its spelling or leave it out",
    "model_attributes_type": _OBJECT,
    "model_type": _OBJECT,
    "dict_type": _OBJECT,
    "list_type": "must be a list",
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "string_pattern_mismatch": "must not hold control characters such as line breaks or tabs",
    "string_unicode": "must be text in Unicode",
    "timezone_aware": "needs a time zone: 2026-05-01T08:00:00Z or 2026-05-01T10:00:00+02:00",
    "datetime_type": _INSTANT,
    "datetime_parsing": _INSTANT,
    "datetime_from_date_parsing": _INSTANT,
    "datetime_object_invalid": _INSTANT,
    "date_parsing": "must be a date such as 2026-05-01",
    "date_from_datetime_parsing": "must be a date such as 2026-05-01",
    "date_from_datetime_inexact": "must be a date such as 2026-05-01",
}
_PATTERNS = {
    SHA256: "must be a SHA-256: 64 digits, each 0 to 9 or a to f",
    COUNTRY: "must be two capital letters of ISO 3166, such as DE",
    ADDRESS: "must be an address such as https://example.org/hook",
}

AS_NUMBER, BY_NAME = "as a number", "by name"
"""Two forms of one field. Pydantic puts the form into the field's place, where nobody has sent one."""

_ASIDE = " after validation"
"""What pydantic says of the length of a list, as if the team had validated it."""

_PREFIXES = ("Value error, ", "Input should ", "String should ", "List should ", "Dictionary should ")


def describe(error: Mapping[str, Any]) -> list[dict[str, str]]:
    """The fields that one of pydantic's errors is about, each with what is wrong with it."""
    field = ".".join(str(part)[:200] for part in error["loc"] if part not in (AS_NUMBER, BY_NAME))
    if error["type"] == "null":
        return [{"field": f"{field}.{name}", "message": error["msg"]} for name in error["ctx"]["names"]]
    message = (
        _PATTERNS.get(error.get("ctx", {}).get("pattern"))
        or _WORDS.get(error["type"])
        or _plain(error["msg"])
    )
    if field == "body" and message == _OBJECT:
        message += ", sent with Content-Type: application/json"
    return [{"field": field, "message": message}]


def _plain(message: str) -> str:
    message = message.replace(_ASIDE, "")
    for prefix in _PREFIXES:
        if message.startswith(prefix):
            rest = message.removeprefix(prefix)
            return rest if prefix == "Value error, " else f"must {rest}"
    return message[:1].lower() + message[1:]
