"""Plan of a flight."""

from radiometry.road import codes
from radiometry.road.results import Plan
from radiometry.road.site import Road


def plan_points(road: Road, *, e_av_u_rel: float, u_0_u_rel: float) -> Plan:
    """Plan the control points that reach wanted expanded uncertainties."""
    raise codes.SITE_INVALID.refuse(f"Not yet: {road} {e_av_u_rel} {u_0_u_rel}")
