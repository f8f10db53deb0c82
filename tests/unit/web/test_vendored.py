"""Vendored files are what `make web` made: hashes, versions, licences."""

import hashlib
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
FOLDERS = ("src/legato/web/static/vendor", "tests/vendor/axe-core")


@pytest.mark.parametrize("folder", FOLDERS)
def test_vendored_files_are_the_ones_that_were_made(folder: str) -> None:
    """Every file is listed with its hash, each with its licence's text, in the locked version."""
    place = ROOT / folder
    told = json.loads((place / "VENDORED.json").read_text())
    found = {p.name for p in place.iterdir()} - {"VENDORED.json"}
    assert found == set(told["sha256"])
    assert any("LICENSE" in name for name in found)
    for name, digest in told["sha256"].items():
        assert hashlib.sha256((place / name).read_bytes()).hexdigest() == digest, name
    locked = json.loads((ROOT / "web" / "package-lock.json").read_text())["packages"]
    entry = locked[f"node_modules/{told['name']}"]
    assert (entry["version"], entry["integrity"]) == (told["version"], told["npm_integrity"])


def test_the_page_names_no_address_of_another_host() -> None:
    """Nothing on the page or in its scripts and sheets is fetched from elsewhere."""
    static = ROOT / "src/legato/web/static"
    own = [*static.glob("*.html"), *static.glob("*.css"), *static.glob("js/*.js")]
    assert len(own) > 10
    for path in own:
        text = path.read_text().replace('"http://www.w3.org/2000/svg"', "")
        assert "http://" not in text, path
        assert "https://" not in text, path
        assert "style=" not in text, path
