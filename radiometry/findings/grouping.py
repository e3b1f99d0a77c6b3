"""Equal findings as one, with the subjects that they hold for."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from radiometry.findings import Finding, Severity

MOST_SUBJECTS: Final = 100
_RANKS: Final[Mapping[Severity, int]] = {"error": 0, "fail": 0, "pending": 1, "warn": 2}


@dataclass(frozen=True, kw_only=True)
class Occurrence:
    """A finding at one subject.

    Attributes
    ----------
    finding : Finding
        Entry of the registry.
    severity : Severity
        Severity here.
    subject : str
        For example "scene level-4" or "frame dark-2"; "" for the whole.
    detail : str
        One sentence with the numbers.
    values : Mapping, optional
        Those numbers by name.
    """

    finding: Finding
    severity: Severity
    subject: str
    detail: str
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class FindingGroup:
    """Equal findings as one.

    Attributes
    ----------
    code : str
        Code of the finding.
    severity : Severity
        Severity of all of them.
    count : int
        Number of occurrences.
    subjects : tuple of str
        Where each of the first hundred occurred; "" for the whole.
    values : Mapping
        Numbers by name, a list each in the order of the subjects; "detail" where the occurrences differ in
        their sentences.
    sentence : str
        What the finding means.
    detail : str
        What was found: the sentence of all occurrences if it is the same, else that of the finding.
    action : str
        What to do.
    """

    code: str
    severity: Severity
    count: int
    subjects: tuple[str, ...]
    values: Mapping[str, tuple[Any, ...]]
    sentence: str
    detail: str
    action: str


def group_findings(occurrences: Iterable[Occurrence]) -> tuple[FindingGroup, ...]:
    """Return equal findings as one each, the gravest first.

    Parameters
    ----------
    occurrences : iterable of Occurrence
        Findings; equal are those of one code and severity.
    """
    groups: dict[tuple[str, Severity], list[Occurrence]] = {}
    for each in occurrences:
        groups.setdefault((each.finding.code, each.severity), []).append(each)
    found = (_join(some) for some in groups.values())
    return tuple(sorted(found, key=lambda group: _RANKS[group.severity]))


def _join(some: list[Occurrence]) -> FindingGroup:
    first, shown = some[0], some[:MOST_SUBJECTS]
    names = dict.fromkeys(name for each in shown for name in each.values)
    same = all(each.detail == first.detail for each in some)
    details = {} if same else {"detail": tuple(each.detail for each in shown)}
    return FindingGroup(
        code=first.finding.code,
        severity=first.severity,
        count=len(some),
        subjects=tuple(each.subject for each in shown),
        values={name: tuple(each.values.get(name) for each in shown) for name in names} | details,
        sentence=first.finding.sentence,
        detail=first.detail if same and first.detail else first.finding.sentence,
        action=first.finding.remedy,
    )
