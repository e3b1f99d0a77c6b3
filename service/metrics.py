"""The text that Prometheus reads."""

from collections.abc import Iterator, Mapping
from itertools import product
from typing import get_args

from service.schemas.frames import State as FrameState
from service.schemas.jobs import State as JobState
from store.blobs import Damage
from store.jobs import Dependency
from store.parts import Kind
from store.parts import State as PartState
from store.queries.resource_counts import ResourceCounts
from store.software import read_version


def render(counts: ResourceCounts, *, free_bytes: int) -> str:
    """Every state has its line, also where it counts none: a graph then falls to zero, not to nothing."""
    return "".join(f"{line}\n" for line in (*_lines(counts), *_of_this_process(free_bytes)))


def _of_this_process(free_bytes: int) -> Iterator[str]:
    yield from _head("stilb_info", "The version that serves.")
    yield f'stilb_info{{version="{read_version()}"}} 1'
    yield from _head("stilb_data_free_bytes", "Room left on the disk of the data folder.")
    yield f"stilb_data_free_bytes {free_bytes}"


def _lines(counts: ResourceCounts) -> Iterator[str]:
    yield from _by_state("stilb_jobs", "Jobs by state.", counts.jobs, get_args(JobState))
    yield from _head(
        "stilb_oldest_queued_job_age_seconds", "How long the job that waits longest has been due."
    )
    yield f"stilb_oldest_queued_job_age_seconds {counts.oldest_queued_s:.3f}"
    yield from _head("stilb_jobs_due_later", "Queued jobs whose time to be tried again has not come.")
    yield f"stilb_jobs_due_later {counts.due_later}"
    yield from _head("stilb_parts", "Processes by kind and by whether their work goes on.")
    for kind, state in product(get_args(Kind), get_args(PartState)):
        yield f'stilb_parts{{kind="{kind}",state="{state}"}} {counts.parts.get((kind, state), 0)}'
    yield from _head("stilb_jobs_failed", "Jobs that failed or were quarantined, by the code of their error.")
    for code, count in counts.failures.items():
        yield f'stilb_jobs_failed{{code="{code}"}} {count}'
    yield from _head("stilb_jobs_waiting_for", "Queued jobs whose last attempt found this not to serve.")
    yield from _by_dependency("stilb_jobs_waiting_for", counts.waiting_for)
    yield from _head("stilb_workers_without", "Workers that hold jobs back, as this does not serve.")
    yield from _by_dependency("stilb_workers_without", counts.workers_without)
    yield from _head("stilb_worker_sandbox", "Workers by the level of their decoders' sandbox.")
    for level, count in counts.sandboxes.items():
        yield f'stilb_worker_sandbox{{level="{level}"}} {count}'
    yield from _by_state("stilb_frames", "Frames by state.", counts.frames, get_args(FrameState))
    yield from _head("stilb_uploads", "Files that were ever received.")
    yield f"stilb_uploads {sum(counts.frames.values())}"
    yield from _head("stilb_refusals", "Refused frames by the code of their refusal.")
    for code, count in counts.refusals.items():
        yield f'stilb_refusals{{code="{code}"}} {count}'
    yield from _by_state(
        "stilb_damaged_files",
        "Stored files that are not what was uploaded; the same upload heals one.",
        counts.damaged_files,
        get_args(Damage),
    )
    yield from _head(
        "stilb_scrub_age_seconds", "How long ago the stored file was proven whose proof is the oldest."
    )
    yield f"stilb_scrub_age_seconds {counts.proof_age_s:.0f}"
    yield from _head("stilb_stored_bytes", "Size of the files of all frames.")
    yield f"stilb_stored_bytes {counts.stored_bytes}"
    yield from _head("stilb_largest_organisation", "The most that any one organisation uses of a quota.")
    for quota, used in counts.largest_organisation.items():
        yield f'stilb_largest_organisation{{quota="{quota}"}} {used}'
    yield from _head("stilb_versions_published", "Calibration versions in force at some time.")
    yield f"stilb_versions_published {counts.versions_published}"


def _head(name: str, meaning: str) -> Iterator[str]:
    yield f"# HELP {name} {meaning}"
    yield f"# TYPE {name} gauge"


def _by_dependency(name: str, counts: Mapping[str, int]) -> Iterator[str]:
    for dependency in Dependency:
        yield f'{name}{{dependency="{dependency}"}} {counts.get(dependency, 0)}'


def _by_state(name: str, meaning: str, counts: Mapping[str, int], states: tuple[str, ...]) -> Iterator[str]:
    yield from _head(name, meaning)
    for state in states:
        yield f'{name}{{state="{state}"}} {counts.get(state, 0)}'
