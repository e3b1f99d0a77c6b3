"""``python -m worker.decode``: the process that reads hostile bytes."""

from worker.decode.child import main

main()
