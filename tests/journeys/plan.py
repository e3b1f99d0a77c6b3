"""What a team brings home, and what its notebook says of it: the same for every door."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Corners = Sequence[tuple[float, float]]

CERTIFICATE = {
    "number": "L-2026-0117",
    "laboratory": "Photometry Laboratory",
    "issued_on": "2026-01-17",
    "due_on": "2027-01-17",
    "expanded_uncertainty_rel": 0.02,
    "coverage_factor": 2.0,
}


@dataclass(frozen=True, kw_only=True)
class File:
    """A file and what it is; ``exposure``: what only the notebook states of it, such as f_number and iso."""

    path: Path
    role: str
    scene: str | None = None
    exposure: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Plan:
    """One campaign: one camera, one method, and all that is sent, drawn and typed.

    ``folder`` holds ``files`` and may hold more; ``camera`` has make, model and serial; ``details`` are those
    of a campaign as `POST /v1/campaigns` names them, ``params`` those of the fit; ``regions`` have names.
    """

    folder: Path
    camera: Mapping[str, Any]
    method: str
    number: str
    files: Sequence[File]
    region: Corners | None = None
    regions: Mapping[str, Corners] | None = None
    meters: Sequence[Mapping[str, Any]] = ()
    readings: Sequence[Mapping[str, Any]] = ()
    panel: Mapping[str, Any] | None = None
    details: Mapping[str, Any] = field(default_factory=dict)
    params: Mapping[str, Any] = field(default_factory=dict)

    def write_spreadsheet(self, names: Mapping[str, str] | None = None) -> str:
        """The readings as CSV; ``names`` : of the scenes, where a door has given them others."""
        columns = ("scene", "quantity", "value", "unit")
        named = [{**each, "scene": (names or {}).get(each["scene"], each["scene"])} for each in self.readings]
        lines = [columns, *([str(each[column]) for column in columns] for each in named)]
        return "".join(",".join(line) + "\n" for line in lines)

    @property
    def is_flat(self) -> bool:
        """Whether nothing but their content tells the files apart: one folder, and exposures in each file."""
        return all(file.path.parent == self.folder and not file.exposure for file in self.files)


@dataclass(frozen=True)
class Figure:
    """A value with its standard uncertainty, as a door shows it."""

    value: float
    u: float

    def agrees(self, truth: float, *, within: float = 3.0) -> bool:
        """Whether the truth lies within so many standard uncertainties, which are more than nothing."""
        return self.u > 0.0 and abs(self.value - truth) <= within * self.u


def pick(items: Iterable[Mapping[str, Any]], name: str, where: Mapping[str, float | str]) -> Figure:
    """Return the one coefficient of an answer, without an f-number unless one is asked for."""
    asked = {"f_number": None, **where, "name": name}
    (found,) = [row for row in items if all(row.get(key) == value for key, value in asked.items())]
    return Figure(found["value"], found["standard_uncertainty"])


def describe_meter(kind: str, model: str, serial: str, *, certified: bool) -> dict[str, Any]:
    stated = {"certificate": CERTIFICATE} if certified else {}
    return {"kind": kind, "make": "Konica Minolta", "model": model, "serial": serial} | stated
