"""Campaign made from campaign.toml, lacking nothing but its frames. Every step may be repeated."""

import hashlib
import itertools
import json
from collections.abc import Sequence
from typing import Any, cast

from stilb.client import Client
from stilb.details import CampaignDetails, Reading
from stilb.field.plan import Plan
from stilb.records import Campaign


def find_planned(client: Client, plan: Plan) -> Campaign | None:
    """The campaign that the plan has made before: of its camera, with its project number and kind."""
    for camera in client.cameras(make=plan.make, model=plan.model, serial=plan.serial):
        for known in client.campaigns(camera_id=camera.id, project_number=plan.project_number):
            if known.kind == plan.kind:
                return known
    return None


def ensure_campaign(client: Client, plan: Plan) -> Campaign:
    """The plan's campaign, made where there is none, with what the plan says of it now, and its region."""
    details = _details(client, plan)
    campaign = find_planned(client, plan)
    campaign = _correct(client, campaign, details) if campaign else _create(client, plan, details)
    if plan.parts is not None:
        client.set_roi(campaign.id, regions=plan.parts)
    elif plan.polygon is not None:
        client.set_roi(campaign.id, polygon=plan.polygon)
    elif plan.imagej is not None:
        client.set_roi(campaign.id, imagej=plan.imagej)
    return campaign


def ensure_panel(client: Client, plan: Plan, campaign_id: str) -> None:
    """Name the panel that the plan gives by its serial alone, once the frames are read that state it."""
    if plan.panels and "bands" not in plan.panels[0]:
        client.wait_for(campaign_id)
        client.change_campaign(campaign_id, panel_serial=plan.panels[0]["serial"])


def list_parameters(plan: Plan) -> dict[str, Any]:
    """The parameters of the fit; of a panel that the plan gives one measurement of, that one is used."""
    days = [panel["measured_on"] for panel in plan.panels if "bands" in panel]
    return {**({"panel_measured_on": days[0]} if len(days) == 1 else {}), **plan.fit}


def ensure_readings(client: Client, plan: Plan, campaign_id: str) -> tuple[int, list[str]]:
    """Send the plan's readings once: how many they are, and the ids of others that the campaign has."""
    meters = [client.create_meter(**meter).id for meter in plan.meters]
    own: set[str] = set()
    for readings in (plan.readings_csv, plan.readings):
        if readings:
            own |= _send_once(client, campaign_id, readings, meters)
    others = [each["id"] for each in _in_use(client, campaign_id) if each["id"] not in own]
    return len(own), others


def _details(client: Client, plan: Plan) -> CampaignDetails:
    measured = [client.create_panel(**panel).id for panel in plan.panels if "bands" in panel]
    return {**plan.campaign, "panel_id": measured[-1]} if measured else plan.campaign


def _correct(client: Client, campaign: Campaign, details: CampaignDetails) -> Campaign:
    """Correct the details that differ; a time may be written in several ways, so it stays."""
    said = {name: value for name, value in details.items() if name not in {"started_at", "ended_at"}}
    changed = {name: value for name, value in said.items() if not _holds(campaign.raw.get(name), value)}
    return client.change_campaign(campaign.id, **cast("CampaignDetails", changed)) if changed else campaign


def _holds(stored: object, said: object) -> bool:
    """The service writes a target's defaults out: what was said must be in it, more may be."""
    if isinstance(stored, dict) and isinstance(said, dict):
        return stored.keys() >= said.keys() and all(_holds(stored[name], said[name]) for name in said)
    return stored == said


def _create(client: Client, plan: Plan, details: CampaignDetails) -> Campaign:
    camera = client.create_camera(plan.make, plan.model, plan.serial, **plan.camera)
    # Two runs that begin at once, or one that is killed before its answer, make one campaign.
    key = _digest("campaign", camera.id, plan.method, details)
    return client.create_campaign(camera.id, method=plan.method, idempotency_key=key, **details)


def _send_once(
    client: Client, campaign_id: str, readings: str | Sequence[Reading], meters: list[str]
) -> set[str]:
    """The same readings again are those that are there, unless all of them have been withdrawn since."""
    for attempt in itertools.count():
        key = _digest("readings", campaign_id, readings, meters, attempt)
        answer = client.add_readings(campaign_id, readings, meter_ids=meters, idempotency_key=key)
        ids = {each["id"] for each in answer}
        if ids & {each["id"] for each in _in_use(client, campaign_id)}:
            return ids
    raise AssertionError("unreachable")


def _in_use(client: Client, campaign_id: str) -> list[dict[str, Any]]:
    return [each for each in client.readings(campaign_id) if "withdrawn_at" not in each]


def _digest(*said: object) -> str:
    return hashlib.sha256(json.dumps(said, sort_keys=True, default=list).encode()).hexdigest()
