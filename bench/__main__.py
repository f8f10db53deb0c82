"""Run the named benches, all by default, print their rows and keep them under docs/bench/."""

import importlib
import sys

NAMES = (
    "calibration", "paper", "pictures", "adversary", "demo", "line", "daemon", "events", "passes",
    "ptypasses", "truetime", "stops", "faults", "unattended", "booted", "replays", "web",
    "report", "machine", "abuse", "soak",
)  # fmt: skip


def main(names: list[str]) -> int:
    """Return 0 where every row with an aim holds."""
    failed = 0
    for name in names or NAMES:
        if name not in NAMES:
            print(f"no bench {name}: there are {', '.join(NAMES)}", file=sys.stderr)  # noqa: T201 # its purpose
            return 2
        rows = importlib.import_module(f"bench.{name}").run()
        for row in rows:
            print(row.line(), flush=True)  # noqa: T201 # its purpose
            failed += row.holds is False
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
