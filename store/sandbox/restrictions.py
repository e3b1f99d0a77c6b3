"""Restrictions that the kernel puts on a process before it reads what a stranger wrote.

They are of files, network, processes and signals.

Landlock and seccomp need no rights, so this works as any user and in plain containers. Both are asked by way
of ctypes: three system calls and a short program, where libraries bring more than is used.
"""

import ctypes
import os
import platform
import resource
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from store.sandbox.calls import OWN_PID, build_filter

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
_LIMITS: Final = (
    (resource.RLIMIT_CORE, 0),
    (resource.RLIMIT_FSIZE, 0),
    (resource.RLIMIT_NPROC, 0),
    (resource.RLIMIT_NOFILE, OPEN_FILES),
)


@dataclass(frozen=True, kw_only=True)
class Sandbox:
    """Restrictions that hold. ``landlock`` : the version in use, 0 for none."""

    no_new_privs: bool
    landlock: int
    seccomp: bool

    @property
    def level(self) -> str:
        """`full`, `seccomp only`, `landlock only` or `none`."""
        match bool(self.landlock), self.seccomp:
            case True, True:
                return "full"
            case False, True:
                return "seccomp only"
            case True, False:
                return "landlock only"
            case _:
                return "none"

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
    _fields_ = (
        ("handled_access_fs", ctypes.c_uint64),
        ("handled_access_net", ctypes.c_uint64),
        ("scoped", ctypes.c_uint64),
    )


class _Instruction(ctypes.Structure):
    _fields_ = (
        ("code", ctypes.c_uint16),
        ("if_true", ctypes.c_uint8),
        ("if_false", ctypes.c_uint8),
        ("value", ctypes.c_uint32),
    )


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_uint16), ("instructions", ctypes.c_void_p))


class Restrictions:
    """Prepared before the fork, so that a cell spends little time on them."""

    def __init__(self) -> None:
        self._linux = sys.platform == "linux"
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._landlock = self._ask_landlock() if self._linux else 0
        self._filter = build_filter(platform.machine()) if self._linux else []

    def die_with_parent(self) -> None:
        """Only sound where the parent has one thread: the signal comes when the starting thread ends."""
        if self._linux:
            self._libc.prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)

    def shut_in(self, meanwhile: Callable[[], None] = lambda: None) -> Sandbox:
        """Lose new privileges, every path, the network, and all system calls but those of computing.

        ``meanwhile`` : starts what needs one more system call. A thread that it starts loses all of it, too.
        """
        if not self._linux:
            return Sandbox(no_new_privs=False, landlock=0, seccomp=False)
        no_new_privs = self._libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
        landlock = self._landlock if self._restrict_files() else 0
        meanwhile()
        seccomp = self._restrict_calls()
        for limit, most in _LIMITS:
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

    def _ask_landlock(self) -> int:
        version: int = self._libc.syscall(_LANDLOCK_CREATE_RULESET, None, 0, _LANDLOCK_VERSION)
        return max(0, version)

    def _restrict_files(self) -> bool:
        version = self._landlock
        if not version:
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
