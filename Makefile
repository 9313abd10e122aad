# The commands that matter: `make demo`, `make test` and, after an edit, `make quick`. They make their own virtual environment in .venv.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
FUZZ_SECONDS ?= 600
PIP := $(BIN)/pip --disable-pip-version-check
# one file after the other, in the order of tests/conftest.py; xdist's own begins with the files of many tests, which are short
# one worker more than there are processors: tests of the page and of devices wait
PARALLEL := -n $$(($$(getconf _NPROCESSORS_ONLN) + 1)) --dist loadfile --no-loadscope-reorder
# empty: an image may set it, and a command that compiles every module anew starts two seconds later; tests start hundreds
export PYTHONDONTWRITEBYTECODE :=
# objects of the C core that no edit has changed stay from one run of the tests to the next
export GYROCAL_OBJECTS ?= $(CURDIR)/build/objects
QUICK := $(addprefix tests/,effects error_model policy recording simulation variables fuzz/test_parsers.py test_cli.py)

.PHONY: demo test wide quick docs parts coverage fuzz mutants lowest wheel release clean

demo: $(VENV)/.installed
	$(BIN)/gyrocal demo
	@echo "Look at it yourself: $(BIN)/gyrocal workbench demo-out/recorded"

test: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/pytest $(PARALLEL)

# what takes longer than `make test` can afford, before a release and in CI beside it: further seeds, sizes, campaigns and CPUs,
# most whole diagnoses and most visits of the page
wide: $(VENV)/.installed-dev
	$(BIN)/pytest $(PARALLEL) --wide -m wide

# what an edit wants, in less than a minute: the laws of the effects, the parsers, and one session through the verbs
quick: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/pytest $(PARALLEL) -m "not slow" $(QUICK)

docs: $(VENV)/.installed-dev
	$(BIN)/python docs/_site/site.py

# the sensors: each driver against its emulated part, a whole calibration of each, and all of them on the simulated board
parts: $(VENV)/.installed-dev
	$(BIN)/pytest tests/core/test_parts.py tests/core/test_driver.py tests/device/test_parts.py tests/firmware/test_board_parts.py

coverage: $(VENV)/.installed-dev
	$(BIN)/python benchmarks/core_coverage.py

fuzz: $(VENV)/.installed-dev
	$(BIN)/python tests/fuzz/fuzzing.py --seconds $(FUZZ_SECONDS)
	$(BIN)/python tests/fuzz/readers.py --seconds $(FUZZ_SECONDS)

# careless edits of the code, drawn by chance, and whether the tests catch them: make mutants MUTANTS="--folders noise -n 30 --seed 2"
mutants: $(VENV)/.installed-dev
	nice -n 15 $(BIN)/python tests/mutants/mutants.py $(MUTANTS)

# the tests that need no network and no browser, on the lowest versions that pyproject.toml allows
lowest: VENV := .venv-lowest
lowest:
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python tests/lowest_versions.py pyproject.toml > $(VENV)/lowest.txt
	$(VENV)/bin/pip install --quiet -c $(VENV)/lowest.txt -e '.[page,net,import,ros,fleet]' pytest hypothesis pandas pyyaml
	$(VENV)/bin/pytest tests/recording tests/error_model tests/noise tests/calibration tests/present tests/test_cli.py tests/test_api.py

# the tutorials, the notebook and the recordings of docs/ in an environment that holds the wheel and nothing of this folder
wheel: $(VENV)/.installed-dev
	rm -rf dist .venv-wheel
	$(PIP) wheel --quiet --no-deps --wheel-dir dist .
	$(PYTHON) -m venv .venv-wheel
	.venv-wheel/bin/pip install --quiet -c constraints.txt "$$(echo dist/gyrocal-*.whl)[page,net]"
	GYROCAL_PYTHON=$(CURDIR)/.venv-wheel/bin/python $(BIN)/pytest --wide tests/test_docs.py tests/test_recordings.py -k 'tutorial or notebook or recording'

# checks and builds what a release uploads (packaging/release.py); refuses while the project has no address
release: $(VENV)/.installed-dev
	$(BIN)/python packaging/release.py

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit("gyrocal needs Python 3.11 or newer; set PYTHON=/path/to/python3.11") if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) install --quiet -c constraints.txt -e '.[page,net]'
	touch $@

$(VENV)/.installed-dev: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) install --quiet -c constraints.txt -e '.[train,dev]'
	touch $@ $(VENV)/.installed

clean:
	rm -rf $(VENV) .venv-lowest .venv-wheel build dist demo-out runs .pytest_cache .mypy_cache .ruff_cache
