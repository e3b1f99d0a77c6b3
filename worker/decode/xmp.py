"""The XMP packet of a TIFF, read from hostile bytes.

The one XML of this house, so no library for it: expat without its one dangerous part, the document type. No
DOCTYPE means no entity can be declared, so nothing can be expanded or fetched; size, depth and number of
elements are bounded too. What cannot be read is no packet, never an error.
"""

from collections.abc import Mapping
from typing import Final
from xml.parsers import expat

from radiometry.findings import InputRejected
from worker.decode import limits, tags
from worker.decode.tiff import Directory

MAX_BYTES: Final = 256 << 10
MAX_DEPTH: Final = 16
MAX_PROPERTIES: Final = 2_000
MAX_TEXT_BYTES: Final = 128 << 10
_MOST_TERMS: Final = 64
_LARGEST: Final = 1e15
_RDF: Final = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
# By what their addresses hold: firmware writes them with and without version and closing slash.
_FAMILIES: Final = (
    ("micasense.com/MicaSense", "micasense"),
    ("micasense.com/DLS", "dls"),
    ("pix4d.com", "camera"),
    ("dji.com/drone-dji", "drone-dji"),
)
_CONTAINERS: Final = frozenset(f"{_RDF} {name}" for name in ("RDF", "Description", "Seq", "Bag", "Alt"))
_ITEM: Final = f"{_RDF} li"

Properties = Mapping[str, tuple[str, ...]]


class _RefusedError(Exception):
    """The packet is beyond the bounds, or declares a document type."""


class _Collector:
    """Gathers the properties of the known families: an attribute, an element's text, or its list's items."""

    def __init__(self) -> None:
        self.found: dict[str, list[str]] = {}
        self._depth = 0
        self._count = 0
        self._size = 0
        self._property: str | None = None
        self._opened_at = 0
        self._text: list[str] = []
        self._items: list[str] = []

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._count += 1 + len(attributes)
        if self._depth > MAX_DEPTH or self._count > MAX_PROPERTIES:
            raise _RefusedError
        if self._property is None and name not in _CONTAINERS:
            self._property, self._opened_at = _key(name), self._depth
            self._text, self._items = [], []
        elif name == _ITEM:
            self._text = []
        for attribute, value in attributes.items():
            if (key := _key(attribute)) and self._property is None:
                self._add(key, [value])

    def end(self, name: str) -> None:
        if name == _ITEM and self._property is not None:
            self._items.append("".join(self._text))
        elif self._property is not None and self._depth == self._opened_at:
            self._add(self._property, self._items or ["".join(self._text)])
            self._property = None
        self._depth -= 1

    def text(self, text: str) -> None:
        if self._property is not None:
            self._size += len(text)
            if self._size > MAX_TEXT_BYTES:
                raise _RefusedError
            self._text.append(text)

    def _add(self, key: str, values: list[str]) -> None:
        self.found.setdefault(key, [value.strip() for value in values])


def _key(name: str) -> str | None:
    """`family:Name` of a known family."""
    address, _, local = name.rpartition(" ")
    return next((f"{family}:{local}" for part, family in _FAMILIES if part in address), None)


def read_xmp(main: Directory) -> Properties:
    """The packet's properties of the known families; empty where there is no packet to read."""
    try:
        packet = main.raw(tags.XMP, at_most=MAX_BYTES)
    except InputRejected:
        return {}
    return parse_xmp(packet)


def parse_xmp(packet: bytes) -> Properties:
    packet = packet.strip(b"\0 \r\n\t")
    if not packet or len(packet) > MAX_BYTES:
        return {}
    collector = _Collector()
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartDoctypeDeclHandler = _refuse
    parser.EntityDeclHandler = _refuse
    parser.StartElementHandler = collector.start
    parser.EndElementHandler = collector.end
    parser.CharacterDataHandler = collector.text
    try:
        parser.Parse(packet, True)
    except (expat.ExpatError, _RefusedError, ValueError, LookupError):
        return {}
    return {key: tuple(values) for key, values in collector.found.items()}


def _refuse(*_declaration: object) -> None:
    raise _RefusedError


class Xmp:
    """The packet's values as texts and numbers."""

    def __init__(self, found: Properties) -> None:
        self._found = found

    def text(self, key: str) -> str | None:
        values = self._found.get(key, ("",))
        printable = "".join(letter if letter.isprintable() else " " for letter in values[0])
        return printable.strip()[: limits.MAX_TEXT].strip() or None

    def whole(self, key: str) -> str | None:
        """A text of any length, as it is."""
        return self._found[key][0] if key in self._found else None

    def numbers(self, key: str) -> tuple[float, ...]:
        """All numbers of a property, a list or between commas; one that is none makes all nothing."""
        words = [word for value in self._found.get(key, ()) for word in value.split(",")]
        try:
            numbers = tuple(float(word) for word in words[: _MOST_TERMS + 1])
        except ValueError:
            return ()
        sane = len(numbers) <= _MOST_TERMS and all(abs(number) < _LARGEST for number in numbers)
        return numbers if sane else ()

    def require(self, key: str, count: int | None = None) -> tuple[tuple[float, ...], str]:
        """All numbers of a property, and "" or what is wrong with it; ``count`` : how many there must be."""
        numbers, name = self.numbers(key), key.partition(":")[2]
        if numbers and (count is None or len(numbers) == count):
            return numbers, ""
        if numbers:
            return (), f"{name} has {len(numbers)} numbers, not {count}"
        if key not in self._found:
            return (), f"{name} is missing"
        words = sum(value.count(",") + 1 for value in self._found[key])
        if words > _MOST_TERMS:
            return (), f"{name} has {words} numbers, more than {_MOST_TERMS}"
        return (), f"{name} is not a list of numbers below {_LARGEST:g}"

    def number(self, key: str) -> float | None:
        numbers = self.numbers(key)
        return numbers[0] if len(numbers) == 1 else None

    def first_number(self, *keys: str) -> float | None:
        """Return the number of a property that firmware writes in one of several families."""
        return next((found for key in keys if (found := self.number(key)) is not None), None)

    def index(self, key: str) -> int | None:
        number = self.number(key)
        return int(number) if number is not None and number == int(number) and 0 <= number < 1000 else None
