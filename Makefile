# legato: `make demo` and `make test` are all that a fresh machine needs.

PYTHON ?= python3
BIN := .venv/bin
# One thread a process: the machines are small, and results do not depend on the cores.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: env demo test lint types contracts unit bench lock clean

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
	$(BIN)/ruff check src tests bench
	$(BIN)/ruff format --check src tests bench

types: env
	$(BIN)/mypy

contracts: env
	$(BIN)/lint-imports --no-cache

unit: env
	$(BIN)/pytest -n 2 --dist worksteal

bench: env
	$(BIN)/python -m bench

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
