"""Clients made by generators do what docs/generated-clients.md shows, word for word, on a running service."""

import hashlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from tests.support.campaigns import ISOS, K_TRUE
from tests.support.compose import ROOT
from tests.support.fieldwork import write_field_folder
from tests.support.printed import NO_CURL

PAGE = (ROOT / "docs" / "generated-clients.md").read_text(encoding="utf-8")
LOCKS = Path(__file__).parent / "clients"
TOOLS = ROOT / "build" / "clients"
OUT_OF_REACH = re.compile(
    r"error sending request|Could not connect|dns error|operation timed out|ENOTFOUND|EAI_AGAIN"
    r"|ECONNREFUSED|ECONNRESET|ENETUNREACH|ETIMEDOUT|ERR_SOCKET_TIMEOUT|network request to .* failed"
)
LINT = """
import { createConfig, lint } from "@redocly/openapi-core";
const found = await lint({ ref: "openapi.json", config: await createConfig({ extends: ["recommended"] }) });
const errors = found.filter(({ severity }) => severity === "error");
console.log(JSON.stringify(errors.map(({ ruleId, message }) => [ruleId, message])));
"""
OF_PYTHON = {"yaml": "config.yaml", "python": "calibrate.py"}
OF_TYPESCRIPT = {"json": "tsconfig.json", "ts": "calibrate.ts"}

pytestmark = pytest.mark.skipif(shutil.which("curl") is None, reason=NO_CURL)


def install(lock, *commands):
    """A folder with the tools of a lock file, kept for later runs; skips without their registry."""
    folder = TOOLS / f"{lock.stem}-{hashlib.sha256(lock.read_bytes()).hexdigest()[:16]}"
    if not (folder / "complete").exists():
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(lock.parent, folder)
        for command in commands:
            done = subprocess.run(
                command, check=False, cwd=folder, capture_output=True, text=True, timeout=600
            )
            if done.returncode and OUT_OF_REACH.search(done.stderr):
                pytest.skip(f"{command[0]} does not reach its registry: {done.stderr[-300:]}")
            assert done.returncode == 0, done.stderr
        (folder / "complete").touch()
    return folder


def run_page(language, files, url, folder, *tools):
    """Write the files of the page's part and run its commands, without `npx`, which only finds a tool."""
    part = PAGE.partition(f"\n## {language}\n")[2].partition("\n## ")[0]
    blocks = dict(re.findall(r"^```(\w+)\n(.*?)^```", part, re.MULTILINE | re.DOTALL))
    assert blocks.keys() == {"sh", *files}
    write_field_folder(folder, isos=ISOS[:1])
    for kind, name in files.items():
        (folder / name).write_text(blocks[kind], encoding="utf-8")
    path = os.pathsep.join([*map(str, tools), str(Path(sys.executable).parent), os.environ["PATH"]])
    return subprocess.run(
        ["sh", "-euc", blocks["sh"].replace("npx ", "")],
        check=False,
        cwd=folder,
        env=os.environ | url | {"PATH": path},
        capture_output=True,
        text=True,
        timeout=250,
    )


def run_client(deployment, language, files, folder, *tools):
    with deployment.team() as team:
        done = run_page(language, files, {"STILB": team.url, "KEY": team.key}, folder, *tools)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert "warning" not in (done.stdout + done.stderr).lower()
    rows = [line.split() for line in done.stdout.splitlines() if line.startswith("luminance_k ")]
    assert [float(row[1]) for row in rows] == [ISOS[0]]
    assert all(abs(float(k) - K_TRUE) <= 3 * float(u) for _, _, k, u, _ in rows)


def test_client_of_openapi_python_client_calibrates(embedded, tmp_path):
    uv = shutil.which("uv") or str(Path(sys.executable).with_name("uv"))
    tools = install(
        LOCKS / "requirements.lock",
        [uv, "venv", "-q", "--python", sys.executable, "tools"],
        [uv, "pip", "install", "-q", "--require-hashes", "--python", "tools", "-r", "requirements.lock"],
    )
    generator = tmp_path / "bin"
    generator.mkdir()
    (generator / "openapi-python-client").symlink_to(tools / "tools" / "bin" / "openapi-python-client")
    run_client(embedded, "Python", OF_PYTHON, tmp_path / "field", generator)
    document = httpx.get(f"{embedded.url}/openapi.json", timeout=60).json()
    made = [each for each in (tmp_path / "field/stilb_api/api").rglob("*.py") if each.name != "__init__.py"]
    assert len(made) == sum(len(methods) for methods in document["paths"].values())


@pytest.mark.skipif(shutil.which("npm") is None, reason="its tools are npm's")
def test_client_of_openapi_typescript_calibrates_and_redocly_finds_no_error(embedded, tmp_path):
    fetch = ["--prefer-offline", "--no-audit", "--no-fund", "--ignore-scripts", "--fetch-retries=1"]
    tools = install(LOCKS / "package-lock.json", ["npm", "ci", "--loglevel=error", *fetch]) / "node_modules"
    field = tmp_path / "field"
    field.mkdir()
    (field / "node_modules").symlink_to(tools)
    (field / "package.json").write_text('{"type": "module"}')
    run_client(embedded, "TypeScript", OF_TYPESCRIPT, field, tools / ".bin")
    (field / "openapi.json").write_text(httpx.get(f"{embedded.url}/openapi.json", timeout=60).text)
    (field / "lint.js").write_text(LINT)
    lint = ["node", "lint.js"]
    found = subprocess.run(lint, check=True, cwd=field, capture_output=True, text=True, timeout=120)
    assert found.stdout == "[]\n"
