"""Papers of a road: its report on two pages with the headings of EN 13201-4, and the card of a plan."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Final

from fastapi import Query, Request, Response

from radiometry.drawing.text import in_step, write_exposure, write_unit
from radiometry.road import drawing
from service.documents.issuing import send_pdf
from service.documents.rendered import write_order
from service.documents.sheets import Node, optional, percent, plain, stamp, table
from service.http import answers, lookup, operations
from service.http.context import UsesContext
from service.roads import routes, schemas, words
from store.queries.organisations import name_laboratory
from store.tables import Organisation, Road

_MOST_COLUMNS: Final = 18
_USES: Final = {"agrees": "used", "differs": "differs, not used", "not_seen": "not seen"}


def lay_out_report(result: Node, *, by: str, picture: str) -> Node:
    """Return everything that the template sets, from an evaluation as it is answered."""
    times = [stamp(each["taken_at"]) for each in result["frames"] if "taken_at" in each]
    return {
        "template": "road.typ",
        "number": f"R-{result['road_id'][-10:]}-{result['number']}",
        "created_at": result["created_at"],
        "stamp": stamp(result["created_at"]),
        "by": by,
        "result": result,
        "limits": ", ".join(map(words.write_limit, result["criteria"])),
        "times": sorted({min(times), max(times)}) if times else [],
        "instruments": _tabulate_instruments(result),
        "remarks": list(_list_remarks(result)),
        "results": _tabulate_results(result),
        "prospects": _tabulate_prospects(result["criteria"]),
        "svg": picture,
        "control": tabulate_control(result["control"]),
        "grids": list(_tabulate_grid(result)),
    }


def _tabulate_instruments(result: Node) -> Node:
    rows, stated = [], result["stated"]
    for version in sorted({each["calibration_id"] for each in result["frames"]}):
        first, *more = (each for each in result["frames"] if each["calibration_id"] == version)
        exposure = f"f/{plain(first['f_number'])}, {write_exposure(first['exposure_time_s'])}"
        setting = f"{1 + len(more)} frame{'s' * bool(more)}, {exposure}, ISO {plain(first['iso'])}"
        certificate = f"certificate {first['certificate']}" if "certificate" in first else version
        chain = f"K version {first['calibration_version']} ({first['calibration_state']}), {certificate}"
        rows.append([first["camera"], setting, chain])
    meters = {each["meter_id"]: each for each in stated.get("meters", ())}
    for meter_id in dict.fromkeys(each.get("meter_id") for each in stated.get("control", ())):
        meter = meters.get(meter_id, {"meter": "meter without name"})
        mine = [each["values"] for each in stated["control"] if each.get("meter_id") == meter_id]
        chain = "no certificate"
        if "u_rel" in meter:
            chain = f"certificate {meter.get('certificate', '')}, U = {percent(2 * meter['u_rel'])}"
        rows.append([meter["meter"], f"{len(mine)} points, {sum(map(len, mine))} readings", chain])
    return table(["instrument", "use", "traceable by"], rows, align="lll", widths=[2, 2, 2.4])


def _list_remarks(result: Node) -> Iterator[str]:
    for each in result["scales"]:
        factor = " ± ".join(in_step(each["factor"], each["factor_u"]))
        slope = " ± ".join(in_step(each["slope"], each["slope_u"]))
        yield (
            "Luminances became illuminances by the control points in one generalised least squares: "
            f"{each['surface']}, factor {factor}, expected 1.00 ± {each['expected_u']:.2f}; slope with the "
            f"angle {slope}."
        )
    patches = percent(result["model"]["patches_rel"])
    yield f"E from draws of the field, so that patches of pavement ({patches}) do not lower the minimum."
    for each in result["findings"]:
        yield f"{each['sentence']} {each['action']}".replace("`", "")
    yield "Glare f_TI and the luminance that a driver sees are not visible from above: not measured."


def _tabulate_results(result: Node) -> Node:
    judged = {each["figure"]: each for each in result["criteria"]}
    known = {each["figure"]: each for each in result["figures"]}
    rows = []
    for name in dict.fromkeys([*judged, *known]):
        value = u = limit = likely = words.NONE
        verdict = "not required"
        if each := known.get(name):
            value, u = in_step(each["value"], each["expanded_uncertainty"])
            u = f"± {u} ({percent(each['expanded_uncertainty'] / each['value'])})"
            value += "" if each["unit"] == "1" else f" {write_unit(each['unit'])}"
        if rule := judged.get(name):
            limit, verdict = words.write_limit(rule, short=True), words.VERDICTS[rule["verdict"]]
            likely = words.write_probability(rule.get("probability"))
        rows.append([" ".join(words.FIGURES[name][:2]), value, u, limit, likely, verdict])
    budget = ", ".join(f"{each['source']} {percent(each['u_rel'])}" for each in result["budget"])
    used = sum(each["state"] == "agrees" for each in result["control"])
    return table(
        ["quantity", "measured", "U (95 %)", "required", "probability", "verdict"],
        rows,
        align="lrrrrl",
        widths=[2.2, 1.3, 1.7, 1, 1, 1.4],
        caption=f"Budget of E_av, standard uncertainties: {budget}. From {used} control points.",
    )


def _tabulate_prospects(criteria: Sequence[Node]) -> Node:
    """Return what would decide what is not decided, should the values stay."""
    rows = [
        [words.FIGURES[rule["figure"]][1], *words.write_prospect(rule, each)]
        for rule in criteria
        for each in rule.get("prospects", ())
    ]
    head = ["what would decide it", "control points", "U (95 %)", "then"]
    return table(head, rows, align="llrl", widths=[2, 2, 1, 1.4])


def tabulate_control(control: Sequence[Node]) -> Node:
    """Return each control point against the map that is made without it."""
    rows = [
        [
            each["name"],
            f"{each['x_m']:.1f}",
            f"{each['y_m']:.1f}",
            f"{each['value']:.3g}",
            optional(each, "without_it", "{:.3g}".format),
            optional(each, "difference_rel", lambda share: f"{100 * share:+.1f} %"),
            _USES.get(each["state"]) or f"left out: {each.get('reason', '')}",
        ]
        for each in control
    ]
    head = ["point", "along [m]", "from kerb [m]", "meter", "map without it", "difference", "use"]
    return table(head, rows, align="lrrrrrl", widths=[1, 1, 1, 1, 1.2, 1, 1.6])


def _tabulate_grid(result: Node) -> Iterator[Node]:
    """Yield a table for each lane, walkway or area; the minimum in brackets."""
    for part in dict.fromkeys(each["part"] for each in result["points"]):
        mine = [each for each in result["points"] if each["part"] == part]
        xs, ys = (sorted({each[name] for each in mine}) for name in ("x_m", "y_m"))
        cells = dict.fromkeys(((y, x) for y in ys for x in xs), "")
        for each in mine:
            lux = f"{each['illuminance_lx']:.1f}"
            cells[each["y_m"], each["x_m"]] = f"[{lux}]" if each["name"] == result["minimum"] else lux
        cut = xs[:_MOST_COLUMNS]
        rows = [[f"{part}: {y:.2f}", *(cells[y, x] for x in cut)] for y in ys]
        head = ["y \\ x", *(f"{x:.2f}" for x in cut)]
        yield table(head, rows, align="l" + "r" * len(cut), widths=[1.6] + [1.0] * len(cut))


def lay_out_card(road: Node, plan: Node, *, by: str) -> Node:
    """Return both sides of the card, from a road and its plan as they are answered."""
    spare = [each for each in plan["points"] if each.get("is_spare")]
    points = [each for each in plan["points"] if not each.get("is_spare")]
    start = road["site"]["rows"][0].get("first_x_m", 0.0)
    across: dict[str, list[str]] = {}
    for each in points:
        across.setdefault(f"{each['y_m']:.1f} m", []).append(each["name"])
    read = [(each["name"], f"{each['x_m'] - start:.1f} m", f"{each['y_m']:.1f} m") for each in points]
    best = len(plan["times"]) // 2
    return {
        "template": "road.typ",
        "number": road["id"],
        "created_at": road["created_at"],
        "by": by,
        "road": road,
        "points": points,
        "across": " · ".join(f"{', '.join(names)} at {place}" for place, names in across.items()),
        "times": [[write_exposure(each["time_s"]), n == best] for n, each in enumerate(plan["times"])],
        "never": ", ".join(
            f"{write_exposure(each['time_s'])} ({percent(each['error_rel'])})" for each in plan["avoid"]
        ),
        "rows": [[*each, "", "", ""] for each in [*read, *((each["name"], "", "") for each in spare)]],
    }


router = operations.Router(prefix="/v1/roads/{road_id}", tags=["roads"])


@router.get("/results/{number}/report.pdf", **answers.sends_stored_file("application/pdf"))
async def get_road_report(row: routes.UsesResult, request: Request, context: UsesContext) -> Response:
    """The evaluation on two pages of A4 (PDF/A) with the headings of EN 13201-4."""

    def order() -> tuple[str, bytes]:
        result = routes.answer_result(context, row).dump()
        with context.database.reading() as session:
            by = name_laboratory(session.get_one(Organisation, row.organisation_id))
        png = b"".join(context.files.open(row.map_png_sha256)[1]) if row.map_png_sha256 else b""
        sheets = lay_out_report(result, by=by, picture=drawing.draw_map(result, png) if png else "")
        return sheets["number"], write_order("sheets", sheets=sheets)

    return await send_pdf(request, context, order)


@router.get("/plan.pdf", **answers.sends_stored_file("application/pdf"))
async def get_road_plan_card(
    road: lookup.Own[Road],
    wanted: Annotated[schemas.WantedPlan, Query()],
    request: Request,
    context: UsesContext,
) -> Response:
    """The plan as a card for the person on the road: two sides of A5, where and what to read."""

    def order() -> tuple[str, bytes]:
        with context.database.reading() as session:
            by = name_laboratory(session.get_one(Organisation, road.organisation_id))
            answer = routes.answer_road(session, road).dump()
        plan = routes.answer_plan(context, road, wanted).dump()
        return road.id, write_order("sheets", sheets=lay_out_card(answer, plan, by=by))

    return await send_pdf(request, context, order)
