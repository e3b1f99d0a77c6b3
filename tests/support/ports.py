"""Ports for processes that are stopped and started again on the same one."""

import random
import socket

# below those that the system gives to connections: another process's connection would hold the port meanwhile
_PORTS = range(20_000, 32_000)


def pick_port() -> int:
    """Return a port of the loopback that is free now and that no connection is given."""
    while True:
        port = random.SystemRandom().choice(_PORTS)
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        return port
