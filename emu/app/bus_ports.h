/* --bus-port: cycles of the parallel buses of units as lines of text on pseudo-terminals (link/line/bus_pty.h). */
#ifndef PSABENCH_APP_BUS_PORTS_H
#define PSABENCH_APP_BUS_PORTS_H

#include "app/options.h"
#include "bench/bench.h"
#include "link/line/bus_pty.h"

struct bus_port {
    struct bus_pty pty;
    struct bench *bench;
    unsigned unit;
};

struct bus_ports {
    struct bus_port *port[OPTIONS_BUS_MAX];
    unsigned count;
};

/* Whether there are such units and their boards have a bus. False with one line in why. */
bool bus_ports_check(const struct bench *b, const struct options *o, char *why, size_t cap);

bool bus_ports_open(struct bus_ports *p, struct links *links, struct bench *b, const struct options *o, char *why,
                    size_t cap);
void bus_ports_ready(const struct bus_ports *p, FILE *out);
void bus_ports_abandon(struct bus_ports *p); /* their names are the parent's */
void bus_ports_close(struct bus_ports *p);   /* cycles under way go on, no client waits for them */
void bus_ports_free(struct bus_ports *p);    /* once the links have been reaped */

#endif
