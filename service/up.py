"""`make up`: the whole service in the foreground, as one tree of processes (`service.up [part ...]`)."""

import sys
from dataclasses import replace

from service.launch import folder, run, supervisor
from service.launch.supervisor import Part

WORKER = [sys.executable, "-m", "worker", "-Q", "looks,frames,fits,maps"]
# What a part needs to end once its own grace is over.
_TO_END_S = 5.0

ROSTER = run.Roster(
    before=[[sys.executable, "-m", "store.migrate"]],
    parts=[
        Part(name="service", command=[sys.executable, "-m", "service"], knows_key=True, has_pulse=True),
        Part(name="worker", command=WORKER, has_pulse=True),
    ],
)


def main() -> int:
    supervisor.follow_make()
    settings = run.read_apart()
    roster = give_grace(ROSTER, settings.stop_grace_s)
    if names := set(sys.argv[1:]):
        parts = [part for part in roster.parts if part.name in names]
        if len(parts) < len(names) or settings.is_embedded:
            known = ", ".join(part.name for part in roster.parts)
            folder.report(f"some parts of {known} alone need STILB_DATABASE_URL, where the others are")
            return folder.Exit.CANNOT_START
        roster = replace(roster, parts=parts, serves=any(part.knows_key for part in parts))
    if settings.is_current:
        # a process that would load most of stilb, to find that nothing is to be done
        roster = replace(roster, before=[])
    return run.launch(settings, roster)


def give_grace(roster: run.Roster, grace_s: float) -> run.Roster:
    parts = [replace(part, stop_within_s=grace_s + _TO_END_S) for part in roster.parts]
    return replace(roster, parts=parts)


if __name__ == "__main__":
    sys.exit(main())
