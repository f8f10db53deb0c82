"""`python -m legato.web.draw FOLDER`: a session's report on stdout, for the page's server alone."""

import sys
from pathlib import Path


def main(folder: Path) -> None:
    """Write the report of a session's folder to stdout as UTF-8."""
    from legato.records.record import read_session
    from legato.report.html import render

    sys.stdout.buffer.write(render(read_session(folder)).encode())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
