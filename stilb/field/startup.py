"""Commands that start at each login of this user: by systemd, on macOS by launchd, on Windows by Startup."""

import hashlib
import os
import plistlib
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

_UNIT = """[Unit]
Description=Send frames to stilb
StartLimitIntervalSec=0

[Service]
ExecStart={command}
Restart=on-failure
RestartSec=10
RestartPreventExitStatus=3

[Install]
WantedBy=default.target
"""
"""Exit code 3: the key is no longer valid, and waiting does not help."""
_SCRIPT = """@echo off\r
chcp 65001 >nul\r
:again\r
{command}\r
if errorlevel 4 goto later\r
if errorlevel 3 exit /b\r
if errorlevel 2 goto later\r
exit /b\r
:later\r
timeout /t 10 /nobreak >nul\r
goto again\r
"""


@dataclass(frozen=True, kw_only=True)
class StartupEntry:
    """One command, in the file that the system reads; ``enabled_by``: a link that systemd needs beside it."""

    path: Path
    content: bytes
    enabled_by: Path | None = None

    def write(self) -> None:
        """Have the command started at each login from now on."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_bytes(self.content)
        if self.enabled_by is not None:
            self.enabled_by.parent.mkdir(parents=True, exist_ok=True)
            self.enabled_by.unlink(missing_ok=True)
            self.enabled_by.symlink_to(self.path)

    def remove(self) -> bool:
        """Have it started no longer; False if it was not."""
        if self.enabled_by is not None:
            self.enabled_by.unlink(missing_ok=True)
        with suppress(FileNotFoundError):
            self.path.unlink()
            return True
        return False


def describe_entry(
    folder: Path,
    command: Sequence[str],
    *,
    platform: str = sys.platform,
    environment: Mapping[str, str] = os.environ,
) -> StartupEntry:
    """Return the entry of the one command that watches a folder; nothing is written yet."""
    name = f"stilb-push-{hashlib.sha256(os.fsencode(folder.resolve())).hexdigest()[:12]}"
    home = Path(environment.get("HOME") or Path.home())
    if platform == "darwin":
        said = {
            "Label": name,
            "ProgramArguments": [*command],
            "RunAtLoad": True,
            "KeepAlive": {"SuccessfulExit": False},
            "StandardErrorPath": str(home / "Library/Logs" / f"{name}.log"),
        }
        return StartupEntry(
            path=home / "Library/LaunchAgents" / f"{name}.plist", content=plistlib.dumps(said)
        )
    if platform == "win32":
        text = _SCRIPT.format(command=subprocess.list2cmdline(command).replace("%", "%%"))
        programs = Path(environment["APPDATA"], "Microsoft/Windows/Start Menu/Programs/Startup")
        return StartupEntry(path=programs / f"{name}.cmd", content=text.encode())
    units = Path(environment.get("XDG_CONFIG_HOME") or home / ".config", "systemd/user")
    # as systemd reads each word back
    escapes = str.maketrans({"\\": "\\\\", '"': '\\"', "%": "%%", "$": "$$"})
    text = _UNIT.format(command=" ".join(f'"{word.translate(escapes)}"' for word in command))
    unit = units / f"{name}.service"
    wants = units / "default.target.wants" / unit.name
    return StartupEntry(path=unit, content=text.encode(), enabled_by=wants)
