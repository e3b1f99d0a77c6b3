"""Check that this commit can be released, and build what there is to distribute: `make release`.

Exit code 0 only if version, change log, tree and every distribution that exists are right.
"""

import email
import hashlib
import re
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SERVER = "stilb-server"
"""The name that a distribution of the server is to have."""


@dataclass(frozen=True, kw_only=True)
class Check:
    """One condition of a release; ``right`` is None where there is nothing to check."""

    name: str
    right: bool | None
    detail: str


def read_version(root: Path) -> str:
    """Return the version that `pyproject.toml` states."""
    return str(tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"])


def check_version(root: Path) -> Check:
    """Check that the version is a final one, and that no tag has it on another commit."""
    version = read_version(root)
    if not re.fullmatch(r"\d+\.\d+\.\d+", version):
        return Check(name="version", right=False, detail=f"{version} is not MAJOR.MINOR.PATCH")
    tagged = _run_git(root, "tag", "--list", f"v{version}")
    if tagged and _run_git(root, "rev-parse", f"v{version}^{{commit}}") != _run_git(
        root, "rev-parse", "HEAD"
    ):
        detail = f"v{version} is the tag of another commit: raise `version` in pyproject.toml"
        return Check(name="version", right=False, detail=detail)
    return Check(name="version", right=True, detail=version)


def check_change_log(root: Path) -> Check:
    """Check that the newest release in the change log is this version, with a date and an entry."""
    version = read_version(root)
    text = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    sections = re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    released = [(title, body) for title, body in sections if title.strip() != "Unreleased"]
    if not released:
        return Check(name="change log", right=False, detail="CHANGELOG.md has no release")
    title, body = released[0]
    if not re.fullmatch(rf"\[?{re.escape(version)}\]? - \d{{4}}-\d{{2}}-\d{{2}}", title.strip()):
        detail = f"the newest release is {title!r}, not '{version} - <date>'"
        return Check(name="change log", right=False, detail=detail)
    entries = len(re.findall(r"^- ", body, re.MULTILINE))
    return Check(name="change log", right=entries > 0, detail=f"{title}: {entries} entries")


def check_tree(root: Path) -> Check:
    """Check that every file is committed."""
    changed = _run_git(root, "status", "--porcelain").splitlines()
    detail = f"{len(changed)} files are not committed, first: {changed[0][3:]}" if changed else "clean"
    return Check(name="tree", right=not changed, detail=detail)


def check_migrations(root: Path, *, at_release: bool = True) -> Check:
    """Check that no released migration has changed, and at a release that each has its hash in the list."""
    folder = root / "migrations"
    lines = (folder / "released.sha256").read_text(encoding="ascii").splitlines()
    released = {name: sha256 for sha256, name in map(str.split, lines)}
    found = {
        f"versions/{path.name}": hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted((folder / "versions").glob("[0-9]*.py"))
    }
    changed = [name for name, sha256 in released.items() if found.get(name) != sha256]
    if changed:
        detail = f"{', '.join(changed)} changed after the release: restore it, and add another migration"
        return Check(name="migrations", right=False, detail=detail)
    new = " ".join(found.keys() - released.keys() if at_release else ())
    detail = f"cd migrations && sha256sum {new} >> released.sha256" if new else f"{len(released)} as released"
    return Check(name="migrations", right=not new, detail=detail)


def check_wheel(root: Path) -> Check:
    """Build the client's wheel into `dist/`, and check its name, its version and what it contains."""
    version = read_version(root)
    with tempfile.TemporaryDirectory() as folder:
        command = ["uv", "build", "--quiet", "--offline", "--wheel", "--out-dir", folder, str(root)]
        built = subprocess.run(command, check=False, capture_output=True, text=True)  # noqa: S603
        wheels = sorted(Path(folder).glob("*.whl"))
        if built.returncode or len(wheels) != 1:
            return Check(name="wheel", right=False, detail=f"uv build failed: {built.stderr.strip()[-500:]}")
        check = inspect_wheel(wheels[0], version)
        if check.right:
            (root / "dist").mkdir(exist_ok=True)
            (root / "dist" / wheels[0].name).write_bytes(wheels[0].read_bytes())
        return check


def inspect_wheel(wheel: Path, version: str) -> Check:
    """Check that a wheel is the client of this version and holds nothing of the server."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (path,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        stated = email.message_from_bytes(archive.read(path))
    tops = {name.partition("/")[0] for name in names}
    strangers = sorted(tops - {"stilb", f"stilb-{version}.dist-info"})
    if (stated["Name"], stated["Version"]) != ("stilb", version):
        return Check(
            name="wheel", right=False, detail=f"{wheel.name} is {stated['Name']} {stated['Version']}"
        )
    if strangers:
        return Check(name="wheel", right=False, detail=f"{wheel.name} also holds {', '.join(strangers)}")
    return Check(name="wheel", right=True, detail=f"dist/{wheel.name}, {len(names)} files")


def check_server(root: Path) -> Check:
    """Check the server's distribution, as soon as a `pyproject.toml` declares one."""
    for path in sorted(root.glob("*/pyproject.toml")):
        project = tomllib.loads(path.read_text(encoding="utf-8")).get("project", {})
        if project.get("name") == SERVER:
            same = project.get("version") == read_version(root)
            detail = f"{path.parent.name}/ declares {SERVER} {project.get('version')}; it is not built here"
            return Check(name="server", right=same, detail=detail)
    detail = f"there is no {SERVER} distribution: the server is the image of the Dockerfile, or a checkout"
    return Check(name="server", right=None, detail=detail)


CHECKS: tuple[Callable[[Path], Check], ...] = (
    check_version,
    check_change_log,
    check_tree,
    check_migrations,
    check_wheel,
    check_server,
)


def _run_git(root: Path, *arguments: str) -> str:
    command = ["git", "-C", str(root), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip("\n")  # noqa: S603


def report(checks: Iterator[Check]) -> int:
    """Write a line per check, and return the exit code."""
    failed = 0
    words = {True: "ok", False: "FAILED", None: "absent"}
    for check in checks:
        failed += check.right is False
        sys.stdout.write(f"{check.name:<12}{words[check.right]:<8}{check.detail}\n")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(report(check(ROOT) for check in CHECKS))
