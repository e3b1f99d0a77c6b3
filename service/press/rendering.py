"""Orders into files. The service itself imports none of this: Typst would keep its memory."""

import json
from collections.abc import Callable
from typing import Final

from radiometry.methods import get_method
from service.press.orders import Order
from service.press.pages import lay_out
from service.press.typesetter import typeset

_RENDERERS: Final[dict[str, Callable[[Order], bytes]]] = {
    "certificate": lambda order: typeset(lay_out(order["certificate"], order["preview"])),
    "sheets": lambda order: typeset(order["sheets"]),
    "plot": lambda order: get_method(order["method"]).draw(order["result"]).encode(),
}


def render(order: bytes) -> bytes:
    """Return the file that was ordered."""
    read = json.loads(order)
    return _RENDERERS[read["kind"]](read)
