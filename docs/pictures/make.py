"""Make README's pictures anew: `python docs/pictures/make.py`, with chromium on the PATH.

Runs `legato demo` in a folder of its own, then photographs what it prints and its report.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from rich.ansi import AnsiDecoder
from rich.console import Console

HERE = Path(__file__).resolve().parent
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --hide-scrollbars "
    "--disable-background-networking --disable-component-update --disable-sync"
)


def main() -> None:
    """Write demo.png and report.png beside this file."""
    with tempfile.TemporaryDirectory() as folder:
        demo = [sys.executable, "-m", "legato", "demo", "--out", folder]
        shown = subprocess.run(
            demo, check=True, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        ).stdout.replace(folder, "~/.local/state/legato")
        said = json.loads(subprocess.run([*demo, "--json"], check=True, capture_output=True).stdout)
        console = Console(record=True, width=100, file=open("/dev/null", "w"))  # noqa: SIM115, PTH123
        console.print("$ make demo")
        for line in AnsiDecoder().decode(shown):
            console.print(line)
        page = Path(folder) / "demo.svg"
        console.save_svg(str(page), title="make demo")
        photograph(page.as_uri(), HERE / "demo.png", (1240, 1020), folder)
        photograph(Path(said["report"]).as_uri(), HERE / "report.png", (1100, 1830), folder)


def photograph(address: str, picture: Path, size: tuple[int, int], folder: str) -> None:
    """Write a page's picture in a browser of its own."""
    subprocess.run(
        ["chromium", *FLAGS.split(), f"--user-data-dir={folder}/browser",
         f"--window-size={size[0]},{size[1]}", f"--screenshot={picture}", address],
        check=True, capture_output=True,
    )  # fmt: skip


if __name__ == "__main__":
    main()
