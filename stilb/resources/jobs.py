"""Jobs: what the service computes, and waiting for it."""

import time
from collections.abc import Iterator
from typing import Any

from stilb.connection import Connection
from stilb.problem import JobFailed
from stilb.records import Job
from stilb.transport import Call, address

_WAIT_S = 30  # one long poll; the service allows 60
_SHORTEST_POLL_S = 0.2  # should an answer come at once all the same


class Jobs(Connection):
    """Jobs, and what comes of them."""

    def job(self, job_id: str) -> Job:
        return Job.of(self._get(address("jobs", job_id)))

    def jobs(
        self, *, state: str | None = None, kind: str | None = None, subject: str | None = None
    ) -> Iterator[Job]:
        """The jobs of your organisation, newest first.

        ``subject``: the frame or campaign that they work on, or the version or measurement that they made.
        """
        query = {"state": state, "kind": kind, "subject": subject}
        return map(Job.of, self._transport.items(address("jobs"), query))

    def retry_job(self, job: Job | str) -> Job:
        """Try a job again that failed or was quarantined; the job as it waits then."""
        job_id = job if isinstance(job, str) else job.id
        return Job.of(self._post(f"{address('jobs', job_id)}/retry", {}))

    def retry_jobs(
        self, state: str, *, kind: str | None = None, code: str | None = None, campaign_id: str | None = None
    ) -> int:
        """Try all jobs again that are ``failed``, or ``quarantined``, and fit the rest; how many they are."""
        chosen = {"state": state, "kind": kind, "code": code, "campaign_id": campaign_id}
        body = {name: value for name, value in chosen.items() if value is not None}
        return int(self._post(address("jobs", "retry"), body)["retried"])

    def job_events(self, job_id: str) -> Iterator[dict[str, Any]]:
        """Yield ``id``, ``state``, ``progress`` and ``attempt`` of a job as they change, until it ends."""
        for _, data in self._transport.events(f"{address('jobs', job_id)}/events"):
            yield data
            if data["state"] not in {"queued", "running"}:
                return

    def job_causes(self) -> list[tuple[int, Job]]:
        """Return for each cause of failures that were not dismissed how many jobs have it, and the newest."""
        items = self._get(address("jobs", "causes"))["items"]
        return [(each["count"], Job.of(each["newest"])) for each in items]

    def dismiss_jobs(
        self,
        state: str,
        *,
        kind: str | None = None,
        code: str | None = None,
        campaign_id: str | None = None,
        dismissed: bool = True,
    ) -> int:
        """Dismiss all jobs that are ``failed``, or ``quarantined``, and fit the rest; how many they are."""
        chosen = {"state": state, "kind": kind, "code": code, "campaign_id": campaign_id}
        body = {name: value for name, value in chosen.items() if value is not None}
        return int(self._post(address("jobs", "dismiss"), body | {"dismissed": dismissed})["dismissed"])

    def wait(self, job: Job | str, *, timeout_s: float | None = None) -> Job:
        """Wait until a job has succeeded; ``JobFailed`` when it will not, ``TimeoutError`` when it lasts."""
        job_id = job if isinstance(job, str) else job.id
        end = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            asked_at = time.monotonic()
            left_s = _WAIT_S if end is None else max(0, min(_WAIT_S, int(end - asked_at)))
            call = Call(
                method="GET",
                path=address("jobs", job_id),
                headers={"Prefer": f"wait={left_s}"},
                answer_within_s=left_s + self._timeout_s,
            )
            found = Job.of(self._transport.json(call))
            if found.state == "succeeded":
                return found
            if found.state not in {"queued", "running"}:
                raise JobFailed(found)
            if end is not None and time.monotonic() >= end:
                raise TimeoutError(f"job {job_id} is still {found.state} after {timeout_s:g} s")
            time.sleep(max(0.0, _SHORTEST_POLL_S - (time.monotonic() - asked_at)))
