"""The verdicts on a luminance campaign, for tests of their reasons."""

import math

from radiometry.luminance.rows import Params
from radiometry.luminance.verdicts import judge
from tests.radiometry.evidence import READINGS, K, light, taken

PARAMS = Params()


def verdicts(rows, readings=READINGS, params=PARAMS):
    return judge([taken(row) for row in rows], rows, readings, params)


def codes(rows, frame, readings=READINGS):
    return [reason.code for reason in verdicts(rows, readings)[frame].reasons]


def only(rows, frame, readings=READINGS):
    """The one reason of this frame, when no other frame has any."""
    found = verdicts(rows, readings)
    assert [name for name, verdict in found.items() if verdict.reasons] == [frame]
    (reason,) = found[frame].reasons
    assert found[frame].outcome == reason.outcome
    return reason


def odd(signal_dn, **changes):
    """A frame of which the exposure fits the signal, so that nothing else can be said of it."""
    f_number = math.sqrt(K * 0.1 * 3200 * 5.0 / signal_dn)
    return light("middle", f_number, name="odd", signal_dn=signal_dn, **changes)
