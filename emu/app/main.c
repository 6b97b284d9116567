/* psa-emu: options, scenario, bench, service. */
#include "app/list/list.h"
#include "app/options.h"
#include "app/service.h"
#include "base/text.h"
#include "base/why.h"
#include "command/exact.h"
#include "link/own_file.h"

#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

/* PSABENCH_VERSION comes from pyproject.toml by way of the Makefile. */
#define VERSION TEXT_OF(PSABENCH_VERSION)
#ifndef PSABENCH_FLAGS /* the compiler's options, which decide the last bit of a number; from the Makefile as well */
#define PSABENCH_FLAGS "unknown"
#endif

#ifdef __clang__
#define COMPILER __VERSION__
#else
#define COMPILER "GCC " __VERSION__
#endif

static void print_version(void)
{
    puts("psa-emu " VERSION);
    puts("compiler: " COMPILER);
    puts("flags: " PSABENCH_FLAGS);
}

static int print_error(int status, const char *why)
{
    fprintf(stderr, "psa-emu: %s\n", why);
    return status;
}

/* What was printed is out, or the reason why it is not. */
static int end_stdout(void)
{
    char why[128];
    if (fflush(stdout) == 0 && !ferror(stdout)) return SERVICE_DONE;
    snprintf(why, sizeof why, "stdout: %s", strerror(errno));
    return print_error(SERVICE_MACHINE, why);
}

static void override_scenario(struct scenario *s, const struct options *o)
{
    if (o->seed_given) s->seed = o->seed;
    for (unsigned i = 0; i < s->bus_count; i++) {
        if (o->bitrate.given) s->bus[i].cfg.bitrate_hz = o->bitrate.hz;
        if (o->data_bitrate.given) s->bus[i].cfg.data_bitrate_hz = o->data_bitrate.hz;
    }
    if (o->start) s->start = true;
}

/* The tree is deleted. */
static bool print_json(cJSON *j, FILE *out)
{
    char *text = cJSON_Print(j);
    errno = text ? 0 : ENOMEM;
    const bool ok = text && fprintf(out, "%s\n", text) >= 0 && fflush(out) == 0;
    cJSON_free(text);
    cJSON_Delete(j);
    return ok;
}

/* The scenario with every key. */
static bool print_scenario(const struct scenario *s, FILE *out)
{
    return print_json(scenario_dump(s), out);
}

static cJSON *version_json(void)
{
    cJSON *j = cJSON_CreateObject();
    cJSON_AddStringToObject(j, "version", VERSION);
    cJSON_AddStringToObject(j, "compiler", COMPILER);
    cJSON_AddStringToObject(j, "flags", PSABENCH_FLAGS);
    return j;
}

/* --json with a list or --version. */
static int print_list(enum options_action action)
{
    char why[1024];
    cJSON *j = action == OPTIONS_VERSION ? version_json() : list_json(action, why, sizeof why);
    if (!j) return print_error(SERVICE_MACHINE, why);
    print_json(j, stdout);
    return end_stdout();
}

/* --resolved: SERVICE_DONE, or the exit status with one line in why. */
static int write_resolved(const struct scenario *s, const char *path, char *why, size_t cap)
{
    bool user = false;
    FILE *out = own_file_output("--resolved ", path, &user, why, cap);
    if (!out) return user ? SERVICE_INPUT : SERVICE_MACHINE;
    const bool whole = print_scenario(s, out);
    if (!whole) why_fail(why, cap, "--resolved %.800s: %s; the file is not complete", path, strerror(errno));
    fclose(out);
    return whole ? SERVICE_DONE : SERVICE_MACHINE;
}

/* The scenario of the snapshot or the options, and its bench. */
static bool load_bench(const struct options *o, const struct snapshot *from, struct scenario *s, struct bench *bench,
                       char *why, size_t cap)
{
    const bool loaded = from ? scenario_parse(o->restore, from->scenario, from->scenario_len, s, why, cap)
                             : scenario_load(o->scenario ? o->scenario : "calibrate", s, why, cap);
    if (!loaded || !scenario_open(s, why, cap)) return false;
    override_scenario(s, o);
    if (!bench_init(bench, s, 0)) return why_fail(why, cap, "%s: out of memory for %u units", s->path, s->unit_count);
    bench->sched.eager = o->eager;
    return timeline_check(bench, why, cap);
}

static int dump_scenario(const struct options *o, struct scenario *s, struct bench *bench)
{
    char why[1024];
    if (!load_bench(o, NULL, s, bench, why, sizeof why)) return print_error(SERVICE_INPUT, why);
    return print_scenario(s, stdout) ? SERVICE_DONE : print_error(SERVICE_MACHINE, "--dump: stdout cannot be written");
}

/* The scenario with every key as one line, its numbers to the last bit. The caller free()s it. */
static char *resolved_line(const struct scenario *s)
{
    cJSON *j = scenario_dump(s);
    char *line = exact_line(j);
    cJSON_Delete(j);
    return line;
}

static int run_bench(const struct options *o, const struct snapshot *from, struct scenario *scenario,
                     struct bench *bench, struct service *service)
{
    char why[1024];
    if (!load_bench(o, from, scenario, bench, why, sizeof why)) return print_error(SERVICE_INPUT, why);
    const int resolved = o->resolved ? write_resolved(scenario, o->resolved, why, sizeof why) : SERVICE_DONE;
    if (resolved != SERVICE_DONE) return print_error(resolved, why);
    const int watched = o->unit ? bench_find_unit(scenario, o->unit) : 0;
    if (watched < 0) {
        why_expected(why, sizeof why, "--unit", WHY_TEXT(o->unit), "a unit of the scenario");
        return print_error(SERVICE_INPUT, why);
    }
    char *line = resolved_line(scenario);
    if (!line) return print_error(SERVICE_MACHINE, "out of memory");
    bench->watched = (unsigned)watched;
    const struct service_origin origin = {.scenario = line, .snapshot = from};
    const bool open = service_open(service, bench, o, &origin, why, sizeof why);
    const int signal_number = open ? service_run(service) : 0;
    const bool refused = service->refused;
    service_close(service);
    free(line);
    if (!open) return print_error(refused ? SERVICE_INPUT : SERVICE_MACHINE, why);
    if (signal_number == SIGINT) return SERVICE_INT;
    return service->incomplete ? SERVICE_MACHINE : SERVICE_DONE;
}

static int restore_bench(const struct options *o, struct scenario *scenario, struct bench *bench,
                         struct service *service)
{
    char why[1024];
    struct snapshot from;
    if (!snapshot_load(o->restore, &from, why, sizeof why)) return print_error(SERVICE_INPUT, why);
    const int status = run_bench(o, &from, scenario, bench, service);
    snapshot_free(&from);
    return status;
}

int main(int argc, char *argv[])
{
    struct options o;
    char why[1024];
    signal(SIGXFSZ, SIG_IGN); /* a limit of the file size is an error of write(), as a full disk is */
    if (!options_parse(argc, argv, &o, why, sizeof why)) return print_error(SERVICE_INPUT, why);
    if (o.json && o.action != OPTIONS_DUMP) return print_list(o.action);
    if (o.action == OPTIONS_HELP) options_print_help(stdout);
    if (o.action == OPTIONS_VERSION) print_version();
    if (o.action == OPTIONS_LIST_COMMANDS) list_commands(stdout);
    if (o.action == OPTIONS_LIST_SCPI) list_scpi(stdout);
    if (o.action == OPTIONS_LIST_FAULTS) list_faults(stdout);
    if (o.action == OPTIONS_LIST_PROFILES || o.action == OPTIONS_LIST_SCENARIOS) {
        const char *folder = o.action == OPTIONS_LIST_PROFILES ? "profiles" : "scenarios";
        if (!list_files(stdout, folder, why, sizeof why)) return print_error(SERVICE_MACHINE, why);
    }
    if (o.action == OPTIONS_LIST_KEYS) scenario_keys(stdout);
    if (o.action != OPTIONS_RUN && o.action != OPTIONS_DUMP) return end_stdout();
    struct scenario *scenario = malloc(sizeof *scenario);
    struct bench *bench = calloc(1, sizeof *bench); /* without units: bench_free() is harmless */
    struct service *service = malloc(sizeof *service);
    const int status = !scenario || !bench || !service ? print_error(SERVICE_MACHINE, "out of memory")
                       : o.action == OPTIONS_DUMP      ? dump_scenario(&o, scenario, bench)
                       : o.restore                     ? restore_bench(&o, scenario, bench, service)
                                                       : run_bench(&o, NULL, scenario, bench, service);
    free(service);
    if (bench) bench_free(bench);
    free(bench);
    free(scenario);
    return status;
}
