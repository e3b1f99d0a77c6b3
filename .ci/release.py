"""Check that this commit can be released, and build what there is to distribute: `make release`.

Exit code 0 only if version, change log, tree, migrations and both distributions are right.
"""

import email
import hashlib
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import server_wheel

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, kw_only=True)
class Check:
    """One condition of a release."""

    name: str
    right: bool
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
    new = " ".join(sorted(found.keys() - released.keys()) if at_release else ())
    detail = f"cd migrations && sha256sum {new} >> released.sha256" if new else f"{len(released)} as released"
    return Check(name="migrations", right=not new, detail=detail)


def check_client(root: Path) -> Check:
    """Build the client's wheel into `dist/`, and check what it contains."""

    def build(folder: Path) -> Path:
        uv = str(Path(sys.executable).with_name("uv"))
        command = [uv, "build", "-q", "--offline", "--wheel", "-o", str(folder), str(root)]
        subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603
        return next(folder.glob("*.whl"))

    return _check_wheel(root, "stilb", ("stilb",), build)


def check_server(root: Path) -> Check:
    """Build the server's wheel into `dist/`, and check what it contains."""
    return _check_wheel(
        root, "stilb-server", server_wheel.ROOMS, lambda folder: server_wheel.build(root, folder)
    )


def _check_wheel(root: Path, name: str, rooms: Sequence[str], build: Callable[[Path], Path]) -> Check:
    with tempfile.TemporaryDirectory() as folder:
        try:
            wheel = build(Path(folder))
        except subprocess.CalledProcessError as failure:
            return Check(
                name=name, right=False, detail=f"uv build failed: {str(failure.stderr).strip()[-500:]}"
            )
        committed = _run_git(root, "ls-files", *rooms).splitlines()
        check = inspect_wheel(wheel, name=name, version=read_version(root), rooms=rooms, committed=committed)
        if check.right:
            (root / "dist").mkdir(exist_ok=True)
            for made in wheel.parent.glob("stilb*"):
                shutil.copy(made, root / "dist")
        return check


def inspect_wheel(
    wheel: Path, *, name: str, version: str, rooms: Sequence[str], committed: Sequence[str]
) -> Check:
    """Check that a wheel has this name and version, every committed file of its rooms, and no other room."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (path,) = (each for each in names if each.endswith(".dist-info/METADATA"))
        stated = email.message_from_bytes(archive.read(path))
    strangers = sorted({each.partition("/")[0] for each in names} - {*rooms, path.partition("/")[0]})
    missing = sorted(set(committed) - set(names))
    if (stated["Name"], stated["Version"]) != (name, version):
        fault = f"is {stated['Name']} {stated['Version']}"
    elif strangers:
        fault = f"also holds {', '.join(strangers)}"
    elif missing:
        fault = f"lacks {len(missing)} files, first: {missing[0]}"
    else:
        detail = f"dist/{wheel.name}, {len(names)} files, {wheel.stat().st_size / 1e6:.1f} MB"
        return Check(name=name, right=True, detail=detail)
    return Check(name=name, right=False, detail=f"{wheel.name} {fault}")


CHECKS: tuple[Callable[[Path], Check], ...] = (
    check_version,
    check_change_log,
    check_tree,
    check_migrations,
    check_client,
    check_server,
)


def _run_git(root: Path, *arguments: str) -> str:
    command = ["git", "-C", str(root), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip("\n")  # noqa: S603


def report(checks: Iterator[Check]) -> int:
    """Write a line per check, and return the exit code."""
    failed = 0
    for check in checks:
        failed += not check.right
        sys.stdout.write(f"{check.name:<14}{'ok' if check.right else 'FAILED':<8}{check.detail}\n")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(report(check(ROOT) for check in CHECKS))
