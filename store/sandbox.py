"""Restrictions that the kernel puts on a process before it reads what a stranger wrote."""

import ctypes
import errno
import fcntl
import mmap
import os
import platform
import resource
import signal
import sys
from collections.abc import Callable
from ctypes import c_uint8, c_uint16, c_uint32, c_uint64
from pathlib import Path
from typing import Final

from radiometry.records import Record

Instruction = tuple[int, int, int, int]  # code, jumps if true and false, value: the kernel's sock_filter

_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_ALLOW, _FAIL, _KILL = 0x7FFF0000, 0x00050000 | errno.EPERM, 0x80000000
_NUMBER, _ARCHITECTURE, _ARGUMENTS = 0, 4, 16  # places in struct seccomp_data
_X32_BIT: Final = 0x40000000
OWN_PID: Final = -1

# Linux's numbers; -1 where an architecture does without.
_ARCHITECTURES: Final = {"x86_64": (0, 0xC000003E), "aarch64": (1, 0xC00000B7)}
_FREE: Final = (
    {"read": (0, 63), "readv": (19, 65), "write": (1, 64), "writev": (20, 66), "lseek": (8, 62)}
    | {"recvmsg": (47, 212)}  # by which the file comes
    | {"poll": (7, -1), "ppoll": (271, 73), "close": (3, 57), "fstat": (5, 80), "futex": (202, 98)}
    | {"munmap": (11, 215), "mremap": (25, 216), "madvise": (28, 233), "brk": (12, 214)}
    | {"rseq": (334, 293)}  # by a thread that was started before and first runs now: the C library insists
    | {"rt_sigaction": (13, 134), "rt_sigprocmask": (14, 135), "rt_sigreturn": (15, 139)}
    | {"sigaltstack": (131, 132), "restart_syscall": (219, 128), "clock_gettime": (228, 113)}
    | {"gettimeofday": (96, 169), "getrandom": (318, 278), "getpid": (39, 172), "gettid": (186, 178)}
    | {"getrusage": (98, 165), "sched_yield": (24, 124), "sched_getaffinity": (204, 123)}
    | {"getcpu": (309, 168), "sysinfo": (99, 179), "exit": (60, 93), "exit_group": (231, 94)}
)
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


_PR_SET_PDEATHSIG, _PR_SET_NO_NEW_PRIVS = 1, 38
_SECCOMP: Final = {"x86_64": 317, "aarch64": 277}
_SET_MODE_FILTER, _OF_ALL_THREADS = 1, 1
_LANDLOCK_CREATE_RULESET, _LANDLOCK_RESTRICT_SELF = 444, 446
_LANDLOCK_VERSION = 1
# Rights over files that each version of Landlock knows of: 13 at first, then refer, truncate and ioctl.
_FILE_RIGHTS: Final = ((5, (1 << 16) - 1), (3, (1 << 15) - 1), (2, (1 << 14) - 1), (1, (1 << 13) - 1))
_NETWORK_SINCE, _SCOPES_SINCE = 4, 6
_TCP_RIGHTS = 0b11  # bind and connect
_SCOPES = 0b11  # abstract sockets and signals
OPEN_FILES: Final = 16
_LIMITS: Final = dict.fromkeys((resource.RLIMIT_CORE, resource.RLIMIT_FSIZE, resource.RLIMIT_NPROC), 0)


class Sandbox(Record):
    """Restrictions that hold. ``landlock`` : the version in use, 0 for none."""

    no_new_privs: bool
    landlock: int
    seccomp: bool

    @property
    def level(self) -> str:
        """`full`, `seccomp only`, `landlock only` or `none`."""
        if self.landlock and self.seccomp:
            return "full"
        return "seccomp only" if self.seccomp else "landlock only" if self.landlock else "none"

    @property
    def parts(self) -> dict[str, bool]:
        """Each part by the name that the operator reads."""
        return {
            "no_new_privs": self.no_new_privs,
            "landlock_files": self.landlock >= 1,
            "landlock_network": self.landlock >= _NETWORK_SINCE,
            "landlock_signals": self.landlock >= _SCOPES_SINCE,
            "seccomp": self.seccomp,
        }

    @property
    def lacks(self) -> tuple[str, ...]:
        """Return the needed parts that this kernel refuses; seccomp alone takes network and signals, too."""
        needed = ("no_new_privs", "landlock_files", "seccomp")
        return tuple(name for name in needed if not self.parts[name])


class _RulesetAttributes(ctypes.Structure):
    _fields_ = (("handled_access_fs", c_uint64), ("handled_access_net", c_uint64), ("scoped", c_uint64))


class _Instruction(ctypes.Structure):
    _fields_ = (("code", c_uint16), ("if_true", c_uint8), ("if_false", c_uint8), ("value", c_uint32))


class _Program(ctypes.Structure):
    _fields_ = (("length", c_uint16), ("instructions", ctypes.c_void_p))


class Restrictions:
    """Prepared before the fork, so that a cell spends little time on them."""

    def __init__(self) -> None:
        self._linux = sys.platform == "linux"
        self._libc = ctypes.CDLL(None, use_errno=True)
        version = (_LANDLOCK_CREATE_RULESET, None, 0, _LANDLOCK_VERSION)
        self._landlock: int = max(0, self._libc.syscall(*version)) if self._linux else 0
        self._filter = build_filter(platform.machine()) if self._linux else []

    def die_with_parent(self) -> None:
        """Only sound where the parent has one thread: the signal comes when the starting thread ends."""
        if self._linux:
            self._libc.prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)

    def shut_in(self, meanwhile: Callable[[], None] = lambda: None) -> Sandbox:
        """Lose privileges, paths, network, and after ``meanwhile`` all calls but of computing."""
        if not self._linux:
            return Sandbox(no_new_privs=False, landlock=0, seccomp=False)
        no_new_privs = self._libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
        landlock = self._landlock if self._restrict_files() else 0
        meanwhile()
        seccomp = self._restrict_calls()
        for limit, most in (*_LIMITS.items(), (resource.RLIMIT_NOFILE, OPEN_FILES)):
            resource.setrlimit(limit, (most, most))
        return Sandbox(no_new_privs=no_new_privs, landlock=landlock, seccomp=seccomp)

    def _restrict_calls(self) -> bool:
        if not self._filter:
            return False
        pid = os.getpid()
        array = (_Instruction * len(self._filter))(
            *(_Instruction(*each[:3], pid if each[3] == OWN_PID else each[3]) for each in self._filter)
        )
        program = _Program(len(array), ctypes.addressof(array))
        call = _SECCOMP[platform.machine()]
        done: int = self._libc.syscall(call, _SET_MODE_FILTER, _OF_ALL_THREADS, ctypes.byref(program))
        return done == 0

    def _restrict_files(self) -> bool:
        if not (version := self._landlock):
            return False
        rights = next(each for since, each in _FILE_RIGHTS if version >= since)
        wanted = _RulesetAttributes(
            handled_access_fs=rights,
            handled_access_net=_TCP_RIGHTS if version >= _NETWORK_SINCE else 0,
            scoped=_SCOPES if version >= _SCOPES_SINCE else 0,
        )
        # an older kernel refuses a structure with fields that it does not know
        size = 24 if version >= _SCOPES_SINCE else 16 if version >= _NETWORK_SINCE else 8
        ruleset: int = self._libc.syscall(_LANDLOCK_CREATE_RULESET, ctypes.byref(wanted), size, 0)
        if ruleset < 0:
            return False
        try:
            return bool(self._libc.syscall(_LANDLOCK_RESTRICT_SELF, ruleset, 0) == 0)
        finally:
            os.close(ruleset)


_ROOT: Final = Path(__file__).resolve().parents[1]
_KEPT: Final = ("PATH", "LANG", "PYTHONDONTWRITEBYTECODE")


def build_command(module: str) -> list[str]:
    return [sys.executable, "-s", "-P", "-m", module]


def build_environment() -> dict[str, str]:
    """Return an environment without settings and credentials. One thread per library."""
    kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
    return {**kept, "PYTHONPATH": str(_ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
