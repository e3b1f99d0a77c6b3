"""The method that commands and client use where none is named."""

from typing import Final

DEFAULT_METHOD: Final = "luminance"
