/* What came into a bench from outside, each with its instant: with the scenario it makes the same bench again.
 *
 *     {"t":1000,"bus":0,"came":1,"heir_of":0,"name":"can0","fd":false}     a program is on the bus, the first one
 *     {"t":2500,"bus":0,"from":1,"frame":"605#4018100100000000"}     it sent a frame (can-utils' notation; ## for FD)
 *     {"t":2500,"ran":true,"cmd":"head.turn","args":{"angle_deg":90}}     a command that changes the bench was carried out
 *     {"t":2500,"refused":true,"cmd":"supply.set",...}     one was rejected on the spot: it changed nothing
 *     {"t":9000,"bus":0,"went":1}     the program has left
 *     {"t":2500,"unit":0,"cycle":3,"write":true,"data":9029,"strobe_ns":800}     one on the bus of a unit, at address 3
 *     {"t":9000,"unit":0,"watch":16383}     a client observes these lines of a unit (0: none)
 *
 * An entry comes after everything that was due before its instant; with "ran", also after everything due at it. Nothing
 * that happens inside the bench is here (timeline, faults under way, answers). Kept in memory, up to a limit; one
 * thread. */
#ifndef PSABENCH_BENCH_JOURNAL_H
#define PSABENCH_BENCH_JOURNAL_H

#include "bench/bench.h"
#include "control/control.h"
#include "link/can/can_hub.h"

#define JOURNAL_MAX      (64u << 20) /* bytes; a million frames and more */
#define JOURNAL_LINE_MAX 8192u
#define JOURNAL_NEWS_MAX 256u

struct journal;

/* Of one bus: who is on it, and a node that hears every frame. */
struct journal_tap {
    struct journal *journal;
    unsigned bus;
    struct can_node observer;
    uint64_t traffic; /* sum of all frames and their instants: two runs that differ in one differ in it */
};

struct journal {
    const struct bench *bench;
    char *text; /* lines with their LF; from the heap */
    size_t len, cap;
    const char *lost; /* why it is not complete; NULL: it is */
    int64_t last_ns;  /* of the last entry */
    unsigned said;    /* announcements of how full it is */
    int64_t moved_ns; /* time stood still here since it last moved */
    bool ran;         /* what is due at last_ns has run since the last entry */
    uint64_t changes; /* of what is watched, as far as it is in `watched` */
    uint64_t watched[CONTROL_UNITS_MAX];
    struct journal_tap tap[CONTROL_BUSES_MAX];
};

void journal_init(struct journal *j, const struct bench *b);
void journal_free(struct journal *j);

/* Listens to the clients of a bus; before power-up. */
void journal_follow(struct journal *j, struct can_hub *h, unsigned bus);

/* A command was carried out, or its handler rejected it (done: false). Those that the bench gives itself while time moves are
 * left out. */
void journal_command(struct journal *j, const struct control_command *row, const cJSON *args, bool done);

/* A cycle came to the bus of a unit, not by a command. */
void journal_cycle(struct journal *j, unsigned unit, const struct board_cycle *c);

/* Time has moved: call after each run of the scheduler, before anything else comes in. */
void journal_moved(struct journal *j);

/* The next announcement, each once: half full, nearly full, with the instant at which it will be at the rate so far; lost.
 * False: none is due. */
bool journal_news(struct journal *j, int64_t now_ns, char news[JOURNAL_NEWS_MAX]);

/* Clients that began or ceased to observe lines since time last moved; before the text is used. */
void journal_watchers(struct journal *j);

/* ---- reading */

enum journal_kind { JOURNAL_CAME, JOURNAL_WENT, JOURNAL_FRAME, JOURNAL_COMMAND, JOURNAL_WATCH, JOURNAL_CYCLE };

struct journal_entry {
    enum journal_kind kind;
    int64_t t_ns;
    bool ran;
    unsigned bus, unit;
    uint32_t client, adopts; /* adopts: the detached client whose slot it adopted; 0: none */
    uint64_t watch;
    bool fd;
    char name[32];
    struct can_msg m;
    struct board_cycle cycle;
    bool refused;    /* the command */
    const char *cmd; /* stays json's, as args */
    const cJSON *args;
    cJSON *json;
};

/* One line, without its LF. False with what is wrong in why; nothing to release then. */
bool journal_read(const char *line, size_t len, struct journal_entry *e, char *why, size_t cap);
void journal_release(struct journal_entry *e);

#endif
