"""Which determinations are of the same camera, and whether bodies and lenses can be told apart."""

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
    """The factors of an analysis, each with its label per determination and its levels' names.

    ``units`` : (body, lens) positions in the levels of each factor, one row a camera that existed; of the one
        factor "camera" the levels themselves
    ``confounded`` : lenses are known and differ, and no swaps link them
    """

    names: tuple[FactorName, ...]
    labels: tuple[Index, ...]
    levels: tuple[tuple[str, ...], ...]
    units: tuple[tuple[int, ...], ...]
    unit_names: tuple[str, ...]
    confounded: bool


def group_cameras(rows: Sequence[Determination]) -> Grouping:
    """Take a body with a lens for one camera; tell the two apart where swaps link all of them.

    A body that was calibrated with two lenses is two cameras: taken for one, the difference of its lenses
    would pass for a lack of repeatability. Where a body's lens is named once and at other times not, it is
    taken for the one that is named.
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
    """Name a camera by its body, and by its lens as well where the body had several."""
    several = Counter(body for body, _ in set(pairs))
    return {
        (body, lens): body if several[body] == 1 else f"{body} with lens {lens or 'unknown'}"
        for body, lens in pairs
    }


def _index(names: Sequence[str]) -> tuple[tuple[str, ...], Index]:
    levels, labels = np.unique(np.array(names), return_inverse=True)
    return tuple(map(str, levels)), labels.astype(np.intp)
