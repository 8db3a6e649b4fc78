# Needs Python 3.11 or newer and make; everything else goes into .venv in this folder.
# Another interpreter: make test PYTHON=/path/to/python3.12 · pytest options: make test PYTEST_ARGS="-n 2 -k fabric"

PYTHON ?= $(shell command -v python3.11 || command -v python3.12 || command -v python3.13 || command -v python3)
VENV ?= .venv
BIN := $(VENV)/bin
PYTEST_ARGS ?=

.PHONY: demo test lint validate bench clean

demo: $(VENV)/installed
	$(BIN)/mfar calibrate cupro-su1098 --out out/cupro

test: lint
	$(BIN)/python -m pytest $(PYTEST_ARGS)

lint: $(VENV)/installed-dev
	$(BIN)/ruff check .

validate: $(VENV)/installed-dev
	$(BIN)/python -m pytest -m slow $(PYTEST_ARGS)

bench: $(VENV)/installed
	$(BIN)/python tests/benchmarks/run.py --out out/benchmarks.json

clean:
	rm -rf out build *.egg-info .pytest_cache .hypothesis .ruff_cache .mypy_cache

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=...")'
	$(PYTHON) -m venv $(VENV)

# Stamps: installed again only when pyproject.toml changes. The second holds everything of the first.
$(VENV)/installed: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[cluster,contact,fast]'
	@touch $@

$(VENV)/installed-dev: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $(VENV)/installed $@
