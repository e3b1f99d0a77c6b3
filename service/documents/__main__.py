"""A process that renders one order and ends: what Typst and the figures keep in memory ends with it.

It imports no web and no database. The order comes in as JSON, the file goes out. Before it looks at the order
the kernel shuts it in: nothing is read from the machine, no fonts but those that Typst brings along, no
packages, no clock.
"""

import os
import resource
import sys
from typing import Final

from service.documents.rendering import render, start_threads
from store.sandbox import Restrictions

_MEMORY_BYTES: Final = 2 << 30
_CPU_S: Final = 120


def main() -> None:
    if "--first" not in sys.argv:
        os.nice(10)  # a look-up goes first
    order = sys.stdin.buffer.read()
    try:
        _shut_in(require="--require" in sys.argv)
        sys.stdout.buffer.write(render(order))
    except Exception as error:  # noqa: BLE001  told to who waits: standard error leads nowhere
        sys.stdout.write(f"{type(error).__name__}: {error}")
        sys.exit(1)


def _shut_in(*, require: bool) -> None:
    if (lacks := Restrictions().shut_in(start_threads).lacks) and require:
        raise RuntimeError(f"STILB_DECODER_SANDBOX=require, and this kernel gives no {', no '.join(lacks)}.")
    # the first ends it by SIGXCPU, which says why
    resource.setrlimit(resource.RLIMIT_CPU, (_CPU_S, _CPU_S + 1))
    if sys.platform == "linux":
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))


if __name__ == "__main__":
    main()
