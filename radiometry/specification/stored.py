"""Metadata of the fields of dataclasses that are stored or answered."""

from typing import Any, Final

LATER: Final = {"later": True}  # left out where it is None, so that hashes of older contents stay the same


def meaning(sentence: str) -> dict[str, Any]:
    """Return what a field means, as OpenAPI and the documents show it."""
    return {"description": sentence}
