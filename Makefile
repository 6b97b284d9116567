# psabench: set-up, build, check, install. `make help` lists the targets. Own settings go on the command line or into config.mk.
-include config.mk

CC        := $(if $(filter default,$(origin CC)),gcc,$(CC))
CXX       := $(if $(filter default,$(origin CXX)),$(patsubst clang%,clang++%,$(patsubst gcc%,g++%,$(CC))),$(CXX))
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
SAN_E2E   := $(wildcard $(addprefix tests/e2e/*/test_,$(addsuffix .py,bad_* unit tools canopen faults_random cycles outputs text_ports)))
# Build a part only, say DIRS='base chip' T=test_ads1282, while the rest does not compile.
DIRS      ?= base trace phys chip canopen board unit link command fault control scpi scenario bench telemetry app api
UNIT      := $(sort $(wildcard tests/unit/*/test_*.c tests/unit/*/*/test_*.c))
TIER      ?= all#                      tests of tests/tiers.toml: test, rest (what make test leaves out), all
TESTS     ?= $(if $(filter check,$(MAKECMDGOALS)),$(if $(T),$(foreach t,$(T),$(if $(filter %/$(t).c,$(UNIT)),$(t),\
                 $(error no file $(t).c in tests/unit))),$(shell python3 tools/tiers.py $(TIER))))
VERSION := $(shell sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)
ABI_psabench     := $(shell sed -n 's/^\#define PSABENCH_ABI \([0-9]*\)/\1/p' emu/api/psabench.h)
ABI_psabench-nav := $(shell sed -n 's/^\#define NAV_ABI \([0-9]*\)$$/\1/p' nav/nav.h)
export PYTHONPYCACHEPREFIX ?= $(CURDIR)/build/pycache#   else each program that a test starts compiles numpy again
unexport PYTHONDONTWRITEBYTECODE
# What correctness needs is before the user's CFLAGS. -ffp-contract=off: the same bytes on every machine. All objects are
# fit for the shared library: -fPIC with hidden symbols costs the emulator nothing that can be measured.
STD   := -std=c11 -ffp-contract=off -fPIC -fvisibility=hidden -DPSABENCH_VERSION=$(VERSION)
WARN  := -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wundef -Wstrict-prototypes -Wmissing-prototypes $(if $(WERROR),-Werror)
SANFL := $(if $(SAN),-fsanitize=$(SAN) -fno-sanitize-recover=all -fno-omit-frame-pointer)
INC   := -Iemu -Ibuild -isystem build/gen/mavlink $(shell $(PKGCONFIG) --cflags libcjson libfyaml 2>/dev/null)
LIBS  := $(shell $(PKGCONFIG) --libs libcjson libfyaml 2>/dev/null) -lm
FLAGS   = $(STD) $(WARN) $(INC) $(CPPFLAGS)
CXXFLAGS ?= $(patsubst -O0,-O1,$(patsubst -O2,-O3,$(CFLAGS)))#   without optimisation Eigen asks for C++'s runtime
# C++ of nav, which includes from the root of the checkout and of emu only base/detmath.h (tools/check_includes.py): Eigen without vectors of its own, which differ from machine to machine; no exceptions and no RTTI, so that it
# needs no runtime of C++ and links into C. Pairs of doubles in one register (SLP) cost gcc 12 a third of the Monte-Carlo's speed.
CXXSTD := $(patsubst -std=c11,-std=c++17,$(STD)) -fno-exceptions -fno-rtti -fno-math-errno -fno-tree-slp-vectorize -DEIGEN_DONT_VECTORIZE -DEIGEN_NO_MALLOC -DEIGEN_MPL2_ONLY
CXXWARN = $(filter-out -Wstrict-prototypes -Wmissing-prototypes,$(WARN)) -Wmissing-declarations
EIGEN  := $(patsubst -I%,-isystem %,$(shell $(PKGCONFIG) --cflags eigen3 2>/dev/null))
CXXSANFL := $(SANFL) $(if $(findstring undefined,$(SAN)),-fsanitize=float-cast-overflow) $(if $(SAN),$(if $(findstring clang,$(CXX)),-fno-sanitize=function))#  which asks for RTTI
CXXCOMPILE = $(CXX) $(CXXSTD) $(CXXWARN) -I. $(EIGEN) $(CPPFLAGS) $(CXXSANFL) $(CXXFLAGS)
COMPILE = $(CC) $(FLAGS) $(SANFL) $(CFLAGS)
LINK    = $(CC) $(SANFL) $(CFLAGS) $(LDFLAGS)
RPATH  ?= -Wl,-rpath,'$$ORIGIN/../lib'#   of the emulator: libraries that a wheel has beside it (setup.py); a distribution sets it to nothing
# One word a step; V=1 shows the whole commands.
Q   = $(if $(V),,@)
say = @mkdir -p $(@D)$(if $(V),,; echo '  $(1)	$@')
# build/gen/gen.mk is made from proto/psabench.yaml before anything is compiled and names the generated sources in GEN_SRC.
PY     := .venv/bin/python
NO_GEN := setup run test test-all quick bench mutants clean help uninstall lock
include $(if $(filter-out $(NO_GEN),$(or $(MAKECMDGOALS),all)),build/gen/gen.mk)

LCM      := $(wildcard build/gen/lcm/*.c)#   none without lcm-gen: an emulator that has no --lcm
SRC      := $(filter-out $(if $(LCM),%/service_no_lcm.c,emu/telemetry/lcm_% %/service_lcm.c),$(sort $(foreach d,$(DIRS),$(wildcard emu/$(d)/*.c emu/$(d)/*/*.c))))
MAIN     := $(filter emu/app/main.c,$(SRC))
OBJ      := $(patsubst %.c,$(BUILD)/obj/%.o,$(SRC) $(GEN_SRC))
LIB_OBJ  := $(filter-out $(BUILD)/obj/emu/app/main.o,$(OBJ))
API_OBJ  := $(filter $(BUILD)/obj/emu/api/%,$(OBJ))
CORE_OBJ := $(filter-out $(API_OBJ) $(foreach d,link command fault control scpi scenario bench telemetry app,$(BUILD)/obj/emu/$(d)/%),$(OBJ))
NAV_SRC  := $(sort $(wildcard nav/*/*.cpp))
# For sanitizers, clang and clang-tidy each folder of nav is one file: Eigen once a folder, not once a file, is half of their time.
NAV_UNIT := $(patsubst nav/%/,build/unity/nav_%.cpp,$(sort $(dir $(NAV_SRC))))
NAV_OBJ  := $(patsubst %.cpp,$(BUILD)/obj/%.o,$(if $(SAN)$(filter clang%,$(notdir $(CC))),$(NAV_UNIT),$(NAV_SRC))) $(BUILD)/obj/emu/base/detmath.o
INSTALL  = BUILD='$(BUILD)' DESTDIR='$(DESTDIR)' PREFIX='$(PREFIX)' LIBDIR='$(LIBDIR)' VERSION='$(VERSION)' ABI=$(ABI_psabench) NAV_ABI=$(ABI_psabench-nav) tools/install
UNIT_BIN := $(patsubst %,$(BUILD)/tests/%,$(basename $(notdir $(UNIT))))
FUZZ_SRC  := $(sort $(wildcard tests/fuzz/fuzz_*.c tests/fuzz/*/fuzz_*.c))
FUZZ      ?= $(sort $(patsubst fuzz_%.c,%,$(notdir $(FUZZ_SRC))))
FUZZ_BIN := $(FUZZ:%=$(BUILD)/fuzz/fuzz_%)
BENCH_BIN := $(patsubst tests/bench/%.c,$(BUILD)/bench/%,$(sort $(wildcard tests/bench/*.c))) $(if $(EIGEN),$(BUILD)/bench/bench_kf)

.SECONDARY:
.DELETE_ON_ERROR:
.PHONY: FORCE all lib setup run quick test test-all bench bench-bin mutants mutate fault-matrix false-positives check pytest builds e2e e2e-san e2e-vcan e2e-slc0 uml soak fuzz fuzz-check fuzz-long fuzz-bin fuzz-each lint format golden docs notebooks site prove install cli uninstall foreign wheel deb clean help lock
all: $(if $(MAIN),$(BUILD)/psa-emu,$(LIB_OBJ)) $(if $(API_OBJ),lib) ## the emulator build/psa-emu and the libraries (CC=clang: in build-clang, SAN=address,undefined: in build-san)
lib: $(foreach l,psabench psabench-nav,$(BUILD)/lib$(l).so $(BUILD)/lib$(l).a $(BUILD)/$(l).pc) ## libpsabench and libpsabench-nav, shared and static, and their pkg-config files
$(BUILD)/deb/psa-emu: RPATH :=
$(BUILD)/psa-emu $(BUILD)/deb/psa-emu: $(filter-out $(API_OBJ),$(OBJ))
	$(call say,LINK)
	$(Q)$(LINK) $(RPATH) -o $@ $^ $(LIBS)

# For the programs of tests. A thin archive (T): an ordinary one would keep one object of each file name, and every board has its board.o.
$(BUILD)/lib/emu.a: $(LIB_OBJ)
$(BUILD)/lib/core.a: $(CORE_OBJ)
$(BUILD)/lib/emu.a $(BUILD)/lib/core.a:
	$(call say,AR)
	$(Q)rm -f $@ && $(AR) rcsT $@ $^
# One object of what the interface needs of the core, with no name but psabench_* to be seen: also in the static library.
$(BUILD)/lib/psabench.o: $(API_OBJ) $(BUILD)/lib/core.a
$(BUILD)/lib/psabench-nav.o: $(NAV_OBJ)
$(BUILD)/lib/psabench.o $(BUILD)/lib/psabench-nav.o:
	$(call say,LD -r)
	$(Q)$(LD) -r -o $@ $^ && $(OBJCOPY) --localize-hidden $@

$(BUILD)/libpsabench.so $(BUILD)/libpsabench-nav.so: $(BUILD)/lib%.so: $(BUILD)/lib/%.o
	$(call say,LINK)
	$(Q)$(LINK) -shared -Wl,-soname,$(@F).$(ABI_$*) -o $@.$(ABI_$*) $^ -lm && ln -sf $(@F).$(ABI_$*) $@
$(BUILD)/libpsabench.a $(BUILD)/libpsabench-nav.a: $(BUILD)/lib%.a: $(BUILD)/lib/%.o
	$(Q)rm -f $@ && $(AR) rcs $@ $^
$(BUILD)/%.pc: FORCE
	@$(INSTALL) pc $* $@
# Another make may be at it: a draft of its own each.
$(NAV_UNIT): build/unity/nav_%.cpp: FORCE
	@mkdir -p $(@D) && new=$@.$$$$ && printf '#include "%s" // NOLINT(bugprone-suspicious-include)\n' $(filter nav/$*/%,$(NAV_SRC)) > $$new && \
	    if cmp -s $$new $@; then rm $$new; else mv $$new $@; fi
$(BUILD)/obj/%.o: %.cpp Makefile
	$(call say,CXX)
	$(Q)$(CXXCOMPILE) -MMD -MP -c -o $@ $<
$(BUILD)/obj/build/gen/lcm/%.o: WARN := -w#   lcm-gen's code
$(BUILD)/obj/emu/app/main.o: CPPFLAGS += -DPSABENCH_FLAGS='"$(strip $(filter-out -D%,$(STD)) $(SANFL) $(CFLAGS))"'#   psa-emu --version
$(BUILD)/obj/%.o: %.c Makefile
	$(call say,CC)
	$(Q)$(COMPILE) -MMD -MP -c -o $@ $<

# Programs of tests: each names its objects, the rest comes from the archive.
LINK_LIBS = $(LIBS)
$(BUILD)/obj/tests/%.o: CPPFLAGS += -I. -Itests/unit -Itests/fuzz/support#         nav/, rigs that several folders use
# Their own code; what they test is at -O1 or -O2. gcc has some of its warnings at -O2 alone, clang has all of them at -O0.
$(BUILD)/obj/tests/unit/%.o: CFLAGS := $(if $(SAN),$(CFLAGS:-O1=-O0),$(if $(filter clang%,$(notdir $(CC))),$(CFLAGS:-O2=-O0),$(CFLAGS)))
$(BUILD)/obj/tests/bench/%.o: CPPFLAGS += -D_POSIX_C_SOURCE=199309L#                clock_gettime
$(UNIT_BIN): LINK_LIBS += -lcmocka
$(FUZZ_BIN): LINK_LIBS += -fsanitize=fuzzer
$(BUILD)/tests/test_koi $(BUILD)/tests/test_nav $(BUILD)/tests/test_sins: $(BUILD)/libpsabench-nav.a
$(BUILD)/tests/test_kf_kernels: $(BUILD)/obj/nav/filter/kf_kernels.o
$(foreach t,$(UNIT),$(eval $(BUILD)/tests/$(basename $(notdir $(t))): $(BUILD)/obj/$(t:.c=.o)))
$(foreach t,$(FUZZ_SRC),$(eval $(BUILD)/fuzz/$(basename $(notdir $(t))): $(BUILD)/obj/$(t:.c=.o)))
$(foreach c,ads1282 ads1256 ad7712,$(eval $(filter $(BUILD)/fuzz/fuzz_$(c)_%,$(FUZZ_BIN)): $(BUILD)/obj/tests/fuzz/support/$(c)_world.o))
$(BENCH_BIN): $(BUILD)/bench/%: $(BUILD)/obj/tests/bench/%.o
$(BUILD)/obj/tests/bench/bench_kf.o: CPPFLAGS += -UEIGEN_DONT_VECTORIZE -UEIGEN_NO_MALLOC#   the peer as its users have it
$(BUILD)/bench/bench_kf: $(BUILD)/libpsabench-nav.a
$(UNIT_BIN) $(FUZZ_BIN) $(BENCH_BIN): $(BUILD)/lib/emu.a
	$(call say,LINK)
	$(Q)$(LINK) -o $@ $(filter %.o,$^) $(filter-out %/emu.a,$(filter %.a,$^)) $(BUILD)/lib/emu.a $(LINK_LIBS)
build/gen/gen.mk: $(wildcard proto/*.yaml proto/mavlink/*.xml proto/lcm/*.lcm) tools/gen_proto.py tools/gen_mavlink.py tools/gen_lcm $(wildcard tools/protogen/*.py) | $(PY)
	@mkdir -p $(@D) && $(PY) tools/gen_proto.py --out $(@D) && $(PY) tools/gen_mavlink.py --out $(@D) && CC='$(CC)' tools/gen_lcm $(@D)/lcm
	@echo 'GEN_SRC := $$(sort $$(wildcard build/gen/*.c build/gen/lcm/*.c))' > $@
$(PY): ; tools/setup run

setup: ## system packages (as root or with sudo) and .venv, all that make test needs
	tools/setup test
run: ## set-up, build, and the main job: board up, accelerometers calibrated over CAN; report in build/run/report.html
	@tools/setup run && $(MAKE) --no-print-directory $(if $(filter -j% --jobserver%,$(MAKEFLAGS)),,-j$$(nproc)) all && .venv/bin/psabench run all --out build/run
quick: ## build and the tests nearest to what changed since the last commit, within a minute; says what it left out
	@tools/setup test && $(PY) tools/quick.py
test: ## set-up, build, and the tests of tier `test` (tests/tiers.toml), ten minutes; ends with one line of counts
	@tools/setup test && python3 tools/test_all.py test
test-all: ## set-up, and every test: all compilers, sanitizers, links, pages, fuzz corpus, long runs
	@tools/setup all && python3 tools/test_all.py all
check: $(TESTS:%=$(BUILD)/tests/%) ## the C unit tests (one: make check T=test_sched; under ASan and UBSan: make check SAN=address,undefined)
	@python3 tools/run_c_tests.py $^
PYTESTS = $(if $(T),$(foreach t,$(T),$(or $(shell find tests -name '$(t).py'),$(error no file $(t).py in tests))),tests/py tests/conform tests/golden)
pytest: $(if $(T),all,bench-bin) ## the Python tests, golden traces included (a file: make pytest T=test_frames)
	$(PY) -m pytest --tier $(TIER) $(PYTESTS) $(if $(T),,-m "not soak")
E2E ?= tests/e2e
e2e: all ## the end-to-end tests over the transports of the host (socketcand, slcan on a pty)
	$(PY) -m pytest --tier $(TIER) $(E2E) -m "host and not soak"
e2e-san: ## end-to-end tests of bad input and broken peers, the emulator under AddressSanitizer and UBSan
	@$(MAKE) --no-print-directory SAN=address,undefined all
	PSA_EMU=$(CURDIR)/build-san/psa-emu $(PY) -m pytest $(SAN_E2E) -m "host and not soak"
uml: e2e-vcan e2e-slc0 ## the end-to-end tests on a kernel's vcan0 and slc0: this kernel's, or a user-mode one's
e2e-vcan: all
	tests/uml/native --timeout 2300 tests/uml/job_e2e.sh --tier $(TIER)
e2e-slc0: all
	tests/uml/slc0 --tier $(TIER)
# The files by name: to collect all of tests/py for one test of it takes 45 s of CPU, of tests/e2e 20 s.
SOAK = $(shell grep -rl --include='test_*.py' 'mark\.soak' $(1))
soak: all ## the tests that take a minute or more of real time: end to end on the host and on vcan0, pages of the panel
	$(PY) -m pytest $(call SOAK,tests/e2e) -m "host and soak"
	$(PY) -m pytest $(call SOAK,tests/py) -m soak
	tests/uml/native --timeout 1200 tests/uml/job_soak.sh $(call SOAK,tests/e2e)
builds: ## the emulator and its libraries by clang, at -O0 and -O3, and under sanitizers: tests compare their results
	+@tools/builds
golden: all ## rewrite the golden traces; review the difference like code
	GOLDEN=rewrite $(PY) -m pytest -q tests/golden
mutants: | $(PY) ## broken boards that the conformance suite must find, docs/reference/mutants.md (some: make mutants MUTANTS='pik- sdo-')
	@PYTHONPATH=tools $(PY) -m tests.mutants.run $(MUTANTS)
mutate: all ## random mutants of folders, judged by the unit tests nearest to them: make mutate MUTATE='emu/chip/ads1256 --sample 20'
	@PYTHONPATH=tools:scripts $(PY) -m tests.mutants.unit_mutants $(MUTATE)
false-positives: all ## conforming boards that the suite must pass, docs/reference/false_positives.md (some: ARGS='w24 --minutes 5')
	@PYTHONPATH=tools $(PY) -m tests.false_positives.run $(ARGS)
fault-matrix: all ## every fault at every point, and the requirements that it breaks (docs/faults.md)
	PSABENCH_FAULTS=all $(PY) -m pytest tests/conform/suite/test_conform_faults.py
bench: ## speed beside Verilog models of the same board and against the targets, into docs/reference/performance.md
	@tools/setup bench && $(MAKE) --no-print-directory bench-bin
	@PYTHONPATH=tools BENCH_CC='$(CC)' BENCH_CFLAGS='$(CFLAGS)' $(PY) -m tests.bench.run --seconds $(BENCH_S)
bench-bin: all $(BENCH_BIN)
FUZZ_MAKE := $(MAKE) --no-print-directory CC=clang SAN=address,undefined,fuzzer-no-link BUILD=build-fuzz
fuzz: ## each fuzz_*.c of tests/fuzz for FUZZ_S seconds (libFuzzer, sanitizers; some: make fuzz FUZZ='psa2 api' FUZZ_S=3600)
	@$(FUZZ_MAKE) fuzz-each
fuzz-check: ## the fuzz corpus, then some thousand inputs for each target, the same each time
	@$(FUZZ_MAKE) FUZZ_S=check fuzz-each
fuzz-long: ## each target for an hour of CPU in all, a target per core; earlier runs count (LONG='psa2 pik --minutes 5')
	@$(FUZZ_MAKE) fuzz-bin && $(PY) tools/fuzz_long.py $(LONG)
fuzz-bin: $(FUZZ_BIN)
fuzz-each: $(FUZZ_BIN)
	@tests/fuzz/run $(FUZZ_S) $(FUZZ_BIN)
lint: all $(NAV_UNIT) ## formats, warnings of gcc and clang, clang-tidy, includes, generated files, ruff, mypy (a part: LINT=test, LINT=rest)
	@FLAGS='$(FLAGS)' CXXLINT='$(CXXSTD) $(CXXWARN) -I. $(EIGEN)' tools/lint $(LINT)
format: ## rewrite C and Python in the project's format
	find emu nav tests examples docs/examples -name '*.[ch]' -o -name '*.[ch]pp' | xargs clang-format -i
	$(PY) -m ruff format .
docs: all ## generated files that are kept in git: DBC, EDS, protocol pages, requirements, tables of the pages, FIDELITY.md
	$(foreach t,proto docs commands requirements fault_matrix fidelity,$(PY) tools/gen_$(t).py && )$(PY) tools/fuzz_long.py --docs && $(PY) -m psabench.logs.wireshark > share/wireshark/psabench.lua && $(PY) -m psabench.logs.sessions
notebooks: all ## run examples/notebooks/*.py and write the .ipynb with their outputs (some: make notebooks NOTEBOOKS=first_frame)
	@tools/setup site && $(PY) tools/notebooks.py $(NOTEBOOKS)
site: all ## all pages, the notebooks and the reference of the interfaces as a site with search, build/site (docs/tools/site.md)
	@tools/setup site && $(PY) tools/sitegen/build.py
prove: all ## run the proofs of the models whose sources have changed (or GROUP=psa2, GROUP=all), docs/evidence.md
	@$(PY) tools/evidence.py --prove $(GROUP); rc=$$?; $(PY) tools/gen_fidelity.py && exit $$rc
CLI ?= $(BUILD)/cli#   manual pages and completion; empty: without
install: all $(if $(CLI),cli) ## psa-emu, libraries, protocol files, manual pages, completion, sigrok decoders under $(DESTDIR)$(PREFIX)
	@CLI='$(CLI)' $(INSTALL) install
cli: all
	@PSA_EMU='$(CURDIR)/$(BUILD)/psa-emu' $(PY) tools/gen_cli.py --out $(CLI)
uninstall: ; @$(INSTALL) uninstall ## remove what install put there
foreign: all ; @tools/foreign ## MAVProxy on a unit's MAVLink link, by hand; says how to install it (docs/tools/mavlink.md)
wheel: all ## build/dist/psabench-*.whl, the Python package with emulator, library and data files in it
	.venv/bin/uv build -q --wheel --no-build-isolation --offline --python $(PY) -o build/dist
compile_commands.json: Makefile $(SRC) $(GEN_SRC) ## how each file is compiled, for editors and clang-tidy
	@python3 tools/compile_commands.py '$(COMPILE)' $(SRC) $(GEN_SRC) -- '$(COMPILE) -I. -Itests/unit' $(UNIT) > $@
deb: $(BUILD)/deb/psa-emu cli ## build/psabench_VERSION_ARCHITECTURE.deb, for Debian 12
	@$(INSTALL:tools/install=CLI='$(CLI)' PY='$(PY)' tools/deb)
lock: $(PY) ; tools/lock ## pin requirements*.in in requirements*.lock
clean: ; rm -rf build build-* compile_commands.json ## remove everything that was built; .venv stays
help: ## this list
	@sed -n 's/^\([a-z_.0-9-]*\):.* ## \(.*\)/\1|\2/p' Makefile | while IFS='|' read -r t d; do printf '  %-22s %s\n' "$$t" "$$d"; done
-include $(OBJ:.o=.d) $(NAV_OBJ:.o=.d) $(UNIT:%.c=$(BUILD)/obj/%.d) $(BENCH_BIN:$(BUILD)/%=$(BUILD)/obj/tests/%.d) $(FUZZ_SRC:%.c=$(BUILD)/obj/%.d) $(wildcard $(BUILD)/obj/tests/fuzz/support/*.d)
