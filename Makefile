# make run, make test: nothing else is needed beforehand; ./env sets up what is missing.
# make run RUN=DIRECTORY: there; without it runs/focusing, then runs/focusing-2 and so on.
RUN ?=
TESTS ?= # all
BENCH ?= # everything

.PHONY: run test test-slow lint format bench reference lock

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
	./env ruff format .
	./env ruff check --fix .

bench:
	./env python -m benchmarks $(BENCH)

lock: # versions and hashes of the Python packages that ./env and the containers install on Debian 13; needs uv
	uv pip compile pyproject.toml --all-extras --generate-hashes --python-version 3.13 --no-annotate --no-emit-index-url \
		--python-platform x86_64-manylinux_2_28 --constraint containers/debian-13.txt \
		--custom-compile-command 'make lock' --output-file requirements-debian-13.txt

reference: # of the keys of a case
	@trap 'rm -f schema.part reference.part' EXIT; set -e; \
	./env wavetank schema >schema.part; ./env wavetank schema --reference >reference.part; \
	mv schema.part wavetank/case/schema.json; mv reference.part docs/reference.md
