"""Exit codes of the commands, and the next step after an error. docs/command-line.md lists the codes."""

from enum import IntEnum

from stilb.problem import Problem, Unclear


class Exit(IntEnum):
    """Exit codes for scripts. They are stable."""

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
    "unauthenticated": "Sign in with a valid key: stilb login URL",
    "scope_missing": "Ask an administrator of your organisation for a key with that scope, then: stilb "
    "login URL",
    "no_calibration_in_force": "Publish a version (stilb publish), or ask for another time with --at.",
    "regions_differ": "Measure both with the same --region or --grid, or add --other-region.",
    "campaign_incomplete": "Add the missing items, which stilb campaign show CAMPAIGN lists, then run "
    "this again.",
    "unreachable": "Check the address and the network (stilb doctor), then run this again: it continues.",
    "not_sent": "Check the address: it begins with http:// or https:// (stilb login URL).",
    "unexpected_answer": "Check the address: stilb login URL",
    "export_damaged": "Run this again: only missing files are downloaded.",
}


def exit_of(error: BaseException) -> Exit:
    """Return the exit code of an error that ends a command."""
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
    """Return what to do about an error, or "" if its message says so."""
    match error:
        case Problem() if error.code in _STEPS:
            return _STEPS[error.code]
        case Problem() if error.status >= 500:
            return "Try again later. If it persists, send the operator the output of stilb doctor."
        case TimeoutError():
            return "The service continues. stilb jobs shows the progress."
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
