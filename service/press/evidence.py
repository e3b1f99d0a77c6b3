"""Sections on the inputs of a luminance certificate: meters, scenes, readings, regions, frames."""

from collections import defaultdict

from radiometry.drawing.text import in_step, natural_key, write_unit
from service.press.figures import optional, percent, plain, stamp
from service.press.regions import region_blocks
from service.press.sheet import Node, flow, section, table


def evidence_sections(certificate: Node, preview: str) -> list[Node]:
    """Return the sections from the meters to the dark frames."""
    frames = certificate["frames"]
    return [
        section("Meters", [_meters(certificate)]),
        section("Scenes and readings", [_scenes(certificate), _readings(certificate)]),
        section("Region", region_blocks(certificate, preview)),
        section("Light frames", [_frames([f for f in frames if f["role"] == "light"])]),
        section("Dark frames", [_dark(certificate), _frames([f for f in frames if f["role"] == "dark"])]),
    ]


def _meters(certificate: Node) -> Node:
    if not certificate["meters"]:
        return flow("No meter is recorded for the readings.")
    rows = []
    for meter in certificate["meters"]:
        stated = meter.get("certificate", {})
        days = sorted({meter[name] for name in ("first_day", "last_day") if name in meter})
        rows.append(
            [
                meter["kind"],
                f"{meter['make']} {meter['model']}",
                meter["serial"],
                f"{stated['number']}\n{stated['laboratory']}" if stated else "none",
                f"{stated['issued_on']}\n{stated['due_on']}" if stated else "-",
                percent(stated["expanded_uncertainty_rel"]) if stated else "-",
                plain(stated["coverage_factor"]) if stated else "-",
                "\n".join(days) or "-",
            ]
        )
    head = ["kind", "meter", "serial", "certificate", "issued, due", "U", "k", "used"]
    return table(head, rows, align="lllllrrl", widths=[1.2, 1.6, 1.1, 2.2, 1.1, 0.8, 0.4, 1.1])


def _scenes(certificate: Node) -> Node:
    rows = [
        [
            scene["scene"],
            plain(scene["luminance_cd_m2"]),
            str(scene["readings"]),
            percent(scene["spread_rel"]),
            optional(scene, "illuminance_lx", plain),
            optional(scene, "illuminance_spread_rel", percent),
            optional(scene, "rho_e_pi_cd_m2", plain),
        ]
        for scene in sorted(certificate["result"]["scenes"], key=lambda each: natural_key(each["scene"]))
    ]
    head = ["scene", "L [cd/m²]", "readings", "range", "E [lx]", "range", "rho E/pi [cd/m²]"]
    return table(head, rows, align="lrrrrrr", widths=[2, 1, 0.8, 1, 1, 1, 1.2])


def _readings(certificate: Node) -> Node:
    rows = [
        [
            reading["scene"],
            reading["quantity"],
            f"{plain(reading['value'], 6)} {write_unit(reading['unit'])}",
            _entered(reading),
            reading.get("meter", "not recorded"),
            optional(reading, "taken_at", stamp),
        ]
        for reading in sorted(certificate["readings"], key=lambda each: natural_key(each["scene"]))
    ]
    head = ["scene", "quantity", "value", "as entered", "meter", "taken at"]
    return table(head, rows, align="llrrll", widths=[1.2, 1, 1.3, 1.3, 2.4, 1.9], caption="All readings.")


def _entered(reading: Node) -> str:
    if "entered_value" not in reading:
        return "-"
    return f"{plain(reading['entered_value'], 6)} {write_unit(reading['entered_unit'])}"


def _frames(frames: list[Node]) -> Node:
    rows = []
    for frame in sorted(frames, key=lambda each: natural_key(f"{each.get('scene', '')} {each['frame']}")):
        exposure = frame["exposure"]
        signal, u = in_step(frame["signal_dn"], frame["signal_standard_uncertainty_dn"])
        rows.append(
            [
                "\n".join([frame["frame"], *frame["warnings"]]),
                frame.get("scene", "-"),
                plain(exposure["exposure_time_s"]),
                plain(exposure["f_number"]),
                plain(exposure["iso"]),
                signal,
                u,
                frame["sha256"],
            ]
        )
    head = ["frame", "scene", "t [s]", "f/", "ISO", "N [DN]", "u(N)", "SHA-256"]
    return table(head, rows, align="llrrrrrh", widths=[2, 1.2, 0.8, 0.5, 0.8, 1.1, 0.7, 3])


def _dark(certificate: Node) -> Node:
    dark: dict[float, list[Node]] = defaultdict(list)
    for frame in certificate["frames"]:
        if frame["role"] == "dark":
            dark[frame["exposure"]["iso"]].append(frame)
    rows = []
    for fit in certificate["result"]["iso_fits"]:
        c = fit["coefficient"]
        value, u = in_step(c["dark_signal_dn"], c["dark_signal_standard_uncertainty_dn"])
        found = dark[c["iso"]]
        times = sorted({frame["exposure"]["exposure_time_s"] for frame in found})
        shown = ", ".join(plain(time) for time in times) or "no dark frames; black level of the files"
        rows.append([plain(c["iso"]), value, u, str(len(found)), shown])
    head = ["ISO", "D [DN]", "u(D)", "frames", "exposure times [s]"]
    caption = "Dark signal per ISO value: median of the frames taken with the lamp off, at their mean time."
    return table(head, rows, align="rrrrl", widths=[1, 1, 1, 1, 4], caption=caption)
