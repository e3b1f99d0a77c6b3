"""The findings: what each flag, reason and refusal means, and what to do about it."""

import hashlib

from fastapi import APIRouter, Request, Response

from service.auth import Reader
from service.immutable import not_modified, standing_headers
from service.routes import problems
from service.schemas.findings import FindingsAnswer, describe_findings

router = APIRouter(prefix="/v1/findings", tags=["calibrations"])


@router.get("", response_model=FindingsAnswer, responses=problems())
def list_findings(request: Request, _caller: Reader) -> Response:
    """List the findings with severity, place, sentence and remedy.

    Flags, reasons of verdicts and refusals name a `code` of this list. It changes only with the release.
    """
    answer = describe_findings()
    tag = hashlib.sha256(answer.model_dump_json().encode()).hexdigest()
    headers = standing_headers(tag)
    return not_modified(request, tag, headers) or answer.respond(headers)
