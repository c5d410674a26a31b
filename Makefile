# make demo   everything it needs, then the live dashboard on one printed URL (SOURCE=drive DATA=<folder> plays a log,
#             SOURCE=tilt or arm other simulated boards, BOARD=emulated the firmware image in the emulator, OFFICE=1 also
#             an office that watches over a slow line)
# make test   everything it needs, then all tests
# make compilers  the core by other compilers: clang-tidy, sanitizers, aarch64
# make cases  inputs that once failed, from $GYROFREE_CASES or ../shared/cases
# make zenohd Zenoh's own router (cargo builds it), held against our rules
# make firmware  the board's image and map into build/firmware, with its size
# make faults every fault, done to real processes, and the tables of docs/faults.md
# make fuzz   libFuzzer on the board's decoder and commands (SECONDS=60); make fuzz-web hostile requests to the page
# make wheel  dist/gyrofree-*.whl, which installs and runs where there is no compiler
# make site   the documents as a site in build/site, links checked; make pictures takes its pictures anew
# make sbom   what the product is made of, build/sbom.json; make audit asks for known vulnerabilities of it
# make bench  the figures of README and docs, one JSON line each
PYTHON ?= python3
SOURCE ?= table
SPEED ?= 1
PORT ?= 8080
BUS_PORT ?= 7447
SECONDS ?= 60
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
# The lists name every package with its hash, also those that others ask for.
INSTALL := $(PIP) install --quiet --no-deps --require-hashes
DRIVE := $(if $(DATA),--data "$(DATA)")

.PHONY: demo test cases setup wheel dev system-packages bench docs site pictures messages lint compilers firmware fuzz fuzz-web compose-test faults zenohd clean

# BOARD=emulated: the table is sensed by the firmware image in the emulator
demo: setup $(if $(filter emulated,$(BOARD)),.make/board firmware)
	@$(BIN)/gyrofree demo --source $(if $(filter emulated,$(BOARD)),emulated,$(SOURCE)) $(DRIVE) $(if $(OFFICE),--office) --speed $(SPEED) --port $(PORT) --bus-port $(BUS_PORT)

# Packages come while the core compiles; neither needs the other. For tests all that they want.
ALSO := $(if $(filter test,$(MAKECMDGOALS)),.make/dev .make/site)
setup: .make/tools
	@$(MAKE) --no-print-directory --silent --output-sync=line -j3 BUILDS=$(BUILDS) .make/core .make/runtime $(ALSO)

.make/venv:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed; this is $$($(PYTHON) --version). Name another: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || if [ "$$(id -u)" = 0 ]; then apt-get update -q && apt-get install -y -q python3-venv; else echo "This Python cannot make environments; run: sudo apt-get install python3-venv"; exit 1; fi
	@echo "Making the environment .venv ..."
	@$(PYTHON) -m venv .venv
	@mkdir -p .make && touch $@

.make/tools: requirements/build.txt requirements/compiler.txt requirements/native.sh | .make/venv
	@echo "Installing what the core is built with ..."
	@$(INSTALL) -r requirements/build.txt
	@sh requirements/native.sh
	@touch $@

.make/runtime: requirements/runtime.txt .make/tools
	@echo "Installing packages, each checked against its hash ..."
	@$(INSTALL) -r requirements/runtime.txt
	@touch $@

# The package itself, editable, with the build of its core that this machine runs.
# For tests both builds at once.
BUILDS := $(if $(filter test dev cases,$(MAKECMDGOALS)),both,here)
CORE := $(wildcard inertial/core/*.c* inertial/core/CMakeLists.txt inertial/core/*/*.?pp)
.make/core: pyproject.toml $(CORE) .make/tools
	@echo "Compiling the core, a minute or two ..."
	@CXX="$$(cat .make/compiler)" $(PIP) install --quiet --no-deps --no-build-isolation \
		--config-settings=cmake.define.Python_INCLUDE_DIR="$$(cat .make/headers)" --config-settings=cmake.define.BUILDS=$(BUILDS) --editable .
	@echo $(BUILDS) > $@

# Both builds of the core: what the tests compare.
.make/both-cores: .make/core
	@[ "$$(cat $<)" = both ] || { rm $<; $(MAKE) --no-print-directory --silent BUILDS=both $<; }
	@touch $@

# A wheel in dist/ that needs no compiler where it is installed.
wheel: .make/tools
	@CXX="$$(cat .make/compiler)" $(PIP) wheel --quiet --no-deps --no-build-isolation \
		--config-settings=cmake.define.Python_INCLUDE_DIR="$$(cat .make/headers)" --config-settings=cmake.define.BUILDS=both --wheel-dir dist .
	@ls dist/*.whl

.make/board: requirements/board.txt .make/runtime
	$(INSTALL) -r requirements/board.txt
	@touch $@

dev: .make/dev .make/both-cores
.make/dev: requirements/dev.txt .make/runtime
	@echo "Installing what the tests need ..."
	@$(INSTALL) --no-compile -r requirements/dev.txt
	@touch $@

system-packages:
	@sh tests/support/system_packages.sh

# The browser draws in software and wants the machine for itself, so it comes after the others.
test: setup dev system-packages site
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder -m "not browser and not faults and not cases and not zenohd and not compilers"
	$(BIN)/python -m pytest -m browser

# Every fault done to real processes; it writes the tables of docs/faults.md.
faults: setup dev system-packages
	$(BIN)/python tests/faults/run.py

# Zenoh's own router, built by cargo (5 minutes), and what is held against it.
build/zenohd/bin/zenohd:
	cargo install zenohd --version 1.10.2 --locked --root build/zenohd

zenohd: setup dev build/zenohd/bin/zenohd
	ZENOHD=$(CURDIR)/build/zenohd/bin/zenohd $(BIN)/python -m pytest -q tests/sites/test_zenohd.py

# The inputs that once failed, from $GYROFREE_CASES or ../shared/cases.
cases: setup dev
	$(BIN)/python -m pytest -q -rs tests/system/test_cases.py

lint: dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# clang-tidy over the core, its tests with the sanitizers, and its bits on aarch64: five to ten minutes.
compilers: setup dev
	@sh tests/support/system_packages.sh compilers
	$(BIN)/python -m pytest -q -m compilers tests/inertial

bench: setup dev
	@for file in tests/bench/bench_*.py; do echo "== $$file"; $(BIN)/python $$file || exit 1; done

firmware:
	@command -v arm-none-eabi-gcc >/dev/null || { echo "The board's compiler is needed; run: sudo apt-get install gcc-arm-none-eabi"; exit 1; }
	@$(MAKE) --no-print-directory -C firmware_protocol/port/lpc1768 OUT="$(CURDIR)/build/firmware"

fuzz: setup dev system-packages
	$(BIN)/python tests/fuzz.py --seconds $(SECONDS)

fuzz-web: setup dev
	$(BIN)/python tests/fuzz_web.py

docs: setup
	$(BIN)/python -m firmware_protocol.document > docs/protocol.md
	$(BIN)/python -m messages.contract.document > docs/topics.md
	$(BIN)/gyrofree config reference > docs/configuration.md
	$(BIN)/python -m gyrofree.operations.document > docs/metrics.md

# Its packages want versions of their own, so they have an environment of their own.
.make/site: requirements/site.txt | .make/venv
	@echo "Installing what the site is built with ..."
	@rm -rf .make/site && $(PYTHON) -m venv .make/site
	@.make/site/bin/python -m pip --disable-pip-version-check install --quiet --no-deps --require-hashes -r requirements/site.txt
	@touch $@

site: .make/site
	@said=$$(NO_MKDOCS_2_WARNING=1 .make/site/bin/mkdocs build --strict 2>&1) || { echo "$$said"; exit 1; } # --quiet would count no warning
	@echo "build/site/index.html"

pictures: setup dev system-packages
	$(BIN)/python docs/guide/draw.py docs/guide/pictures
	$(BIN)/python tests/support/pictures.py docs/guide/pictures

messages: dev
	$(BIN)/python -m grpc_tools.protoc -Imessages/contract --python_out=messages/contract --pyi_out=messages/contract messages/contract/gyrofree.proto

# What the product is made of, from the lock: CycloneDX JSON.
sbom: dev
	@mkdir -p build && $(BIN)/python -P deploy/sbom.py > build/sbom.json
	@echo "build/sbom.json"

# Known vulnerabilities of what the lock names; its packages have an environment of their own.
.make/audit: requirements/audit.txt | .make/venv
	@rm -rf .make/audit && $(PYTHON) -m venv .make/audit
	@.make/audit/bin/python -m pip --disable-pip-version-check install --quiet --no-deps --require-hashes -r requirements/audit.txt
	@touch $@

audit: .make/audit
	@sh deploy/audit.sh .make/audit/bin/pip-audit

compose-test:
	bash deploy/compose-test.sh

clean:
	rm -rf .venv .make var artefacts
