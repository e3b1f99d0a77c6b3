"""Pages of a certificate: one to sign, and an annex with the evidence; every number as text."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime, time

from radiometry.drawing.text import (
    in_step,
    label_axis,
    natural_key,
    sort_naturally,
    write_exposure,
    write_unit,
)
from radiometry.frame.multispectral import label_band
from radiometry.methods import get_method
from radiometry.specification.certificate import FRAME, Column
from radiometry.specification.method import MethodSpec
from service.documents.sheets import (
    Node,
    facts,
    figure,
    flow,
    name_device,
    optional,
    percent,
    plain,
    region_blocks,
    section,
    stamp,
    table,
    write_json,
)

STAMPS = {
    "draft": "Draft: nobody has signed",
    "revoked": "Revoked",
    "superseded": "Superseded",
    "published": "",
}
_LEGEND = (
    "U = k u: expanded uncertainty for 95 %. u: standard uncertainty. k: coverage factor. dof: effective "
    "degrees of freedom, printed up to 1000."
)
_VERIFY = "stilb export {id} calibration && stilb-verify calibration/{file}.json --data calibration"
_MOST_BIG = 8
_MOST_SOURCES = 3
_MOST_NOTES = 3


def find_state(certificate: Node) -> str:
    """Return the state that a certificate is marked with; one that nobody has signed stays a draft."""
    state: str = certificate["validity"]["state"]
    return "draft" if state == "published" and "approved_by" not in certificate else state


def lay_out(certificate: Node, preview: str) -> Node:
    """Return everything that the template sets. ``preview`` : an SVG of a frame with the region, or ""."""
    spec = get_method(certificate["method"])
    rows = certificate["coefficients"]
    named = [row for row in rows if row["name"] in spec.certificate.headlines]
    # an annex has also those at an f-number of the first page's
    headlines = [row for row in named if "f_number" not in row] or named
    others = [row for row in rows if row not in headlines]
    return {
        **{name: certificate[name] for name in ("title", "number", "created_at", "laboratory")},
        "attached": write_json(certificate),
        "stamp": STAMPS[find_state(certificate)],
        "heading": f"{spec.label} calibration of a camera",
        "results": _summarise(spec, certificate, headlines),
        "big": len(headlines) <= _MOST_BIG,
        "notes": [f"{certificate['procedure']}. {certificate['equation']}.", _LEGEND],
        "item": _item(certificate),
        "work": _list_work(certificate),
        "meters": _tabulate_meters(certificate["meters"]) if certificate["meters"] else None,
        "traceability": [certificate["traceability"], _count_evidence(certificate)],
        "budget": _shorten_budget(certificate, headlines),
        "validity": _list_validity(certificate),
        "signatures": _list_signatures(certificate),
        "verify": _VERIFY.format(id=certificate["calibration_id"], file=_name_file(certificate)),
        "fingerprint": certificate["content_sha256"],
        "sections": [
            *_list_gaps(certificate),
            section("Result", list(_show_result(spec, certificate)), wide=True),
            *([section("Further coefficients", [_tabulate(spec, others)], wide=True)] if others else []),
            *_list_flags(certificate["flags"]),
            *_budgets(certificate),
            *([section("Readings", [_readings(certificate)])] if certificate["readings"] else []),
            *([section("Panel", list(_panels(certificate)))] if certificate["panels"] else []),
            section("Region", region_blocks(certificate, preview)),
            section("Statements", [flow(statement) for statement in certificate["statements"]]),
            section("Parameters", [facts(_list_parameters(spec, certificate))]),
            *_checklist(certificate["checklist"]),
            _list_software(certificate),
            *_list_points(spec.certificate.columns, certificate),
        ],
    }


def _summarise(spec: MethodSpec, certificate: Node, rows: list[Node]) -> Node:
    """Return the table of the first page: value ± U, with the verdict where a method gives one."""
    result = certificate["result"]
    words = {True: "✓ passes", False: "✗ fails"}
    against = f"tolerance {plain(100 * result['tolerance_rel'])} %" if "tolerance_rel" in result else ""
    if rule := certificate["parameters"].get("acceptance"):
        against += f"\n{rule.replace('_', ' ')}"
    stated = [
        [percent(residual), f"{words[passed]}\n{against}"]
        for residual, passed in spec.certificate.verdicts(result)
    ]
    judged, between = bool(stated), "\n" if len(rows) <= _MOST_BIG else ", "
    printed = [
        [
            f"{spec.label_coefficient(row['name'])}{between}{_holds_for(row)}".removesuffix(f"{between}-"),
            *_state(row),
            write_unit(row["unit"]),
            *verdict,
        ]
        for row, verdict in zip(rows, stated or [[]] * len(rows), strict=True)
    ]
    head = ["", "value ± U", "U / value", "k", "dof", "unit", *(["largest residual", "verdict"] * judged)]
    longest = max(len(line) for row in printed for line in row[0].split("\n"))
    widths = [max(2.4, 0.1 * longest), 2.3, 1.2, 0.7, 0.9, 1.7, *([1.2, 1.5] * judged)]
    return table(head, printed, align="lrrrrl" + "rl" * judged, widths=widths)


def _state(row: Node) -> list[str]:
    """Return value ± U, the relative U, k and dof; what is relative only, or exact, has neither."""
    if not row.get("expanded_uncertainty"):
        value, u = in_step(row["value"], row["standard_uncertainty"])
        why = "relative only" if row["standard_uncertainty"] else "fixed"
        return [f"{value}\nu = {u}" if row["standard_uncertainty"] else value, why, "-", "-"]
    dof = row.get("effective_dof", math.inf)
    relative = abs(row["expanded_uncertainty"] / row["value"]) if row["value"] else math.inf
    return [
        " ± ".join(in_step(row["value"], row["expanded_uncertainty"])),
        f"{in_step(0.0, 100 * relative)[1]} %" if relative < 1.0 else "-",
        f"{row['coverage_factor']:.2f}",
        plain(dof, 3) if dof <= 1000.0 else "> 1000",
    ]


def _tabulate(spec: MethodSpec, rows: list[Node]) -> Node:
    printed = [
        [
            spec.label_coefficient(row["name"]),
            _holds_for(row),
            *(text.replace("\n", ", ") for text in _state(row)),
            write_unit(row["unit"]),
        ]
        for row in rows
    ]
    head = ["coefficient", "valid for", "value ± U", "U / value", "k", "dof", "unit"]
    return table(head, printed, align="llrrrrl", widths=[2.6, 2.4, 2.2, 1, 0.6, 0.8, 1.4])


def _holds_for(row: Node) -> str:
    """Return ISO value, f-number, band or channel, and for sharpness the position named in its model."""
    _, _, position = row["model"].partition(":")
    named = [
        f"ISO {plain(row['iso'])}" if "iso" in row else "",
        f"f/{plain(row['f_number'])}" if "f_number" in row else "",
        row.get("channel", label_band(row.get("band", ""))),
        position if " " not in position else "",
    ]
    return ", ".join(name for name in named if name) or "-"


def _item(certificate: Node) -> list[list[str]]:
    item, work = certificate["item"], certificate["work"]
    lens = item.get("lens")
    rows = [["Camera", name_device(item)], ["Lens", name_device(lens) if lens else "not recorded"]]
    if "pixel_pitch_um" in item:
        rows.append(["Pixel pitch", f"{plain(item['pixel_pitch_um'])} µm"])
    named = [["Customer", work.get("customer")], ["Project", work.get("project_number")]]
    return rows + [[label, value or "not recorded"] for label, value in named]


def _list_work(certificate: Node) -> list[list[str]]:
    work = certificate["work"]
    days = sorted({work[name] for name in ("first_day", "last_day") if name in work})
    source = {"readings": "", "campaign": " (as stated for the campaign)", "frames": " (camera clock)"}[
        work.get("days_from", "readings")
    ]
    named = [
        ["Date", " to ".join(map(_date, days)) + source if days else None],
        ["Place", work.get("place")],
        ["Conditions", work.get("conditions")],
        ["Recorded by", work.get("recorder")],
        ["Comments", work.get("comments")],
    ]
    return [[label, value or "not recorded"] for label, value in named if value or label != "Comments"]


def _date(moment: str) -> str:
    """Return a day in words, with the time where it does not begin the day."""
    at = datetime.fromisoformat(moment)
    return f"{at.day} {at:%B %Y}" + (f", {at:%H:%M} UTC" if at.time() != time() else "")


def _tabulate_meters(meters: list[Node]) -> Node:
    rows = []
    for meter in meters:
        stated, u = meter.get("certificate", {}), "-"
        if stated:
            u = f"{percent(stated['expanded_uncertainty_rel'])}\nk = {plain(stated['coverage_factor'])}"
        rows.append(
            [
                f"{meter['kind'].capitalize()} meter {name_device(meter)}",
                f"{stated['number']}, {_date(stated['issued_on'])}" if stated else "none",
                stated.get("laboratory", "-"),
                u,
                optional(stated, "due_on", _date),
            ]
        )
    head = ["standard", "certificate", "issued by", "U", "valid until"]
    return table(head, rows, align="lllrl", widths=[2.6, 2.2, 1.8, 0.8, 1.2])


def _count_evidence(certificate: Node) -> str:
    roles = Counter(frame["role"] for frame in certificate["frames"])
    scenes = {frame["scene"] for frame in certificate["frames"] if "scene" in frame}
    counts = [
        *([f"{len(scenes)} scenes"] if scenes else []),
        *([f"{len(certificate['readings'])} readings"] if certificate["readings"] else []),
        *(f"{count} {role} frame{'s' * (count != 1)}" for role, count in roles.items()),
    ]
    items = certificate["checklist"]["items"]
    done = sum("done_by" in item for item in items)
    signed = certificate["checklist"].get("signature")
    by = f", signed by {signed['name']} on {_date(signed['signed_at'][:10])}" if signed else ", not signed"
    return f"{', '.join(counts)}." + (f" Checklist: {done} of {len(items)} items{by}." if items else "")


def _shorten_budget(certificate: Node, headlines: list[Node]) -> list[list[str]]:
    """Return the largest sources of the first headline's uncertainty, and what the others make together."""
    if not certificate["budgets"] or not headlines[0]["value"]:
        return []
    lines = sorted(certificate["budgets"][0]["lines"], key=lambda line: -line["variance_share"])
    parts = {line["source"].capitalize(): line["u"] for line in lines[:_MOST_SOURCES]}
    if len(lines) > _MOST_SOURCES:
        parts["All others"] = math.hypot(*(line["u"] for line in lines[_MOST_SOURCES:]))
    parts["u / value"] = headlines[0]["standard_uncertainty"]
    value = abs(headlines[0]["value"])
    shown = [[name, f"{in_step(0.0, 100 * u / value)[1]} %"] for name, u in parts.items()]
    return [["For", f"{_holds_for(headlines[0])}; the complete budget is in the annex"], *shown]


def _list_validity(certificate: Node) -> list[list[str]]:
    validity, issued = certificate["validity"], certificate.get("issued", {})
    rows = []
    if "valid_from" in validity:
        end = _date(validity["valid_to"]) if "valid_to" in validity else "replaced or withdrawn"
        rows += [["From", _date(validity["valid_from"])], ["Until", end]]
    if not certificate["published"]:
        rows.append(["Published", "no; this is a draft"])
    rows += [["Reason", act["reason"]] for act in certificate["published"]]
    if "amends" in issued:
        amended = issued["amends"]
        rows.append(["Amends", f"certificate {amended['number']}, issued {stamp(amended['issued_at'])}"])
    if issued.get("at_upgrade"):
        when = "at an upgrade of the service: the version was published before certificates were kept"
        rows.append(["Issued", f"{stamp(issued['at'])}, {when}"])
    if "revoked" in validity:
        revoked = validity["revoked"]
        rows.append(["Revoked", f"{stamp(revoked['at'])}: {revoked['reason']}"])
    notes = list(dict.fromkeys(flag["meaning"] for flag in certificate["flags"]))
    more = f"{len(notes) - _MOST_NOTES} more in the annex" if len(notes) > _MOST_NOTES else ""
    shown = "\n".join([*notes[:_MOST_NOTES], *([more] if more else [])])
    return [*rows, *([["Notes", shown]] if notes else [])]


def _list_signatures(certificate: Node) -> list[list[str]]:
    acts = certificate["published"]
    signed = [
        ("Fitted by", certificate.get("fitted_by"), certificate["created_at"]),
        ("Approved by", certificate.get("approved_by"), acts[-1]["at"] if acts else ""),
    ]
    return [
        [
            f"{label}: {person['name']}, {person['role']}" if person else label,
            f"{_date(at[:10])} · signature" if at and person else "name, date and signature",
        ]
        for label, person, at in signed
    ]


def _name_file(certificate: Node) -> str:
    amends = certificate.get("issued", {}).get("amends")
    return f"amendment-{amends['amendment']}" if amends else "certificate"


def _list_gaps(certificate: Node) -> Iterator[Node]:
    """Yield what a draft lacks; once it is published, its page says so."""
    if certificate["gaps"] and not certificate["published"]:
        lacks = [flow(gap["message"]) for gap in certificate["gaps"]]
        yield section("Before you publish: items of ISO/IEC 17025, 7.8, that are missing", lacks, wide=True)


def _list_flags(flags: list[Node]) -> Iterator[Node]:
    """Yield a table with a row for each flag: its meaning, and where it was raised with what values."""
    by_meaning: dict[str, list[str]] = defaultdict(list)
    for flag in flags:
        where = f"{flag['where'].replace('iso ', 'ISO ')}: " if flag["where"] else ""
        by_meaning[flag["meaning"]].append(f"{where}{flag['detail']}")
    if rows := [[meaning, " ".join(values)] for meaning, values in by_meaning.items()]:
        found = table(["meaning", "where, values"], rows, align="ll", widths=[1, 1])
        yield section("Flags", [found], wide=True)


def _show_result(spec: MethodSpec, certificate: Node) -> Iterator[Node]:
    """Yield the plots, and what the method says of its result, or else what is one number or word of it."""
    result = certificate["result"]
    plot = spec.draw(result | {"flight": certificate.get("flight", [])})
    yield figure(plot, "Bars and bands: expanded uncertainty. Hollow: excluded or rejected.", width=1.0)
    scalars = {name: value for name, value in result.items() if not isinstance(value, list | dict)}
    described = list(spec.certificate.describe(result)) or _flatten(scalars)
    yield facts(
        [
            *([_label(name), value] for name, value in described),
            *([["vignetting correction", certificate["vignetting"]]] if spec.corrected_by else []),
        ]
    )


def _list_parameters(spec: MethodSpec, certificate: Node) -> list[list[str]]:
    named = {each.field: each for each in spec.parameters}
    rows = [
        *_flatten({name: value for name, value in certificate["configuration"].items() if name != "lens"}),
        *_flatten({"target": certificate.get("target", {})}),
    ]
    for name, value in certificate["parameters"].items():
        known = named.get(name)
        label = known.label if known else name
        unit = f" {write_unit(known.unit)}" if known and known.unit not in ("", "1") else ""
        rows += [(text, f"{shown}{unit}") for text, shown in _flatten({label: value})]
    return [[_label(name), value] for name, value in rows]


def _label(name: str) -> str:
    """Return a name as words, with its unit in brackets."""
    words, _, unit = name.replace("_", " ").rpartition(" ")
    return label_axis(words, unit) if unit in {"px", "um", "mm", "deg"} else f"{words} {unit}".strip()


def _flatten(node: Mapping[str, object], stem: str = "") -> Iterator[tuple[str, str]]:
    for name, value in node.items():
        label = f"{stem} {name}".strip()
        if isinstance(value, dict):
            yield from _flatten(value, label)
        elif isinstance(value, list):
            yield label, "; ".join(_format(member) for member in value) or "none"
        else:
            yield label, _format(value)


def _format(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return ", ".join(f"{name} {text}" for name, text in _flatten(value))
    return plain(value, 6) if isinstance(value, int | float) else str(value)


def _budgets(certificate: Node) -> Iterator[Node]:
    explained = any("input_uncertainty" in line for each in certificate["budgets"] for line in each["lines"])
    rows: list[list[str]] = []
    for budget in certificate["budgets"]:
        rows.append([f"§{_holds_for({'model': '', **budget})}"])
        for line in budget["lines"]:
            row = [line["source"], line["kind"], percent(line["u_rel"]), plain(line["u"], 3)]
            if explained:
                x = f"{plain(line['input_uncertainty'], 3)} {line['input_unit']}".removesuffix(" 1")
                row[2:2] = [x, optional(line, "sensitivity", lambda value: plain(value, 3))]
            rows.append([*row, percent(line["variance_share"])])
    head = ["source", "type", *(["u(x)", "sens."] * explained), "u, rel.", "u", "of u²"]
    relative = " u(x) without a unit is relative; sens.: sensitivity." * explained
    caption = f"Type A: from scatter; type B: from other information.{relative}"
    widths = [2.2, 0.6, *([1.4, 1.2] * explained), 1, 1.2, 1.1]
    if rows:
        budget = table(head, rows, align="ll" + "r" * (len(head) - 2), widths=widths, caption=caption)
        yield section("Uncertainty budget", [budget])


def _readings(certificate: Node) -> Node:
    """Return a row for each scene and meter, with all its readings as entered."""
    found: dict[tuple[str, str], list[str]] = defaultdict(list)
    for row in certificate["readings"]:
        unit = write_unit(row.get("entered_unit", row["unit"]))
        meter = row.get("meter", f"{row['quantity']} meter not recorded")
        found[row["scene"], f"{meter} [{unit}]"].append(plain(row.get("entered_value", row["value"]), 6))
    rows: list[list[str]] = []
    for meter in dict.fromkeys(meter for _, meter in found):
        rows.append([f"§{meter}"])
        of_meter = {scene: values for (scene, each), values in found.items() if each == meter}
        rows += [[scene, ", ".join(of_meter[scene])] for scene in sort_naturally(of_meter)]
    return table(["scene", "readings as entered"], rows, align="ll", widths=[1, 3])


def _panels(certificate: Node) -> Iterator[Node]:
    fits = [each["coefficient"] for each in certificate["result"]["band_fits"]]
    for panel in certificate["panels"]:
        day, stated = panel["measured_on"], any(band.get("origin") for band in panel["bands"])
        used = [label_band(each["band"]) for each in fits if day in each.get("panel_measured_on", ())]
        yield facts(
            [
                ["Serial number", panel["serial"]],
                ["Stated by files of" if stated else "Measured on", day],
                *([] if stated else [["Used for", ", ".join(used) or "no band"]]),
            ]
        )
        rows = [
            [
                label_band(band["band"]),
                plain(band["reflectance"], 6),
                optional(band, "standard_uncertainty", plain),
            ]
            for band in panel["bands"]
        ]
        yield table(["band", "R", "u(R)"], rows, align="lrr", widths=[2, 1, 1])


def _list_points(columns: Sequence[Column], certificate: Node) -> Iterator[Node]:
    """Yield the points of the fit and the frames by their roles, in one table where a point is a frame."""
    points, beside = certificate["result"]["points"], FRAME not in columns
    if not beside:
        yield section("Points of the fit", [_tabulate_points(columns, points)], wide=True)
    of_frame = {point["frame"]: point for point in points} if beside else {}
    for role in dict.fromkeys(frame["role"] for frame in certificate["frames"]):
        frames = [frame for frame in certificate["frames"] if frame["role"] == role]
        shown = columns if any(frame["frame"] in of_frame for frame in frames) else ()
        table_of_role = _tabulate_frames(frames, shown, of_frame)
        yield section(f"{role.capitalize()} frames", [table_of_role], wide=True)


def _tabulate_frames(frames: list[Node], columns: Sequence[Column], points: Mapping[str, Node]) -> Node:
    rows = []
    for frame in sorted(frames, key=lambda each: natural_key(f"{each.get('scene', '')} {each['frame']}")):
        exposure, point = frame.get("exposure", {}), points.get(frame["frame"], {})
        left_out = [point["left_out"]] if point.get("left_out") else []
        rows.append(
            [
                "\n".join([frame["frame"], *left_out, *frame["warnings"]]),
                optional(frame, "scene"),
                optional(exposure, "exposure_time_s", write_exposure),
                optional(exposure, "f_number", plain),
                optional(exposure, "iso", plain),
                _signal(frame),
                *(_cell(point, column) for column in columns),
                frame["sha256"],
            ]
        )
    return table(
        ["frame", "scene", "t", "f/", "ISO", "signal [DN]", *(each.head for each in columns), "SHA-256"],
        rows,
        align="llrrrr" + "r" * len(columns) + "h",
        widths=[
            *(2.3, 1.1, 0.9, 0.5, 0.8, 1.9 if any("signal_dn" in frame for frame in frames) else 4.8),
            *(each.share for each in columns),
            5.8,
        ],
    )


def _signal(frame: Node) -> str:
    if "signal_dn" in frame:
        return " ± ".join(in_step(frame["signal_dn"], frame["signal_standard_uncertainty_dn"]))
    rows = [row for row in frame["statistics"] if row["channel"] != "grey" or len(frame["statistics"]) == 1]
    return ", ".join(f"{row['channel']} {plain(row['mean_dn'])}" for row in rows) or "-"


def _tabulate_points(columns: Sequence[Column], points: list[Node]) -> Node:
    if not points:
        return flow("None.")
    rows = [[*(_cell(point, column) for column in columns), point["left_out"] or "used"] for point in points]
    return table(
        [*(column.head for column in columns), "status"],
        rows,
        align="".join("l" if column.form == "text" else "r" for column in columns) + "l",
        widths=[*(column.share for column in columns), 2.4],
    )


def _cell(point: Node, column: Column) -> str:
    match column.form:
        case "text":
            return optional(point, column.name) or "-"
        case "number":
            return optional(point, column.name, plain)
        case "percent":
            return optional(point, column.name, percent)


def _checklist(checklist: Node) -> Iterator[Node]:
    """Yield how many items of each section are done; the items are in the JSON certificate."""
    items = Counter(item["section"] for item in checklist["items"])
    done = Counter(item["section"] for item in checklist["items"] if "done_by" in item)
    if rows := [[name, f"{done[name]} of {count}"] for name, count in items.items()]:
        shown = table(["section", "done"], rows, align="lr", widths=[4, 1])
        yield section("Checklist of the procedure", [shown])


def _list_software(certificate: Node) -> Node:
    words = {"stilb": "fit code version", "release": "stilb"}
    software = sorted(certificate["software"].items())
    rows = [[words.get(name, name), str(version)] for name, version in software]
    return section("Software", [facts([*rows, ["calibration", certificate["calibration_id"]]])])
