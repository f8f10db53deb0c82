"""The pages made from the code. `python -m docs.gen.reference reference/wire` prints one."""

import sys
from collections.abc import Callable
from typing import Final

from docs.gen import bench, commands, configuration, faults, records, wire

PAGES: Final[dict[str, Callable[[], str]]] = {
    "reference/configuration": configuration.page,
    "reference/commands": commands.page,
    "reference/wire": wire.page,
    "reference/faults": faults.page,
    "reference/records": records.page,
    "reference/figures": bench.page,
}

if __name__ == "__main__":
    sys.stdout.write(PAGES[sys.argv[1]]())
