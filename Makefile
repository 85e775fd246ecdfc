# The tasks of this repository. Needed: GNU make and Python 3.10 or newer with its venv module.
# Each target makes the environment it needs under .venv/ at first use.

PYTHON ?= python3
PYTEST_ARGS ?= -n auto
DOMAIN := domains/household/domain.pddl
PROBLEM := domains/household/look-for-soda.pddl
OUT := build/household
BBTC := .venv/demo/bin/bbtc
PIP_INSTALL := -m pip install --quiet --disable-pip-version-check
MUTANTS ?= 150
SEED ?= 0
OLDEST_PY_TREES := build/py_trees-2.2/py_trees

# Programs and tests start Python hundreds of times: each would compile all of bbtc anew where the environment asks
# for no bytecode to be kept.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo test test-long long-forms explore mutants lint docs format golden pictures clean python-version

help:
	@echo "make demo    from the household domain to trees that run, into $(OUT)/"
	@echo "make test    all tests"
	@echo "make test-long  their long forms, new random examples, a sample of mutants: hours"
	@echo "make docs    the documentation site, into site/"
	@echo "make lint    ruff, mypy, import layers"
	@echo "make format  lay out the Python code"
	@echo "make golden  all tests, rewriting the golden files that drifted"
	@echo "make pictures  draw the pictures of docs/pictures/ anew"
	@echo "make clean   remove what these targets made"

# --- what the README shows -------------------------------------------------------------------

demo: .venv/demo/.installed
	@mkdir -p $(OUT)
	$(BBTC) check $(DOMAIN) $(PROBLEM)
	$(BBTC) compile $(DOMAIN) $(PROBLEM) -o $(OUT)/task.json
	$(BBTC) plan $(DOMAIN) $(PROBLEM) --strategy refine -o $(OUT)/tree.json
	$(BBTC) simulate $(OUT)/tree.json
	$(BBTC) export $(OUT)/tree.json --to dot -o $(OUT)/tree.dot
	$(BBTC) export $(OUT)/tree.json --to svg -o $(OUT)/tree.svg
	$(BBTC) export $(OUT)/tree.json --to btcpp -o $(OUT)/tree.xml
	$(BBTC) export $(OUT)/tree.json --to py_trees -o $(OUT)/tree.py
	.venv/demo/bin/python $(OUT)/tree.py
	@echo "Written to $(OUT)/:"
	@ls $(OUT)

test: .venv/dev/.installed $(OLDEST_PY_TREES)
	.venv/dev/bin/python -m pytest $(PYTEST_ARGS)

# What takes too long, or too much, for each change (tests/README.md): three parts, each of which can be
# made alone. A part that fails keeps no other from being made: make -k.
test-long:
	+$(MAKE) --keep-going long-forms explore mutants

long-forms: .venv/long/.installed $(OLDEST_PY_TREES)
	BBTC_LONG=1 .venv/long/bin/python -m pytest $(PYTEST_ARGS)

explore: .venv/long/.installed $(OLDEST_PY_TREES)
	HYPOTHESIS_PROFILE=explore .venv/long/bin/python -m pytest $(PYTEST_ARGS)

mutants: .venv/long/.installed $(OLDEST_PY_TREES)
	.venv/long/bin/python -m tests.mutation --count $(MUTANTS) --seed $(SEED) --jobs 2

# --- for those who work on it ----------------------------------------------------------------

lint: .venv/dev/.installed
	.venv/dev/bin/ruff check .
	.venv/dev/bin/ruff format --check .
	.venv/dev/bin/mypy
	.venv/dev/bin/lint-imports --no-logo

format: .venv/dev/.installed
	.venv/dev/bin/ruff check --fix .
	.venv/dev/bin/ruff format .

docs: .venv/dev/.installed
	.venv/dev/bin/python -m mkdocs build --strict

golden: .venv/dev/.installed $(OLDEST_PY_TREES)
	.venv/dev/bin/python -m pytest $(PYTEST_ARGS) --update-golden

PICTURE = $(BBTC) export $(OUT)/tree.json -o docs/pictures/household

pictures: BBTC := .venv/dev/bin/bbtc
pictures: .venv/dev/.installed
	$(BBTC) plan $(DOMAIN) $(PROBLEM) --strategy refine -q -o $(OUT)/tree.json
	$(PICTURE).svg --to svg -O layout=bbtc -O flow=true -O legend=true
	$(PICTURE).png --to png -O layout=graphviz-pure -O flow=true
	$(PICTURE)-collapsed.svg --to svg -O layout=graphviz-pure -O templates=collapsed
	$(PICTURE).dot --to dot -O flow=true
	$(PICTURE).mmd --to mermaid -O templates=collapsed -O flow=true
	$(PICTURE).txt --to text -O flow=true

clean:
	rm -rf .venv build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache

# --- environments ----------------------------------------------------------------------------

.venv/demo/.installed: EXTRA := py-trees
.venv/dev/.installed: EXTRA := dev
.venv/long/.installed: EXTRA := dev,compare

.venv/%/.installed: pyproject.toml | python-version
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/python $(PIP_INSTALL) --editable ".[$(EXTRA)]"
	@[ $* = demo ] || $(@D)/bin/python $(PIP_INSTALL) --only-binary stormpy --editable ".[storm]" || \
	  echo "No wheel of Storm fits this system: the tests that compare with it are skipped." >&2
	@touch $@

# For the tests that run exported modules in the oldest py_trees, too; without a network they skip.
$(OLDEST_PY_TREES): | .venv/dev/.installed
	.venv/dev/bin/python $(PIP_INSTALL) --target build/py_trees-2.2 py_trees==2.2.1 || \
	  echo "no py_trees 2.2.1: the tests in it will be skipped" >&2

python-version:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
	  { echo "$(PYTHON) is not Python 3.10 or newer; say which one to use: make PYTHON=python3.12 …" >&2; exit 1; }
