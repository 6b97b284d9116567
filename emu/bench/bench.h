/* What is on the bench: instruments, units, buses, and who watches the lines. Assembled from a scenario; no OS, no clock. */
#ifndef PSABENCH_BENCH_BENCH_H
#define PSABENCH_BENCH_BENCH_H

#include "canopen/uds_door.h"
#include "command/view.h"
#include "scenario/scenario.h"
#include "trace/group.h"
#include "trace/sampler.h"
#include "trace/vcd.h"

#define BENCH_SLICE_NS 1000000 /* step, free, restoring: simulated time between looks at input and output */

/* The bench's own node on each bus: writes the scenario's frame forms (SDO to 2020h) and starts the units (NMT). */
struct bench_starter {
    struct can_node node[SCENARIO_BUSES_MAX];
    struct sched_ev ev;
};

/* Cycles on the parallel bus of a unit that come from outside; one at a time. They belong to the bench, for a board may be
 * in the middle of one when who asked for it has gone. */
struct bench_cycle {
    struct board_cycle cycle;
    bool busy;
    void (*done)(void *ctx, const struct board_cycle *c, enum board_cycle_result r,
                 int64_t t_ns); /* NULL: no client waits */
    void *ctx;
};

struct bench {
    struct sched sched;
    struct can_bus bus[SCENARIO_BUSES_MAX];
    unsigned buses;
    struct lab lab;
    bool fed;                                                                /* the supply feeds the boards */
    struct sched_ev power;                                                   /* the next change of that */
    struct can_node monitor[SCENARIO_BUSES_MAX];                             /* hear every frame */
    void (*on_frame)(void *ctx, const struct can_msg *m, int64_t t_ns);      /* of the monitor; may be NULL */
    void (*on_cycle)(void *ctx, unsigned unit, const struct board_cycle *c); /* one has come; may be NULL */
    void (*on_refused)(void *ctx, const char *unit, const char *why);        /* frame form; may be NULL */
    void *ctx;
    struct bench_starter starter;
    unsigned watched; /* unit whose lines are recorded */
    bool recording;
    struct vcd vcd;
    struct sampler sampler; /* of the line port */
    bool line_wires;        /* that has the wires B of differential pairs, too */
    uint8_t line_ring[SAMPLER_RING];
    struct trace_group traces; /* of all units */
    /* As many as the scenario has, from the heap: half a megabyte of addresses each, a tenth of it in use without observers */
    struct unit *unit;
    struct bench_cycle *cycle;
    struct uds_door uds[SCENARIO_BUSES_MAX][UDS_ECU_MAX]; /* those that the scenario has */
    struct scenario scenario;                             /* last: its units are, too */
};

/* The scenario is copied. Megabytes: take it from the heap; it never moves afterwards. False: out of memory. */
bool bench_init(struct bench *b, const struct scenario *s, unsigned watched);
void bench_free(struct bench *b); /* what bench_init() took; harmless after it failed */

/* Index of the unit of that name, or -1. */
int bench_find_unit(const struct scenario *s, const char *name);

/* Signals of a unit that a recording has; with the wires of differential pairs, which move from then on. */
uint64_t bench_recorded(struct bench *b, unsigned unit, bool wires);

struct bench_recording {
    unsigned unit;
    bool wires; /* of differential pairs, too */
    bool reals; /* real-valued channels of the board, too */
    uint32_t unit_ns;
    uint64_t max_bytes; /* as struct vcd_cfg has it */
};

/* Records the lines of a unit from now on; before power-up, so that the first edge is in it. False: no such time unit. */
bool bench_record(struct bench *b, const struct bench_recording *r, FILE *out);

void bench_power_up(struct bench *b);

/* The supply was given something: boards go off and on now, and at the instants that follow from it. */
void bench_supply_changed(struct bench *b, int64_t t_ns);

/* A cycle for a unit whose board has a bus, c as requested; done is called later if it is BOARD_CYCLE_OK, else never. */
enum board_cycle_result bench_cycle(struct bench *b, unsigned unit, const struct bench_cycle *c, int64_t t_ns);
void bench_cycle_forget(struct bench *b, unsigned unit); /* it goes on, no client waits for it */

/* What commands may reach of it, as far as the bench knows: the callbacks are left as they are. */
void bench_view(struct bench *b, struct control_bench *v);

/* After time has moved: lines follow their watchers. */
void bench_follow(struct bench *b);

/* The end: what is still pending goes to the recording. */
void bench_finish(struct bench *b);

#endif
