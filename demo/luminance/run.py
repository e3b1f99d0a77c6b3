"""The whole way, from the simulation to the verdict."""

from functools import partial

from demo.journey import write_files
from demo.luminance.campaign import TOLERANCE_REL, plan_campaign
from demo.luminance.frames import write_frame
from demo.luminance.journey import travel
from demo.luminance.report import as_table, compare
from demo.stage import Stage

_SEED = 20250301


def run(stage: Stage) -> bool:
    """Calibrate K; whether every K agrees with its truth."""
    campaign = plan_campaign(_SEED)
    shots = range(len(campaign.shots))
    paths = write_files(stage, [partial(write_frame, campaign, number, stage.folder) for number in shots])
    outcome = travel(stage, campaign, paths)
    rows = compare(outcome, truth=campaign.true_luminance_k, tolerance_rel=TOLERANCE_REL)
    stage.display.show(as_table(rows))
    stage.display.say(f"version {outcome.calibration.version} is {outcome.calibration.state}")
    return all(row.agrees for row in rows)
