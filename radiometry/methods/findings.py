"""The registry of findings: those of every method, of the fleet, and those that no method owns."""

from collections.abc import Mapping
from types import MappingProxyType

from radiometry.findings import Finding, files, interface, shared
from radiometry.fleet import results as fleet
from radiometry.methods import METHODS
from radiometry.road import codes as road


def collect_findings(*declared: tuple[Finding, ...]) -> Mapping[str, Finding]:
    entries = [each for entries in declared for each in entries]
    found = {each.code: each for each in entries}
    if len(found) < len(entries):
        twice = sorted({each.code for each in entries if found[each.code] is not each})
        raise ValueError(f"declared twice: {', '.join(twice)}")
    return MappingProxyType(found)


FINDINGS = collect_findings(
    shared.FINDINGS,
    files.FINDINGS,
    interface.FINDINGS,
    fleet.FINDINGS,
    road.FINDINGS,
    *(spec.findings for spec in METHODS),
)
