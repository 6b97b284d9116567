/* The virtual logic analysers of a running emulator (--logic): each serves up to 14 lines of the watched unit. */
#ifndef PSABENCH_APP_LOGIC_H
#define PSABENCH_APP_LOGIC_H

#include "app/options.h"
#include "bench/bench.h"
#include "link/logic/beagle_tcp.h"

#include <cjson/cJSON.h>

struct logic_port {
    struct beagle_server server; /* first */
    struct bench *bench;
    const char *name[BEAGLE_CHANNELS + 1]; /* lines of the channels, up to NULL */
    char names[256];                       /* the same with commas */
};

struct logic_ports {
    struct logic_port *port[OPTIONS_LOGIC_MAX];
    unsigned count;
};

/* Whether the watched unit has the lines that the options name; nothing is opened. False with one line in why. */
bool logic_check(const struct bench *b, const struct options *o, char *why, size_t cap);

/* Opens what the options ask for, checked. False with one line in why. */
bool logic_open(struct logic_ports *all, struct links *links, struct bench *b, const struct options *o, char *why,
                size_t cap);

/* In two steps: first the ports, then, when the loop's links have been reaped, their storage. */
void logic_close(struct logic_ports *all);
void logic_free(struct logic_ports *all);

bool logic_is_sampling(const struct logic_ports *all);
bool logic_has_begun(const struct logic_ports *all); /* a capture has begun, perhaps ended */

/* Adds "logic", an object for each port: what its captures came to. Nothing without ports. */
void logic_describe(const struct logic_ports *all, cJSON *result);

void logic_print_counters(const struct logic_ports *all); /* on stderr */

#endif
