"""Findings of roads."""

from radiometry.findings import declare, error

SITE_INVALID = error(
    "The site of a road cannot be used.",
    "Give a row of luminaires, and lanes, walkways or areas with their sizes in metres.",
)
ROAD_RULE_UNKNOWN = error(
    "A requirement names a rule or a class that is not in the library.",
    "Choose one of `GET /v1/road-rules`, or state your own `criteria`.",
)
PLACE_UNDETERMINED = error(
    "The points that are marked in a frame do not place it on the road.",
    "Mark four or more points of the road that surround the field, no three on one line.",
)

FINDINGS = declare(globals())
