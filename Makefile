# Everything needs only Python >= 3.11 with venv, and a package index. `make help` lists the targets.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
KERNELS := $(VENV)/.kernels

.PHONY: help install demo test check serve bench openapi

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "make %-9s %s\n", $$1, $$2}' Makefile

install: $(KERNELS) ## make .venv with the pinned dependencies

demo: $(KERNELS) ## run the whole service on the sample photo; writes demo-out/
	$(BIN)/python -m examples.demo

test: $(KERNELS) ## run every test
	$(BIN)/pytest --numprocesses 3 --dist loadfile --no-loadscope-reorder

check: $(STAMP) ## format, lint, types, openapi in step
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m service.openapi --check

serve: $(KERNELS) ## run the service on http://127.0.0.1:8000
	$(BIN)/gcvec serve

bench: $(KERNELS) ## measure time, memory and size; writes docs/benchmarks.md (20 minutes)
	$(BIN)/python -m benchmarks

openapi: $(STAMP) ## write openapi/openapi.json anew
	$(BIN)/python -m service.openapi

$(STAMP): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "gcvec needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) -V 2>&1). Try: make PYTHON=python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -e .
	@touch $(STAMP)

# Kernels are compiled beforehand, so that no picture need wait for it: all of them anew once a source has changed,
# since numba, when it looks for one on disk, does not see a change in another that it calls.
$(KERNELS): $(STAMP) $(shell find gcvec -name '*.py')
	@find gcvec worker -name '*.nb[ic]' -delete
	@$(BIN)/python -m compileall -q gcvec service worker  # where Python is kept from doing so when it runs
	@$(BIN)/python -m gcvec.kernel_library
	@touch $(KERNELS)
