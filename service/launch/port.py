"""The port is tried before anything starts: a clear line now instead of a child that dies again and again."""

import errno
import socket

from service.launch.refusal import Refusal


def free_port(host: str, port: int) -> int:
    """Return the port, or any free one for 0."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            # As the server does: connections of an earlier run that still fade away are no obstacle.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            return int(probe.getsockname()[1])
    except OSError as error:
        reason = "is in use" if error.errno == errno.EADDRINUSE else f"cannot be served: {error.strerror}"
        raise Refusal(f"port {port} on {host} {reason}; set another with STILB_PORT") from error
