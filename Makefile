# Everything is done in .venv; `make run` and `make test` set up what is missing.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: run test setup lint types bench clean

run: setup
	$(BIN)/aliasbench run quick -o runs/quick
	$(BIN)/aliasbench report runs/quick -o runs/quick-report

test: setup
	$(BIN)/python -m pytest

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: setup typing-tree
	$(BIN)/mypy

bench: setup
	$(BIN)/python -m pytest tests/perf --benchmark-enable --benchmark-only -s

clean:
	rm -rf $(VENV) .typing .mypy_cache .ruff_cache .pytest_cache .benchmarks build dist *.egg-info runs
