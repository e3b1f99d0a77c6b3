"""Metadata of the fields of dataclasses that are stored or answered."""

from collections.abc import Mapping
from typing import Any, Final

LATER: Final = {"later": True}  # left out where it is None, so that hashes of older contents stay the same


def meaning(sentence: str) -> dict[str, Any]:
    """Return what a field means, as OpenAPI and the documents show it."""
    return {"description": sentence}


def about(description: str, *, later: bool = False) -> Mapping[str, Any]:
    """Return the metadata of a field with what it means, which documents and OpenAPI show."""
    return {"description": description, **(LATER if later else {})}
