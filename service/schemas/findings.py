"""Equal findings as one, as the answers of campaigns, versions and measurements have them."""

from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import Field

from radiometry.findings import Severity
from radiometry.findings.grouping import FindingGroup, Occurrence, group_findings
from radiometry.methods.findings import FINDINGS
from service.schemas.base import Answer


class FindingGroupAnswer(Answer, restates=FindingGroup, fields="code count sentence detail action"):
    """Equal findings as one."""

    severity: Severity
    subjects: list[str] = Field(description='Where each of the first hundred was found; "" for the whole.')
    values: dict[str, Any] = Field(
        description="Numbers by name, a list each in the order of `subjects`; `detail` where what was found "
        "differs."
    )


def group_flags(raised: Iterable[Mapping[str, Any]]) -> list[FindingGroupAnswer]:
    """Return stored flags with equal ones as one."""
    groups = group_findings(
        Occurrence(
            finding=FINDINGS[each["flag"]], severity="warn", subject=each["where"], detail=each["detail"]
        )
        for each in raised
    )
    return [FindingGroupAnswer.restate(group) for group in groups]
