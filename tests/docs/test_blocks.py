"""Each block of code that README and docs print is run by a test, or named here with the reason."""

import re

import pytest

from tests.support.compose import ROOT

pytestmark = pytest.mark.unit

RUN = {
    "README.md": "tests/flow/test_readme.py",
    "docs/certificate.md": "tests/flow/test_printed.py",
    "docs/client.md": "tests/stilb/test_docs.py",
    "docs/command-line.md": "tests/flow/test_printed.py tests/stilb/test_campaign.py",
    "docs/dashboards.md": "tests/flow/test_printed.py tests/flow/test_consumers.py tests/store/test_views.py",
    "docs/generated-clients.md": "tests/flow/test_generated_clients.py",
    "docs/history.md": "tests/flow/test_printed.py",
    "docs/http.md": "tests/flow/test_printed.py",
    "docs/install.md": "tests/support/wheels.py tests/docs/test_install.py",
    "docs/measuring.md": "tests/flow/test_printed.py",
    "docs/operations.md": "tests/verify/test_backup.py tests/worker/test_celery.py",
    "docs/reflectance.md": "tests/demo/test_demos.py",
    "docs/tools.md": "tests/flow/test_printed.py",
    # targets of make, which tests/docs/test_docs.py compares with the Makefile
    "CONTRIBUTING.md": "tests/docs/test_docs.py",
}
# a block with its language; those in braces are directives of the site
CODE = re.compile(r"^```(\S*)[^\n]*\n.*?^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(
    r"^    ((?:\w+=\S* )?(?:curl|docker|make|pip|python3?|stilb|stilb-\w+|uv) .*|(?:\w+ = )?client\..*)",
    re.MULTILINE,
)


def test_each_page_with_code_names_the_tests_that_run_it():
    printed = set()
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/**/*.md"))):
        text, name = page.read_text("utf-8"), str(page.relative_to(ROOT))
        languages = [each for each in CODE.findall(text) if not each.startswith("{")]
        assert all(languages), f"{name}: a block names no language"
        assert COMMAND.findall(text) == [], f"{name}: code stands in a fence, with its language"
        printed |= {name} if languages else set()
    assert printed == RUN.keys()


@pytest.mark.parametrize("page", RUN)
def test_the_tests_read_the_page(page):
    names = (page, page.rpartition("/")[2])
    for test in RUN[page].split():
        text = (ROOT / test).read_text("utf-8")
        assert any(f'"{name}"' in text for name in names), test
