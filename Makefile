# Every target first makes its own environment, so each works as the first command on a clean clone.
.DEFAULT_GOAL := help
PYTHON ?= python3
VENV := .venv
CLIENTS := tests/flow/test_generated_clients.py
CONSUMERS := tests/flow/test_consumers.py
JOURNEYS := tests/journeys/test_every_door.py
# what takes minutes of a processor and breaks seldom
APART := $(CLIENTS) $(CONSUMERS) $(JOURNEYS) tests/bench/test_every_benchmark.py tests/flow/test_readme.py tests/flow/test_seventh_method.py
BIN := $(VENV)/bin
export PATH := $(CURDIR)/$(BIN):$(PATH)
# an image may forbid it: each process would then compile every module again, and `make up` take twice as long
export PYTHONDONTWRITEBYTECODE =

.PHONY: help demo up test apart journeys clients consumers quick faults hostile chromium audit audit-dependencies export verify verify-backup lint format coverage fuzz model bench docs tables api pictures examples release wheels lock clean

need = $(if $($1),,$(error make $@ needs $1; make help shows what it takes))

help:  ## what can be made
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 20

demo: $(VENV)/run  ## a whole simulated calibration through the HTTP API, in a minute (KEEP=1 keeps serving)
	@python -m demo

up: $(VENV)/run  ## the whole service in the foreground, on ./stilb-data
	@exec python -m service.up

test quick: export OPENBLAS_NUM_THREADS = 1
test: $(VENV)/dev chromium  ## every test but those of `make apart`, on SQLite and on PostgreSQL (FILE="tests/radiometry -k gls" runs some)
	@$(if $(FILE),pytest -q $(FILE),pytest -q -n $$(($$(nproc) + 1)) --maxprocesses 8 --dist worksteal $(APART:%=--ignore %))

apart: $(VENV)/dev  ## what `make test` leaves out: journeys, clients, consumers, the README, benchmarks in small, a seventh method
	@pytest -q $(APART)

clients: $(VENV)/dev  ## the clients that generators make of the OpenAPI document: each is built, typed and calibrates
	@pytest -q $(CLIENTS)

consumers: $(VENV)/dev  ## the programs that others use read back what the service writes (1.3 GB; WRITE=1 publishes)
	@WRITE="$(WRITE)" pytest -q $(CONSUMERS)

journeys: export OPENBLAS_NUM_THREADS = 1
# some GB, which do not belong into memory
journeys: export TMPDIR := $(or $(TMPDIR),/tmp)
journeys: $(VENV)/dev chromium  ## a night, a flight and a head through pages, command, client and curl, from card to certificate
	@pytest -q -n 2 --dist worksteal $(JOURNEYS)

quick: lint  ## what a change needs in a minute: lint, types, and the tests of the science and of single units
	@pytest -q -m "unit and not slow" -n $$(nproc) --maxprocesses 8 --dist worksteal

faults: export OPENBLAS_NUM_THREADS = 1
faults: $(VENV)/dev  ## drill every fault on both deployments and write docs/faults.md, in an hour (SEED=1, ARGS="--only disk")
	@python -m tests.faults --seed $(or $(SEED),1) $(or $(ARGS),--write)

hostile: export OPENBLAS_NUM_THREADS = 1
hostile: $(VENV)/dev  ## hostile requests at every operation, and 512 hostile connections, in 20 minutes (ARGS="--only attack")
	@python -m tests.faults.hostile $(ARGS)

# Debian's, for the tests of the pages, where it may be installed; where not, they say so and skip. What drives it
# is linked with libatomic, which a chromium does not always bring.
chromium:
	@needed=libatomic1; [ -n "$$STILB_CHROMIUM" ] || command -v chromium >/dev/null || needed="$$needed chromium-headless-shell"; \
	[ "$$(id -u)" != 0 ] || ! command -v apt-get >/dev/null || dpkg -s $$needed >/dev/null 2>&1 \
	|| timeout 600 sh -c "export DEBIAN_FRONTEND=noninteractive; apt-get -qq -o Acquire::http::Timeout=20 update \
	&& apt-get -qq -o Acquire::http::Timeout=20 install -y --no-install-recommends $$needed" >/dev/null 2>&1 || true

audit: $(VENV)/run  ## is the audit trail whole, and every row as it says? (HEAD=seq:hash compares a head noted before)
	@python -m verify.audit $(HEAD)

# tools of its own, which nothing else needs
audit-dependencies: $(VENV)/uv  ## known vulnerabilities of all locked versions, by the databases of PyPI and npm; needs npm
	@uv venv -q --clear build/audit && uv pip install -q --python build/audit --require-hashes -r .ci/audit.lock
	@failed=0; for lock in $(wildcard *.lock .ci/*.lock tests/flow/*/requirements.lock); do echo "$$lock"; \
	build/audit/bin/pip-audit --strict --disable-pip --require-hashes --progress-spinner off -r "$$lock" || failed=1; done; \
	npm --prefix tests/flow/clients audit --package-lock-only && exit $$failed

export: $(VENV)/run  ## what a version or measurement depends on, into a folder: CAL=<id> or MSR=<id> URL=<service> KEY=<key> TO=<folder>
	$(call need,TO)@STILB_KEY="$(KEY)" python -m stilb export $(if $(MSR),--measurement) "$(or $(MSR),$(CAL))" "$(TO)" --url "$(URL)"

verify: $(VENV)/run  ## recompute a certificate or measurement: CERT=<file or address> DATA=<folder or service> [KEY=<key>]
	$(call need,CERT)@STILB_KEY="$(KEY)" python -m verify "$(CERT)" --data "$(DATA)"

verify-backup: $(VENV)/run  ## can a backup be restored? FROM=<folder> [DATABASE=<restored PostgreSQL>] [BLOBS=<s3://...>]
	$(call need,FROM)@python -m verify.backup "$(FROM)" --database "$(DATABASE)" --blobs "$(BLOBS)"

# That the tests can be collected is seen beside mypy, which takes longer and one processor: it compiles every module
# once, as each process of `make test` would otherwise do for itself.
lint: $(VENV)/dev  ## style, types, who may import whom, that no method is known by its name, and the budgets of size
	@ruff check . && ruff format --check . && python -m tests.docs.budgets && \
	(mypy & types=$$!; lint-imports && python -m tests.docs.method_names && collected=$$(pytest -qq --collect-only) \
	|| { echo "$$collected"; false; }; others=$$?; wait $$types && exit $$others)

format: $(VENV)/dev  ## put the code in its style
	@ruff format . && ruff check --fix .

coverage: export OPENBLAS_NUM_THREADS = 1
coverage: $(VENV)/dev  ## how often intervals hold the truth, regime by regime, in fifteen minutes (ARGS='--only "mean of"')
	@python -m tests.regimes $(ARGS)

fuzz: $(VENV)/dev  ## damaged files through the decoder, for SECONDS=60: nothing wrong may be accepted unseen
	@python -m tests.worker.decode.fuzzing --seconds "$(or $(SECONDS),60)"

model: $(VENV)/dev  ## publications and look-ups against a model of them, in STEPS=10000 random steps on either database
	@MODEL_STEPS="$(or $(STEPS),10000)" pytest -q -n 2 tests/store/test_publications_model.py -k random

bench: $(VENV)/dev  ## side by side with what people use today and with the limit
	@python -m bench

docs: $(VENV)/dev  ## the documentation with the API reference, into build/site; a broken link or import fails it
	@sphinx-build -q -W --keep-going -E -j 2 -b html docs build/site && echo "build/site/index.html"

tables: $(VENV)/dev  ## write the tables of parameters and coefficients in docs/ from the specifications
	@PYTHONPATH=. python docs/tables.py

api: $(VENV)/dev  ## the difference of the HTTP interface from the last release; what breaks clients fails it
	@PYTHONPATH=. python docs/api.py

pictures: $(VENV)/dev chromium  ## take the pictures of the README again, from the test that drives the whole procedure
	@STILB_ILLUSTRATIONS=docs/pictures pytest -q tests/browser/test_procedure.py

examples: $(VENV)/dev  ## record the examples of the OpenAPI document from the demos
	@python -m tests.examples

release: $(VENV)/dev  ## check version, change log, tree and both wheels for a release, and build into dist/
	@python .ci/release.py

wheels: $(VENV)/uv  ## build both distributions into dist/, to install them elsewhere
	@uv build -q --offline --wheel -o dist . && python .ci/server_wheel.py dist && ls dist/stilb-*.whl

lock: $(VENV)/uv  ## resolve the dependencies again, with hashes; needs npm
	uv pip compile -q -U --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 --group pyproject.toml:server pyproject.toml -o requirements.lock
	uv pip compile -q -U --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 --group pyproject.toml:dev -c requirements.lock pyproject.toml -o requirements-dev.lock
	echo openapi-python-client | uv pip compile -q -U --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 - -o tests/flow/clients/requirements.lock
	uv pip compile -q -U --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 --overrides tests/flow/consumers/overrides.txt --no-emit-package gdal tests/flow/consumers/requirements.in -o tests/flow/consumers/requirements.lock
	echo pip-audit | uv pip compile -q -U --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 - -o .ci/audit.lock
	npm --prefix tests/flow/clients update --package-lock-only --omit-lockfile-registry-resolved --no-audit --no-fund

clean:  ## forget the environment
	rm -rf $(VENV)

$(VENV)/uv: requirements-bootstrap.lock
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r $<
	@touch $@

$(VENV)/run: requirements.lock $(VENV)/uv
	@uv pip install --quiet --compile-bytecode --python $(BIN)/python --require-hashes -r $<
	@touch $@

$(VENV)/dev: requirements-dev.lock $(VENV)/run
	@uv pip install --quiet --compile-bytecode --python $(BIN)/python --require-hashes -r $<
	@touch $@
