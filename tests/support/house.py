"""The service and the worker in the test's own process: HTTP without a socket, jobs when the test says so."""

import atexit
from contextlib import ExitStack, contextmanager
from pathlib import Path
from unittest.mock import patch

from fastapi import FastAPI
from sqlalchemy import select
from starlette.testclient import TestClient

from service.documents.rendering import render
from service.http.app import build_app
from service.http.auth import SCOPES
from service.http.context import Context
from service.http.processes import Traffic
from service.http.signatures import Sessions
from service.jobs.watch import JobWatch
from service.system.health import Health
from store.blobs import LocalBlobs
from store.database import Database
from store.queries.organisations import ensure_operator
from store.settings import Settings
from store.tables import Job, utc_now
from tests.support.frames import write_frame
from worker.context import Context as WorkerContext
from worker.decode.pool import DecoderPool
from worker.runner import run

KEY = "stilb_test_key"
CAMERA = {"make": "DJI", "model": "FC6520", "serial": "0K1XE8"}
PUBLICATION = {"valid_from": "2026-05-01T00:00:00Z", "reason": "first"}


# What takes long to make and holds nothing of a house. An application has its world in its context alone: the
# next house takes over what the last one left.
_idle_apps: list[FastAPI] = []
DECODERS = DecoderPool()
atexit.register(DECODERS.close)


class House:
    def __init__(self, database: Database, folder: Path):
        self.database = database
        self.folder = folder
        self.settings = Settings(data=folder, allowed_hosts="testserver")
        self.blobs = LocalBlobs(folder / "blobs")
        self._stack = ExitStack()

    def __enter__(self):
        with self.database.writing("test") as session:
            ensure_operator(session, KEY, list(SCOPES))
        context = Context(
            settings=self.settings,
            database=self.database,
            blobs=self.blobs,
            watch=JobWatch(self.database),
            sessions=Sessions(b"a secret of the tests, 32 bytes long"),
            traffic=Traffic(),
            health=Health(self.database, self.blobs),
        )
        context.traffic.metrics.totals_every_s = 0.0
        # a process for each picture takes longer than the picture
        self._stack.enter_context(
            patch("service.documents.rendered.render_apart", lambda order, **_: render(order))
        )
        self.app = _idle_apps.pop() if _idle_apps else build_app(context)
        self.app.state.context = context
        self._stack.callback(_idle_apps.append, self.app)
        self.http = self._stack.enter_context(
            TestClient(self.app, headers={"Authorization": f"Bearer {KEY}"}, raise_server_exceptions=True)
        )
        self.worker = WorkerContext(
            settings=self.settings, database=self.database, blobs=self.blobs, decoders=DECODERS
        )
        return self

    def __exit__(self, *_):
        self._stack.close()

    def with_key(self, secret: str) -> TestClient:
        """Another client of the same service."""
        return TestClient(
            self.app, headers={"Authorization": f"Bearer {secret}"}, raise_server_exceptions=False
        )

    def with_scopes(self, *scopes: str) -> TestClient:
        """A client with a key of its own, which may no more than this."""
        return self.with_key(self.post("/v1/keys", {"name": "scoped", "scopes": scopes})["secret"])

    def ask(self, method: str, path: str, *, status: int, **request):
        answer = self.http.request(method, path, **request)
        assert answer.status_code == status, answer.text
        return answer.json()

    def post(self, path: str, body, *, status: int = 201, **headers):
        return self.ask("POST", path, status=status, json=body, headers=headers)

    def put(self, path: str, body, *, status: int = 200):
        return self.ask("PUT", path, status=status, json=body)

    def patch(self, path: str, body, *, status: int = 200):
        return self.ask("PATCH", path, status=status, json=body)

    def get(self, path: str, *, status: int = 200, **params):
        return self.ask("GET", path, status=status, params=params or None)

    def stage(self, recipe, **arguments):
        """Do what a recipe does; with `staged`, where this was done before, take a copy of what it made."""
        return recipe(self, **arguments)

    def work(self) -> int:
        """Run every job that is due; how many there were."""
        done = 0
        while (job_id := self.next_job()) is not None:
            done += run(self.worker, job_id)["state"] != "dropped"
        return done

    def finish(self, path: str, body) -> dict:
        """Ask for a job, run what is due, and return the job's result."""
        job = self.post(path, body, status=202)
        self.work()
        job = self.get(f"/v1/jobs/{job['id']}")
        assert job["state"] == "succeeded", job
        return job["result"]

    def fit(self, campaign: dict, **params) -> dict:
        made = self.finish(f"/v1/campaigns/{campaign['id']}/calibrations", params)
        return self.get(f"/v1/calibrations/{made['calibration_id']}")

    def publish(self, version: dict, *, status: int = 200, **changes) -> dict:
        path = f"/v1/calibrations/{version['id']}/publish"
        return self.post(path, {**PUBLICATION, **changes}, status=status)

    def revoke(self, version: dict, reason: str = "wrong lamp") -> dict:
        return self.post(f"/v1/calibrations/{version['id']}/revoke", {"reason": reason}, status=200)

    def measure(self, **asked) -> dict:
        made = self.finish("/v1/measurements", asked)
        return self.get(f"/v1/measurements/{made['measurement_id']}")

    def next_job(self) -> str | None:
        """Return the job that has been due longest; None if none waits."""
        due = (Job.state == "queued") & (Job.due_at <= utc_now())
        with self.database.reading() as session:
            return session.scalar(select(Job.id).where(due).order_by(Job.due_at, Job.id).limit(1))

    def camera(self, **changes) -> dict:
        answer = self.http.post("/v1/cameras", json=CAMERA | changes)
        assert answer.status_code in {200, 201}, answer.text
        return answer.json()

    def campaign(self, **changes) -> dict:
        return self.post("/v1/campaigns", {"camera_id": self.camera()["id"], "method": "luminance"} | changes)

    def upload(self, campaign: dict, content: bytes, *, status: int = 201, **query):
        path = f"/v1/campaigns/{campaign['id']}/frames"
        return self.ask("POST", path, status=status, content=content, params=query)

    def frame_bytes(self, **changes) -> bytes:
        return write_frame(self.folder / "frame.dng", **changes).read_bytes()


@contextmanager
def furnished(template: Path, folder: Path):
    """Open a house on a copy of a migrated SQLite database in the folder."""
    path = folder / "stilb.sqlite"
    path.write_bytes(template.read_bytes())
    database = Database(f"sqlite:///{path}")
    try:
        with House(database, folder) as house:
            yield house
    finally:
        database.dispose()
