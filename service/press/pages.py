"""Pages of a certificate: titles, tables and drawings, with every number as text.

Everything printed comes from the dictionary that is served as certificate.json. A method that fits a curve
per ISO value has pages of its own; all others share theirs.
"""

from radiometry.drawing.text import in_step, write_unit
from radiometry.methods import get_method
from service.press import general
from service.press.evidence import evidence_sections
from service.press.figures import degrees, expanded, percent, plain, stamp
from service.press.results import result_sections
from service.press.sheet import Node, facts, flow, section, table, write_json

STAMPS = {
    "draft": "Draft: nobody has signed",
    "revoked": "Revoked",
    "superseded": "Superseded",
    "published": "",
}
_LEGEND = (
    "u(K): standard uncertainty. U(K): expanded uncertainty. k: coverage factor (95 %). dof: degrees of "
    "freedom."
)


def front_matter(certificate: Node, state: str) -> Node:
    """Return what stands at the head of every certificate, and the JSON that goes with it."""
    same = {name: certificate[name] for name in ("title", "number", "created_at", "laboratory")}
    return same | {"attached": write_json(certificate), "stamp": STAMPS[state]}


def find_state(certificate: Node) -> str:
    """Return the state that a certificate is marked with; one that nobody has signed stays a draft."""
    state: str = certificate["validity"]["state"]
    return "draft" if state == "published" and "approved_by" not in certificate else state


def lay_out(certificate: Node, preview: str) -> Node:
    """Return everything that the template sets. ``preview`` : an SVG of a frame with the region, or ""."""
    is_curve = get_method(certificate["method"]).certificate.layout == "curve"
    return front_matter(certificate, find_state(certificate)) | {
        "item": _item(certificate),
        "work": list_work(certificate),
        "results": _summary(certificate) if is_curve else general.summarise(certificate),
        "summary": _sentences(certificate) if is_curve else general.list_notes(certificate),
        "authority": _authority(certificate),
        "gaps": [gap["message"] for gap in certificate["gaps"]],
        "flags": [list_flag(flag) for flag in certificate["flags"]],
        "sections": [
            *(
                [*result_sections(certificate), *evidence_sections(certificate, preview)]
                if is_curve
                else general.list_sections(certificate, preview)
            ),
            *([_checklist(certificate)] if certificate["checklist"]["items"] else []),
            list_software(certificate, [["calibration", certificate["calibration_id"]]]),
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


def list_work(certificate: Node) -> list[list[str]]:
    """Return where, when, for whom and by whom."""
    work = certificate["work"]
    days = sorted({work[name] for name in ("first_day", "last_day") if name in work})
    source = {
        "readings": "",
        "campaign": " (as stated for the campaign)",
        "frames": " (camera clock)",
    }[work.get("days_from", "readings")]
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
        f"{_LEGEND} Verdict against a tolerance of {percent(result['tolerance_rel'])} of L.",
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


def list_flag(flag: Node) -> list[str]:
    """Return the row of a flag."""
    return [flag["where"] or "all", flag["meaning"], flag["detail"]]


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


def list_software(certificate: Node, identifiers: list[list[str]]) -> Node:
    """Return the section of the software, with the identifiers of what was calibrated."""
    words = {"stilb": "fit code version", "release": "stilb"}
    rows = [
        [words.get(name, name), str(version)] for name, version in sorted(certificate["software"].items())
    ]
    rows += [*identifiers, ["content SHA-256", certificate["content_sha256"]]]
    return section("Software and identifiers", [facts(rows)])
