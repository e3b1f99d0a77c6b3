"""The registry of findings, as clients see it."""

from dataclasses import asdict

from pydantic import Field

from radiometry.findings import Finding, Place, Severity
from radiometry.methods.findings import FINDINGS
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
