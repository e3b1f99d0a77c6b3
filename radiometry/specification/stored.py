"""Stored results: fields that earlier versions of a dataclass did not have."""

from typing import Final

LATER: Final = {"later": True}
"""Metadata of a field that is left out where it is None, so that hashes of older contents stay the same."""
