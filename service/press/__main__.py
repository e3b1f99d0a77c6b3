"""A process that renders one order and ends: what Typst and the figures keep in memory ends with it.

It imports no web and no database. The order comes in as JSON, the file goes out. Nothing is read from the
machine: no fonts but those that Typst brings along, no packages, no clock.
"""

import os
import sys

from service.press.rendering import render


def main() -> None:
    os.nice(10)  # a look-up goes first
    sys.stdout.buffer.write(render(sys.stdin.buffer.read()))


if __name__ == "__main__":
    main()
