"""File names as every file system takes them, and as a shell does."""

import os
import re
import shlex
import subprocess
from pathlib import Path

_FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f\x7f]')
# Devices of Windows, with any extension.
_RESERVED = re.compile(r"(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])( *\..*)?", re.IGNORECASE)
# Of the 255 that a name may have, the rest is for what is added to it.
_MOST_BYTES = 180


def quote(path: Path) -> str:
    """Return a path as it is typed in a command."""
    return (subprocess.list2cmdline if os.name == "nt" else shlex.join)([str(path)])


def plain_stem(filename: str) -> str:
    """Return the name of a file without its extension, in characters that Windows takes as well."""
    name = _FORBIDDEN.sub("_", filename)
    before, dot, _ = name.rpartition(".")
    cut = (before if dot and before else name).encode("utf-8", "replace")[:_MOST_BYTES]
    stem = cut.decode("utf-8", "ignore").strip(". ")
    return f"_{stem}" if not stem or _RESERVED.fullmatch(stem) else stem
