"""Small frames from several clients at once, beside one client that sends them one after the other."""

import hashlib
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import stilb
from bench.report import judge, say
from bench.subject import CAMERA, Scale
from bench.timing import compare, take_turns
from bench.upload import KEY, Service, open_http

_CLIENTS = 8
_FRAME_BYTES = 20_000


def run(scale: Scale, service: Service) -> list[bool]:
    """Compare the time for a frame of each of eight clients with that of one."""
    say(f"\nframes of {_FRAME_BYTES / 1000:g} kB from {_CLIENTS} clients at once")
    each = max(2, scale.uploads)
    with stilb.Client(service.url, KEY) as client:
        camera = client.create_camera(CAMERA.body.make, CAMERA.body.model, CAMERA.body.serial).id
        campaigns = [client.create_campaign(camera).id for _ in range(_CLIENTS)]

    def send(campaign: str) -> None:
        with open_http(service) as http:
            for _ in range(each):
                content = os.urandom(_FRAME_BYTES)
                http.post(
                    f"/v1/campaigns/{campaign}/frames?role=field",
                    content=content,
                    headers={"X-Content-SHA256": hashlib.sha256(content).hexdigest()},
                ).raise_for_status()

    def send_all() -> None:
        with ThreadPoolExecutor(_CLIENTS) as threads:
            list(threads.map(send, campaigns))

    ways: dict[str, Callable[[], object]] = {"one": lambda: send(campaigns[0]), "all": send_all}
    began = time.perf_counter()
    seconds = take_turns(ways, rounds=scale.rounds, warm_up=1)
    frames = (scale.rounds + 1) * each * (_CLIENTS + 1)
    say(f"  {frames} frames in {time.perf_counter() - began:.1f} s")
    one = [_CLIENTS * spent for spent in seconds["one"]]
    return [judge("rate of eight clients, to one client's", compare(one, seconds["all"]), at_least=3.0)]
