# make run, make test: nothing else is needed beforehand; ./env sets up what is missing.
# make run RUN=DIRECTORY: there; without it runs/focusing, then runs/focusing-2 and so on.
RUN ?=
TESTS ?= # all
BENCH ?= # everything

.PHONY: run test test-slow lint format bench reference

run:
	./env wavetank run cases/focusing.toml $(if $(RUN),--out $(RUN))

test:
	./env pytest -q $(TESTS)

test-slow:
	./env pytest -q -m slow $(TESTS)

lint:
	./env ruff check .
	./env ruff format --check .
	./env mypy

format:
	./env ruff check --fix .
	./env ruff format .

bench:
	./env python -m benchmarks $(BENCH)

reference: # of the keys of a case
	./env wavetank schema >wavetank/case/schema.json
	./env wavetank schema --reference >docs/reference.md
