"""``python -m worker.decode``: the process from which those are forked that read hostile bytes."""

from worker.decode.zygote import main

main()
