"""Importing does nothing: no thread, no log handler, no device, and nothing slow."""

import json
import pkgutil
import subprocess
import sys

import legato

MODULES = sorted(
    m.name for m in pkgutil.walk_packages(legato.__path__, "legato.") if "__main__" not in m.name
)

LOOK = """
import importlib, json, logging, os, sys, threading
before = set(os.listdir("/proc/self/fd"))
for name in json.loads(sys.argv[1]):
    importlib.import_module(name)
print(json.dumps({
    "threads": [t.name for t in threading.enumerate()],
    "handlers": [repr(h) for h in logging.getLogger().handlers],
    "files": len(set(os.listdir("/proc/self/fd")) - before),
}))
"""


def test_every_module_imports_without_side_effects() -> None:
    """No module starts a thread, installs a log handler or keeps a file open at import."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", LOOK, json.dumps(MODULES)],
        check=True,
        capture_output=True,
        text=True,
    )
    assert json.loads(done.stdout) == {"threads": ["MainThread"], "handlers": [], "files": 0}


def test_the_command_line_starts_without_the_heavy_libraries() -> None:
    """`legato --help` brings neither OpenCV nor SciPy nor matplotlib."""
    look = "import sys, legato.cli.main; print([m for m in sys.argv[1:] if m in sys.modules])"
    heavy = ["cv2", "scipy", "matplotlib", "zmq", "jinja2"]
    done = subprocess.run(
        [sys.executable, "-c", look, *heavy], check=True, capture_output=True, text=True
    )
    assert done.stdout.strip() == "[]"
