/* psa-emu: options, scenario, bench, service. */
#include "app/list.h"
#include "app/options.h"
#include "app/service.h"
#include "base/text.h"

#include <signal.h>
#include <stdlib.h>

enum { EXIT_DONE = 0, EXIT_INPUT = 2, EXIT_MACHINE = 3, EXIT_INT = 130 };

/* PSABENCH_VERSION comes from pyproject.toml by way of the Makefile. */
#define VERSION TEXT_OF(PSABENCH_VERSION)

static int complain(int status, const char *why)
{
    fprintf(stderr, "psa-emu: %s\n", why);
    return status;
}

static void override(struct scenario *s, const struct options *o)
{
    if (o->seed_given) s->seed = o->seed;
    if (o->bitrate_given) s->bus.bitrate_hz = o->bitrate_hz;
    if (o->data_bitrate_given) s->bus.data_bitrate_hz = o->data_bitrate_hz;
    if (o->start) s->start = true;
}

static int run(const struct options *o, struct scenario *scenario, struct bench *bench, struct service *service)
{
    char why[1024];
    if (!scenario_load(o->scenario ? o->scenario : "calibrate", scenario, why, sizeof why))
        return complain(EXIT_INPUT, why);
    override(scenario, o);
    const int watched = o->unit ? bench_find_unit(scenario, o->unit) : 0;
    if (watched < 0) {
        snprintf(why, sizeof why, "--unit %s: %s has no unit of that name", o->unit, scenario->path);
        return complain(EXIT_INPUT, why);
    }
    bench_init(bench, scenario, (unsigned)watched);
    const bool open = service_open(service, bench, o, why, sizeof why);
    const int signal_number = open ? service_run(service) : 0;
    service_close(service);
    if (!open) return complain(EXIT_MACHINE, why);
    if (signal_number == SIGINT) return EXIT_INT;
    return service->vcd_failed ? EXIT_MACHINE : EXIT_DONE;
}

int main(int argc, char *argv[])
{
    struct options o;
    char why[1024];
    if (!options_parse(argc, argv, &o, why, sizeof why)) return complain(EXIT_INPUT, why);
    if (o.action == OPTIONS_HELP) return fputs(options_help(), stdout) < 0;
    if (o.action == OPTIONS_VERSION) return puts("psa-emu " VERSION) < 0;
    if (o.action == OPTIONS_LIST_COMMANDS) list_commands(stdout);
    if (o.action == OPTIONS_LIST_SCPI) list_scpi(stdout);
    if (o.action == OPTIONS_LIST_PROFILES && !list_profiles(stdout, why, sizeof why))
        return complain(EXIT_MACHINE, why);
    if (o.action == OPTIONS_LIST_SCENARIOS && !list_scenarios(stdout, why, sizeof why))
        return complain(EXIT_MACHINE, why);
    if (o.action != OPTIONS_RUN) return EXIT_DONE;
    struct scenario *scenario = malloc(sizeof *scenario);
    struct bench *bench = malloc(sizeof *bench);
    struct service *service = malloc(sizeof *service);
    const int status =
        scenario && bench && service ? run(&o, scenario, bench, service) : complain(EXIT_MACHINE, "no memory");
    free(service);
    free(bench);
    free(scenario);
    return status;
}
