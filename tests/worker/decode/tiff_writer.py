"""Writes TIFF structures byte by byte, in either order, right or wrong as a test wants them."""

import struct

SHORT, LONG, RATIONAL, UNDEFINED, ASCII, BYTE, SRATIONAL, DOUBLE = 3, 4, 5, 7, 2, 1, 10, 12
_FORMATS = {SHORT: "H", LONG: "I", RATIONAL: "II", SRATIONAL: "ii", DOUBLE: "d"}


class TiffWriter:
    """Append-only: data first, then the directories that point to it, then the first directory."""

    def __init__(self, order="<"):
        self.order = order
        self.content = bytearray((b"II*\0" if order == "<" else b"MM\0*") + b"\0\0\0\0")

    def append(self, data):
        """Returns the data's offset."""
        self.content += b"\0" * (len(self.content) % 2)
        offset = len(self.content)
        self.content += data
        return offset

    def directory(self, entries):
        """``entries`` : {tag: (kind, values)}; returns the directory's offset."""
        table = b""
        for tag, (kind, values) in sorted(entries.items()):
            data, count = self._encode(kind, values)
            if len(data) > 4:
                data = struct.pack(self.order + "I", self.append(data))
            table += struct.pack(self.order + "HHI", tag, kind, count) + data.ljust(4, b"\0")
        return self.append(struct.pack(self.order + "H", len(entries)) + table + b"\0\0\0\0")

    def finish(self, first_directory):
        struct.pack_into(self.order + "I", self.content, 4, first_directory)
        return bytes(self.content)

    def _encode(self, kind, values):
        if kind in (ASCII, UNDEFINED, BYTE):
            data = values.encode() + b"\0" if isinstance(values, str) else bytes(values)
            return data, len(data)
        values = values if isinstance(values, list) else [values]
        layout = self.order + _FORMATS[kind]
        pairs = [value if isinstance(value, tuple) else (value,) for value in values]
        return b"".join(struct.pack(layout, *pair) for pair in pairs), len(values)
