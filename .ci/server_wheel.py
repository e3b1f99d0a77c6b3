"""Build the wheel of `stilb-server` from the rooms of a checkout: `python .ci/server_wheel.py [folder]`.

Version and requirements are those of `pyproject.toml`; one of the server's own would repeat them.
"""

import json
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("radiometry", "store", "worker", "service", "migrations", "verify")
MANUAL = "service/pages/manual"
"""Where the service finds its manual if there is no docs/ beside it."""


def list_pages(root: Path) -> list[Path]:
    """List the pages of the manual and their pictures."""
    return sorted([*root.glob("docs/*.md"), *root.glob("docs/pictures/*.*")])


def build(root: Path, folder: Path) -> Path:
    """Build the wheel into a folder, and return its path."""
    with tempfile.TemporaryDirectory() as name:
        stage = Path(name)
        for room in ROOMS:
            shutil.copytree(root / room, stage / room, ignore=shutil.ignore_patterns("__pycache__"))
            (stage / room / "py.typed").touch()
        for page in list_pages(root):
            target = stage / MANUAL / page.relative_to(root / "docs")
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(page, target)
        shutil.copyfile(root / "LICENSE", stage / "LICENSE")
        # a link to a page of the checkout leads nowhere from a package's page
        readme = re.sub(r"!?\[([^\]]*)\]\((?!https?:)[^)]*\)", r"\1", (root / "README.md").read_text("utf-8"))
        (stage / "README.md").write_text(readme, encoding="utf-8")
        (stage / "pyproject.toml").write_text(describe(root), encoding="utf-8")
        built = stage / "dist"
        uv = str(Path(sys.executable).with_name("uv"))
        subprocess.run([uv, "build", "-q", "--offline", "--wheel", "-o", built, stage], check=True)  # noqa: S603
        (wheel,) = built.glob("*.whl")
        folder.mkdir(parents=True, exist_ok=True)
        version = wheel.name.split("-")[1]
        bill = json.dumps(list_materials(root / "requirements.lock", version), indent=1)
        (folder / f"stilb_server-{version}.cdx.json").write_text(bill, encoding="utf-8")
        return Path(shutil.copy(wheel, folder))


def describe(root: Path) -> str:
    """Return the server's `pyproject.toml`."""
    stated = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
    project, groups, requires = (
        stated["project"],
        stated["dependency-groups"],
        stated["build-system"]["requires"],
    )
    tables = {
        "build-system": {"requires": requires, "build-backend": stated["build-system"]["build-backend"]},
        "project": {
            "name": "stilb-server",
            **{key: project[key] for key in ("version", "description", "requires-python")},
            "readme": "README.md",
            **{key: project[key] for key in ("license", "license-files")},
            "keywords": project["keywords"],
            "classifiers": project["classifiers"],
            "dependencies": groups["server"],
        },
        "[project.authors]": project["authors"][0],
        "project.scripts": {"stilb-server": "service.command:main", "stilb-verify": "verify.__main__:main"},
        "tool.uv.build-backend": {"module-name": list(ROOMS), "module-root": "", "namespace": True},
    }
    # a JSON string, number, boolean or list of strings is one of TOML too
    return "\n".join(
        f"[{table}]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in rows.items())
        for table, rows in tables.items()
    )


def list_materials(lock: Path, version: str) -> dict[str, object]:
    """Return the CycloneDX bill of materials of the packages that the lock pins, with their hashes."""
    pinned = re.findall(
        r"^([\w.-]+)(?:\[.*?\])?==([^\s;]+)(.*?)(?=^\S|\Z)", lock.read_text(), re.MULTILINE | re.DOTALL
    )
    components = [
        {
            "type": "library",
            "name": name,
            "version": pin,
            "purl": f"pkg:pypi/{name}@{pin}",
            "bom-ref": f"pkg:pypi/{name}@{pin}",
            # of all files of this version, of which an installation takes one
            "properties": [
                {"name": "lock:sha256", "value": each} for each in re.findall(r"sha256:(\w+)", rest)
            ],
        }
        for name, pin, rest in pinned
    ]
    product = {"type": "application", "name": "stilb-server", "version": version}
    head = {"bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1}
    return head | {"metadata": {"component": product}, "components": components}


if __name__ == "__main__":
    sys.stdout.write(f"{build(ROOT, Path(*sys.argv[1:2] or ['dist']))}\n")
