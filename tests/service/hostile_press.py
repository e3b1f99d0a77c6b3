"""A press that obeys its order; `python -m tests.service.hostile_press` stands in for `service.press`."""

import json

from service.press import __main__ as press
from service.press import typesetter
from tests.worker.decode.probing import probe

ORDERS = {
    "probe": lambda order: json.dumps(probe(order["world"])).encode(),
    "typst": lambda _: typesetter.typeset({"template": "hostile", "created_at": "2026-01-01T00:00:00Z"}),
    "flood": lambda _: bytes(150 << 20),
}


def obey(order: bytes) -> bytes:
    read = json.loads(order)
    typesetter._TEMPLATES["hostile"] = read.get("typst", "").encode()
    return ORDERS[read["kind"]](read)


if __name__ == "__main__":
    press.render = obey
    press._CPU_S = 2
    press.main()
