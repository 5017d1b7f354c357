# Everything is done in .venv; `make run` and `make test` set up what is missing.
BIN := .venv/bin

# What Python compiles is kept, whatever the caller's environment says: tests start it hundreds of times.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: run test setup lint types bench clean

run: setup
	$(BIN)/aliasbench run quick -o runs/quick --fresh
	$(BIN)/aliasbench report runs/quick -o runs/quick-report

test:
	@sh .ci/setup.sh browser
	$(BIN)/python tests/compile_kernels.py
	$(BIN)/python -m pytest -n auto --dist loadfile

setup:
	@sh .ci/setup.sh

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: setup
	$(BIN)/mypy

# The extra `peers` is what the tracer is measured against.
bench: setup
	PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip install -q -e ".[dev,peers]"
	$(BIN)/python -m pytest tests/perf --benchmark-enable --benchmark-only -s

clean:
	rm -rf .venv .typing .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks build dist *.egg-info runs
