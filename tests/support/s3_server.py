"""``python -m tests.support.s3_server``: an S3 store with one bucket, alone in its process; says where it is.

In a process of its own, since the one within the test process is emptied for everybody by whoever wants it
empty.
"""

import os
import signal

import httpx
from moto.server import ThreadedMotoServer


def main() -> None:
    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    httpx.put(f"http://{host}:{port}/{os.environ['BUCKET']}", timeout=120.0).raise_for_status()
    print(f"http://{host}:{port}", flush=True)  # noqa: T201 (what the starter waits for)
    signal.pause()


if __name__ == "__main__":
    main()
