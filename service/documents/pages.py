"""Pages of a certificate: titles, tables and drawings, with every number as text."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

from radiometry.drawing.text import in_step, write_unit
from radiometry.methods import get_method
from radiometry.specification.certificate import Column
from radiometry.specification.method import MethodSpec
from service.documents.sections import evidence_sections, result_sections
from service.documents.sheets import (
    Node,
    degrees,
    expanded,
    facts,
    figure,
    flow,
    optional,
    percent,
    plain,
    region_blocks,
    section,
    stamp,
    table,
    write_json,
)

_LEGEND = (
    "u: standard uncertainty. U = k u: expanded uncertainty. k: coverage factor (95 %). dof: effective "
    "degrees of freedom, printed up to 1000."
)
_EXACT = "fixed"


def summarise(certificate: Node) -> Node:
    """Return the table of the first page: the headline coefficients."""
    spec = get_method(certificate["method"])
    rows = [row for row in certificate["coefficients"] if row["name"] in spec.certificate.headlines]
    return _tabulate(spec, rows)


def list_notes(certificate: Node) -> list[str]:
    """Return the sentences below the table of the first page."""
    return [f"{certificate['procedure']}. {certificate['equation']}.", _LEGEND, certificate["traceability"]]


def list_sections(certificate: Node, preview: str) -> list[Node]:
    """Return the sections from the result to the points of the fit."""
    spec = get_method(certificate["method"])
    others = [row for row in certificate["coefficients"] if row["name"] not in spec.certificate.headlines]
    return [
        section("Result", [_drawn(certificate), facts(_conditions(certificate))]),
        *([section("Further coefficients", [_tabulate(spec, others)])] if others else []),
        *_budgets(certificate),
        *([section("Panel", list(_panels(certificate)))] if certificate["panels"] else []),
        section("Region", region_blocks(certificate, preview)),
        *_frames(certificate),
        section(
            "Points of the fit", [_tabulate_points(spec.certificate.columns, certificate["result"]["points"])]
        ),
    ]


def _drawn(certificate: Node) -> Node:
    flight = {"flight": certificate.get("flight", [])}
    plot = get_method(certificate["method"]).draw(certificate["result"] | flight)
    return figure(plot, "Bars and bands: expanded uncertainty. Hollow: excluded or rejected.", width=1.0)


def _tabulate(spec: MethodSpec, rows: list[Node]) -> Node:
    """Return a table of coefficients and what each is valid for, in the version's order."""
    printed = []
    for row in rows:
        value, u = in_step(row["value"], row["standard_uncertainty"])
        _, expanded = in_step(row["value"], row["expanded_uncertainty"])
        exact = row["standard_uncertainty"] == 0.0
        printed.append(
            [
                spec.label_coefficient(row["name"]),
                _holds_for(row),
                value,
                _EXACT if exact else u,
                "-" if exact else expanded,
                "-" if exact else f"{row['coverage_factor']:.2f}",
                plain(row["effective_dof"], 3) if row.get("effective_dof", math.inf) <= 1000.0 else "",
                write_unit(row["unit"]),
            ]
        )
    head = ["coefficient", "valid for", "value", "u", "U", "k", "dof", "unit"]
    return table(head, printed, align="llrrrrrl", widths=[2.6, 2.6, 1.4, 1, 1, 0.6, 0.6, 1])


def _holds_for(row: Node) -> str:
    """Return ISO value, f-number, band or channel, and for sharpness the position named in its model."""
    _, _, position = row["model"].partition(":")
    named = [
        f"ISO {plain(row['iso'])}" if "iso" in row else "",
        f"f/{plain(row['f_number'])}" if "f_number" in row else "",
        row.get("channel", row.get("band", "")),
        position if " " not in position else "",
    ]
    return ", ".join(name for name in named if name) or "-"


def _conditions(certificate: Node) -> list[list[str]]:
    """Return the configuration, target, parameters and scalar results, one line each."""
    rows = [["Camera", f"{certificate['item']['make']} {certificate['item']['model']}"]]
    for name, value in _flatten(certificate["configuration"]):
        rows.append([name, value])
    for name, value in _flatten({"target": certificate.get("target", {})}):
        rows.append([name, value])
    rows += [[f"parameter {name}", value] for name, value in _flatten(certificate["parameters"])]
    scalars = {
        name: value for name, value in certificate["result"].items() if not isinstance(value, list | dict)
    }
    rows += [list(pair) for pair in _flatten(scalars)]
    return [[label.replace("_", " "), value] for label, value in rows]


def _flatten(node: Node, stem: str = "") -> Iterator[tuple[str, str]]:
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
    """Yield the budgets of the headline coefficients: a table each, or all as rows where there are many."""
    budgets = certificate["budgets"]
    if not budgets:
        return
    names = sorted(get_method(certificate["method"]).certificate.headlines)
    caption = (
        f"Uncertainty budget of {', '.join(names)}. Type A: from scatter; type B: from other information."
    )
    head = ["valid for", "source", "type", "u, relative", "u", "fraction of u²"]
    rows = [
        [
            _holds_for({"model": "", **budget}) if line is budget["lines"][0] else "",
            line["source"],
            line["kind"],
            percent(line["u_rel"]),
            plain(line["u"], 3),
            percent(line["variance_share"]),
        ]
        for budget in budgets
        for line in budget["lines"]
    ]
    widths = [1.4, 2.6, 0.6, 1.2, 1.2, 1.2]
    yield section("Uncertainty", [table(head, rows, align="lllrrr", widths=widths, caption=caption)])


def _panels(certificate: Node) -> Iterator[Node]:
    fits = [each["coefficient"] for each in certificate["result"]["band_fits"]]
    for panel in certificate["panels"]:
        day, stated = panel["measured_on"], any(band.get("origin") for band in panel["bands"])
        used = [each["band"] for each in fits if day in each.get("panel_measured_on", ())]
        yield facts(
            [
                ["Serial number", panel["serial"]],
                ["Stated by files of" if stated else "Measured on", day],
                *([] if stated else [["Used for", ", ".join(used) or "no band"]]),
            ]
        )
        rows = [
            [band["band"], plain(band["reflectance"], 6), optional(band, "standard_uncertainty", plain)]
            for band in panel["bands"]
        ]
        yield table(["band", "R", "u(R)"], rows, align="lrr", widths=[2, 1, 1])


def _frames(certificate: Node) -> Iterator[Node]:
    """Yield one section per role, in the order of first appearance."""
    by_role: dict[str, list[Node]] = defaultdict(list)
    for frame in certificate["frames"]:
        by_role[frame["role"]].append(frame)
    for role, frames in by_role.items():
        yield section(f"{role.capitalize()} frames", [_frame_table(frames)])


def _frame_table(frames: list[Node]) -> Node:
    rows = []
    for frame in frames:
        exposure = frame.get("exposure", {})
        means = [f"{row['channel']} {plain(row['mean_dn'], 6)}" for row in frame["statistics"]]
        rows.append(
            [
                "\n".join([frame["frame"], *frame["warnings"]]),
                optional(exposure, "exposure_time_s", plain),
                optional(exposure, "f_number", plain),
                optional(exposure, "iso", plain),
                ", ".join(means) or "-",
                frame["sha256"],
            ]
        )
    head = ["frame", "t [s]", "f/", "ISO", "mean [DN]", "SHA-256"]
    return table(head, rows, align="lrrrlh", widths=[2.4, 0.8, 0.5, 0.8, 2.2, 3])


def _tabulate_points(columns: Sequence[Column], points: list[Node]) -> Node:
    """Return a table of points, used or not."""
    if not points:
        return flow("None.")
    rows = [[*(_cell(point, column) for column in columns), point["left_out"] or "used"] for point in points]
    return table(
        [*(column.head for column in columns), "status"],
        rows,
        align="".join("l" if column.form == "text" else "r" for column in columns) + "l",
        widths=[*(column.share for column in columns), 1.6],
    )


def _cell(point: Node, column: Column) -> str:
    match column.form:
        case "text":
            return optional(point, column.name) or "-"
        case "number":
            return optional(point, column.name, plain)
        case "percent":
            return optional(point, column.name, percent)


STAMPS = {
    "draft": "Draft: nobody has signed",
    "revoked": "Revoked",
    "superseded": "Superseded",
    "published": "",
}
_LEGEND_OF_K = (
    "u(K): standard uncertainty. U(K): expanded uncertainty. k: coverage factor (95 %). dof: degrees of "
    "freedom."
)


def find_state(certificate: Node) -> str:
    """Return the state that a certificate is marked with; one that nobody has signed stays a draft."""
    state: str = certificate["validity"]["state"]
    return "draft" if state == "published" and "approved_by" not in certificate else state


def lay_out(certificate: Node, preview: str) -> Node:
    """Return everything that the template sets. ``preview`` : an SVG of a frame with the region, or ""."""
    is_curve = get_method(certificate["method"]).certificate.layout == "curve"
    return {
        **{name: certificate[name] for name in ("title", "number", "created_at", "laboratory")},
        "attached": write_json(certificate),
        "stamp": STAMPS[find_state(certificate)],
        "item": _item(certificate),
        "work": _list_work(certificate),
        "results": _summary(certificate) if is_curve else summarise(certificate),
        "summary": _sentences(certificate) if is_curve else list_notes(certificate),
        "authority": _authority(certificate),
        "gaps": [gap["message"] for gap in certificate["gaps"]],
        "flags": [[flag["where"] or "all", flag["meaning"], flag["detail"]] for flag in certificate["flags"]],
        "sections": [
            *(
                [*result_sections(certificate), *evidence_sections(certificate, preview)]
                if is_curve
                else list_sections(certificate, preview)
            ),
            *([_checklist(certificate)] if certificate["checklist"]["items"] else []),
            _list_software(certificate),
        ],
        "statements": certificate["statements"],
    }


def _item(certificate: Node) -> list[list[str]]:
    item = certificate["item"]
    lens = item.get("lens", {})
    rows = [
        ["Camera", f"{item['make']} {item['model']}"],
        ["Serial number", item["serial"]],
        ["Lens", f"{lens['make']} {lens['model']}" if lens else "not recorded"],
    ]
    if "serial" in lens:
        rows.append(["Lens serial number", lens["serial"]])
    if "pixel_pitch_um" in item:
        rows.append(["Pixel pitch", f"{plain(item['pixel_pitch_um'])} µm"])
    return rows


def _list_work(certificate: Node) -> list[list[str]]:
    """Return where, when, for whom and by whom."""
    work = certificate["work"]
    days = sorted({work[name] for name in ("first_day", "last_day") if name in work})
    source = {"readings": "", "campaign": " (as stated for the campaign)", "frames": " (camera clock)"}[
        work.get("days_from", "readings")
    ]
    named = [
        ["Customer", work.get("customer")],
        ["Project", work.get("project_number")],
        ["Place", work.get("place")],
        ["Performed", " to ".join(days) + source if days else None],
        ["Recorded by", work.get("recorder")],
        ["Conditions", work.get("conditions")],
        ["Comments", work.get("comments")],
    ]
    return [[label, value or "not recorded"] for label, value in named if value or label != "Comments"]


def _summary(certificate: Node) -> Node:
    rows = []
    for fit in certificate["result"]["iso_fits"]:
        c = fit["coefficient"]
        k, u = in_step(c["luminance_k"], c["luminance_k_standard_uncertainty"])
        rows.append(
            [
                plain(c["iso"]),
                k,
                u,
                *expanded(certificate, c["luminance_k"], c),
                degrees(c),
                write_unit(c["luminance_k_unit"]),
                percent(fit["largest_residual_rel"]),
                "passed" if fit["passed"] else "failed",
            ]
        )
    head = ["ISO", "K", "u(K)", "U(K)", "k", "dof", "unit", "largest error", "verdict"]
    return table(head, rows, align="rrrrrrlrl", widths=[1, 1.2, 1, 1, 0.8, 0.8, 2.1, 1.5, 1.2])


def _sentences(certificate: Node) -> list[str]:
    result = certificate["result"]
    models = sorted({fit["coefficient"]["model"] for fit in result["iso_fits"]})
    return [
        f"{certificate['procedure']}. Model: {', '.join(models)}. {certificate['equation']}.",
        f"{_LEGEND_OF_K} Verdict against a tolerance of {percent(result['tolerance_rel'])} of L.",
        certificate["traceability"],
    ]


def _authority(certificate: Node) -> list[list[str]]:
    validity = certificate["validity"]
    fitted_by = _name(certificate.get("fitted_by"), certificate["author"])
    rows = [["Calibrated", f"{fitted_by}, {stamp(certificate['created_at'])}"]]
    for act in certificate["published"]:
        end = f"to {stamp(act['valid_to'])}" if "valid_to" in act else "on"
        by = _name(certificate.get("approved_by"), act["by"])
        text = f"{by}, {stamp(act['at'])}: {act['reason']} (from {stamp(act['valid_from'])} {end})"
        rows.append(["Approved" if "approved_by" in certificate else "Published", text])
    issued = certificate.get("issued", {})
    if "amends" in issued:
        amended = issued["amends"]
        rows.append(["Amends", f"certificate {amended['number']}, issued {stamp(amended['issued_at'])}"])
    if issued.get("at_upgrade"):
        when = "at an upgrade of the service: the version was published before certificates were kept"
        rows.append(["Issued", f"{stamp(issued['at'])}, {when}"])
    if "valid_from" in validity:
        start = stamp(validity["valid_from"])
        end = f"to {stamp(validity['valid_to'])}" if "valid_to" in validity else "until superseded or revoked"
        rows.append(["Valid", f"from {start} {end}"])
    if "revoked" in validity:
        revoked = validity["revoked"]
        rows.append(["Revoked", f"{revoked['by']}, {stamp(revoked['at'])}: {revoked['reason']}"])
    if not certificate["published"]:
        rows.append(["Published", "no; this is a draft"])
    return rows


def _name(person: Node | None, unnamed: str) -> str:
    return f"{person['name']}, {person['role']}" if person else unnamed


def _checklist(certificate: Node) -> Node:
    checklist = certificate["checklist"]
    rows, last = [], None
    for item in checklist["items"]:
        if item["section"] != last:
            last = item["section"]
            rows.append([f"§{last}"])
        done = "done_by" in item
        notes = [item[name] for name in ("evidence", "note") if name in item]
        who = f"{item['done_by']}, {stamp(item['done_at'])}" if done else "-"
        rows.append(["✓" if done else "○", "\n".join([item["text"], *notes]), who])
    signature = checklist.get("signature")
    signed = "Not signed."
    if signature:
        when = stamp(signature["signed_at"])
        signed = f"Signed by {signature['name']} on {when}."
    lines = table(["", "item", "done by, time"], rows, align="lll", widths=[0.3, 7, 2.4])
    return section("Checklist of the procedure", [lines, flow(signed)])


def _list_software(certificate: Node) -> Node:
    words = {"stilb": "fit code version", "release": "stilb"}
    rows = [
        [words.get(name, name), str(version)] for name, version in sorted(certificate["software"].items())
    ]
    rows += [
        ["calibration", certificate["calibration_id"]],
        ["content SHA-256", certificate["content_sha256"]],
    ]
    return section("Software and identifiers", [facts(rows)])
