"""``python -m stilb`` is the `stilb` command."""

import sys

from stilb.commands.app import main

if __name__ == "__main__":
    sys.exit(main())
