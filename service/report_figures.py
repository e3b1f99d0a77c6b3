"""Profile and histogram of a measurement's map, as its report prints them."""

from dataclasses import replace

from radiometry.drawing.sheet import draw_sheet
from service.cells import find_row_line
from service.map_tools import Area, OpenMap
from service.profiles import answer_histogram, answer_profile
from service.schemas.map_tools import BinsOfMap, LineOfMap
from service.web.map_plots import plot_histogram, plot_profile

_POINTS, _BINS = 300, 40
_PANEL_PX = (360, 170)


def draw_readings(found: OpenMap) -> tuple[str, str]:
    """Draw a profile and a histogram as SVG, with a caption.

    The profile is along the row of cells with the lowest U_l, without cells along the longer side of the
    region through its middle.
    """
    ends, along = _choose_line(found)
    line = " ".join(f"{x:.2f},{y:.2f}" for x, y in ends)
    profile = answer_profile(found, LineOfMap(line=line, most=_POINTS))
    area: Area = "grid" if found.row.parameters.get("grid") else "region"
    histogram = answer_histogram(found, BinsOfMap(area=area, bins=_BINS))
    figures = [
        (f"Profile {along}", plot_profile(profile, logarithmic=False)),
        (f"Histogram of the {'cells' if area == 'grid' else 'region'}", plot_histogram(histogram)),
    ]
    svg = draw_sheet(
        [[(title, replace(figure, note="")) for title, figure in figures]],
        "Profile and histogram",
        panel_px=_PANEL_PX,
    )
    notes = [figures[0][1].note, f"From (x, y) = {line.replace(' ', ' to ')} px.", figures[1][1].note]
    return svg, " ".join([*notes, "Pixels of the map, seen from above."])


def _choose_line(found: OpenMap) -> tuple[list[tuple[float, float]], str]:
    surface = found.row.result["surface"]
    if surface is not None:
        lines = surface["u_l"]
        known = [line for line, each in enumerate(lines) if each]
        chosen = min(known, key=lambda line: lines[line]["value"]) if known else len(lines) // 2
        ends = [(float(x), float(y)) for x, y in find_row_line(found.row, chosen)]
        return ends, f"along row {chosen + 1} of the cells" + (", lowest U_l" if known else "")
    xs, ys = zip(*found.row.parameters["polygon"], strict=True)
    middle = [(min(each) + max(each)) / 2.0 for each in (xs, ys)]
    if max(xs) - min(xs) >= max(ys) - min(ys):
        return [(min(xs), middle[1]), (max(xs), middle[1])], "through the region"
    return [(middle[0], min(ys)), (middle[0], max(ys))], "through the region"
