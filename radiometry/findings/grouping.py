"""Equal findings as one, and the advice that follows from them."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Self

from radiometry.drawing.text import name_few, sort_naturally
from radiometry.findings import Finding, Severity, shared
from radiometry.records import Record, about

MOST_SUBJECTS: Final = 100
_RANKS: Final[Mapping[Severity, int]] = {"error": 0, "fail": 0, "pending": 1, "warn": 2}


class Occurrence(Record):
    """A finding at one subject."""

    finding: Finding  #: Entry of the registry
    severity: Severity  #: Severity here
    subject: str  #: For example "scene level-4" or "frame dark-2"; "" for the whole
    detail: str  #: One sentence with the numbers
    values: Mapping[str, Any] = field(default_factory=dict)  #: Those numbers by name


class FindingGroup(Record):
    """Equal findings as one."""

    code: str = about("Code of the finding.")
    severity: Severity = about("Severity of all of them.")
    count: int = about("Number of occurrences.")
    subjects: tuple[str, ...] = about('Where each of the first hundred occurred; "" for the whole.')
    values: Mapping[str, tuple[Any, ...]] = about(
        'Numbers by name, a list each in the order of the subjects; "detail" where the occurrences '
        "differ in their sentences."
    )
    sentence: str = about("What the finding means.")
    detail: str = about(
        "What was found: the sentence of all occurrences if it is the same, else that of the finding."
    )
    action: str = about("What to do.")

    @property
    def sentences(self) -> tuple[str, ...]:
        """Return what was found, each sentence once."""
        return tuple(dict.fromkeys(self.values.get("detail", (self.detail,))))


@dataclass(frozen=True, eq=False, repr=False, slots=True)
class Cause(str):  # noqa: SLOT000  the decorator makes them
    """Lack of a fit, or an improvement of it; as a string it is its sentence."""

    sentence: str  #: With the names and the numbers
    finding: Finding  #: Entry of the registry
    subjects: tuple[str, ...] = ("",)  #: For example "scene level-4"; "" for the whole
    values: Mapping[str, Any] = field(default_factory=dict)  #: The numbers of the sentence by name

    def __new__(cls, sentence: str, *_: object) -> Self:
        """Make the sentence the value of the string."""
        return str.__new__(cls, sentence)


def name_frames(what: str, frames: Collection[str], finding: Finding) -> Cause:
    """Return what holds for these frames as one cause."""
    subjects = tuple(f"frame {name}" for name in sort_naturally(frames))
    return Cause(f"{what}: {name_few('frame', frames)}", finding, subjects)


_WAITS: Final = (shared.NOT_READ, shared.NOT_EXTRACTED)  # what workers do by themselves


def group_causes(sentences: Iterable[str], default: Finding) -> tuple[FindingGroup, ...]:
    """Return causes as findings, those of one code as one; a sentence without a code has the default's.

    The severity is the default's, or "pending" of what needs nobody.
    """
    groups: dict[str, list[Occurrence]] = {}
    for each in sentences:
        cause = each if isinstance(each, Cause) else Cause(each, default)
        severity: Severity = "pending" if cause.finding in _WAITS else default.severity
        groups.setdefault(each if cause.finding is default else cause.finding.code, []).extend(
            Occurrence(
                finding=cause.finding,
                severity=severity,
                subject=subject,
                detail=str(each),
                values=cause.values,
            )
            for subject in cause.subjects
        )
    return tuple(map(_join, groups.values()))


def group_findings(occurrences: Iterable[Occurrence]) -> tuple[FindingGroup, ...]:
    """Return equal findings as one each, the gravest first."""
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


_BY_SOURCE = {
    "fit of K": "Calibrate with more light levels, apertures and readings: the fit of K is the largest "
    "source.",
    "meter calibration": "Use a meter with a smaller calibration uncertainty: it is the largest source here, "
    "and no number of readings or frames reduces it.",
    "dark signal": "Take more dark frames at this ISO value and time: the dark signal is the largest source.",
    "exposure time": "Have the shutter's times measured: the marking of the time is the largest source.",
    "f-number": "Have the apertures measured, or calibrate and measure at one aperture: the marking of the "
    "f-number is the largest source.",
    "ISO setting": "Calibrate at this very ISO setting: it is the largest source.",
    "vignetting": "Take more and brighter flat fields at this f-number: the correction of vignetting is the "
    "largest source.",
    "scatter between frames": "Take several frames and measure their mean: shutter and aperture repeat no "
    "better, and this is the largest source.",
    "spectral mismatch": "Calibrate under the very light that is measured, or send the measured spectra of "
    "both and the camera's response as tables: the spectral mismatch is the largest source.",
    "flicker": "Expose for a whole number of half periods of the mains, such as 1/50 s of 50 Hz: flicker is "
    "the largest source.",
    "focus distance": "Calibrate at the distance of the measurement: the focus is the largest source.",
    "stray light": "Keep bright lamps out of the frame, and shade the lens: stray light is the largest "
    "source.",
    "K": "Take the panel again, before and after the flight, in even light: K is the largest source.",
    "sunshine readings": "Fly under a steady sky, or take the mean of more readings: the scatter of the "
    "sunshine sensor is the largest source.",
    "drift": "Take the panel nearer to the frames in time, before and after them: K's drift between the "
    "panel visits is the largest source.",
    "sunshine tilt": "Mount the sunshine sensor level, and fly when the sun is high: its tilt is the largest "
    "source.",
    "panel": "Have the panel measured, and take it level and evenly lit: the panel is the largest source.",
    "panel angle": "Level the panel with a bubble or an inclinometer, and state its level: its angle is the "
    "largest source.",
    "alignment": "Draw the region where its surroundings are even: what remains of the bands' displacement "
    "is the largest source.",
    "sunshine gain": "Take the panel in the light of the flight, so that the sunshine sensor chooses the "
    "same gain: the gain's ratio is the largest source.",
    "scatter between repeats": "Keep the light and the camera still and average more frames: what the frames "
    "scatter is the largest source.",
    "pixel noise": "Average several frames or a larger region: the noise of the pixels is the largest "
    "source.",
}

# In place of the above, where the correction assumes what could have been stated
_IF_ASSUMED = {
    "spectral mismatch": "State what its correction names as not known, with the campaign of the calibration "
    "or with the night, or calibrate under a lamp of this kind: the spectral mismatch is the largest source.",
    "flicker": "State what its correction names as assumed, with the light of the place, or expose for a "
    "whole number of half periods of the mains (1/10 s suits 50 and 60 Hz): flicker is the largest source.",
    "focus distance": "State what its correction names as not known: the focus is the largest source.",
    "stray light": "Keep bright lamps out of the frame, and shade the lens, or state the glare that a black "
    "trap shows: stray light is the largest source.",
}


def advise(
    found: Iterable[Finding], *, budget: Sequence[tuple[str, float]], assumed: Collection[str] = ()
) -> tuple[str, ...]:
    """Return the remedy of each finding once, then a sentence for the largest source of uncertainty."""
    sentences = list(dict.fromkeys(finding.remedy for finding in found))
    largest = max(budget, key=lambda entry: entry[1], default=None)
    if largest is not None and largest[1] > 0.0:
        source = largest[0]
        sentences.append((_IF_ASSUMED if source in assumed else _BY_SOURCE)[source])
    return tuple(sentences)
