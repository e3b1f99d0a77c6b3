"""The findings: what each flag, reason and refusal means, and what to do about it."""

import hashlib
from dataclasses import asdict

from fastapi import Request, Response
from pydantic import Field

from radiometry.findings import Finding, Place, Severity
from radiometry.methods.findings import FINDINGS
from service.auth import Reader
from service.immutable import not_modified, standing_headers
from service.operations import Router
from service.routes import problems
from service.schemas.base import Answer


class FindingAnswer(Answer, restates=Finding):
    """A finding that can occur in a frame, a fit or a measurement."""

    code: str = Field(description="Stable: the `flag`, the `code` of a reason, or the `code` of a refusal.")
    severity: Severity = Field(description='The gravest that an occurrence can have; "error": no result.')
    where: list[Place] = Field(description="Where it can occur.")
    status: int | None = Field(default=None, description="HTTP status where a request is refused.")
    retryable: bool = Field(description="True if the same request may succeed later.")


class FindingsAnswer(Answer):
    """Every finding that this service knows."""

    items: list[FindingAnswer]


def describe_findings() -> FindingsAnswer:
    """Return every finding."""
    return FindingsAnswer(items=[FindingAnswer.model_validate(asdict(each)) for each in FINDINGS.values()])


router = Router(prefix="/v1/findings", tags=["calibrations"])


@router.get("", response_model=FindingsAnswer, responses=problems())
def list_findings(request: Request, _caller: Reader) -> Response:
    """List the findings with severity, place, sentence and remedy.

    Flags, reasons of verdicts and refusals name a `code` of this list. It changes only with the release.
    """
    answer = describe_findings()
    tag = hashlib.sha256(answer.model_dump_json().encode()).hexdigest()
    headers = standing_headers(tag)
    return not_modified(request, tag, headers) or answer.respond(headers)
