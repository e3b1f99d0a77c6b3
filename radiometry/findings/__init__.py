"""Findings in frames, fits, measurements and requests: the form of an entry, and of each occurrence."""

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal, Self

from radiometry.records import Record, about

Outcome = Literal["pass", "warn", "fail", "pending"]
Severity = Literal["warn", "pending", "fail", "error"]
Place = Literal[
    "frame",
    "verdict",
    "campaign",
    "calibration",
    "certificate",
    "measurement",
    "fleet",
    "file",
    "request",
    "job",
]


@dataclass(frozen=True, eq=False, repr=False, slots=True)
class Finding(str):  # noqa: SLOT000  the decorator makes them
    """One entry of the registry; as a string it is its code, which is stored and stays."""

    code: str = field(metadata={"description": "Stable name, also the heading in the documentation."})
    severity: Severity = field(
        metadata={"description": 'The gravest that an occurrence can have. "error": there is no result.'}
    )
    where: tuple[Place, ...] = field(
        metadata={
            "description": 'Where it occurs: as a warning of a stored "frame", a reason in a frame\'s '
            '"verdict", a finding of a "campaign", a flag of a "calibration", "measurement" or "fleet" '
            'comparison, a missing item of a "certificate", the refusal of a "file" or a "request", or the '
            'error of a "job".'
        }
    )
    sentence: str = field(metadata={"description": "What was found."})
    remedy: str = field(metadata={"description": "What to do about it."})
    status: int | None = field(
        default=None,
        metadata={"description": "HTTP status of the refusal of a request; None if it refuses none."},
    )
    retryable: bool = field(
        default=False, metadata={"description": "True if the same request may succeed later."}
    )

    def __new__(cls, code: str, *_: object, **__: object) -> Self:
        """Make the code the value of the string."""
        return str.__new__(cls, code)

    def __hash__(self) -> int:
        """Return the hash of the code, so that either finds the other in a set."""
        return str.__hash__(self)

    def at(self, where: str, detail: str) -> "Raised":
        """Return the flag as raised at a place."""
        return Raised(flag=self.code, where=where, detail=detail)

    def reason(self, detail: str, outcome: Outcome | None = None) -> "Reason":
        """Return the reason of a verdict."""
        found: Outcome = outcome or ("fail" if self.severity == "error" else self.severity)
        return Reason(code=self, outcome=found, detail=detail)

    def reject(self, message: str) -> "InputRejected":
        """Return the refusal in these words alone; the caller raises it."""
        return InputRejected(self, message)

    def refuse(self, what_is_wrong: str) -> "InputRejected":
        """Return the refusal with the remedy; the caller raises it."""
        return self.reject(f"{what_is_wrong} {self.remedy}")


def flag(sentence: str, remedy: str, where: Place = "calibration", *more: Place) -> Finding:
    """Declare a flag of a result that can be used."""
    return Finding("", "warn", (where, *more), sentence, remedy)


def flag_measurement(sentence: str, remedy: str) -> Finding:
    """Declare a flag of a measurement alone."""
    return flag(sentence, remedy, "measurement")


def flag_both(sentence: str, remedy: str) -> Finding:
    """Declare a flag of a fit that holds for what is measured with it too."""
    return flag(sentence, remedy, "calibration", "measurement")


def reason(severity: Literal["warn", "pending", "fail"], sentence: str, remedy: str, *more: Place) -> Finding:
    """Declare a reason why a frame does not simply pass."""
    return Finding("", severity, ("verdict", *more), sentence, remedy)


warn, fail = partial(reason, "warn"), partial(reason, "fail")


def error(sentence: str, remedy: str, where: Place = "request", *more: Place) -> Finding:
    """Declare a reason why an input gives no result."""
    return Finding("", "error", (where, *more), sentence, remedy, 422)


def declare(names: dict[str, object]) -> tuple[Finding, ...]:
    """Make the names of a module's entries their codes; return the entries in their order."""
    entries = {name: each for name, each in names.items() if isinstance(each, Finding)}
    named = {name: replace(each, code=name.lower()) for name, each in entries.items()}
    names |= named
    return tuple(named.values())


class Raised(Record):
    """A flag with the place where it applies and what was found there."""

    flag: str = about("Code of the finding.")
    where: str = about('For example "iso 3200", "scene level-4" or "frame dark-2"; "" for the whole.')
    detail: str = about("One sentence with the numbers.")


class Reason(Record):
    """A reason in a frame's verdict; ``detail`` is a sentence with the numbers and what to do."""

    code: Finding
    outcome: Outcome
    detail: str


class InputRejected(Exception):  # noqa: N818  the name says whose fault it is
    """An input that cannot be used: never retried, always explained."""

    def __init__(self, code: Finding, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
