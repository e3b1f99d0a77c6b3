"""Fields of dataclasses that are stored or answered, and their sentences."""

import dataclasses
from typing import Any, Final

LATER: Final = {"later": True}  # left out where it is None, so that hashes of older contents stay the same


def about(sentence: str) -> dict[str, Any]:
    """Return the metadata of a field: what it means, as OpenAPI and the documents show it."""
    return {"description": sentence}


def later(sentence: str = "") -> Any:  # noqa: ANN401  a field of a dataclass takes its annotated type
    """Return a field that older contents lack: None by default, and left out where it is None."""
    return dataclasses.field(default=None, metadata=LATER | (about(sentence) if sentence else {}))
