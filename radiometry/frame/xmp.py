"""XMP sidecars in the namespace of Pix4D, in which multispectral cameras state their lenses."""

import re
from collections.abc import Mapping, Sequence
from typing import Final
from xml.sax.saxutils import escape

FORBIDDEN_IN_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_NAMESPACES: Final = {
    "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "dc": "http://purl.org/dc/elements/1.1/",
    "Camera": "http://pix4d.com/camera/1.0/",
}


def write_sidecar(properties: Mapping[str, str | Sequence[float]], *, description: str) -> str:
    """Write a sidecar, which is also the packet that an image holds.

    Parameters
    ----------
    properties : mapping of str to str or sequence of float
        Values by their names in the namespace; a sequence of numbers becomes an ordered array.
    description : str
        Text of dc:description.
    """
    names = "".join(f' xmlns:{prefix}="{address}"' for prefix, address in _NAMESPACES.items())
    elements = "".join(
        f"   <Camera:{name}>{_write_value(value)}</Camera:{name}>\n" for name, value in properties.items()
    )
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n'
        f'<x:xmpmeta xmlns:x="adobe:ns:meta/">\n <rdf:RDF{names}>\n  <rdf:Description rdf:about="">\n'
        f'   <dc:description><rdf:Alt><rdf:li xml:lang="x-default">{escape(description)}</rdf:li></rdf:Alt>'
        f"</dc:description>\n{elements}"
        '  </rdf:Description>\n </rdf:RDF>\n</x:xmpmeta>\n<?xpacket end="w"?>\n'
    )


def _write_value(value: str | Sequence[float]) -> str:
    if isinstance(value, str):
        return escape(value)
    return f"<rdf:Seq>{''.join(f'<rdf:li>{number!r}</rdf:li>' for number in value)}</rdf:Seq>"
