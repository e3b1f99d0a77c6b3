"""Dark frames of a stack that saw light."""

from radiometry.lit import TAKE_AGAIN, inspect_black
from radiometry.noise.stacks import Stack
from radiometry.verdicts import Reason, ReasonCode

ABOVE_OTHERS_SHARE = 0.001
"""Of the span from black to white, above the darkest frame of the same ISO and time: black levels wander by a
tenth of this."""


def find_lit(stack: Stack) -> dict[str, Reason]:
    """Say which frames of a dark stack saw light, by name.

    What is warm grows with time, in all frames of one time alike: that is a noise campaign's very subject, so
    only what no sensor reaches by itself counts against the stated black level.
    """
    span = max(stack.white_level_dn - stack.black_level_dn, 1.0)
    darkest = min(stack.frame_means_dn)
    found = {}
    for frame, mean in zip(stack.frames, stack.frame_means_dn, strict=True):
        reason = inspect_black(mean, black_level_dn=stack.black_level_dn, white_level_dn=stack.white_level_dn)
        if mean - darkest > ABOVE_OTHERS_SHARE * span:
            detail = (
                f"Its mean is {mean - darkest:.3g} DN above that of a dark frame of the same ISO and time: "
                f"this one saw light. {TAKE_AGAIN}"
            )
            reason = Reason(code=ReasonCode.DARK_NOT_DARK, outcome="fail", detail=detail)
        if reason is not None and reason.outcome == "fail":
            found[frame] = reason
    return found
