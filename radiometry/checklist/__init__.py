"""Checklist at the end of the luminance procedure, and the items that the record can tick."""

from radiometry.checklist.facts import Facts, FrameFacts, IsoFacts, VersionFacts
from radiometry.checklist.items import ITEMS, Item
from radiometry.checklist.rules import Finding, find

__all__ = ["ITEMS", "Facts", "Finding", "FrameFacts", "IsoFacts", "Item", "VersionFacts", "find"]
