# psabench: set-up, build, check, install. `make help` lists the targets. Own settings go on the command line or into config.mk.
-include config.mk

ifeq ($(origin CC),default)
CC := gcc
endif
ifeq ($(origin CXX),default)
CXX := $(patsubst clang%,clang++%,$(patsubst gcc%,g++%,$(CC)))
endif
AR        ?= ar
OBJCOPY   ?= objcopy
PKGCONFIG ?= pkg-config
PREFIX    ?= /usr/local
LIBDIR    ?= $(PREFIX)/lib
SAN       ?=#                         address,undefined
CFLAGS    ?= $(if $(SAN),-O1 -g1,-O2 -g)
WERROR    ?=#                         1: a warning is an error, as in make test
BUILD     ?= build$(if $(filter clang%,$(notdir $(CC))),-clang)$(if $(SAN),-san)
FUZZ_S    ?= 20
BENCH_S   ?= 180#                      seconds of measuring; 60 for a quick look
JOBS      ?= $(shell nproc)#           tests at once
SAN_E2E   := $(wildcard $(addprefix tests/e2e/*/test_,$(addsuffix .py,bad_* unit tools canopen faults_random cycles)))
# Build a part only, say DIRS='base chip' T=test_ads1282 while the rest does not compile.
DIRS      ?= base trace phys chip canopen board unit link command fault control scpi scenario bench app api
UNIT      := $(sort $(wildcard tests/unit/*/test_*.c tests/unit/*/*/test_*.c))
TIER      ?= all#                      tests of tests/tiers.toml: test, rest (what make test leaves out), all
ifneq ($(filter check,$(MAKECMDGOALS)),)
TESTS     ?= $(if $(T),$(foreach t,$(T),$(if $(filter %/$(t).c,$(UNIT)),$(t),$(error no file $(t).c in tests/unit))),$(shell python3 tools/tiers.py $(TIER) $(if $(SAN),--sanitizers)))
endif

VERSION := $(shell sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)
ABI     := $(shell sed -n 's/^\#define PSABENCH_ABI \([0-9]*\)/\1/p' emu/api/psabench.h)
NAV_ABI := $(shell sed -n 's/^\#define NAV_ABI \([0-9]*\)$$/\1/p' emu/nav/nav.h)

# What correctness needs stands before the user's CFLAGS. -ffp-contract=off: the same bytes on every machine. All objects are
# fit for the shared library: -fPIC with hidden symbols costs the emulator nothing that can be measured.
STD   := -std=c11 -ffp-contract=off -fPIC -fvisibility=hidden -DPSABENCH_VERSION=$(VERSION)
WARN  := -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wundef -Wstrict-prototypes -Wmissing-prototypes $(if $(WERROR),-Werror)
SANFL := $(if $(SAN),-fsanitize=$(SAN) -fno-sanitize-recover=all -fno-omit-frame-pointer)
INC   := -Iemu -Ibuild $(shell $(PKGCONFIG) --cflags libcjson libfyaml 2>/dev/null)
LIBS  := $(shell $(PKGCONFIG) --libs libcjson libfyaml 2>/dev/null) -lm
FLAGS   = $(STD) $(WARN) $(INC) $(CPPFLAGS)
CXXFLAGS ?= $(patsubst -O0,-O1,$(patsubst -O2,-O3,$(CFLAGS)))#   without optimisation Eigen asks for C++'s runtime
# C++ of emu/nav: Eigen without vectors of its own, which differ from machine to machine; no exceptions and no RTTI, so that it
# needs no runtime of C++ and links into C. Pairs of doubles in one register (SLP) cost gcc 12 a third of the Monte-Carlo's speed.
CXXSTD := $(patsubst -std=c11,-std=c++17,$(STD)) -fno-exceptions -fno-rtti -fno-math-errno -fno-tree-slp-vectorize -DEIGEN_DONT_VECTORIZE -DEIGEN_NO_MALLOC -DEIGEN_MPL2_ONLY
CXXWARN = $(filter-out -Wstrict-prototypes -Wmissing-prototypes,$(WARN)) -Wmissing-declarations
EIGEN  := $(patsubst -I%,-isystem %,$(shell $(PKGCONFIG) --cflags eigen3 2>/dev/null))
# Clang's check of function pointers in C++ asks for RTTI.
CXXSANFL := $(SANFL) $(if $(findstring undefined,$(SAN)),-fsanitize=float-cast-overflow) $(if $(SAN),$(if $(findstring clang,$(CXX)),-fno-sanitize=function))
CXXCOMPILE = $(CXX) $(CXXSTD) $(CXXWARN) -Iemu $(EIGEN) $(CPPFLAGS) $(CXXSANFL) $(CXXFLAGS)
COMPILE = $(CC) $(FLAGS) $(SANFL) $(CFLAGS)
LINK    = $(CC) $(SANFL) $(CFLAGS) $(LDFLAGS)

# One word a step; V=1 shows the whole commands.
Q  = $(if $(V),,@)
say = $(if $(V),,@echo '  $(1)	$(2)')

# build/gen/gen.mk is made from proto/psabench.yaml before anything is compiled and names the generated sources in GEN_SRC.
PY     := .venv/bin/python
NO_GEN := setup run test test-all quick bench mutants clean help uninstall lock
ifneq ($(wildcard proto/psabench.yaml),)
ifneq ($(if $(MAKECMDGOALS),$(filter-out $(NO_GEN),$(MAKECMDGOALS)),all),)
include build/gen/gen.mk
endif
endif

SRC      := $(sort $(foreach d,$(DIRS),$(wildcard emu/$(d)/*.c emu/$(d)/*/*.c)))
MAIN     := $(filter emu/app/main.c,$(SRC))
OBJ      := $(patsubst %.c,$(BUILD)/obj/%.o,$(SRC) $(GEN_SRC))
LIB_OBJ  := $(filter-out $(BUILD)/obj/emu/app/main.o,$(OBJ))
API_OBJ  := $(filter $(BUILD)/obj/emu/api/%,$(OBJ))
CORE_OBJ := $(filter-out $(API_OBJ) $(foreach d,link command fault control scpi scenario bench app,$(BUILD)/obj/emu/$(d)/%),$(OBJ))
LIB_SO   := $(BUILD)/libpsabench.so.$(ABI)
LIB_ALL  := $(if $(API_OBJ),$(LIB_SO) $(BUILD)/libpsabench.so $(BUILD)/libpsabench.a $(BUILD)/psabench.pc)
NAV_OBJ  := $(patsubst %.cpp,$(BUILD)/obj/%.o,$(sort $(wildcard emu/nav/*.cpp))) $(BUILD)/obj/emu/base/detmath.o
NAV_SO   := $(BUILD)/libpsabench-nav.so.$(NAV_ABI)
NAV_ALL  := $(NAV_SO) $(BUILD)/libpsabench-nav.so $(BUILD)/libpsabench-nav.a $(BUILD)/psabench-nav.pc
TEST_BIN := $(addprefix $(BUILD)/tests/,$(TESTS))
FUZZ      ?= $(sort $(patsubst tests/fuzz/fuzz_%.c,%,$(wildcard tests/fuzz/fuzz_*.c)))
FUZZ_BIN := $(FUZZ:%=$(BUILD)/fuzz/fuzz_%)
BENCH_BIN := $(patsubst tests/bench/%.c,$(BUILD)/bench/%,$(sort $(wildcard tests/bench/*.c)))
C_FILES   = $(sort $(shell find emu tests examples docs/examples -name '*.[ch]' -o -name '*.[ch]pp'))

.SECONDARY:
.DELETE_ON_ERROR:
.PHONY: all lib setup run quick test test-all bench bench-bin mutants fault-matrix false-positives alarms check pytest san builds e2e e2e-san e2e-vcan e2e-slc0 uml soak fuzz fuzz-check fuzz-long fuzz-bin fuzz-each lint format golden docs prove install uninstall wheel clean help lock

## all: the emulator, build/psa-emu (make CC=clang and make SAN=address,undefined build beside it, in build-clang and build-san)
all: $(if $(MAIN),$(BUILD)/psa-emu,$(LIB_OBJ)) lib

## lib: libpsabench and libpsabench-nav, shared and static, and their pkg-config files; headers: emu/api/psabench.h, emu/nav/nav*.h
lib: $(LIB_ALL) $(NAV_ALL)

$(BUILD)/psa-emu: $(filter-out $(API_OBJ),$(OBJ))
	$(call say,LINK,$@)
	$(Q)$(LINK) -o $@ $^ $(LIBS)

# One object of what the interface needs of the core, with no name but psabench_* to be seen: also in the static library. A thin
# archive (T): an ordinary one would keep one object of each file name, and every room has its board.o.
$(BUILD)/lib/psabench.o: $(API_OBJ) $(CORE_OBJ)
	@mkdir -p $(@D)
	$(call say,LD -r,$@)
	$(Q)rm -f $(@D)/core.a && $(AR) rcsT $(@D)/core.a $(CORE_OBJ)
	$(Q)$(LD) -r -o $@ $(API_OBJ) $(@D)/core.a && $(OBJCOPY) --localize-hidden $@

$(BUILD)/lib/psabench-nav.o: $(NAV_OBJ)
	@mkdir -p $(@D)
	$(call say,LD -r,$@)
	$(Q)$(LD) -r -o $@ $^ && $(OBJCOPY) --localize-hidden $@

$(LIB_SO): $(BUILD)/lib/psabench.o
$(NAV_SO): $(BUILD)/lib/psabench-nav.o
$(LIB_SO) $(NAV_SO):
	$(call say,LINK,$@)
	$(Q)$(LINK) -shared -Wl,-soname,$(@F) -o $@ $^ -lm

$(BUILD)/libpsabench.so: $(LIB_SO)
$(BUILD)/libpsabench-nav.so: $(NAV_SO)
$(BUILD)/libpsabench.so $(BUILD)/libpsabench-nav.so:
	$(Q)ln -sf $(^F) $@

$(BUILD)/libpsabench.a $(BUILD)/libpsabench-nav.a: $(BUILD)/lib%.a: $(BUILD)/lib/%.o
	$(Q)rm -f $@ && $(AR) rcs $@ $^

# Other makes may run in this folder at the same time: a name of its own until it is whole, and install fills in its own.
FILL_IN = sed -e 's|@PREFIX@|$(PREFIX)|; s|@LIBDIR@|$(LIBDIR)|; s|@VERSION@|$(VERSION)|'
$(BUILD)/psabench.pc: emu/api/psabench.pc.in
$(BUILD)/psabench-nav.pc: emu/nav/psabench-nav.pc.in
$(BUILD)/psabench.pc $(BUILD)/psabench-nav.pc: pyproject.toml Makefile FORCE
	$(Q)$(FILL_IN) $(filter %.in,$^) > $@.$$$$ && \
	    { cmp -s $@.$$$$ $@ && rm $@.$$$$ || mv $@.$$$$ $@; }

# In a line of its own: .SECONDARY above would leave a target alone that waits for a file that is never there.
.PHONY: FORCE
FORCE:

$(BUILD)/obj/%.o: %.cpp Makefile
	@mkdir -p $(@D)
	$(call say,CXX,$@)
	$(Q)$(CXXCOMPILE) -MMD -MP -c -o $@ $<

$(BUILD)/obj/%.o: %.c Makefile
	@mkdir -p $(@D)
	$(call say,CC,$@)
	$(Q)$(COMPILE) -MMD -MP -c -o $@ $<

$(BUILD)/tests/test_nav: $(BUILD)/libpsabench-nav.a
$(BUILD)/obj/tests/%.o: CPPFLAGS += -Itests/unit#                                   rigs that several folders use
$(foreach t,$(UNIT),$(eval $(BUILD)/tests/$(basename $(notdir $(t))): $(BUILD)/obj/$(t:.c=.o)))
$(BUILD)/tests/%: $(LIB_OBJ)
	@mkdir -p $(@D)
	$(call say,LINK,$@)
	$(Q)$(LINK) -o $@ $(filter %.o,$^) $(filter %.a,$^) $(LIBS) -lcmocka

$(BUILD)/obj/tests/bench/%.o: CPPFLAGS += -D_POSIX_C_SOURCE=199309L#                     clock_gettime
$(BUILD)/bench/%: $(BUILD)/obj/tests/bench/%.o $(LIB_OBJ)
	@mkdir -p $(@D)
	$(call say,LINK,$@)
	$(Q)$(LINK) -o $@ $< $(LIB_OBJ) $(LIBS)

build/gen/gen.mk: $(wildcard proto/*.yaml) tools/gen_proto.py $(wildcard tools/protogen/*.py) | $(PY)
	@mkdir -p $(@D)
	$(PY) tools/gen_proto.py --out $(@D)
	@echo 'GEN_SRC := $$(sort $$(wildcard build/gen/*.c))' > $@

$(PY):
	tools/setup run

## setup: system packages (as root or with sudo) and .venv, all that make test needs
setup:
	tools/setup test

## run: set-up, build, and the main job: board up, accelerometers calibrated through the wire; report in build/run/report.html
run:
	@tools/setup run
	@$(MAKE) --no-print-directory all
	@.venv/bin/psabench run all --out build/run

## quick: build and the tests nearest to what changed since the last commit, within a minute; says what it left out
quick:
	@tools/setup test
	@$(PY) tools/quick.py

## test: set-up, build, and the tests of tier `test` (tests/tiers.toml) in ten minutes; ends with one line of counts
test:
	@tools/setup test
	@python3 tools/test_all.py test

## test-all: set-up, and every test there is: all compilers, sanitizers, links, pages, fuzz corpus, long runs
test-all:
	@tools/setup test
	@python3 tools/test_all.py all

## bench: speed beside Verilog models of the same board (Icarus, Verilator) and against the targets, into docs/reference/performance.md
bench:
	@tools/setup bench
	@$(MAKE) --no-print-directory bench-bin
	@PYTHONPATH=tools BENCH_CC='$(CC)' BENCH_CFLAGS='$(CFLAGS)' $(PY) -m tests.bench.run --seconds $(BENCH_S)

bench-bin: all $(BENCH_BIN)

## mutants: does the conformance suite find what is wrong? docs/reference/mutants.md (some: make mutants MUTANTS='pik- sdo-')
mutants: | $(PY)
	@PYTHONPATH=tools $(PY) -m tests.mutants.run $(MUTANTS)

## false-positives: does the conformance suite fail boards that conform? docs/reference/false_positives.md (some: ARGS='w24 --minutes 5')
alarms: false-positives # its earlier name
false-positives: all
	@PYTHONPATH=tools $(PY) -m tests.false_positives.run $(ARGS) $(ALARMS)

## fault-matrix: every fault at every point, and the requirements that the conformance suite finds broken (docs/faults.md)
fault-matrix: all
	PSABENCH_FAULTS=all $(PY) -m pytest tests/conform/suite/test_conform_faults.py

## check: the C unit tests (one: make check T=test_sched)
check: $(TEST_BIN)
	@python3 tools/run_c_tests.py --jobs $(JOBS) $(TEST_BIN)

## san: the C unit tests under AddressSanitizer and UBSan
san:
	@$(MAKE) --no-print-directory SAN=address,undefined check

## pytest: the Python tests, golden traces included (a file: make pytest T=test_frames)
PYTESTS = $(if $(T),$(foreach t,$(T),$(or $(shell find tests -name '$(t).py'),$(error no file $(t).py in tests))),tests/py tests/conform tests/golden)
pytest: $(if $(T),all,bench-bin)
	$(PY) -m pytest --tier $(TIER) $(PYTESTS)

## builds: the emulator and its library as clang, -O0 and -O3 make them, and under sanitizers, which must all do the same
builds:
	@$(MAKE) --no-print-directory CC=clang all
	@$(MAKE) --no-print-directory CFLAGS='-O0 -g' BUILD=build-O0 all
	@$(MAKE) --no-print-directory SAN=address,undefined all
	@$(MAKE) --no-print-directory CC=clang SAN=address,undefined all
	@$(MAKE) --no-print-directory CFLAGS='-O3 -g' BUILD=build-O3 lib
	@$(MAKE) --no-print-directory CC=clang CFLAGS='-O0 -g' BUILD=build-clang-O0 lib

## e2e: the end-to-end suite over the transports of the host (socketcand, slcan on a pty)
e2e: all
	$(PY) -m pytest --tier $(TIER) tests/e2e -m "host and not soak"

## e2e-san: what strangers and their mistakes do to the emulator, with it under AddressSanitizer and UBSan
e2e-san:
	@$(MAKE) --no-print-directory SAN=address,undefined all
	PSA_EMU=$(CURDIR)/build-san/psa-emu $(PY) -m pytest $(SAN_E2E) -m "host and not soak"

## uml: the end-to-end suite on a kernel's vcan0 and slc0: this kernel's, or a user-mode one's
uml: e2e-vcan e2e-slc0

e2e-vcan: all
	tests/uml/native tests/uml/job_e2e.sh --tier $(TIER)

e2e-slc0: all
	tests/uml/slc0 --tier $(TIER)

## golden: write the golden traces anew; review the difference like code
golden: all
	GOLDEN=rewrite $(PY) -m pytest -q tests/golden

## soak: the end-to-end tests that take a minute or more of real time, on the host and on vcan0
soak: all
	$(PY) -m pytest tests/e2e -m "host and soak"
	tests/uml/native --timeout 1200 tests/uml/job_e2e.sh -m "vcan and soak"

FUZZ_MAKE := $(MAKE) --no-print-directory CC=clang SAN=address,undefined,fuzzer-no-link BUILD=build-fuzz

## fuzz: each tests/fuzz/fuzz_*.c for FUZZ_S seconds (libFuzzer, sanitizers; some: make fuzz FUZZ='psa2 api' FUZZ_S=3600)
fuzz:
	@$(FUZZ_MAKE) fuzz-each

## fuzz-check: the files that fuzzing has found so far, then some thousand inputs for each target, the same each time
fuzz-check:
	@$(FUZZ_MAKE) FUZZ_S=check fuzz-each

## fuzz-long: each target for an hour of CPU in all, a target a core; what has been run counts (LONG='psa2 pik --minutes 5')
fuzz-long:
	@$(FUZZ_MAKE) fuzz-bin
	@$(PY) tools/fuzz_long.py $(LONG)

fuzz-bin: $(FUZZ_BIN)

fuzz-each: $(FUZZ_BIN)
	@tests/fuzz/run $(FUZZ_S) $(FUZZ_BIN)

$(filter $(BUILD)/fuzz/fuzz_ads1282_%,$(FUZZ_BIN)): $(BUILD)/obj/tests/fuzz/ads1282_world.o
$(filter $(BUILD)/fuzz/fuzz_ads1256_%,$(FUZZ_BIN)): $(BUILD)/obj/tests/fuzz/ads1256_world.o
$(filter $(BUILD)/fuzz/fuzz_ad7712_%,$(FUZZ_BIN)): $(BUILD)/obj/tests/fuzz/ad7712_world.o

$(BUILD)/fuzz/%: $(BUILD)/obj/tests/fuzz/%.o $(LIB_OBJ)
	@mkdir -p $(@D)
	$(call say,LINK,$@)
	$(Q)$(LINK) -fsanitize=fuzzer -o $@ $(filter %.o,$^) $(LIBS)

## lint: formatting, warnings of gcc and clang, clang-tidy, include table and sizes, ruff, strict mypy (part: LINT=test, LINT=rest)
lint: all
	@FLAGS='$(FLAGS)' CXXLINT='$(CXXSTD) $(CXXWARN) -Iemu $(EIGEN)' tools/lint $(LINT)

## format: rewrite C and Python in the project's format
format:
	$(if $(C_FILES),clang-format -i $(C_FILES))
	$(PY) -m ruff format .

## docs: what follows from proto/ and is kept in git: DBC, EDS, docs/reference/protocol.md, docs/reference/requirements.md, FIDELITY.md
docs: all
	$(PY) tools/gen_proto.py
	$(PY) tools/gen_docs.py
	$(PY) tools/gen_commands.py
	$(PY) tools/gen_requirements.py
	$(PY) tools/gen_fault_matrix.py
	$(PY) tools/gen_fidelity.py
	$(PY) tools/fuzz_long.py --docs

## prove: run what proves the models whose sources have changed (or GROUP=psa2, GROUP=all), and record it (docs/evidence.md)
prove: all
	@$(PY) tools/evidence.py --prove $(GROUP); rc=$$?; $(PY) tools/gen_fidelity.py && exit $$rc

SIGROK := share/libsigrokdecode/decoders

## install: psa-emu, libpsabench, protocol files, sigrok decoders (where sigrok looks, too) and sessions under $(DESTDIR)$(PREFIX)
install: all
	install -D -m 755 $(BUILD)/psa-emu $(DESTDIR)$(PREFIX)/bin/psa-emu
	install -D -m 644 emu/api/psabench.h $(DESTDIR)$(PREFIX)/include/psabench.h
	install -D -m 755 $(LIB_SO) $(DESTDIR)$(LIBDIR)/$(notdir $(LIB_SO))
	ln -sf $(notdir $(LIB_SO)) $(DESTDIR)$(LIBDIR)/libpsabench.so
	install -m 644 $(BUILD)/libpsabench.a $(DESTDIR)$(LIBDIR)/libpsabench.a
	$(FILL_IN) emu/api/psabench.pc.in | install -D -m 644 /dev/stdin $(DESTDIR)$(LIBDIR)/pkgconfig/psabench.pc
	install -D -m 644 -t $(DESTDIR)$(PREFIX)/include/psabench/nav emu/nav/nav.h emu/nav/nav_mc.h
	install -m 755 $(NAV_SO) $(DESTDIR)$(LIBDIR)/$(notdir $(NAV_SO))
	ln -sf $(notdir $(NAV_SO)) $(DESTDIR)$(LIBDIR)/libpsabench-nav.so
	install -m 644 $(BUILD)/libpsabench-nav.a $(DESTDIR)$(LIBDIR)/libpsabench-nav.a
	$(FILL_IN) emu/nav/psabench-nav.pc.in | install -m 644 /dev/stdin $(DESTDIR)$(LIBDIR)/pkgconfig/psabench-nav.pc
	for f in $$(find -L proto decoders share -type f ! -name '*.pyc'); do \
	    install -D -m 644 $$f $(DESTDIR)$(PREFIX)/share/psabench/$$f || exit 1; done
	cd decoders && for f in $$(find -L * -type f ! -name '*.pyc'); do \
	    install -D -m 644 $$f $(abspath $(DESTDIR)$(PREFIX))/$(SIGROK)/$$f || exit 1; done

## uninstall: what install put there
uninstall:
	rm -f $(DESTDIR)$(PREFIX)/bin/psa-emu $(DESTDIR)$(PREFIX)/include/psabench.h $(DESTDIR)$(LIBDIR)/pkgconfig/psabench.pc \
	    $(addprefix $(DESTDIR)$(LIBDIR)/libpsabench.,a so so.$(ABI)) $(DESTDIR)$(LIBDIR)/pkgconfig/psabench-nav.pc \
	    $(addprefix $(DESTDIR)$(LIBDIR)/libpsabench-nav.,a so so.$(NAV_ABI))
	rm -rf $(DESTDIR)$(PREFIX)/share/psabench $(DESTDIR)$(PREFIX)/include/psabench $(patsubst decoders/%/pd.py,$(DESTDIR)$(PREFIX)/$(SIGROK)/%,$(wildcard decoders/*/pd.py))

## wheel: build/dist/psabench-*.whl, the Python package with emulator, library and data files in it
wheel: all
	.venv/bin/uv build -q --wheel --no-build-isolation --offline --python $(PY) -o build/dist

## compile_commands.json: how each file is compiled, for editors and clang-tidy
compile_commands.json: Makefile $(SRC) $(GEN_SRC)
	@{ echo '['; sep=; for f in $(SRC) $(GEN_SRC) $(UNIT); do \
	    printf '%s{"directory": "%s", "file": "%s", "command": "%s -c %s"}\n' "$$sep" '$(CURDIR)' $$f '$(COMPILE) -Itests/unit' $$f; \
	    sep=,; done; echo ']'; } > $@

# spidev and gpiod are a Linux machine's hardware, which tests put their own in place of; spidev would have to be compiled.
UV_LOCK = .venv/bin/uv pip compile -q --upgrade --universal --python-version 3.11 --generate-hashes --custom-compile-command 'make lock'
## lock: pin requirements.in in requirements.lock, and what requirements-mf4.in needs beside it in requirements-mf4.lock
lock: $(PY)
	$(UV_LOCK) --no-emit-package spidev --no-emit-package gpiod -o requirements.lock requirements.in
	$(UV_LOCK) $$(sed -n 's/^\([^ =]*\)==.*/--no-emit-package \1/p' requirements.lock) -c requirements.lock \
	    -o requirements-mf4.lock requirements-mf4.in

## clean: everything that was built; .venv stays
clean:
	rm -rf build build-* compile_commands.json

## help: this list
help:
	@sed -n 's/^## \([a-z_.0-9-]*\): \(.*\)/  \1|\2/p' Makefile | while IFS='|' read -r t d; do printf '%-24s %s\n' "$$t" "$$d"; done

-include $(BENCH_BIN:$(BUILD)/bench/%=$(BUILD)/obj/tests/bench/%.d)
-include $(FUZZ_BIN:$(BUILD)/fuzz/%=$(BUILD)/obj/tests/fuzz/%.d)
-include $(OBJ:.o=.d) $(NAV_OBJ:.o=.d) $(UNIT:%.c=$(BUILD)/obj/%.d)
