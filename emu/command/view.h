/* What the commands may reach of the bench. The application fills it in. */
#ifndef PSABENCH_COMMAND_VIEW_H
#define PSABENCH_COMMAND_VIEW_H

#include "base/can/can.h"
#include "phys/lab.h"
#include "unit/unit.h"

#define CONTROL_UNITS_MAX 1000u
#define CONTROL_BUSES_MAX 8u
#define CONTROL_WHY_MAX   256u

/* One client of a CAN adapter, or the sum of those who left. */
struct control_client {
    const char *adapter, *name;
    uint32_t connection; /* connection number */
    uint32_t
        slot; /* position on the bus: connection number of the first client there, whose slot it may have adopted */
    uint64_t delivered, taken, dropped, overrun, refused;
};

/* Lateness of the wall pace. */
struct control_pace {
    const char *name; /* wall, step, free */
    bool by_step;     /* time moves only by commands */
    uint64_t turns, late, slips;
    double p50_us, p99_us, p999_us, max_us; /* of events */
    uint64_t frames;
    double frame_p50_us, frame_p99_us, frame_p999_us, frame_max_us; /* of frames handed to the kernel */
};

struct control_command;
struct fault_engine;
struct cJSON;

/* Endpoints of a child of `fork`. */
struct control_fork {
    const char *control, *can, *truth; /* paths of sockets, truth may be NULL; can: as --can, several with spaces */
    const uint64_t *seed;              /* of the child's noise from the fork on; NULL: the parent's */
};

/* What the bench does for commands, by trade. Each function gets control_bench.ctx; those with `why` write a sentence into it
 * when they return false. */

struct control_sim { /* the time */
    /* Time is to move by for_ns once after_tx frames of clients have been taken, or a client's queue is full, which only time
     * empties; control_run_done() is called then. False when it cannot. */
    bool (*run)(void *ctx, int64_t for_ns, uint64_t after_tx, char *why);
    void (*run_stop)(void *ctx); /* from within an event: the run ends at this instant */
    void (*pace)(void *ctx, struct control_pace *out);
    /* The supply was set: its next brown-out has to be computed again. May be NULL. */
    void (*supply_changed)(void *ctx, int64_t t_ns);
};

struct control_recording { /* of the lines of a unit, as VCD; start NULL: there is none */
    /* wires: with those of differential pairs. max_bytes: where a recording ends by itself; 0: it does not. */
    bool (*start)(void *ctx, const char *path, unsigned unit, bool wires, uint64_t max_bytes, char *why);
    bool (*stop)(void *ctx, char *why);
    bool (*flush)(void *ctx, char *why);
};

/* A capture around a trigger, probe.arm. */
struct control_capture {
    const char *path;
    unsigned unit, line;
    unsigned when; /* enum capture_when of the line */
    int64_t pre_ns, post_ns;
    uint32_t files;
    uint64_t ring_bytes, max_bytes;
};

struct control_captures { /* arm NULL: there are none */
    bool (*arm)(void *ctx, const struct control_capture *c, char *why);
    bool (*disarm)(void *ctx, char *why);
    void (*trigger)(void *ctx, int64_t t_ns); /* what it waits for is here; from within an event */
    void (*describe)(void *ctx, struct cJSON *result);
};

struct control_clients {           /* programs on the CAN buses */
    uint64_t (*can_rx)(void *ctx); /* frames delivered to the client that has been on the bus longest */
    bool (*nth)(void *ctx, unsigned i, struct control_client *out); /* in order of coming; false past the last */
    void (*gone)(void *ctx, struct control_client *out);
    struct can_node *(*node)(void *ctx, uint32_t slot);               /* of the client there; NULL: it has left */
    bool (*stall)(void *ctx, const struct can_node *client, bool on); /* it reads nothing; false: it has gone */
};

struct control_process { /* of the emulator; NULL: not here */
    void (*quit)(void *ctx);
    void (*push)(void *ctx, void *client, const char *line);  /* to a client of the control socket, that is no reply */
    void (*reply)(void *ctx, void *client, const char *line); /* one that is due, at any time but from control_line() */
    bool (*snapshot)(void *ctx, const char *path, struct cJSON *result, char *why);
    bool (*fork)(void *ctx, const struct control_fork *f, struct cJSON *result, char *why);
    bool (*endpoints)(void *ctx, struct cJSON *result); /* adds "endpoints", where programs connect; false: no memory */
    void (*files)(void *ctx, struct cJSON *result); /* adds "files" and "journal": what grows, and how large it is */
    /* A command that changes the bench's future was carried out; args as it was given. */
    void (*journal)(void *ctx, const struct control_command *row, const struct cJSON *args, bool done, int64_t t_ns);
};

struct control_bench {
    void *ctx;
    struct lab *lab;
    struct can_bus *bus[CONTROL_BUSES_MAX];
    const char *bus_name[CONTROL_BUSES_MAX];  /* NULL: can0, can1, ... */
    struct can_node *host[CONTROL_BUSES_MAX]; /* who sends for the bench itself */
    unsigned buses;
    struct unit *unit[CONTROL_UNITS_MAX];
    const char *unit_name[CONTROL_UNITS_MAX];
    struct can_node *node[CONTROL_UNITS_MAX]; /* of the unit on the bus; may be NULL */
    unsigned units;
    struct sched *sched;
    uint64_t seed;
    const char *scenario;
    struct fault_engine *faults; /* NULL: no commands of faults */

    struct control_sim sim;
    struct control_recording recording;
    struct control_captures capture;
    struct control_clients clients;
    struct control_process process;
};

/* The converters take their inputs in blocks: what was before a change of their world must be sampled before it. */
static inline void control_settle_inputs(const struct control_bench *b, int64_t t_ns)
{
    for (unsigned i = 0; i < b->units; i++) unit_sample_until(b->unit[i], t_ns);
}

#endif
