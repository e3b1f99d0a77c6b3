"""The system calls that are left to who is shut in, as a program for seccomp: all others fail with EPERM.

It computes, maps memory and talks on two descriptors that it holds. It opens nothing, starts nothing,
connects to nothing and signals nobody.
"""

import errno
import fcntl
import mmap
import signal
from typing import Final

Instruction = tuple[int, int, int, int]
"""Code, instructions to skip if true and if false, value: as the kernel's struct sock_filter."""

_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_ALLOW, _FAIL, _KILL = 0x7FFF0000, 0x00050000 | errno.EPERM, 0x80000000
_NUMBER, _ARCHITECTURE, _ARGUMENTS = 0, 4, 16  # places in struct seccomp_data
_X32_BIT: Final = 0x40000000
OWN_PID: Final = -1

# Linux's numbers; -1 where an architecture does without.
_ARCHITECTURES: Final = {"x86_64": (0, 0xC000003E), "aarch64": (1, 0xC00000B7)}
_FREE: Final = {
    "read": (0, 63),
    "readv": (19, 65),
    "recvmsg": (47, 212),  # by which the file comes
    "write": (1, 64),
    "writev": (20, 66),
    "poll": (7, -1),
    "ppoll": (271, 73),
    "close": (3, 57),
    "lseek": (8, 62),
    "fstat": (5, 80),
    "munmap": (11, 215),
    "mremap": (25, 216),
    "madvise": (28, 233),
    "brk": (12, 214),
    "futex": (202, 98),
    "rseq": (334, 293),  # by a thread that was started before and first runs now: the C library insists
    "rt_sigaction": (13, 134),
    "rt_sigprocmask": (14, 135),
    "rt_sigreturn": (15, 139),
    "sigaltstack": (131, 132),
    "restart_syscall": (219, 128),
    "clock_gettime": (228, 113),
    "gettimeofday": (96, 169),
    "getrandom": (318, 278),
    "getpid": (39, 172),
    "gettid": (186, 178),
    "getrusage": (98, 165),
    "sched_yield": (24, 124),
    "sched_getaffinity": (204, 123),
    "getcpu": (309, 168),
    "sysinfo": (99, 179),
    "exit": (60, 93),
    "exit_group": (231, 94),
}
_MMAP, _MPROTECT = (9, 222), (10, 226)
_FCNTL, _PRLIMIT, _TGKILL = (72, 25), (302, 261), (234, 131)
_SCHED_SETAFFINITY: Final = (203, 122)
_PROT_EXEC: Final = mmap.PROT_EXEC if hasattr(mmap, "PROT_EXEC") else 4
_FCNTL_COMMANDS: Final = (fcntl.F_GETFD, fcntl.F_GETFL, getattr(fcntl, "F_DUPFD_CLOEXEC", 1030))


def build_filter(machine: str) -> list[Instruction]:
    """Return the program, to be completed with OWN_PID; nothing for a machine not known here."""
    if machine not in _ARCHITECTURES:
        return []
    column, architecture = _ARCHITECTURES[machine]
    program: list[Instruction] = [
        (_LOAD, 0, 0, _ARCHITECTURE),
        (_EQUAL, 1, 0, architecture),
        (_RETURN, 0, 0, _KILL),
        (_LOAD, 0, 0, _NUMBER),
    ]
    if machine == "x86_64":
        program += [(_AT_LEAST, 0, 1, _X32_BIT), (_RETURN, 0, 0, _KILL)]
    for numbers in _FREE.values():
        if numbers[column] >= 0:
            program += [(_EQUAL, 0, 1, numbers[column]), (_RETURN, 0, 0, _ALLOW)]
    # no new code: what is executable was mapped before
    program += _when(_MMAP[column], 2, _without(_PROT_EXEC))
    program += _when(_MPROTECT[column], 2, _without(_PROT_EXEC))
    # no F_SETOWN or F_SETSIG, by which a descriptor signals another process
    program += _when(_FCNTL[column], 1, _one_of(*_FCNTL_COMMANDS))
    # 0 stands for the process, or the thread, that asks
    program += _when(_PRLIMIT[column], 0, _one_of(0))
    program += _when(_SCHED_SETAFFINITY[column], 0, _one_of(0))
    # abort() and nothing else: by any other signal a cell could look as if somebody had killed it
    abort = [(_EQUAL, 1, 0, OWN_PID), (_RETURN, 0, 0, _FAIL), *_argument(2), *_one_of(signal.SIGABRT)]
    program += _when(_TGKILL[column], 0, abort)
    return [*program, (_RETURN, 0, 0, _FAIL)]


def _when(number: int, argument: int, rules: list[Instruction]) -> list[Instruction]:
    body = [*_argument(argument), *rules]
    return [(_EQUAL, 0, len(body), number), *body]


def _argument(index: int) -> list[Instruction]:
    """Load the lower half of an argument, which is all that the kernel looks at in these calls."""
    return [(_LOAD, 0, 0, _ARGUMENTS + 8 * index)]


def _one_of(*values: int) -> list[Instruction]:
    allowed = [each for value in values for each in ((_EQUAL, 0, 1, int(value)), (_RETURN, 0, 0, _ALLOW))]
    return [*allowed, (_RETURN, 0, 0, _FAIL)]


def _without(bit: int) -> list[Instruction]:
    return [(_ANY_BIT, 0, 1, bit), (_RETURN, 0, 0, _FAIL), (_RETURN, 0, 0, _ALLOW)]
