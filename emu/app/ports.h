/* The endpoints of a running emulator: CAN adapters, line and bus ports, control socket, truth port, VCD file. */
#ifndef PSABENCH_APP_PORTS_H
#define PSABENCH_APP_PORTS_H

#include "app/instruments.h"
#include "app/options.h"
#include "bench/bench.h"
#include "link/can/can_hub.h"
#include "link/can/can_log.h"
#include "link/can/slcan_pty.h"
#include "link/can/socketcan.h"
#include "link/can/socketcand_tcp.h"
#include "link/ctl_sock.h"
#include "link/line/bus_pty.h"
#include "link/line/line_pty.h"

#include <cjson/cJSON.h>

struct ports_can {
    enum options_can_kind kind;
    const char *bus; /* its bus where there are several; NULL: all of them, or the only one */
    unsigned hubs;   /* socketcand: how many it serves */
    union {
        struct socketcand_server socketcand;
        struct slcan_pty slcan;
        struct socketcan socketcan;
        struct can_log log;
    };
};

struct bus_port {
    struct bus_pty pty;
    struct bench *bench;
    unsigned unit;
};

struct ports {
    struct links links;
    struct can_hub hub[SCENARIO_BUSES_MAX]; /* one a bus */
    unsigned hubs;
    uint32_t connections; /* clients of all hubs so far */
    struct ports_can *can[OPTIONS_CAN_MAX];
    unsigned can_count;
    struct line_pty *line;
    struct bus_port *bus[OPTIONS_BUS_MAX];
    unsigned bus_count;
    struct instruments scpi;          /* control and sched are filled in by the caller */
    struct ctl_server control, truth; /* callbacks are filled in by the caller */
    FILE *vcd;
};

/* Whether the bench has the buses and instruments that the options name; nothing is opened. False with one line in why. */
bool ports_check(struct ports *p, const struct bench *b, const struct options *o, char *why, size_t cap);

/* Opens what the options ask for, checked; links and hubs of p are set up first with bench, epoch and say. False with one line in
 * why: what, where, what would be right. ports_close() in either case. */
void ports_init(struct ports *p, struct bench *b, const struct options *o); /* the hubs; nothing is opened yet */
bool ports_open(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap);

/* Prints one `ready key=value ...` line for each endpoint, then `ready all`. */
void ports_ready(const struct ports *p, const struct options *o, FILE *out);

/* What the logs of frames still hold goes into their files; false when one of them is not complete, which is said. */
bool ports_logs_whole(struct ports *p, void (*say)(const char *text));

void ports_close(struct ports *p);

/* In the child of a fork: closes all, but leaves the names of sockets and links to the parent, and the hubs as they are. */
void ports_abandon(struct ports *p);

/* Adds an array "endpoints", an object for each `ready key=value ...` line of text, which is cut up. */
void ports_add_endpoints(cJSON *result, char *text);

/* The same of open ports. False without memory. */
bool ports_describe(const struct ports *p, const struct options *o, cJSON *result);

#endif
