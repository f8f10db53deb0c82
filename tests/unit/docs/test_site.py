"""The documentation's site: built without a warning, and read without a network."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from docs.gen.figures import FIGURES
from docs.gen.reference import PAGES
from tests.printed import DOCS, ROOT

FETCHED = re.compile(
    r"""<(?:script|img|link|iframe|source)\b[^>]*\b(?:src|href)="([^"]+)"|url\(([^)]+)\)"""
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site once; a warning is an error."""
    out = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", "-E", "-W", "--keep-going", "-q", "-b", "html",
         "-d", str(out / "doctrees"), str(DOCS), str(out / "site")],
        cwd=ROOT, env=os.environ | {"NO_COLOR": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (built.returncode, built.stderr) == (0, "")
    return out / "site"


def test_every_page_is_built_and_none_fetches_anything(site: Path) -> None:
    """No script, style, font or picture comes from another machine."""
    pages = list(site.rglob("*.html"))
    assert len(pages) > 35
    for page in [*pages, *site.rglob("*.css")]:
        found = (a or b for a, b in FETCHED.findall(page.read_text(encoding="utf-8")))
        outside = [address for address in found if re.match(r"(https?:)?//", address.strip("\"'"))]
        assert not outside, f"{page.relative_to(site)} fetches {outside}"


def test_pages_made_from_the_code_say_what_the_code_says(site: Path) -> None:
    """No page is left that only says that it will be made."""
    for name in PAGES:
        text = (site / f"{name}.html").read_text(encoding="utf-8")
        assert "Made from the code</h1>" not in text.replace("<h1>", "")
        assert len(text) > 10_000


def test_figures_and_formulas_stand_in_the_pages(site: Path) -> None:
    """Every figure is shown somewhere, with words for who cannot see it; mathematics is MathML."""
    text = "".join(p.read_text(encoding="utf-8") for p in site.rglob("*.html"))
    assert text.count('<svg role="img" aria-label="') == len(FIGURES)
    assert text.count("<math") > 60
    assert "\\frac" not in text
    for name in FIGURES:
        assert f'id="{name}-figure_1"' in text
