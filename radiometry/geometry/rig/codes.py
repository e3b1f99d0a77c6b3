"""Findings of a rig's orientation."""

from radiometry.findings import declared, error, flag

RIG_INCOMPLETE = error(
    "rig_incomplete",
    "Pictures that were taken together do not link all cameras of the rig.",
    "Take three or more pictures of the board with all cameras at once, and give those of one trigger one "
    "`scene`.",
)
TRIGGER_LEFT_OUT = flag(
    "trigger_left_out",
    "A picture does not show the board where the rig's other pictures put it; it was left out.",
    "Check its `scene`: it belongs to another trigger, or the board moved between the exposures.",
    "fleet",
)
RIG_NOT_RIGID = flag(
    "rig_not_rigid",
    "The orientation scatters from trigger to trigger by more than four times what its corners explain.",
    "Put rig and board down for every picture, and check mounts and synchronisation; the scatter is in the "
    "uncertainty.",
    "fleet",
)
FEW_TRIGGERS = flag(
    "few_triggers",
    "Fewer than six triggers were used for a camera.",
    "Take ten or more, with the board near and far and tilted about both axes.",
    "fleet",
)

FINDINGS = declared(globals())
