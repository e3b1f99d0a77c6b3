"""The press at the priority of the tests, not below it, which also obeys orders that no press takes."""

import json
import os
import sys

from service.documents import rendering
from tests.worker.decode.probing import probe

render = rendering.render
COMMAND = [sys.executable, "-s", "-P", "-m", "tests.support.press"]
ORDERS = {
    "probe": lambda order: json.dumps(probe(order["world"])).encode(),
    "typst": lambda _: rendering.typeset({"template": "hostile", "created_at": "2026-01-01T00:00:00Z"}),
    "flood": lambda _: bytes(150 << 20),
}


def obey(order: bytes) -> bytes:
    read = json.loads(order)
    rendering._TEMPLATES["hostile"] = read.get("typst", "").encode()
    return ORDERS[read["kind"]](read) if read["kind"] in ORDERS else render(order)


if __name__ == "__main__":
    os.nice = lambda _: 0
    rendering.render = obey
    rendering._CPU_S = 4
    rendering.main()
