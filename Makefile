# Anyview: `make repro` runs the study, `make test` checks the code. Each works as the first command on a
# Linux machine that has only Python 3.11+ (with venv), git and make. `make help` lists the targets.
#
# PIP_ARGS goes to the installation of PyTorch, whose build differs by machine. For example, without a GPU:
#   make repro PIP_ARGS="--extra-index-url https://download.pytorch.org/whl/cpu"

SHELL := /bin/sh
.DEFAULT_GOAL := help

PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
PIP_ARGS ?=
TORCH := $(shell sed -n 's/.*"\(torch==[^"]*\)".*/\1/p' pyproject.toml)
export PATH := $(CURDIR)/.venv/bin:$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1

INSTALL := python -m pip install --quiet
COMPILE := pip-compile --quiet --generate-hashes --strip-extras --build-deps-for editable \
	--unsafe-package pip --unsafe-package torch \
	--no-emit-index-url --no-emit-find-links --no-emit-options --pip-args "$(PIP_ARGS)"
PARALLEL := --numprocesses logical --maxprocesses 4 --dist loadfile --no-loadscope-reorder
GL_PACKAGES := libegl1 libopengl0 libgl1-mesa-dri libosmesa6

.PHONY: help repro beyond evidence test test-slow lint format bench setup setup-dev lock audit clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1|/p' Makefile | awk -F'|' '{printf "  make %-10s %s\n", $$1, $$2}'

repro: .setup-stamp .setup-stamp-graphics ## run the whole pipeline; only what changed runs again
	python stages/check.py
	anyview repro

beyond: .setup-stamp .setup-stamp-graphics ## run what goes beyond the thesis as well, and what it needs of the rest
	anyview repro check simulate@diverse split@diverse split@real split@rendered train@sim embed@tcn imitate@ours
	cd beyond && anyview repro

evidence: .setup-stamp .setup-stamp-graphics ## several models of each kind, three questions: hours, see docs/scaling.md
	anyview repro check simulate@diverse split@diverse
	cd evidence && { anyview repro; ended=$$?; python report.py && exit $$ended; }

test: lint .setup-stamp-graphics ## lint, type check and the fast tests
	python -m pytest $(PARALLEL)

test-slow: .setup-stamp-dev .setup-stamp-graphics .setup-stamp-browser ## kills, clusters, browsers, queues: minutes each
	python -m pytest $(PARALLEL) -m slow --durations=12

lint: .setup-stamp-dev ## ruff, mypy and who may import whom
	ruff check .
	ruff format --check .
	mypy
	lint-imports --no-logo

format: .setup-stamp-dev ## let ruff put the code in shape
	ruff check --fix .
	ruff format .

bench: .setup-stamp-dev .setup-stamp-graphics ## run every benchmark
	@for script in benchmarks/*.py; do echo "== $$script"; python $$script || exit 1; done

setup: .setup-stamp .setup-stamp-graphics ## virtual environment, dependencies, headless OpenGL

setup-dev: .setup-stamp-dev .setup-stamp-graphics ## the same, with the tools that tests need

lock: .setup-stamp-dev ## pin every dependency but PyTorch again, with hashes (UPGRADE=--upgrade for newer ones)
	CUSTOM_COMPILE_COMMAND="make lock" $(COMPILE) $(UPGRADE) --output-file requirements.lock pyproject.toml
	CUSTOM_COMPILE_COMMAND="make lock" $(COMPILE) $(UPGRADE) --extra dev --extra cluster --extra lerobot --extra share \
		--constraint requirements.lock --output-file requirements-dev.lock pyproject.toml
	@! grep -nE '://|^(-|nvidia)' requirements.lock requirements-dev.lock

audit: .setup-stamp-dev ## known vulnerabilities and licences of what is installed
	$(PYTHON) -m venv .venv-audit
	.venv-audit/bin/python -m pip install --quiet pip-audit pip-licenses
	.venv-audit/bin/pip-licenses --python .venv/bin/python --order license
	.venv-audit/bin/pip-audit --strict --no-deps --disable-pip --requirement requirements-dev.lock
	echo "$(TORCH)" | .venv-audit/bin/pip-audit --strict --no-deps --disable-pip --requirement /dev/stdin

clean: ## remove environments and caches; data, results and DVC's cache stay
	rm -rf .venv .venv-audit .setup-stamp* .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis src/*.egg-info benchmarks/out
	find . -name __pycache__ -not -path './.dvc/*' -prune -exec rm -rf {} +

# PyTorch first, by exact version; the rest by hash. PyTorch brings setuptools, so that nothing else is
# downloaded to build the one dependency without a wheel, and us.
.setup-stamp: requirements.lock pyproject.toml
	@test -n "$(PYTHON)" || { echo "error: Python 3.11 or newer is needed; set PYTHON=/path/to/python"; exit 2; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { \
		echo "error: $(PYTHON) has no venv; on Debian or Ubuntu: apt-get install python3-venv"; exit 2; }
	test -x .venv/bin/python || $(PYTHON) -m venv .venv
	$(INSTALL) $(PIP_ARGS) $(TORCH)
	$(INSTALL) --no-deps --no-build-isolation --require-hashes -r requirements.lock
	$(INSTALL) --no-deps --no-build-isolation --editable .
	@grep -q PYTHONHASHSEED .venv/bin/activate || \
		echo 'export PYTHONHASHSEED=0  # dvc metrics diff lists sets: the same order every time' >> .venv/bin/activate
	@touch $@

.setup-stamp-dev: .setup-stamp requirements-dev.lock
	$(INSTALL) --no-deps --no-build-isolation --require-hashes -r requirements-dev.lock
	@touch $@

.setup-stamp-graphics: .setup-stamp
	@python -m anyview.runtime.graphics || { \
		if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
			apt-get update -qq && apt-get install -y -qq --no-install-recommends $(GL_PACKAGES) \
				&& python -m anyview.runtime.graphics; \
		else \
			echo "error: install $(GL_PACKAGES) (Debian's names), then run make again"; exit 2; \
		fi; }
	@touch $@

# The report page is tested in a real browser; without one those tests are skipped and say so.
.setup-stamp-browser: .setup-stamp
	@command -v chromium >/dev/null || command -v chromium-browser >/dev/null || command -v google-chrome >/dev/null || { \
		[ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && apt-get update -qq \
			&& apt-get install -y -qq --no-install-recommends chromium; \
	} || echo "note: no Chromium, so the report page is not tested in a browser; install chromium (Debian's name)"
	@touch $@
