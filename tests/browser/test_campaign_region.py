"""The region on the preview: by pointer and by keys, from ImageJ and back, in parts, with its raw numbers."""

import struct

import pytest
from playwright.sync_api import expect

from tests.support.browser import look, settle
from tests.support.frames import write_frame


@pytest.fixture(scope="module")
def frame(tmp_path_factory):
    """Its noise reaches the white level: some of it is clipped."""
    return write_frame(tmp_path_factory.mktemp("frame") / "bright.DNG", signal_dn=3835.0, noise_dn=8.0)


def open_region(page, team, service, frame, **campaign):
    camera = team.client.create_camera("DJI", "FC6520", "0K1XE8")
    with team.http() as http:
        made = http.post(
            "/v1/campaigns", json={"camera_id": camera.id, "method": "luminance"} | campaign
        ).json()
        sent = http.post(
            f"/v1/campaigns/{made['id']}/frames",
            params={"role": "chart" if campaign else "light", "filename": frame.name},
            content=frame.read_bytes(),
        ).json()
    service.wait_for_jobs([sent["id"]])
    page.goto(f"/campaigns/{made['id']}#region")
    settle(page)
    page.locator(".roi-canvas").scroll_into_view_if_needed()
    return made["id"]


def roi_of(team, campaign_id):
    with team.http() as http:
        return http.get(f"/v1/campaigns/{campaign_id}/roi").json()


def test_keys_alone_draw_a_region(page, team, service, frame):
    campaign_id = open_region(page, team, service, frame)
    page.get_by_role("button", name="Rectangle").click()
    expect(page.get_by_role("button", name="Corner 1 of 4: x 38, y 26")).to_be_focused()
    for key in ("Shift+ArrowLeft", "ArrowUp", "Insert"):
        page.keyboard.press(key)
    expect(page.get_by_role("button", name="Corner 2 of 5: x 43, y 26")).to_be_focused()
    page.keyboard.press("Delete")
    page.keyboard.press("Control+z")
    expect(page.get_by_role("button", name="Corner 2 of 5: x 43, y 26")).to_be_visible()
    page.keyboard.press("Control+Shift+z")
    expect(page.get_by_role("button", name="Corner 4 of 4")).to_be_visible()
    expect(page.locator(".roi-clipped rect").first).to_be_attached()
    expect(page.get_by_role("row", name="grey")).to_contain_text("%")
    page.evaluate("scrollTo(0, 0)")
    look(page, "campaign-region")
    page.get_by_role("button", name="Use for all frames").click()
    expect(page.get_by_text("The region is set")).to_be_visible()
    assert roi_of(team, campaign_id)["polygon"] == [[28, 25], [58, 26], [58, 38], [38, 38]]


def test_edges_that_cross_or_leave_the_frame_are_told(page, team, service, frame):
    open_region(page, team, service, frame)
    page.get_by_text("ImageJ: macro and .roi").click()
    page.get_by_label("ImageJ macro").fill("makePolygon(10,10,500,10,10,50);")
    page.get_by_role("button", name="Use this macro").click()
    refused = page.locator(".act-failed")
    expect(refused).to_contain_text("(500, 10) lies outside the frame of 96")
    page.get_by_label("ImageJ macro").fill("makePolygon(10,10,50,50,50,10,10,50);")
    page.get_by_role("button", name="Use this macro").click()
    # told where its values would be, before anybody uses it
    expect(page.locator(".look")).to_contain_text("The polygon crosses or touches itself")
    page.get_by_role("button", name="Use for all frames").click()
    expect(refused).to_contain_text("crosses or touches itself")
    page.context.complaints.clear()


def test_a_roi_file_becomes_a_macro(page, team, service, frame, tmp_path):
    campaign_id = open_region(page, team, service, frame)
    page.get_by_text("ImageJ: macro and .roi").click()
    page.get_by_label("ImageJ file").set_input_files(
        write_roi(tmp_path / "a.roi", [(10, 5), (60, 8), (40, 50)])
    )
    expect(page.get_by_role("button", name="Corner 3 of 3: x 40, y 50")).to_be_visible()
    expect(page.get_by_label("ImageJ macro")).to_have_value("makePolygon(10,5,60,8,40,50);")
    page.get_by_label("ImageJ file").set_input_files(
        {"name": "b.roi", "mimeType": "application/octet-stream", "buffer": b"Iout" + bytes(90)}
    )
    expect(page.get_by_role("alert")).to_contain_text("incomplete")
    page.get_by_role("button", name="Use for all frames").click()
    expect(page.get_by_text("The region is set")).to_be_visible()
    assert roi_of(team, campaign_id)["polygon"] == [[10, 5], [60, 8], [40, 50]]


def write_roi(path, points):
    """As ImageJ writes a polygon of whole pixels: big endian, corners relative to their rectangle."""
    xs, ys = zip(*points, strict=True)
    head = struct.pack(">4shBB4hH", b"Iout", 228, 0, 0, min(ys), min(xs), max(ys), max(xs), len(points))
    cells = [x - min(xs) for x in xs] + [y - min(ys) for y in ys]
    path.write_bytes(head.ljust(64, b"\0") + struct.pack(f">{len(cells)}h", *cells))
    return path


def test_the_parts_of_a_chart_have_names(page, team, service, frame):
    campaign_id = open_region(page, team, service, frame, method="sharpness", target={"kind": "slanted_edge"})
    canvas = page.locator(".roi-canvas")
    box = canvas.bounding_box()
    ends = [{"x": x * box["width"], "y": y * box["height"]} for x, y in ((0.6, 0.4), (0.3, 0.7))]
    canvas.drag_to(canvas, source_position=ends[0], target_position=ends[1])
    page.get_by_label("Name of part 1").fill("centre")
    page.get_by_role("button", name="Add a part").click()
    page.get_by_label("Name of part 2").fill("corner")
    for x_share, y_share in [(0.05, 0.1), (0.2, 0.1), (0.1, 0.3)]:
        canvas.click(position={"x": x_share * box["width"], "y": y_share * box["height"]})
    page.keyboard.press("Enter")
    page.evaluate("scrollTo(0, 0)")
    look(page, "campaign-parts")
    fit = page.get_by_role("button", name="Fit", exact=True)
    fit.click()
    expect(page.locator(".act-failed")).to_contain_text("The region was changed here and is not used yet")
    page.get_by_role("button", name="Use for all frames").click()
    expect(page.get_by_text("The region is set")).to_be_visible()
    page.get_by_text("Change: slanted edge").click()
    page.get_by_label("Tone curve to undo").select_option("sRGB images")
    fit.click()
    expect(page.locator(".act-failed")).to_contain_text("The target was changed here and is not used yet")
    parts = roi_of(team, campaign_id)["regions"]
    assert [part["name"] for part in parts] == ["centre", "corner"]
    assert parts[0]["polygon"] == [[29, 26], [58, 26], [58, 45], [29, 45]]
    assert len(parts[1]["polygon"]) == 3
    # it is refused for its parts, which are too small, and takes others
    expect(page.locator("#overview")).to_contain_text("1 frame refused")
    page.reload()
    expect(page.get_by_role("button", name="Corner 4 of 4")).to_be_visible()
    canvas.scroll_into_view_if_needed()
    expect(page.get_by_role("row", name="grey")).to_contain_text("%")


def test_charts_that_were_refused_for_their_region_ask_for_another_once(page, team, service, frame):
    target = {"kind": "slanted_edge"}
    campaign_id = open_region(page, team, service, frame, method="sharpness", target=target)
    team.client.set_roi(campaign_id, polygon=[(10, 10), (60, 10), (60, 50), (10, 50)])
    team.client.wait_for(campaign_id)
    page.goto(f"/campaigns/{campaign_id}")
    settle(page)
    before = page.locator("#before")
    expect(before.get_by_text("1 frame refused")).to_be_visible()
    expect(before).not_to_contain_text("not usable")
    expect(before.get_by_role("link", name="Draw region")).to_have_attribute("href", "#region")


def test_the_wheel_zooms_and_a_drag_moves_a_corner(page, team, service, frame):
    open_region(page, team, service, frame)
    page.get_by_role("button", name="Rectangle").click()
    canvas = page.locator(".roi-canvas")
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    whole = canvas.get_attribute("viewBox")
    page.mouse.wheel(0, -240)
    expect(canvas).not_to_have_attribute("viewBox", whole)
    assert canvas.evaluate("svg => svg.viewBox.baseVal.width") < 96
    page.get_by_role("button", name="All", exact=True).last.click()
    expect(canvas).to_have_attribute("viewBox", whole)
    scale = box["width"] / 96
    page.mouse.move(box["x"] + 38 * scale, box["y"] + 26 * scale)
    page.mouse.down()
    page.mouse.move(box["x"] + 20 * scale, box["y"] + 10 * scale, steps=3)
    page.mouse.up()
    expect(page.get_by_role("button", name="Corner 1 of 4: x 20, y 10")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(page.get_by_role("button", name="Corner 1 of 4: x 38, y 26")).to_be_visible()
