# make run, make test: nothing else is needed beforehand; ./env sets up what is missing.
RUN ?= runs/focusing

.PHONY: run test test-slow lint format bench

run:
	./env wavetank run cases/focusing.toml --out $(RUN)

test:
	./env pytest -q

test-slow:
	./env pytest -q -m slow

lint:
	./env ruff check .
	./env ruff format --check .
	./env mypy

format:
	./env ruff check --fix .
	./env ruff format .

bench:
	./env python -m benchmarks
