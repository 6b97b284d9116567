/* The endpoints of a running emulator: CAN adapters, line and bus ports, control socket, truth port, VCD file. */
#ifndef PSABENCH_APP_PORTS_H
#define PSABENCH_APP_PORTS_H

#include "app/instruments.h"
#include "app/logic.h"
#include "app/options.h"
#include "bench/bench.h"
#include "link/can/can_hub.h"
#include "link/can/can_log.h"
#include "link/can/slcan_pty.h"
#include "link/can/socketcan.h"
#include "link/can/socketcand_tcp.h"
#include "link/can/udp_can.h"
#include "link/ctl_sock.h"
#include "link/line/bus_pty.h"
#include "link/line/line_pty.h"
#include "link/line/serial_pty.h"

#include <cjson/cJSON.h>

struct mavlink;

struct ports_can {
    enum options_can_kind kind;
    const char *bus; /* its bus where there are several; NULL: all of them, or the only one */
    unsigned hubs;   /* socketcand: how many it serves */
    bool refused;    /* it could not be opened, and another path would do */
    union {
        struct socketcand_server socketcand;
        struct slcan_pty slcan;
        struct socketcan socketcan;
        struct udp_can udp;
        struct cannelloni_can cannelloni;
        struct can_log log;
    };
};

struct bus_port {
    struct bus_pty pty;
    struct bench *bench;
    unsigned unit;
};

struct serial_port {
    struct serial_pty pty;
    struct unit *unit;
    char notice[200];
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
    struct serial_port *serial[OPTIONS_SERIAL_MAX];
    unsigned serial_count;
    struct logic_ports logic;
    struct mavlink *mavlink[OPTIONS_MAVLINK_MAX];
    unsigned mavlink_count;
    struct instruments scpi;          /* control and sched are filled in by the caller */
    struct ctl_server control, truth; /* callbacks are filled in by the caller */
    FILE *vcd;
    bool refused; /* a file could not be opened, and another path would do */
};

/* Whether the bench has the buses and instruments that the options name; nothing is opened. False with one line in why. */
bool ports_check(struct ports *p, const struct bench *b, const struct options *o, char *why, size_t cap);

/* Opens what the options ask for, checked; links and hubs of p are set up first with bench, epoch and say. False with one line in
 * why: what, where, what would be right; p->refused: the fault is the user's. ports_close() in either case. */
void ports_init(struct ports *p, struct bench *b, const struct options *o); /* the hubs; nothing is opened yet */
bool ports_open(struct ports *p, struct bench *b, const struct options *o, char *why, size_t cap);

/* Prints one `ready key=value ...` line for each endpoint, then `ready all`. A value with a space, a quote or a control
 * character is printed as a string of JSON. False: out did not take them. */
bool ports_ready(const struct ports *p, const struct options *o, FILE *out);

void ports_close(struct ports *p);

/* In the child of a fork: closes all, but leaves the names of sockets and links to the parent, and the hubs as they are. */
void ports_abandon(struct ports *p);

/* An array, an object of strings for each endpoint: what the ready lines have. The caller's. */
cJSON *ports_endpoints(const struct ports *p, const struct options *o);

#endif
