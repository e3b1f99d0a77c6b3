"""Decisions about a camera's versions."""

from service.schemas.base import Answer
from store.queries.decisions import Decision


class DecisionAnswer(Answer, restates=Decision, without="calibration"):
    calibration_id: str
    method: str
    version: int
    by_name: str | None = None

    @classmethod
    def of(cls, row: Decision, names: dict[str, str]) -> "DecisionAnswer":
        return cls.restate(row, row.calibration, by_name=names.get(row.by), calibration_id=row.calibration.id)


class DecisionsAnswer(Answer):
    items: list[DecisionAnswer]
