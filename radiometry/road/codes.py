"""Findings of roads."""

from radiometry.findings import declare, error, flag_measurement

SITE_INVALID = error(
    "The site of a road cannot be used.",
    "Give a row of luminaires, and lanes, walkways or areas with their sizes in metres.",
)
ROAD_RULE_UNKNOWN = error(
    "A requirement names a rule or a class that is not in the library.",
    "Choose one of `GET /v1/road-rules`, or state your own `criteria`.",
)
PLACE_UNDETERMINED = error(
    "Neither marked points nor its own position place a frame on the road.",
    "Mark four or more points of the road that surround the field, no three on one line.",
)
ROAD_WET = error(
    "A wet road reflects like a mirror: its luminance says nothing of the illuminance.",
    "Measure when it is dry.",
)
ROAD_NOT_SEEN = error(
    "Too few points of the grid are seen to judge the road.",
    "Take frames that cover the field, and place each by marked points.",
)
ROAD_NOT_DRY = flag_measurement(
    "The road is not stated to be dry.", "Measure it when it is dry, and state `surface`."
)
ROAD_LAMPS_DIFFER = flag_measurement(
    "K was measured under another kind of lamp than the road's: the control points alone correct it.",
    "Read control points under each kind of lamp, or calibrate under the road's.",
)
ROAD_LAMPS_UNREAD = flag_measurement(
    "Two kinds of lamps light the road, and under one of them there is no control point.",
    "Read control points under both.",
)
ROAD_SCALE_UNLIKELY = flag_measurement(
    "The control points ask for a factor that the budget of K and the pavement does not explain.",
    "Check lamp, f-number and meter, and whether the road was moist or its luminance factor is another.",
)
ROAD_SCATTERS = flag_measurement(
    "The control points differ from the map by more than their uncertainties.",
    "Check for moisture, pavements that are not separated, shadows, and places that were read wrong.",
)
ROAD_POINT_DIFFERS = flag_measurement(
    "A control point differs from the map that is made without it; it is not used.",
    "Correct its reading or place, or leave it out with the reason.",
)
ROAD_POINTS_FEW = flag_measurement(
    "Fewer than four control points are used.", "Read eight, half of them below and half between the lamps."
)
ROAD_POINTS_ONE_SIDED = flag_measurement(
    "All control points lie on one side of the field.",
    "Read points on both sides of its middle, along and across.",
)
ROAD_METER_UNCERTIFIED = flag_measurement(
    "A meter at the control points or behind K has no certificate.",
    "Register it with its certificate; until then use ratios of illuminances.",
)
ROAD_VIEW_STEEP = flag_measurement(
    "The road is seen from more than 20 degrees off the vertical, where pavement is not matt.",
    "Fly higher or straight above the field.",
)
ROAD_FALLOFF_ASSUMED = flag_measurement(
    "The falloff of the lens is not corrected: a usual one is assumed, with its uncertainty.",
    "Calibrate vignetting with flat fields and fit K with it, or fly higher, so that the field is smaller.",
)
ROAD_PLACE_UNSURE = flag_measurement(
    "The places of the points are less certain than a third of their distance.",
    "Mark four or more points of the road around the field in every frame, and measure their places better.",
)
ROAD_POINTS_HIDDEN = flag_measurement(
    "More than a tenth of the points are hidden: their light is predicted from their neighbours.",
    "Repeat the flight without cars, or read control points there.",
)
ROAD_RULE_UNCONFIRMED = flag_measurement(
    "The figures of the rule were not confirmed against its text.",
    "Compare them with your copy of the standard, and state who `confirmed` them.",
)

FINDINGS = declare(globals())
