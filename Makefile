SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup scenario baselines sweep report keys test numbers docs fuzz mutants bench lock clean

VENV := .venv
BIN := $(VENV)/bin
# One thread a process: the tests run in two processes, and small matrices are slower with more.
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1

help:  ## list the targets
	@grep -E '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /\1\t/' | expand -t 12

setup: $(VENV)/.ready  ## make .venv with everything the toolkit needs

$(VENV)/.ready: requirements.lock pyproject.toml setup.sh
	@./setup.sh $(VENV)
	@touch $@

scenario: setup  ## run the paper's scenario into results/paper
	$(BIN)/wzsumo run scenarios/paper.toml --out results/paper

baselines: setup  ## the same zone with LiDAR SLAM and the map of before beside the crowd's maps: some two minutes
	$(BIN)/wzsumo run scenarios/paper.toml --out results/paper_baselines --method swept --method lanes --method slam_raw \
		--method slam_log_odds --method slam_barrier --method hd_map --method hd_map_devices

sweep: setup  ## run a study of some two minutes into results/how_many_traces; again: what is missing
	$(BIN)/wzsumo sweep scenarios/studies/how_many_traces.toml --out results/how_many_traces

report: setup  ## tables, figures and report.html of that study
	$(BIN)/wzsumo report results/how_many_traces

keys: setup  ## write the reference of keys and the JSON Schemas anew, from the models
	$(BIN)/wzsumo schema --quiet --out scenarios/scenario.schema.json
	$(BIN)/wzsumo schema study --quiet --out scenarios/studies/study.schema.json
	$(BIN)/wzsumo schema --markdown --quiet --out docs/guide/keys.md
	$(BIN)/wzsumo schema study --markdown --quiet --out docs/guide/study_keys.md

test: setup  ## lint, types and tests; stops at the first stage that fails and names it
	@run() { echo "== $$*" >&2; "$$@" || { code=$$?; echo "make test: $$1 failed (exit code $$code)" >&2; exit $$code; }; }; \
	run $(BIN)/ruff check . >&2; \
	run $(BIN)/ruff format --check . >&2; \
	run $(BIN)/mypy >&2; \
	export $(ONE_THREAD); run $(BIN)/pytest -n 2

MEASURED ?=
COMMIT ?=
numbers: setup  ## put the figures of docs/results/ into the pages, list what is older than its code: MEASURED=paper_case.seeds [COMMIT=HASH]
	@$(BIN)/python analysis/pages/fill_pages.py $(if $(MEASURED),--measured $(MEASURED)) $(if $(COMMIT),--commit $(COMMIT))

docs: setup  ## the documentation as a site: open build/site/index.html
	@$(BIN)/python .ci/site/build_site.py --run-notebook

INPUTS ?= 3000
SEED ?= 1
fuzz: setup  ## damaged and odd inputs through the command line, counted by how they end: INPUTS=3000 SEED=1
	@$(ONE_THREAD) $(BIN)/python analysis/fuzz/fuzz.py --inputs $(INPUTS) --seed $(SEED) --out results/fuzz

FOLDER ?= wzsumo/behaviour
mutants: setup  ## share of small changes of FOLDER's code that its tests notice: FOLDER=wzsumo/mutcd [SAMPLE=100] [TESTS=tests/case] [JOBS=2]
	@$(ONE_THREAD) $(BIN)/python .ci/mutants $(FOLDER) $(if $(SAMPLE),--sample $(SAMPLE)) \
		$(if $(TESTS),--tests $(TESTS)) $(if $(JOBS),--jobs $(JOBS))

bench: setup  ## run every benchmark, one after the other
	@for script in analysis/benchmarks/*.py; do echo "== $$script" >&2; $(BIN)/python "$$script"; done

lock: setup  ## resolve the packages of pyproject.toml anew into requirements.lock, with hashes; what still fits keeps its version
	@python3 -m venv $(VENV)/lock && $(VENV)/lock/bin/pip --quiet --disable-pip-version-check install uv
	$(VENV)/lock/bin/uv --quiet pip compile pyproject.toml --group dev --universal --python-version 3.11 \
		--generate-hashes --no-header --no-annotate --output-file requirements.lock

clean:  ## remove .venv, results and caches
	rm -rf $(VENV) results .pytest_cache .mypy_cache .ruff_cache .hypothesis build *.egg-info
	find wzsumo tests analysis .ci -name __pycache__ -prune -exec rm -rf {} +
