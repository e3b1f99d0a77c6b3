"""Frozen dataclasses, and fields that carry a sentence on what they mean."""

from dataclasses import MISSING, Field, dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Final, dataclass_transform

LATER: Final = {"later": True}  # left out where it is None, so that hashes of older contents stay the same


def about(
    sentence: str,
    *,
    default: Any = MISSING,  # noqa: ANN401  of its type
    default_factory: Any = MISSING,  # noqa: ANN401
    within: tuple[float, float] | None = None,
) -> Any:  # noqa: ANN401
    """Return a field with what it means, as OpenAPI and the documents show it, and the limits of a form."""
    stated = {"description": sentence} | ({"within": within} if within else {})
    return field(default=default, default_factory=default_factory, metadata=stated)


def later(sentence: str = "") -> Any:  # noqa: ANN401  a field takes its annotated type
    """Return a field that older contents lack: None by default, and left out where it is None."""
    return field(default=None, metadata=LATER | ({"description": sentence} if sentence else {}))


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field, about))
class Record:
    """Base of frozen dataclasses; fields are given by name, unless a class says `kw_only=False`."""

    if TYPE_CHECKING:
        __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def __init_subclass__(cls, *, kw_only: bool = True) -> None:
        super().__init_subclass__()
        dataclass(frozen=True, kw_only=kw_only)(cls)
