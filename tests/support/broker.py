"""A Valkey of a test's own."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import redis

from service.launch.valkey import valkey_binary, valkey_command
from tests.support.deployments import spawn
from tests.support.processes import wait_until


@contextmanager
def own_broker(folder: Path) -> Iterator[tuple[str, redis.Redis, subprocess.Popen]]:
    """Its address, a connection to it, and its process, which ends with the block."""
    sock = folder / "valkey.sock"
    command = valkey_command(valkey_binary(), folder, sock)
    with spawn(command, dict(os.environ), stdout=subprocess.DEVNULL) as process:
        try:
            with redis.Redis(unix_socket_path=str(sock)) as broker:
                wait_until(lambda: sock.exists() and broker.ping())
                yield f"redis+socket://{sock}", broker, process
        finally:
            process.kill()
