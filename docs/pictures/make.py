"""Make README's pictures anew: `python docs/pictures/make.py`, with chromium and pdftoppm.

Runs `legato demo` in a folder of its own, then photographs what it prints and its report, the
first pages of the report as PDF, and the comparison with runs on other legs.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.image import imread, imsave
from rich.ansi import AnsiDecoder
from rich.console import Console

SEEDS = ("1", "2", "3", "4", "5")
PAGES, DPI = 4, 56
HERE = Path(__file__).resolve().parent
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --hide-scrollbars "
    "--disable-background-networking --disable-component-update --disable-sync"
)


def main() -> None:
    """Write demo.png, report.png, pdf.png and compare.png beside this file."""
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
        photograph(Path(said["report"]).as_uri(), HERE / "report.png", (1100, 1490), folder)
        paper(folder)
        for seed in SEEDS[1:]:
            legato("demo", "--out", folder, "--seed", seed)
        page = Path(folder) / "compare.html"
        legato("compare", "--last", str(len(SEEDS)), "-o", str(page), "--state-dir", folder)
        photograph(page.as_uri(), HERE / "compare.png", (1100, 1380), folder)


def paper(folder: str) -> None:
    """Write the first pages of the latest session's PDF, side by side, as pdf.png."""
    file = Path(folder) / "report.pdf"
    legato("report", "--pdf", "-o", str(file), "--state-dir", folder)
    command = ["pdftoppm", "-png", "-r", str(DPI), "-l", str(PAGES), str(file), f"{folder}/page"]
    subprocess.run(command, check=True, capture_output=True)
    pages = [imread(page) for page in sorted(Path(folder).glob("page-*.png"))]
    framed = [np.pad(page, ((6, 6), (6, 6), (0, 0)), constant_values=0.85) for page in pages]
    imsave(HERE / "pdf.png", np.concatenate(framed, axis=1))


def legato(*words: str) -> None:
    """Run one command."""
    subprocess.run([sys.executable, "-m", "legato", *words], check=True, capture_output=True)


def photograph(address: str, picture: Path, size: tuple[int, int], folder: str) -> None:
    """Write a page's picture in a browser of its own."""
    subprocess.run(
        ["chromium", *FLAGS.split(), f"--user-data-dir={folder}/browser",
         f"--window-size={size[0]},{size[1]}", f"--screenshot={picture}", address],
        check=True, capture_output=True,
    )  # fmt: skip


if __name__ == "__main__":
    main()
