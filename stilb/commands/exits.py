"""How a command ends: its exit code, and what to do next. docs/command-line.md lists the codes."""

from enum import IntEnum

from stilb.problem import Problem, Unclear


class Exit(IntEnum):
    """What a script can tell from a command's end. Stable."""

    DONE = 0
    FINDINGS = 1
    USAGE = 2
    KEY = 3
    NOT_FOUND = 4
    REFUSED = 5
    NETWORK = 6
    SERVER = 7
    STILL_AT_WORK = 8
    BROKEN = 70
    INTERRUPTED = 130


_STEPS = {
    "unauthenticated": "Sign in with a key that holds: stilb login URL",
    "scope_missing": "Ask an admin of your organisation for a key with that scope, then: stilb login URL",
    "no_calibration_in_force": "Publish a version (stilb publish), or ask for another time with --at.",
    "campaign_incomplete": "Add what is missing; stilb campaign show CAMPAIGN lists it. Then the same again.",
    "unreachable": "Check the address and the network (stilb doctor); then the same command again goes on.",
    "not_sent": "Check the address: it begins with http:// or https:// (stilb login URL).",
    "unexpected_answer": "Check the address: stilb login URL",
    "export_damaged": "The same command again fetches only what is missing.",
}


def exit_of(error: BaseException) -> Exit:
    """The code for an error that ends a command."""
    match error:
        case Problem():
            return _exit_of_status(error.status)
        case TimeoutError():
            return Exit.STILL_AT_WORK
        case Unclear() | OSError():
            return Exit.USAGE
        case _:
            return Exit.BROKEN


def next_step(error: BaseException) -> str:
    """What to do about it, where the message does not say so itself."""
    match error:
        case Problem() if error.code in _STEPS:
            return _STEPS[error.code]
        case Problem() if error.status >= 500:
            return "Try again in a while; if it stays, tell the operator what stilb doctor says."
        case TimeoutError():
            return "It goes on by itself: stilb jobs shows how far it is."
        case _:
            return ""


def _exit_of_status(status: int) -> Exit:
    match status:
        case 401 | 403:
            return Exit.KEY
        case 404:
            return Exit.NOT_FOUND
        case status if status >= 500:
            return Exit.SERVER
        case status if status >= 400:
            return Exit.REFUSED
        case _:  # no answer, or one that did not come whole
            return Exit.NETWORK
