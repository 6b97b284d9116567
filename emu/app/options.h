/* The command line, parsed once into a struct; nothing reads argv after that. docs/emulator.md is its manual. */
#ifndef PSABENCH_APP_OPTIONS_H
#define PSABENCH_APP_OPTIONS_H

#include "app/pace.h"
#include "link/can/cannelloni_can.h"
#include "link/mavlink/mav_options.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define OPTIONS_CAN_MAX    8u
#define OPTIONS_SCPI_MAX   8u
#define OPTIONS_BUS_MAX    8u
#define OPTIONS_SERIAL_MAX 8u
#define OPTIONS_LOGIC_MAX  4u

#define OPTIONS_MAVLINK_MAX 4u

enum options_can_kind {
    OPTIONS_SOCKETCAND,
    OPTIONS_SLCAN,
    OPTIONS_SOCKETCAN,
    OPTIONS_UDP,
    OPTIONS_CANNELLONI,
    OPTIONS_CAN_LOG
};

struct options_can {
    enum options_can_kind kind;
    char bus[16];    /* "": socketcand every bus, by the name that a client opens; others the first */
    const char *arg; /* slcan: link or NULL; socketcan: interface; udp: group; log: file */
    uint16_t port;   /* socketcand; 0: a free one */
    struct cannelloni_ports tunnel;
};

struct options_scpi {
    const char *arg; /* as given */
    char kind[12];   /* head, table, chamber, supply, all: whoever opens it looks */
    bool pty;
    const char *link; /* of the pty; may be NULL */
    uint16_t port;    /* 0: a free one */
};

/* Of a bus port, or of a serial one. */
struct options_bus {
    const char *arg;  /* as given */
    char unit[32];    /* "": the first that has such a port */
    const char *link; /* symbolic link; NULL: none */
};

struct options_logic {
    uint16_t port;     /* 0: a free one */
    const char *lines; /* names with commas; NULL: the board's default */
};

/* Of the buses, instead of the scenario's. */
struct options_rate {
    bool given;
    uint32_t hz;
};

enum options_action {
    OPTIONS_RUN,
    OPTIONS_HELP,
    OPTIONS_VERSION,
    OPTIONS_LIST_PROFILES,
    OPTIONS_LIST_SCENARIOS,
    OPTIONS_LIST_COMMANDS,
    OPTIONS_LIST_SCPI,
    OPTIONS_LIST_FAULTS,
    OPTIONS_LIST_KEYS,
    OPTIONS_DUMP
};

struct options {
    enum options_action action;
    const char *scenario; /* path or name; NULL: calibrate */
    struct options_can can[OPTIONS_CAN_MAX];
    unsigned can_count; /* none given: socketcand on its usual port */
    bool can_given;
    struct options_scpi scpi[OPTIONS_SCPI_MAX];
    unsigned scpi_count;
    struct options_bus bus[OPTIONS_BUS_MAX];
    unsigned bus_count;
    struct options_bus serial[OPTIONS_SERIAL_MAX];
    unsigned serial_count;
    struct options_logic logic[OPTIONS_LOGIC_MAX];
    unsigned logic_count;
    struct mav_options mavlink[OPTIONS_MAVLINK_MAX];
    unsigned mavlink_count;
    enum pace_kind pace;
    int64_t for_ns; /* end of the run; INT64_MAX: none */
    bool seed_given;
    uint64_t seed;
    const char *unit; /* whose lines are traced; NULL: the first */
    const char *vcd;
    uint32_t vcd_unit_ns;
    bool pairs; /* recordings and the line port have the wires A and B of differential pairs, too */
    bool vcd_analog;
    const char *line; /* line port: symbolic link, "-" without one; NULL: no line port */
    int64_t line_hz;
    const char *control, *truth; /* paths of Unix sockets */
    const char *restore;         /* a snapshot instead of a scenario */
    const char *lcm;             /* URL of link/lcm/lcm_url.h; NULL: none */
    bool lcm_truth;
    const char *truth_log; /* file; NULL: none */
    int64_t truth_every_ns;
    const char *resolved; /* file for the scenario with every key; NULL: none */
    struct options_rate bitrate, data_bitrate;
    int64_t epoch_ns; /* added to time stamps */
    bool wait_client; /* time begins with the first CAN client */
    bool until_eof;   /* end with standard input */
    bool eager;       /* conversions that no one looks at are computed, too */
    bool start;       /* units start operational, without waiting for NMT */
    bool quiet;       /* no counters on stderr at the end */
    bool json;        /* what the action prints is JSON */
};

/* argv[0] is skipped; the strings stay the caller's. False with one line in why: what, where, what would be right. */
bool options_parse(int argc, char *const argv[], struct options *o, char *why, size_t cap);

/* Instead of the adapters that o has: those of a text with spaces between them, each as --can would have it. The text
 * is cut up and stays the caller's. False with one line in why. */
bool options_cans(struct options *o, char *text, char *why, size_t cap);

/* The text of --help. False: it cannot be written. */
bool options_print_help(FILE *out);

/* "300ms", "10s", "2.5min", "1h", plain seconds. False when it is no such time or outside 0 ... 1e6 s. */
bool options_duration(const char *text, int64_t *ns);

#endif
