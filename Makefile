# legato: `make demo` and `make test` are all that a fresh machine needs.

PYTHON ?= python3
BIN := .venv/bin
# One thread a process: the machines are small, and results do not depend on the cores.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: env demo test lint types contracts unit browser bench web lock clean docs

env: .venv/.ready

.venv/.ready: constraints.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "legato needs Python 3.11 or later; name one with make PYTHON=..."; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r constraints.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

demo: env
	$(BIN)/legato demo

test: env lint types contracts unit

lint: env
	$(BIN)/ruff check src tests bench docs
	$(BIN)/ruff format --check src tests bench docs

types: env
	$(BIN)/mypy

contracts: env
	$(BIN)/lint-imports --no-cache

unit: env browser
	$(BIN)/pytest -n 2 --dist worksteal

bench: env
	$(BIN)/python -m bench

# The documentation as a site, build/site/index.html; any warning is an error.
docs: env
	$(BIN)/python -m sphinx -E -W --keep-going -q -b html -d build/doctrees docs build/site
	@echo build/site/index.html

# The page's tests drive a browser: the machine's, Debian's where we may install it, else the one
# that playwright brings.
browser: env
	@command -v chromium || command -v chromium-browser || command -v google-chrome \
		|| { [ "$$(id -u)" = 0 ] && command -v apt-get && apt-get update -qq \
			&& DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium; } \
		|| $(BIN)/playwright install chromium-headless-shell

# What the page takes from npm, vendored anew with licences and hashes; only this needs Node.
web:
	cd web && npm ci --ignore-scripts --no-audit --no-fund && npm run vendor

# Versions anew, with hashes and without an index's address.
lock:
	$(PYTHON) -m venv .lock && .lock/bin/pip install --quiet pip-tools
	.lock/bin/pip-compile --quiet --extra dev --generate-hashes --strip-extras --allow-unsafe \
		--no-emit-index-url --no-emit-find-links --no-emit-trusted-host \
		--no-header -o .lock/constraints.txt pyproject.toml
	{ echo "# Every version that legato is built and tested with, with hashes;" \
		"\`make lock\` writes it anew."; cat .lock/constraints.txt; } > constraints.txt
	rm -rf .lock

clean:
	rm -rf .venv .lock build dist .mypy_cache .ruff_cache
