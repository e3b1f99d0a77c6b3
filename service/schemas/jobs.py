"""Jobs, as a client sees them."""

from typing import Any, Literal

from pydantic import ConfigDict, Field

from service.problems import problem_body
from service.schemas.base import Answer, Instant, ProblemAnswer
from store.tables import Job

State = Literal["queued", "running", "succeeded", "failed", "quarantined"]


class JobAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "job_1",
                    "kind": "fit",
                    "subject_id": "cmp_1",
                    "state": "succeeded",
                    "progress": 1.0,
                    "attempt": 1,
                    "result": {"calibration_id": "cal_1"},
                    "created_at": "2026-05-01T08:00:00Z",
                }
            ]
        }
    )

    id: str
    kind: str
    subject_id: str
    state: State
    progress: float = Field(ge=0, le=1)
    attempt: int
    error: ProblemAnswer | None = None
    result: dict[str, Any] | None = Field(default=None, description="Ids and links of what was made.")
    created_at: Instant
    finished_at: Instant | None = None

    @classmethod
    def of(cls, row: Job) -> "JobAnswer":
        error = None
        if row.error is not None:
            status = 422 if row.state == "failed" and row.traceback is None else 500
            error = ProblemAnswer.model_validate(problem_body(row.error.get("status", status), **row.error))
        return cls(
            **{name: getattr(row, name) for name in _FROM_ROW},
            error=error,
        )


_FROM_ROW = (
    *("id", "kind", "subject_id", "state", "progress", "attempt", "result", "created_at", "finished_at"),
)
