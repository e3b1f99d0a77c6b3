"""Check that the disk accepts writes: the parts are not at fault for what a full disk does to them."""

import errno
import os
from contextlib import suppress
from pathlib import Path

_FULL = {errno.ENOSPC, errno.EDQUOT}
_ROOM_BYTES = 1 << 20


def has_room(folder: Path) -> bool:
    """Return whether a megabyte can be written here, which a disk's own figures do not tell of a quota."""
    probe = folder / "room"
    try:
        fd = os.open(probe, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        try:
            written = os.write(fd, bytes(_ROOM_BYTES))
            os.fsync(fd)
        finally:
            os.close(fd)
    except OSError as error:
        return error.errno not in _FULL
    else:
        return written == _ROOM_BYTES
    finally:
        with suppress(OSError):
            probe.unlink()
