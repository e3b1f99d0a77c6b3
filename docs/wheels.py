"""Write the table of the server's large packages into docs/install.md: `python docs/wheels.py`."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "install.md"
LARGE_BYTES = 5e6
REASONS = {
    "cryptography": "signs and verifies receipts (Ed25519)",
    "imagecodecs": "decodes lossless JPEG, LZW, PackBits and PNG; most of it is other codecs",
    "numpy": "arrays, of every computation",
    "obstore": "files in an S3 bucket; needed with `STILB_BLOBS_URL=s3://...` only",
    "opencv-python-headless": "boards, panels, solved cameras, resampled maps; half is bundled libraries",
    "pillow": "previews and pictures of maps",
    "psycopg-binary": "PostgreSQL, with its client library",
    "pydantic-core": "checks requests and writes answers",
    "rawpy": "LibRaw, for raw files that are not plain TIFF",
    "scipy": "optimisation, splines, linear algebra and special functions, of the fits",
    "sqlalchemy": "tables and queries of both databases",
    "typst": "typesets certificates as PDF/A; one program, with its fonts",
    "uvloop": "the event loop of the service",
}


def find_needs(first: list[str]) -> dict[str, metadata.Distribution]:
    """Return the installed distributions that these requirements lead to, by name."""
    found: dict[str, metadata.Distribution] = {}
    ahead = [(Requirement(line), frozenset[str]()) for line in first]
    seen = set()
    while ahead:
        need, extras = ahead.pop()
        name = canonicalize_name(need.name)
        if (name, frozenset(need.extras)) in seen:
            continue
        if need.marker and not any(need.marker.evaluate({"extra": extra}) for extra in {"", *extras}):
            continue
        seen.add((name, frozenset(need.extras)))
        found[name] = metadata.distribution(name)
        ahead += [(Requirement(line), frozenset(need.extras)) for line in found[name].requires or ()]
    return found


def measure(distribution: metadata.Distribution) -> int:
    """Return the size of its installed files [bytes], without bytecode."""
    paths = (Path(distribution.locate_file(file)) for file in distribution.files or ())
    return sum(path.stat().st_size for path in paths if path.suffix != ".pyc" and path.is_file())


def render() -> str:
    """Return the table: what is large, its installed size, and what it is for."""
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    needs = find_needs(stated["dependency-groups"]["server"])
    sizes = {name: measure(found) for name, found in needs.items()}
    large = sorted((name for name in sizes if sizes[name] >= LARGE_BYTES), key=lambda name: -sizes[name])
    rows = [f"| {name} | {sizes[name] / 1e6:.0f} | {REASONS[name]} |" for name in large]
    rest = sum(sizes.values()) - sum(sizes[name] for name in large)
    rows.append(f"| {len(sizes) - len(large)} others | {rest / 1e6:.0f} | none above 5 MB |")
    total = f"| together | {sum(sizes.values()) / 1e6:.0f} | without bytecode |"
    return "\n".join(["| package | MB | what it is for |", "|---|---|---|", *rows, total])


def place(page: str) -> str:
    """Return the page with the table between its marks."""
    return re.sub(r"(?s)(<!-- wheels -->\n).*?(\n<!-- end -->)", lambda m: m[1] + render() + m[2], page)


if __name__ == "__main__":
    PAGE.write_text(place(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
