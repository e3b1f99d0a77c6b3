"""A campaign, its region and its readings."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Unpack

from stilb import records
from stilb.problem import Problem, only
from stilb.transport import Call, Connection, address

_POLL_S = 0.5


class Campaigns(Connection):
    """Campaigns, their regions, their readings."""

    def create_campaign(
        self,
        camera_id: str,
        *,
        method: str = records.DEFAULT_METHOD,
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
            if most := max(most, left):
                on_progress(most - left, most)
            if not left:
                return found
            if end is not None and time.monotonic() >= end:
                raise TimeoutError(f"{left} frames of {campaign_id} are not read after {timeout_s:g} s")
            time.sleep(_POLL_S)

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
        ids = ", ".join(one.id for one in found)
        return only(
            found,
            several=f"Several campaigns have the project number {named!r}: give the id of one: {ids}.",
            none=f"No campaign has the id or the project number {named!r}. `stilb campaign list` shows them.",
        )

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
        self, campaign_id: str, table: str, *, idempotency_key: str | None = None, **settings: float | None
    ) -> dict[str, Any]:
        """Add frames of which only a CSV text of statistics exists, such as ImageJ's Results.

        ``settings``: white_level_dn and, of rows that state none, black_level_dn, exposure_time_s, f_number
        and iso. Their jobs are awaited as those of other frames.
        """
        headers = {**_idempotent(idempotency_key), "Content-Type": "text/csv; charset=utf-8"}
        path = address("campaigns", campaign_id, "points")
        call = Call(method="POST", path=path, query=settings, text=table, headers=headers)
        return dict(self._transport.json(call))

    def motion(self, campaign_id: str, **geometry: float | str | None) -> dict[str, Any]:
        """How far the picture moved during each frame's exposure: a row each, and how many stay within it.

        From the attitudes that the files record; those that record none say so. ``geometry``:
        focal_length_mm, pixel_pitch_um, limit_px, ground_speed_m_s, distance_m (height above ground), role.
        """
        return self._get(address("campaigns", campaign_id, "motion"), geometry)

    def readings(self, campaign_id: str) -> Iterator[dict[str, Any]]:
        return self._items(address("campaigns", campaign_id, "readings"))

    def withdraw_reading(self, reading_id: str) -> dict[str, Any]:
        """Withdraw a mistyped reading: no fit uses it any more, the record keeps it."""
        return self._delete(address("readings", reading_id))


def region(polygon: records.Polygon) -> dict[str, Any]:
    return {"polygon": [[x, y] for x, y in polygon]}


def _written(details: records.CampaignDetails | records.CampaignChange) -> dict[str, Any]:
    body = dict[str, Any](details)
    return body | {name: records.as_text(body[name]) for name in ("started_at", "ended_at") if name in body}


def _idempotent(key: str | None) -> dict[str, str]:
    return {} if key is None else {"Idempotency-Key": key}
