# The two commands that matter: `make demo` and `make test`. Both make their own virtual environment in .venv.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
FUZZ_SECONDS ?= 600
# PyTorch without gigabytes of GPU libraries, which the one of PyPI brings on Linux; where it cannot be reached, that one is taken
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
PIP := $(BIN)/pip --disable-pip-version-check

.PHONY: demo test docs coverage fuzz lowest wheel clean

demo: $(VENV)/.installed
	$(BIN)/gyrocal demo
	@echo "Look at it yourself: $(BIN)/gyrocal workbench demo-out/recorded"

test: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/pytest -n auto --dist loadfile

docs: $(VENV)/.installed-dev
	$(BIN)/python docs/_site/site.py

coverage: $(VENV)/.installed-dev
	$(BIN)/python benchmarks/core_coverage.py

fuzz: $(VENV)/.installed-dev
	$(BIN)/python tests/fuzz/fuzzing.py --seconds $(FUZZ_SECONDS)
	$(BIN)/python tests/fuzz/readers.py --seconds $(FUZZ_SECONDS)

# the tests that need no network and no browser, on the lowest versions that pyproject.toml allows
lowest: VENV := .venv-lowest
lowest:
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python tests/lowest_versions.py pyproject.toml > $(VENV)/lowest.txt
	$(VENV)/bin/pip install --quiet -c $(VENV)/lowest.txt -e '.[import,ros,fleet]' pytest hypothesis mypy pandas pyyaml
	$(VENV)/bin/pytest tests/recording tests/error_model tests/noise tests/calibration tests/present tests/test_cli.py tests/test_api.py

# the tutorials, the notebook and the recordings of docs/ in an environment that holds the wheel and nothing of this folder
wheel: $(VENV)/.installed-dev
	rm -rf dist .venv-wheel
	$(PIP) wheel --quiet --no-deps --wheel-dir dist .
	$(PYTHON) -m venv .venv-wheel
	.venv-wheel/bin/pip install --quiet -c constraints.txt dist/gyrocal-*.whl
	GYROCAL_PYTHON=$(CURDIR)/.venv-wheel/bin/python $(BIN)/pytest tests/test_docs.py tests/test_recordings.py -k 'tutorial or notebook or recording'

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit("gyrocal needs Python 3.11 or newer; set PYTHON=/path/to/python3.11") if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) install --quiet -c constraints.txt -e .
	touch $@

$(VENV)/.installed-dev: pyproject.toml constraints.txt | $(VENV)/bin/python
	-$(PIP) install --quiet --no-deps -c constraints.txt --index-url $(TORCH_INDEX) --timeout 10 --retries 1 torch
	$(PIP) install --quiet -c constraints.txt -e '.[train,dev]'
	touch $@ $(VENV)/.installed

clean:
	rm -rf $(VENV) .venv-lowest .venv-wheel build dist demo-out runs .pytest_cache .mypy_cache .ruff_cache
