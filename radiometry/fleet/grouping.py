"""Grouping of determinations by camera, or by body and lens where swaps separate the two."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from radiometry.fleet.determinations import Determination, Source
from radiometry.fleet.effects import Index, are_separable

FactorName = Literal["camera", "body", "lens"]


@dataclass(frozen=True, kw_only=True)
class Grouping:
    """Factors of an analysis, each with its label per determination and its levels' names.

    Attributes
    ----------
    units : tuple of tuple of int
        One row per camera that existed: positions of its body and lens in the levels of each factor; for the
        one factor "camera" the position of the level.
    confounded : bool
        True if lenses are known and differ, and no swaps link them.
    """

    names: tuple[FactorName, ...]
    labels: tuple[Index, ...]
    levels: tuple[tuple[str, ...], ...]
    units: tuple[tuple[int, ...], ...]
    unit_names: tuple[str, ...]
    confounded: bool


def group_cameras(rows: Sequence[Determination]) -> Grouping:
    """Group determinations by camera (a body with a lens), or by body and lens where swaps link all of them.

    A body that was calibrated with two lenses is two cameras: as one, the difference of its lenses would
    appear as a lack of repeatability. Where a body's lens is named once and at other times not, the named one
    is assumed.

    Parameters
    ----------
    rows : sequence of Determination
        Values of one parameter.
    """
    pairs = _pair(rows)
    named = _name(pairs)
    cameras, camera_labels = _index([named[pair] for pair in pairs])
    one = Grouping(
        names=("camera",),
        labels=(camera_labels,),
        levels=(cameras,),
        units=tuple((index,) for index in range(len(cameras))),
        unit_names=cameras,
        confounded=False,
    )
    known = [(body, lens) for body, lens in pairs if lens is not None]
    if (
        len(known) < len(pairs)
        or len({lens for _, lens in known}) < 2
        or len({body for body, _ in known}) < 2
    ):
        return one
    bodies, body_labels = _index([body for body, _ in known])
    lenses, lens_labels = _index([lens for _, lens in known])
    if not are_separable((body_labels, lens_labels)):
        return replace(one, confounded=True)
    existing = sorted({(int(b), int(e)) for b, e in zip(body_labels, lens_labels, strict=True)})
    return Grouping(
        names=("body", "lens"),
        labels=(body_labels, lens_labels),
        levels=(bodies, lenses),
        units=tuple(existing),
        unit_names=tuple(f"{bodies[b]} with lens {lenses[e]}" for b, e in existing),
        confounded=False,
    )


def _pair(rows: Sequence[Determination]) -> list[tuple[str, str | None]]:
    lenses: dict[str, set[str]] = {}
    for row in rows:
        if row.source.lens is not None:
            lenses.setdefault(row.source.camera, set()).add(row.source.lens)

    def lens_of(source: Source) -> str | None:
        seen = lenses.get(source.camera, set())
        return next(iter(seen)) if len(seen) == 1 else source.lens

    return [(row.source.camera, lens_of(row.source)) for row in rows]


def _name(pairs: Sequence[tuple[str, str | None]]) -> dict[tuple[str, str | None], str]:
    """Return the names of cameras: the body's, with the lens where the body had several."""
    several = Counter(body for body, _ in set(pairs))
    return {
        (body, lens): body if several[body] == 1 else f"{body} with lens {lens or 'unknown'}"
        for body, lens in pairs
    }


def _index(names: Sequence[str]) -> tuple[tuple[str, ...], Index]:
    levels, labels = np.unique(np.array(names), return_inverse=True)
    return tuple(map(str, levels)), labels.astype(np.intp)
