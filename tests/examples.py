"""`make examples`: record the examples of the OpenAPI document from a service that does real work.

Every method's demo runs, then requests for what no demo asks. Of each schema that a route takes or answers,
the richest body is kept, with long lists cut; the service puts them into its document.
"""

import json
import re
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import httpx
import numpy as np
from rich.console import Console

import stilb
from demo import __main__, child, luminance
from demo.journey import Display, Stage
from radiometry.methods import METHODS
from simulation.camera import change
from simulation.multispectral_files import name_file, write_sequoia
from simulation.sequoia import SEQUOIA, capture

Node = dict[str, Any]

_FILE = Path(__file__).parents[1] / "service" / "http" / "examples.json"
_OTHER_BODY = "0K8TF1A0010099"
_QUERIES: dict[str, Node] = {
    "get_campaign_motion": {"focal_length_mm": 3.98, "pixel_pitch_um": 3.75},
    "get_camera_validity": {"method": "luminance"},
    "get_coefficients": {"method": "luminance"},
    "get_drift": {"method": "luminance", "tolerance": 0.04},
}
_MOST_IDS = 24
_LONGEST_TEXT, _MOST_NUMBERS, _MOST_ROWS, _SHORT_ROW, _DIGITS = 400, 8, 4, 200, 8


class Recorder:
    """The richest body of each schema, by the schema's name."""

    def __init__(self, document: Node) -> None:
        self.examples: dict[str, Any] = {}
        self.ids: dict[str, set[str]] = {}
        self.document = document
        self._paths = {
            re.compile(re.sub(r"\{.*?\}", "([^/]+)", path)): path
            for path in sorted(document["paths"], key=lambda path: path.count("{"))
        }

    def hear(self, response: httpx.Response) -> None:
        """Keep what was sent and answered."""
        request = response.request
        found = next((p for p in self._paths.items() if p[0].fullmatch(request.url.path)), None)
        if found is None or response.is_error or not _is_json(response.headers):
            return
        path, answer = found[1], json.loads(response.read())
        operation = self.document["paths"][path][request.method.lower()]
        if "requestBody" in operation and _is_json(request.headers):
            self._keep(operation["requestBody"], json.loads(request.content))
        self._keep(operation["responses"][str(response.status_code)], answer)
        for each in answer.get("items", [answer]):
            if "id" in each:
                self.ids.setdefault(f"{path.rpartition('/')[2].rstrip('s')}_id", set()).add(each["id"])

    def list_needed(self) -> set[str]:
        """Return the names of all schemas of which an example is needed."""
        holders = [
            holder
            for methods in self.document["paths"].values()
            for operation in methods.values()
            for holder in (operation.get("requestBody", {}), *operation["responses"].values())
        ]
        schemas = [holder.get("content", {}).get("application/json") for holder in holders]
        return {name for media in schemas if media for name in self._list_names(media["schema"])}

    def _list_names(self, schema: Node) -> list[str]:
        name, known = self._resolve(schema)
        alternatives = () if "properties" in known else known.get("oneOf", known.get("anyOf", ()))
        if alternatives:
            return [each for one in alternatives for each in self._list_names(one)]
        if name.startswith("Page_"):
            return self._list_names(known["properties"]["items"]["items"])
        return [] if known["type"] == "array" else [name]

    def _resolve(self, schema: Node) -> tuple[str, Node]:
        """Return a schema's name and itself; one that is written out has its title for a name."""
        name = schema.get("$ref", "").rpartition("/")[2]
        known = self.document["components"]["schemas"].get(name, schema)
        return name or known.get("title", ""), known

    def _keep(self, holder: Node, body: Any) -> None:
        self._walk(holder["content"]["application/json"]["schema"], body)

    def _walk(self, schema: Node, body: Any) -> None:
        name, known = self._resolve(schema)
        if isinstance(body, list):
            return
        if name.startswith("Page_"):
            for item in body["items"]:
                self._walk(known["properties"]["items"]["items"], item)
        elif not {"properties", "additionalProperties"} & known.keys():
            for one in known.get("oneOf") or known.get("anyOf") or ():
                if body.keys() <= self._resolve(one)[1].get("properties", {}).keys():
                    self._walk(one, body)
        else:
            short = _shorten(body)
            if len(json.dumps(self.examples.get(name, ""))) <= len(json.dumps(short)):
                self.examples[name] = short


def _is_json(headers: Mapping[str, str]) -> bool:
    return headers.get("content-type", "").partition(";")[0] == "application/json"


def _shorten(body: Any) -> Any:
    if isinstance(body, dict):
        members = [*body.items()]
        if all(name.isdigit() for name in body):
            members = members[:_MOST_ROWS]
        said = {name: _shorten(value) for name, value in members}
        return said | ({"secret": f"{said['secret'][:8]}..."} if "secret" in said else {})
    if isinstance(body, list):
        plain = not any(isinstance(each, dict) for each in body)
        rows = _MOST_ROWS if body and len(json.dumps(body[0])) < _SHORT_ROW else 1
        return [_shorten(each) for each in body[: _MOST_NUMBERS if plain else rows]]
    if isinstance(body, float):
        return float(f"{body:.{_DIGITS}g}")
    return body[:_LONGEST_TEXT] if isinstance(body, str) else body


def _tour(stage: Stage, http: httpx.Client, recorder: Recorder) -> None:
    """Ask for what no demo asks."""
    first, other = _calibrate_other_cameras(stage)
    _survey(stage, http, first)
    _move(stage)
    _manage(http)
    for body in (
        {"height_m": 50, "tilt_deg": 45, "focal_length_mm": 9, "sensor_width_mm": 6.4}
        | {"sensor_height_mm": 4.8, "pixel_pitch_um": 4.65},
    ):
        _post(http, "tools/coverage", body)
        _post(http, "tools/coverage", [body])
    body = {"pixel_pitch_um": 4.65, "focal_length_mm": 9, "exposure_time_s": 0.00125, "distance_m": 25}
    for sent in (body | {"rotation_rate_deg_s": 165.6}, [body | {"ground_speed_m_s": 12}]):
        _post(http, "tools/motion", sent)
    rows = [
        {"exposure_time_s": time_s, "f_number": 11, "iso": 200, "signal_dn": signal_dn}
        for time_s, signal_dn in ((0.01, 373), (0.02, 752), (0.04, 1472), (0.1, 3780))
    ]
    _post(http, "tools/exposure", {"rows": rows, "dark_dn": 8, "white_level_dn": 16384})
    cameras = [first.camera_id, other.camera_id]
    _post(http, "fleet/verdict", {"method": "luminance", "camera_ids": cameras, "tolerance": 0.04})
    cause = {"meter_certificate_number": "L-2025-0117"}
    recall = _post(http, "recalls", {"cause": cause, "reason": "certificate withdrawn"})
    http.get(f"/v1/recalls/{recall['id']}")
    for path, methods in recorder.document["paths"].items():
        name, *more = re.findall(r"{(.*?)}", path) or ("",)
        # what has two names in its address is asked for by a demo
        if (operation := methods.get("get")) and not more:
            query = _QUERIES.get(operation["operationId"], {})
            for each in sorted(recorder.ids.get(name, {""}))[-_MOST_IDS:]:
                if "application/json" in operation["responses"]["200"]["content"]:
                    http.get(path.replace(f"{{{name}}}", each), params=query)
    for version in (first.id, _change_road(http)):
        _post(http, f"calibrations/{version}/revoke", {"reason": "the meter was dropped"})


def _calibrate_other_cameras(stage: Stage) -> tuple[stilb.Calibration, stilb.Calibration]:
    """Repeat the luminance campaign with its own camera, and with another of its model."""
    found = []
    for seed, serial in ((20250302, None), (20250303, _OTHER_BODY), (20250304, _OTHER_BODY)):
        campaign = luminance.plan(seed)
        if serial:
            campaign = replace(campaign, camera=change(campaign.camera, serial=serial))
        found.append(
            luminance.carry_out(replace(stage, folder=stage.folder / str(seed)), campaign, seed=seed)
        )
    return found[0], found[1]


def _survey(stage: Stage, http: httpx.Client, version: stilb.Calibration) -> None:
    """Measure frames of the field with a version, compare two, and draft what would replace it."""
    client, folder = stage.client, stage.folder / "20250302"
    camera = str(version.camera_id)
    survey = client.create_campaign(camera, project_number="DEMO-SURVEY").id
    corners = [(60.0, 60.0), (560.0, 60.0), (560.0, 380.0), (60.0, 380.0)]
    client.set_roi(survey, polygon=corners)
    frames = client.push(survey, sorted(folder.glob("*.DNG"))[1:4], role="field")
    files = [
        {"name": path.name, "size_bytes": path.stat().st_size, "sha256": frame.sha256}
        for path, frame in zip(sorted(folder.glob("*.DNG"))[1:4], frames, strict=True)
    ]
    others = [{"name": "MISC/log.txt", "size_bytes": 2048}]
    _post(http, f"campaigns/{survey}/manifest", {"files": files, "others": others})
    for frame in frames:
        client.wait(frame.job_id)
    grid: stilb.Grid = {"corners": corners, "rows": 2, "columns": 3}
    measured = [
        client.measure(frame.id, calibration_id=version.id, with_map=True, grid=grid, reflectance=0.18)
        for frame in frames
    ]
    client.measure_campaign(survey, calibration_id=version.id)
    old, new = measured[0].id, measured[1].id
    http.get(f"/v1/measurements/{new}/comparison", params={"old": old}).raise_for_status()
    window = {"step": 64, "height": 256, "width": 256}
    queries: tuple[tuple[str, dict[str, Any]], ...] = (
        ("map.json", window),
        ("isolines.geojson", {"area": "grid"}),
    )
    for name, query in queries:
        http.get(f"/v1/measurements/{old}/{name}", params=query).raise_for_status()
    card = [
        {"name": f"card/100MEDIA/DJI_{n:04}.DNG", "taken_s": 1777665600.0 + 300 * (n // 2) + n}
        | {"exposure_time_s": 0.01, "f_number": 4.0, "iso": 400.0, "signal_share": 0.25}
        for n in (1, 2, 3)
    ]
    _post(http, "proposals", {"frames": card})
    known = {"sha256": [frames[0].sha256, "0" * 64]}
    _post(http, f"campaigns/{survey}/frames/known", known)
    http.get(f"/v1/campaigns/{survey}/thumbnails", params={"of": [frames[0].id]}).raise_for_status()
    _post(http, f"frames/{frames[0].id}/region", {"polygon": corners})
    _post(http, f"frames/{frames[0].id}/grid", grid)
    window = {"row0_px": 120, "col0_px": 180, "height_px": 256, "width_px": 256}
    _post(http, f"frames/{frames[0].id}/crops", window)
    own = str(version.raw["campaign_id"])
    _send(http, "PATCH", f"campaigns/{own}", {"recorder": "A. Meier"})
    _send(http, "PATCH", f"cameras/{camera}", {"pixel_pitch_um": 3.28})
    item = {"key": "equipment_lamp", "done": True, "note": "40 W halogen, 3.2 m away"}
    _send(http, "PATCH", f"campaigns/{own}/checklist", {"items": [item], "signature": {"name": "A. Meier"}})
    reading = {"scene": "level-1", "quantity": "luminance", "value": 54.4, "unit": "cd/m2"}
    added = _post(http, f"campaigns/{own}/readings", reading)
    client.withdraw_reading(added["id"])
    _post(http, f"readings/{added['id']}/restore", None)
    client.withdraw_reading(added["id"])
    exclude = [{"frame_id": version.raw["points"][0]["frame_id"], "reason": "a person crossed the light"}]
    draft = client.calibrate(own, model="proportional", tolerance=0.04, exclude=exclude)
    http.get(f"/v1/calibrations/{draft.id}/impact").raise_for_status()
    _send(http, "PATCH", f"frames/{frames[2].id}", {"scene": "street"})
    named = {"frame_ids": [frames[1].id, frames[2].id], "left_out": True, "reason": "a car in the region"}
    _send(http, "PATCH", f"campaigns/{survey}/frames", named)
    table = _post(http, "campaigns", {"camera_id": camera, "method": "luminance"})["id"]
    head = "Label,Area,Mean,Min,Max,scene,exposure_time_s,f_number,iso"
    row = f"{head}\nDSC_1.tif,900,500.5,400,600,level-1,1/60,4,400\n"
    http.post(
        f"/v1/campaigns/{table}/points",
        params={"white_level_dn": 4095},
        content=row.encode(),
        headers={"Content-Type": "text/csv"},
    ).raise_for_status()


def _change_road(http: httpx.Client) -> str:
    """Change the demo's road, and place its frame again; return the version that it was measured with."""
    road = http.get("/v1/roads").json()["items"][0]
    address = f"roads/{road['id']}"
    _send(http, "PATCH", address, {"name": road["name"], "hidden": [road["grid"][0]["name"]]})
    _post(http, f"{address}/placement", road["frames"][0])
    _send(http, "PUT", f"{address}/site.geojson", http.get(f"/v1/{address}/site.geojson").json())
    result = http.get(road["results"][0]["link"]).json()
    return str(result["frames"][0]["calibration_id"])


def _move(stage: Stage) -> None:
    """Send one frame whose file records that the aircraft turned."""
    sequoia = change(SEQUOIA, height_px=120, width_px=160)
    shot = capture(sequoia, np.random.default_rng(1), reflectance={"green": 0.2})["green"]
    band = shot.header.multispectral
    assert band is not None and band.counts is not None  # noqa: PT018  the simulation's always are
    turned = tuple(
        replace(record, yaw_deg=0.06 * number, pitch_deg=0.04 * number, roll_deg=-0.02 * number)
        for number, record in enumerate(band.counts.records)
    )
    counts = replace(band.counts, records=turned)
    header = replace(shot.header, multispectral=replace(band, counts=counts))
    path = stage.folder / name_file(0, header)
    write_sequoia(path, replace(shot, header=header))
    camera_id = stage.client.find_camera(sequoia.camera.body.serial).id
    campaign_id = stage.client.create_campaign(camera_id, method="reflectance").id
    frame = stage.client.push(campaign_id, path, role="field")
    stage.client.wait(frame.job_id)


def _manage(http: httpx.Client) -> None:
    """Make keys, an organisation and a browser's session, and try failed jobs again."""
    key = _post(http, "keys", {"name": "dashboard", "scopes": ["read"], "expires_at": "2099-05-01T00:00:00Z"})
    with httpx.Client(base_url=http.base_url) as browser:
        browser.post("/sign-in", data={"key": key["secret"]})
    sessions = http.get("/v1/sessions").json()["items"]
    _send(http, "DELETE", f"sessions/{sessions[0]['id']}")
    _send(http, "DELETE", "sessions")
    _send(http, "DELETE", f"keys/{key['id']}")
    _post(http, "organisations", {"name": "City of Lansing"})
    _post(http, "jobs/retry", {"state": "failed", "code": "temporarily_unavailable"})
    _post(http, "jobs/dismiss", {"state": "failed", "code": "not_a_raw_file"})


def _introduce(http: httpx.Client) -> None:
    """State the laboratory, and who signs its certificates."""
    own = http.get("/v1/keys/own").json()["id"]
    _send(http, "PATCH", f"keys/{own}", {"person": "A. Meier", "role": "head of the laboratory"})
    settings = {"name": "Lansing Light Laboratory", "address": "124 W Michigan Ave, Lansing"}
    _send(http, "PATCH", "organisation", settings | {"refuses_incomplete_certificates": False})


def _post(http: httpx.Client, path: str, body: object) -> Node:
    return _send(http, "POST", path, body)


def _send(http: httpx.Client, method: str, path: str, body: object = None) -> Node:
    response = http.request(method, f"/v1/{path}", json=body)
    response.raise_for_status()
    return dict(response.json())


def main() -> int:
    """Run every demo, ask what they do not, and write the examples."""
    display = Display(Console())
    with tempfile.TemporaryDirectory(prefix="examples-") as name:
        folder = Path(name)
        with child.serving(folder / "data") as service:
            headers = {"Authorization": f"Bearer {service.key}"}
            with httpx.Client(base_url=service.url, headers=headers, timeout=120.0) as http:
                recorder = Recorder(http.get("/openapi.json").json())
                send = httpx.Client.send

                def heard(self: httpx.Client, request: httpx.Request, **more: Any) -> httpx.Response:
                    response = send(self, request, **more)
                    recorder.hear(response)
                    return response

                client = stilb.Client(service.url, service.key)
                with patch.object(httpx.Client, "send", heard), client:
                    _introduce(http)
                    for demo in (*(method.name for method in METHODS), "road"):
                        stage = Stage(client=client, folder=folder / demo, display=display, quick=True)
                        if not __main__.play(demo, stage):
                            return 1
                    _tour(replace(stage, folder=folder / "tour"), http, recorder)
    _FILE.write_text(json.dumps(recorder.examples, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    if missing := sorted(recorder.list_needed() - recorder.examples.keys()):
        display.say(f"no example of {', '.join(missing)}")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
