"""OpenCV, loaded at its first use: it is large, and most processes never use it."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import cv2 as cv2  # noqa: PLC0414  exported
else:

    class _OpenCV:
        def __getattr__(self, name: str) -> Any:  # noqa: ANN401
            return getattr(import_module("cv2"), name)

    cv2 = _OpenCV()
