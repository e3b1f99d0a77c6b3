"""Memory of one campaign's reviews: what one of them decoded, the next takes over where it is as it was."""

from typing import Any


class _Turns(dict[Any, Any]):
    """Values of this turn; those of the turn before are found until the next."""

    before: dict[Any, Any]

    def __init__(self) -> None:
        super().__init__()
        self.before = {}

    def __missing__(self, key: object) -> Any:  # noqa: ANN401  whatever is kept
        if (value := self.before.get(key)) is not None:
            self[key] = value
        return value

    def turn(self) -> None:
        self.before = dict(self)
        self.clear()


class Memory:
    """Decoded parts of a campaign.

    Attributes
    ----------
    frames : by the frame's id
        The digest of its row as it was read, and its columns: another row is decoded again.
    extractions : by id
        An extraction is made once and never changed.
    regions : by id
        Polygon of a region, which is never changed either.
    """

    def __init__(self) -> None:
        self.frames, self.extractions, self.regions = _Turns(), _Turns(), _Turns()

    def turn(self) -> None:
        """Begin a review: what the one before did not use is forgotten."""
        for each in (self.frames, self.extractions, self.regions):
            each.turn()
