"""Papers of a road: its report on two pages with the headings of EN 13201-4, and the card of a plan."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Final

from fastapi import Query, Request, Response

from radiometry.drawing.text import in_step, write_exposure, write_unit
from service.documents.rendered import Order, order_sheets
from service.documents.routes import send_pdf
from service.documents.sheets import Node, facts, flow, optional, percent, plain, section, stamp, table
from service.http import answers, auth, lookup, operations
from service.http.context import UsesContext
from service.roads import drawing, routes, schemas, words
from store.queries.organisations import name_laboratory
from store.tables import Organisation, Road

_DECISIONS: Final = {
    "guarded": "Guarded acceptance, at most 5 % false acceptance (JCGM 106)",
    "simple": "Simple acceptance: the uncertainty is not taken into account",
    "shared_risk": "Shared risk: simple acceptance with an agreed largest uncertainty",
}
_PLACED: Final = {"marks": "marked points", "position": "the frames' own position"}
_UNKNOWN: Final = "not recorded"
_FOOTER: Final = (
    "Relates only to the stretch, date and conditions named here. May be reproduced only in full."
)
_CAPTION: Final = "Heavy line: limit of the class. Ring: the minimum."
_MOST_COLUMNS: Final = 18
_BEFORE: Final = [
    "Lamps on for 30 minutes or more",
    "Road dry: no sheen, no puddles, no frost",
    "No parked car or shadow on the points",
    "Tape on pole A and kerb; lux meter zeroed with its cap on",
]
_AT_EACH: Final = [
    "Receiver flat on the road, bubble in the middle",
    "Stand on the dark side, 1 m away, crouch: no shadow on it",
    "No car coming; torch and phone off; wait 5 s, then read",
]
_SPARE: Final = (
    "The spare is any place on the road: one wrong point then costs nothing. 1st and 2nd differ by more than "
    "5 %? Read a third time, and write it beside."
)


def lay_out_report(result: Node, *, by: str, picture: str) -> Node:
    """Return everything that the template sets, from an evaluation as it is answered."""
    number = f"R-{result['road_id'][-10:]}-{result['number']}"
    requirement, stated = result["stated"]["requirement"], result["stated"]
    under = f"{result['name']}, {stamp(result['created_at'])}"
    pages = {
        "Road lighting: illuminance measured from the air": _first_page(result, requirement, stated),
        "": _second_page(result, picture, by),
    }
    return {
        "template": "road.typ",
        "paper": "a4",
        "title": "Test report",
        "number": number,
        "created_at": result["created_at"],
        "by": by,
        "footer": _FOOTER,
        "pages": [
            {"title": title, "head": f"Test report {number}", "under": under, "sections": list(sections)}
            for title, sections in pages.items()
        ],
    }


def _state(title: str, stated: dict[str, str]) -> Node:
    """Return a section of facts."""
    return section(title, [facts([list(pair) for pair in stated.items()])])


def _first_page(result: Node, requirement: Node, stated: Node) -> Iterator[Node]:
    site, grid, conditions = stated["site"], result["grid"], stated["conditions"]
    verdict, why = result["said"]
    yield section("", [{"kind": "verdict", "text": verdict, "more": why}])
    factor = requirement.get("maintenance_factor")
    limits = ", ".join(words.write_limit(each) for each in result["criteria"])
    about_rule = {
        "Class": f"{requirement['road_class']}: {limits}",
        "Source": f"{requirement['rule']}; {requirement.get('confirmed') or 'figures not confirmed'}",
        "Decision rule": _DECISIONS[requirement.get("decision", "guarded")],
        "State": f"Maintained values, factor {factor:g}"
        if factor
        else "As found: no maintenance factor was given",
    }
    yield _state("1  Requirement", about_rule)
    row = site["rows"][0]
    lanes = [f"{each['width_m']:g} m" for each in site.get("strips", ()) if each["kind"] == "lane"]
    power = f", {conditions['power_w']:g} W in one spacing" if "power_w" in conditions else ""
    luminaires = conditions.get("lamp_kind", "kind not recorded").replace("_", " ")
    about_site = {
        "Place": result["name"],
        "Geometry": f"S = {row['spacing_m']:g} m, H = {row['height_m']:g} m; rows of luminaires: "
        f"{len(site['rows'])}; lanes: {', '.join(lanes) or 'none'}",
        "Luminaires": luminaires + power,
        "Measured area": f"{grid['points'] - grid['hidden']} of {grid['points']} points visible",
    }
    yield _state("2  Site and installation", about_site)
    times = [stamp(each["taken_at"]) for each in result["frames"] if "taken_at" in each]
    mains = f"{conditions['mains_frequency_hz']:g} Hz" if "mains_frequency_hz" in conditions else _UNKNOWN
    about_night = {
        "Time": " to ".join(sorted({min(times), max(times)})) if times else _UNKNOWN,
        "Road": f"{conditions['surface']} (stated)" if "surface" in conditions else _UNKNOWN,
        "Mains": mains,
        "Remarks": conditions.get("remarks", "age of the lamps, climate and other light are not recorded"),
    }
    yield _state("3  Conditions", about_night)
    yield section("4  Instruments and traceability", [_tabulate_instruments(result)])
    ways = " and ".join(sorted({_PLACED[each["placed_by"]] for each in result["frames"]}))
    about_grid = {
        "Rule": f"{requirement['rule']}: N = {grid['along']}, D = {grid['along_m']:.2f} m along, "
        f"d = {grid['across_m']:.3f} m across; {grid['points']} points",
        "Place of the map": f"by {ways}, ± {grid['place_u_m']:.2f} m; at most a third of the spacing, "
        f"{grid['place_limit_m']:.2f} m",
        "View": f"at most {grid['view_deg']:.0f}° off nadir; limit 20°",
    }
    yield _state("5  Grid", about_grid)
    yield section("6  Method and remarks", [flow(text) for text in _list_remarks(result)])


def _tabulate_instruments(result: Node) -> Node:
    rows, stated = [], result["stated"]
    for version in sorted({each["calibration_id"] for each in result["frames"]}):
        used = [each for each in result["frames"] if each["calibration_id"] == version]
        first = used[0]
        exposure = f"f/{plain(first['f_number'])}, {write_exposure(first['exposure_time_s'])}"
        setting = f"{len(used)} frames, {exposure}, ISO {plain(first['iso'])}"
        certificate = f"certificate {first['certificate']}" if "certificate" in first else version
        chain = f"K version {first['calibration_version']} ({first['calibration_state']}), {certificate}"
        rows.append([first["camera"], setting, chain])
    for meter in stated.get("meters", ()):
        mine = [each["values"] for each in stated["control"] if each["meter"] == meter["meter"]]
        chain = "no certificate"
        if "u_rel" in meter:
            chain = f"certificate {meter.get('certificate', '')}, U = {percent(2 * meter['u_rel'])}"
        rows.append([meter["meter"], f"{len(mine)} points, {sum(map(len, mine))} readings", chain])
    return table(["instrument", "use", "traceable by"], rows, align="lll", widths=[2, 2, 2.4])


def _list_remarks(result: Node) -> Iterator[str]:
    frames, patches = len(result["frames"]), percent(result["model"]["patches_rel"])
    for each in result["scales"]:
        factor = " ± ".join(in_step(each["factor"], each["factor_u"]))
        slope = " ± ".join(in_step(each["slope"], each["slope_u"]))
        yield (
            f"Luminances of {frames} frames were converted to illuminance by the control points in one "
            f"generalised least squares: {each['surface']}, factor {factor}, expected 1.00 ± "
            f"{each['expected_u']:.2f}; slope with the angle {slope}."
        )
    yield f"E from draws of the field, so that patches of pavement ({patches}) do not lower the minimum."
    for each in result["findings"]:
        yield f"{each['sentence']} {each['action']}".replace("`", "")
    yield "Glare f_TI and the luminance that a driver sees are not visible from above: not measured."


def _second_page(result: Node, picture: str, by: str) -> Iterator[Node]:
    yield section("7  Results and comparison with the requirement", [_tabulate_results(result)])
    drawn = [{"kind": "figure", "svg": picture}, flow(_CAPTION)] if picture else []
    yield section("8  Map [lx] and control points", [*drawn, tabulate_control(result["control"])])
    more = flow("In brackets: the minimum. With U and places: points.csv and points.geojson.")
    yield section("9  Illuminance on the grid [lx]", [*_tabulate_grid(result), more])
    signed = [["Measured by", "name, date, signature"], ["Approved by", f"{by}: name, date, signature"]]
    yield section("", [{"kind": "sign", "items": signed}])


def _tabulate_results(result: Node) -> Node:
    judged = {each["figure"]: each for each in result["criteria"]}
    known = {each["figure"]: each for each in result["figures"]}
    rows = []
    for name in dict.fromkeys([*judged, *known]):
        value, u, relative = words.NONE, words.NONE, ""
        if name in known:
            each = known[name]
            value, u = in_step(each["value"], each["expanded_uncertainty"])
            unit = "" if each["unit"] == "1" else f" {write_unit(each['unit'])}"
            value, relative = f"{value}{unit}", f" ({percent(each['expanded_uncertainty'] / each['value'])})"
        rule = judged.get(name)
        rows.append(
            [
                " ".join(words.FIGURES[name][:2]),
                value,
                f"± {u}{relative}" if name in known else u,
                words.write_limit(rule, short=True) if rule else words.NONE,
                words.write_probability(rule.get("probability")) if rule else words.NONE,
                words.VERDICTS[rule["verdict"]] if rule else "not required",
            ]
        )
    budget = ", ".join(f"{each['source']} {percent(each['u_rel'])}" for each in result["budget"])
    used = sum(each["state"] == "agrees" for each in result["control"])
    return table(
        ["quantity", "measured", "U (95 %)", "required", "probability", "verdict"],
        rows,
        align="lrrrrl",
        widths=[2.2, 1.3, 1.7, 1, 1, 1.4],
        caption=f"Budget of E_av, standard uncertainties: {budget}. From {used} control points.",
    )


def tabulate_control(control: Sequence[Node]) -> Node:
    """Return each control point against the map that is made without it."""
    uses = {"agrees": "used", "differs": "differs, not used", "not_seen": "not seen"}
    rows = [
        [
            each["name"],
            f"{each['x_m']:.1f}",
            f"{each['y_m']:.1f}",
            f"{each['value']:.3g}",
            optional(each, "without_it", "{:.3g}".format),
            optional(each, "difference_rel", lambda share: f"{100 * share:+.1f} %"),
            uses.get(each["state"]) or f"left out: {each.get('reason', '')}",
        ]
        for each in control
    ]
    head = ["point", "along [m]", "from kerb [m]", "meter", "map without it", "difference", "use"]
    return table(head, rows, align="lrrrrrl", widths=[1, 1, 1, 1, 1.2, 1, 1.6])


def _tabulate_grid(result: Node) -> Iterator[Node]:
    """Yield a table for each lane, walkway or area; the minimum in brackets."""
    for part in dict.fromkeys(each["part"] for each in result["points"]):
        mine = [each for each in result["points"] if each["part"] == part]
        places = {(each["y_m"], each["x_m"]): each for each in mine}
        xs, ys = (sorted({each[name] for each in mine}) for name in ("x_m", "y_m"))
        cut = xs[:_MOST_COLUMNS]
        rows = []
        for y in ys:
            cells = []
            for x in cut:
                each = places.get((y, x))
                lux = f"{each['illuminance_lx']:.1f}" if each else ""
                cells.append(f"[{lux}]" if each and each["name"] == result["minimum"] else lux)
            rows.append([f"{part}: {y:.2f}", *cells])
        head = ["y \\ x", *(f"{x:.2f}" for x in cut)]
        yield table(head, rows, align="l" + "r" * len(cut), widths=[1.6] + [1.0] * len(cut))


def lay_out_card(road: Node, plan: Node, *, by: str, created_at: str) -> Node:
    """Return both sides of the card, from a road and its plan as they are answered."""
    spare = [each for each in plan["points"] if each.get("is_spare")]
    points = [each for each in plan["points"] if not each.get("is_spare")]
    start = road["site"]["rows"][0].get("first_x_m", 0.0)
    times = [write_exposure(each["time_s"]) for each in plan["times"]]
    best = len(times) // 2
    never = ", ".join(
        f"{write_exposure(each['time_s'])} ({percent(each['error_rel'])})" for each in plan["avoid"]
    )
    across: dict[str, list[str]] = {}
    for each in points:
        across.setdefault(f"{each['y_m']:.1f} m", []).append(each["name"])
    at = " · ".join(f"{', '.join(names)} at {place}" for place, names in across.items())
    drawn = {"kind": "figure", "svg": drawing.draw_plan(road["site"], points)}
    where = flow(f"Along: from pole A, as written above.\nAcross, from the kerb: {at}")
    exposures = {"kind": "times", "items": [[word, number == best] for number, word in enumerate(times)]}
    only = flow(f"Only these. Never {never}, or automatic." if never else "Only these.")
    front = [
        section("", [drawn, where]),
        section("Flight: straight down, raw, manual exposure", [exposures, only]),
        section("Before you start", [{"kind": "boxes", "items": _BEFORE}]),
    ]
    rows = [
        [each["name"], f"{each['x_m'] - start:.1f} m", f"{each['y_m']:.1f} m", "", "", ""] for each in points
    ]
    rows += [[each["name"], "", "", "", "", ""] for each in spare]
    head = ["point", "along", "across", "1st [lx]", "2nd [lx]", "time"]
    write = table(head, rows, align="llllll", widths=[0.8, 1, 1, 1.6, 1.6, 1.2], caption=_SPARE)
    signed = {"kind": "sign", "items": [["Lux meter, serial", ""], ["°C, % RH", ""], ["Read by, date", ""]]}
    back = [
        section("", [write | {"tall": 8.5}]),
        section("At each point", [{"kind": "boxes", "items": _AT_EACH}, signed]),
    ]
    under = f"class {road['requirement']['road_class']}"
    return {
        "template": "road.typ",
        "paper": "a5",
        "title": "Plan card",
        "number": road["id"],
        "created_at": created_at,
        "by": by,
        "footer": "Afterwards: take a picture of the written side; type the figures in stilb. Keep the card.",
        "pages": [
            {"title": road["name"], "head": "Plan card · front: where", "under": under, "sections": front},
            {
                "title": f"Read {len(points)} points, twice",
                "head": "Plan card · back: write",
                "under": "soft pencil, in lux",
                "sections": back,
            },
        ],
    }


router = operations.Router(prefix="/v1/roads/{road_id}", tags=["roads"])


@router.get("/results/{number}/report.pdf", **answers.sends_stored_file("application/pdf"))
async def get_road_report(
    road_id: lookup.Id, number: routes.Number, request: Request, caller: auth.Reader, context: UsesContext
) -> Response:
    """The evaluation on two pages of A4 (PDF/A) with the headings of EN 13201-4."""

    def order() -> tuple[str, Order]:
        with context.database.reading() as session:
            row = routes.find_result(session, road_id, number, caller)
            result = routes.answer_result(session, row).dump()
            by = name_laboratory(session.get_one(Organisation, row.organisation_id))
        png = b"".join(context.files.open(row.map_png_sha256)[1]) if row.map_png_sha256 else b""
        picture = drawing.draw_map(result, png) if png else ""
        sheets = lay_out_report(result, by=by, picture=picture)
        return sheets["number"], order_sheets(sheets)

    return await send_pdf(request, context, order)


@router.get("/plan.pdf", **answers.sends_stored_file("application/pdf"))
async def get_road_plan_card(
    road_id: lookup.Id,
    wanted: Annotated[schemas.WantedPlan, Query()],
    request: Request,
    caller: auth.Reader,
    context: UsesContext,
) -> Response:
    """The plan as a card for the person on the road: two sides of A5, where and what to read."""

    def order() -> tuple[str, Order]:
        row, plan = routes.make_plan(context, road_id, wanted, caller)
        with context.database.reading() as session:
            by = name_laboratory(session.get_one(Organisation, row.organisation_id))
            road: dict[str, Any] = routes.answer_road(session, session.get_one(Road, row.id)).dump()
        told = schemas.RoadPlanAnswer.restate(plan).dump()
        card = lay_out_card(road, told, by=by, created_at=road["created_at"])
        return card["number"], order_sheets(card)

    return await send_pdf(request, context, order)
