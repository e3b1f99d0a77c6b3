"""Cameras, meters, panels and rigs; a campaign, its region and its readings."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

from stilb import records
from stilb.problem import Problem, Unclear, missing
from stilb.records import DEFAULT_METHOD, Camera, CameraDetails, Certificate, Meter, Panel, PanelBand, Rig
from stilb.transport import Call, Connection, PathLike, address, without_none


class Equipment(Connection):
    """Cameras, meters and panels."""

    def create_camera(self, make: str, model: str, serial: str, **details: Unpack[CameraDetails]) -> Camera:
        body = {"make": make, "model": model, "serial": serial, **details}
        return Camera.of(self._post(address("cameras"), body))

    def camera(self, camera_id: str) -> Camera:
        return Camera.of(self._get(address("cameras", camera_id)))

    def cameras(
        self, *, make: str | None = None, model: str | None = None, serial: str | None = None
    ) -> Iterator[Camera]:
        query = {"make": make, "model": model, "serial": serial}
        return map(Camera.of, self._items(address("cameras"), query))

    def find_camera(self, named: str) -> Camera:
        """The camera with this id, this serial, or this make, model and serial with blanks between them."""
        try:
            return self.camera(named)
        except Problem as problem:
            if problem.status != 404:
                raise
        every = list(self.cameras())
        found = [one for one in every if named in {one.serial, f"{one.make} {one.model} {one.serial}"}]
        if len(found) > 1:
            raise Unclear(f"Several cameras are named {named!r}: {_names(found)}. Give the id of one.")
        if not found:
            raise missing(f"No camera is named {named!r}. Registered: {_names(every) or 'none yet'}.")
        return found[0]

    def create_meter(
        self, kind: str, make: str, model: str, serial: str, *, certificate: Certificate | None = None
    ) -> Meter:
        """``kind``: luminance, illuminance or sunshine."""
        body = {"kind": kind, "make": make, "model": model, "serial": serial, "certificate": certificate}
        return Meter.of(self._post(address("meters"), without_none(body)))

    def meters(self) -> Iterator[Meter]:
        return map(Meter.of, self._items(address("meters")))

    def create_panel(self, serial: str, *, measured_on: str, bands: Sequence[PanelBand]) -> Panel:
        """A panel as it was measured on a day; measured again it is another."""
        body = {"serial": serial, "measured_on": measured_on, "bands": list(bands)}
        return Panel.of(self._post(address("panels"), body))

    def panel(self, panel_id: str) -> Panel:
        return Panel.of(self._get(address("panels", panel_id)))

    def panels(self) -> Iterator[Panel]:
        return map(Panel.of, self._items(address("panels")))


def _names(cameras: list[Camera]) -> str:
    return ", ".join(f"{one.make} {one.model} {one.serial} ({one.id})" for one in cameras)


class Rigs(Equipment):
    """Rigs of cameras."""

    def create_rig(self, name: str, camera_ids: Sequence[str]) -> Rig:
        """Cameras that are mounted together, the reference first; the same again is the same rig."""
        return Rig.of(self._post(address("rigs"), {"name": name, "camera_ids": list(camera_ids)}))

    def find_rig(self, named: str) -> Rig:
        """The rig with this id or name."""
        every = [Rig.of(row) for row in self._items(address("rigs"))]
        found = next((one for one in every if named in {one.id, one.name}), None)
        if found is None:
            names = ", ".join(one.name for one in every)
            raise missing(f"No rig is named {named!r}. Registered: {names or 'none yet'}.")
        return found

    def rig_orientation(
        self, rig_id: str, *, tolerance_deg: float | None = None, tolerance_m: float | None = None
    ) -> dict[str, Any]:
        """The orientation of each camera by set, and its stability over the sets, as it is answered."""
        query = {"tolerance_deg": tolerance_deg, "tolerance_m": tolerance_m}
        return self._get(address("rigs", rig_id, "orientation"), query)

    def save_rig(self, rig_id: str, path: PathLike) -> Path:
        """Save the newest orientation as the file's name says: `opencv.yaml` or `rig.json`."""
        path = Path(path)
        return self._save(path, address("rigs", rig_id, "exports", path.name))


_POLL_S = 0.5


class Campaigns(Connection):
    """Campaigns, their regions, their readings."""

    def create_campaign(
        self,
        camera_id: str,
        *,
        method: str = DEFAULT_METHOD,
        idempotency_key: str | None = None,
        **details: Unpack[records.CampaignDetails],
    ) -> records.Campaign:
        """Begin a campaign. Two calls with the same ``idempotency_key`` begin one."""
        body = {"camera_id": camera_id, "method": method, **_written(details)}
        call = Call(method="POST", path=address("campaigns"), json=body, headers=_idempotent(idempotency_key))
        return records.Campaign.of(self._transport.json(call))

    def change_campaign(
        self, campaign_id: str, **details: Unpack[records.CampaignChange]
    ) -> records.Campaign:
        """Correct what is written on a campaign. With another ``target`` its frames are read again."""
        return records.Campaign.of(self._patch(address("campaigns", campaign_id), _written(details)))

    def campaign(self, campaign_id: str) -> records.Campaign:
        return records.Campaign.of(self._get(address("campaigns", campaign_id)))

    def wait_for(
        self,
        campaign_id: str,
        *,
        timeout_s: float | None = None,
        on_progress: Callable[[int, int], None] = lambda *_: None,
    ) -> records.Campaign:
        """Wait until all frames that have arrived are read; ``TimeoutError`` when that takes longer.

        ``on_progress`` is called with how many of those that were waited for are read, and how many they are.
        """
        end, most = None if timeout_s is None else time.monotonic() + timeout_s, 0
        while True:
            found = self.campaign(campaign_id)
            left = int(found.raw["frames"]["being_read"])
            most = max(most, left)
            if most:
                on_progress(most - left, most)
            if not left:
                return found
            if end is not None and time.monotonic() >= end:
                raise TimeoutError(f"{left} frames of {campaign_id} are not read after {timeout_s:g} s")
            time.sleep(_POLL_S)

    def campaign_events(self, campaign_id: str) -> Iterator[dict[str, Any]]:
        """Yield ``id`` and ``revision`` of a campaign, as it is and after each change, without an end."""
        for _, data in self._transport.events(f"{address('campaigns', campaign_id)}/events"):
            yield data

    def campaigns(
        self,
        *,
        project_number: str | None = None,
        camera_id: str | None = None,
        method: str | None = None,
        kind: str | None = None,
    ) -> Iterator[records.Campaign]:
        query = {"project_number": project_number, "camera_id": camera_id, "method": method, "kind": kind}
        return map(records.Campaign.of, self._items(address("campaigns"), {**query, "limit": 1000}))

    def find_campaign(self, named: str) -> records.Campaign:
        """The campaign with this id or this project number."""
        try:
            return self.campaign(named)
        except Problem as problem:
            if problem.status != 404:
                raise
        found = list(self.campaigns(project_number=named))
        if len(found) > 1:
            ids = ", ".join(one.id for one in found)
            raise Unclear(f"Several campaigns have the project number {named!r}: give the id of one: {ids}.")
        if not found:
            raise missing(
                f"No campaign has the id or the project number {named!r}. `stilb campaign list` shows them."
            )
        return found[0]

    def set_roi(
        self,
        campaign_id: str,
        *,
        polygon: records.Polygon | None = None,
        imagej: str | None = None,
        regions: Mapping[str, records.Polygon] | None = None,
    ) -> dict[str, Any]:
        """Set the region of every frame without one of its own, in one of three ways.

        Corners [px], ImageJ's macro call, or several by their names, each of which is measured separately.
        """
        body: dict[str, Any] = {"imagej": imagej}
        if polygon is not None:
            body = region(polygon)
        elif regions is not None:
            body = {"regions": [{"name": name, **region(corners)} for name, corners in regions.items()]}
        return self._put(address("campaigns", campaign_id, "roi"), body)

    def roi(self, campaign_id: str) -> dict[str, Any]:
        return self._get(address("campaigns", campaign_id, "roi"))

    def add_readings(
        self,
        campaign_id: str,
        readings: records.Reading | Sequence[records.Reading] | str,
        *,
        meter_ids: Sequence[str] = (),
        idempotency_key: str | None = None,
    ) -> list[dict[str, Any]]:
        """Add one reading, several, or a CSV text whose first line names the columns.

        Of ``meter_ids`` a reading that names no meter takes the one of its quantity. Two calls with the same
        ``idempotency_key`` add them once, and answer the same.
        """
        path, headers = address("campaigns", campaign_id, "readings"), _idempotent(idempotency_key)
        query = {"meter_id": list(meter_ids) or None}
        if isinstance(readings, str):
            headers["Content-Type"] = "text/csv; charset=utf-8"
            call = Call(method="POST", path=path, query=query, text=readings, headers=headers)
        else:
            call = Call(method="POST", path=path, query=query, json=readings, headers=headers)
        answer = self._transport.json(call)
        return list(answer["items"]) if "items" in answer else [answer]

    def add_points(
        self,
        campaign_id: str,
        table: str,
        *,
        idempotency_key: str | None = None,
        **settings: Unpack[records.TableSettings],
    ) -> dict[str, Any]:
        """Add frames of which only a CSV text of statistics exists, such as ImageJ's Results.

        Settings are those of rows that state none. Their jobs are awaited as those of other frames.
        """
        headers = {**_idempotent(idempotency_key), "Content-Type": "text/csv; charset=utf-8"}
        path = address("campaigns", campaign_id, "points")
        call = Call(method="POST", path=path, query={**settings}, text=table, headers=headers)
        return dict(self._transport.json(call))

    def motion(self, campaign_id: str, **geometry: Unpack[records.Motion]) -> dict[str, Any]:
        """How far the picture moved during each frame's exposure: a row each, and how many stay within it.

        From the attitudes that the files record; those that record none say so.
        """
        return self._get(address("campaigns", campaign_id, "motion"), {**geometry})

    def readings(self, campaign_id: str) -> Iterator[dict[str, Any]]:
        return self._items(address("campaigns", campaign_id, "readings"))

    def withdraw_reading(self, reading_id: str) -> dict[str, Any]:
        """Withdraw a mistyped reading: no fit uses it any more, the record keeps it."""
        return self._delete(address("readings", reading_id))


def region(polygon: records.Polygon) -> dict[str, Any]:
    """Corners as the service reads them."""
    return {"polygon": [[x, y] for x, y in polygon]}


def _written(details: records.CampaignDetails | records.CampaignChange) -> dict[str, Any]:
    body = dict[str, Any](details)
    return body | {name: records.as_text(body[name]) for name in ("started_at", "ended_at") if name in body}


def _idempotent(key: str | None) -> dict[str, str]:
    return {} if key is None else {"Idempotency-Key": key}
