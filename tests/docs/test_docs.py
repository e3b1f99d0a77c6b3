"""The documentation names what exists, all of it and nothing else."""

import re
import subprocess
from pathlib import Path

import pytest
from pydantic import SecretStr

from radiometry.methods.findings import FINDINGS
from service.launch.folder import Exit
from service.pages.documentation import expand_entries
from store.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
# without the front page of the site: that of the repository is the README
PAGES = [
    *(
        ROOT / name
        for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "CODE_OF_CONDUCT.md")
    ),
    *(page for page in sorted(DOCS.rglob("*.md")) if page != DOCS / "index.md"),
]
# Codes that are written where they are raised, and not in the registry: those of the client.
WRITTEN = {
    "stilb": re.compile(r'\bcode="(\w+)"(?: if \w+ else "(\w+)")?|^UNREACHABLE = "(\w+)"', re.MULTILINE)
}


def read(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def prose(page: Path) -> str:
    """Without fenced and indented code, where a # or a bracket is something else."""
    return re.sub(r"^```.*?^```|^    .*?$", "", read(page), flags=re.MULTILINE | re.DOTALL)


def headings(text: str, level: int) -> list[str]:
    return re.findall(rf"^#{{{level}}} (.+)$", text, re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """As a reader's page makes them of headings."""
    titles = [title for level in range(1, 5) for title in headings(prose(page), level)]
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


def written_codes() -> set[str]:
    found: set[str] = set()
    for room, pattern in WRITTEN.items():
        codes = {
            code
            for path in sorted((ROOT / room).rglob("*.py"))
            for match in pattern.finditer(read(path))
            for code in match.groups()
            if code
        }
        assert codes, room
        found |= codes
    return found


def found_at(*places: str) -> set[str]:
    return {code for code, finding in FINDINGS.items() if {*places} & {*finding.where}}


def entries(name: str, level: int) -> list[str]:
    return sorted(headings(expand_entries(prose(DOCS / f"{name}.md"), name), level))


def test_every_code_has_its_heading_and_every_heading_its_code():
    assert entries("errors", 2) == sorted({*found_at("file", "request", "job"), *written_codes()})
    assert entries("flags", 2) == sorted(found_at("frame", "campaign", "calibration", "measurement", "fleet"))
    assert entries("on-site", 3) == sorted(found_at("verdict"))
    assert entries("certificate", 2) == sorted({*found_at("certificate")})


def test_a_code_is_explained_under_its_heading_and_nothing_else_is_touched():
    text = "# clipped\n\n## Of people\n\n### too_dark\nBy hand.\n"
    means = "\n".join(
        f"{FINDINGS[code].sentence}\n{FINDINGS[code].remedy}" for code in ("clipped", "too_dark")
    )
    expanded = expand_entries(text, "on-site")
    assert {*means.splitlines()} <= {
        line.removeprefix("Fail. ").removeprefix("Warn. ") for line in expanded.splitlines()
    }
    assert "## Of people\n\n### too_dark\n" in expanded
    assert expanded.endswith("\n\nBy hand.\n")
    assert expand_entries(text, "luminance") == text


def test_every_setting_has_its_heading_and_every_heading_its_setting():
    text = prose(DOCS / "settings.md")
    assert sorted(headings(text, 2)) == sorted(f"STILB_{name.upper()}" for name in Settings.model_fields)


def test_every_default_is_told():
    for name, setting in Settings.model_fields.items():
        _, _, after = read(DOCS / "settings.md").partition(f"\n## STILB_{name.upper()}\n")
        told = after.partition("\n## ")[0]
        if setting.default in ("", SecretStr("")):
            assert "Empty" in told, name
        else:
            default = _plain(setting.default)
            assert f"Default `{default}`" in told or f"Default {default} " in told, name


def _plain(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def test_every_exit_code_is_told():
    rows = re.findall(r"^\| (\d+) \| .+ \|$", read(DOCS / "operations.md"), re.MULTILINE)
    assert sorted(map(int, rows)) == sorted(Exit)


TARGETS = set(re.findall(r"^([a-z]+):", read(ROOT / "Makefile"), re.MULTILINE))


@pytest.mark.parametrize(
    ("target", "needs"), [("export", "TO"), ("verify", "CERT"), ("verify-backup", "FROM")]
)
def test_a_target_says_what_it_needs(target, needs):
    made = subprocess.run(
        ["make", "-C", ROOT, "-o", ".venv/run", target], check=False, capture_output=True, text=True
    )
    assert f"make {target} needs {needs};" in made.stderr


NAMED_SETTINGS = {f"STILB_{name.upper()}" for name in Settings.model_fields}
for _path in (ROOT / "stilb" / "commands").glob("*.py"):
    NAMED_SETTINGS |= set(re.findall(r'envvar="(\w+)"', read(_path)))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_target_setting_and_file_that_a_page_names_exists(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.exists(), target
        assert there.is_relative_to(ROOT), target
        assert not anchor or anchor in anchors(there), target
    text = read(page)
    assert set(re.findall(r"(?:^|`|[A-Z]+=\d )make ([a-z]+)", text, re.MULTILINE)) <= TARGETS
    for named in re.findall(r"\bSTILB_[A-Z_*]+", text):
        if named.endswith("*"):
            assert any(setting.startswith(named[:-1]) for setting in NAMED_SETTINGS), named
        else:
            assert named.removesuffix("_FILE") in NAMED_SETTINGS
    for path in set(re.findall(r"`([\w./-]+/[\w.-]+\.(?:py|md|yml|toml|lock|svg))`", text)):
        assert (ROOT / path).exists(), path


def test_every_file_that_a_decision_lists_exists():
    for page in (DOCS / "adr").glob("*.md"):
        for room, names in re.findall(r"^    (\w+)/(\w+\.py(?:, \w+\.py)*)  ", read(page), re.MULTILINE):
            for name in names.split(", "):
                assert (ROOT / room / name).exists(), (page, name)


@pytest.mark.parametrize("page", [ROOT / "README.md", DOCS / "pages.md", DOCS / "first-evening.md"])
def test_pictures_exist_and_are_small(page):
    names = re.findall(r"!\[[^]]+\]\(([^)]+)\)", read(page))
    assert names
    for name in names:
        assert (page.parent / name).stat().st_size < 100_000
        assert (page.parent / name).read_bytes()[8:12] == b"WEBP"


def test_every_page_can_be_reached_from_the_readme():
    reached, ahead = set(), [ROOT / "README.md"]
    while ahead:
        page = ahead.pop()
        reached.add(page)
        for target in re.findall(r"\]\(([^)#\s]+)", prose(page)):
            there = (page.parent / target).resolve()
            found = [there] if there.suffix == ".md" else [*there.glob("*.md")] if there.is_dir() else []
            ahead += [each for each in found if each not in reached]
    assert set(PAGES) <= reached


def test_decisions_are_numbered_without_a_gap():
    pages = sorted((DOCS / "adr").glob("*.md"))
    for number, page in enumerate(pages, start=1):
        assert page.name.startswith(f"{number:04}-")
        assert headings(read(page), 1)[0].startswith(f"{number}. ")
        replaced = re.search(r"^Replaced by \[", read(page), re.MULTILINE)
        assert (
            headings(read(page), 2) == []
            if replaced
            else ["The question", "The decision", "The alternatives", "What follows"]
        )
