/* The command table and its JSON form: one object a line in, one object a line out.
 *
 *   {"id":1,"cmd":"head.turn","args":{"angle_deg":5}}
 *   {"id":1,"ok":true,"t_ns":20000000,"can_rx":12,"result":{...}}
 *   {"id":1,"ok":false,"t_ns":20000000,"can_rx":12,"error":{"code":"range","text":"..."}}
 *
 * Every command is a row {name, arguments with unit and range, one sentence, handler}; help, the refusals and
 * docs/emulator.md come from the same rows. Arguments are checked before a handler runs: a refused command changes nothing.
 * The bench is reached through struct control_bench; the application fills it in and moves the time. One thread. */
#ifndef PSABENCH_CONTROL_CONTROL_H
#define PSABENCH_CONTROL_CONTROL_H

#include "base/can.h"
#include "board/unit.h"
#include "phys/head.h"

#include <cjson/cJSON.h>

#define CONTROL_ARGS_MAX  4u
#define CONTROL_UNITS_MAX 16u
#define CONTROL_REPLY_MAX 65536u
#define CONTROL_WHY_MAX   256u

enum control_type { CONTROL_REAL, CONTROL_COUNT, CONTROL_NAME, CONTROL_FACE, CONTROL_UNIT };

struct control_arg {
    const char *name; /* with its unit, angle_deg */
    enum control_type type;
    bool optional;
    double min, max; /* of numbers, both included */
    const char *what;
};

struct control_value {
    bool given;
    double real;
    uint64_t count;
    const char *name;
    enum head_face face;
    unsigned unit; /* index into the bench's units */
};

enum control_outcome { CONTROL_DONE, CONTROL_LATER, CONTROL_REFUSED };

struct control;

struct control_command {
    const char *name;
    const char *what;                         /* one sentence */
    struct control_arg arg[CONTROL_ARGS_MAX]; /* up to the first without a name */
    /* v: the arguments in the order of arg. Adds to result; CONTROL_REFUSED after control_refuse(). */
    enum control_outcome (*run)(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns);
};

/* One client of a CAN adapter, or the sum of those who left. */
struct control_client {
    const char *adapter, *name;
    uint64_t delivered, taken, dropped, overrun, refused;
};

/* Lateness of the wall pace. */
struct control_pace {
    const char *name; /* wall, step, free */
    uint64_t turns, late, slips;
    double p50_us, p99_us, p999_us, max_us; /* of events */
    uint64_t frames;
    double frame_p50_us, frame_p99_us, frame_p999_us, frame_max_us; /* of frames handed to the kernel */
};

/* What the commands may reach. Callbacks get ctx. */
struct control_bench {
    void *ctx;
    struct head *head;
    struct can_bus *bus;
    struct unit *unit[CONTROL_UNITS_MAX];
    struct can_node *node[CONTROL_UNITS_MAX]; /* of the unit on the bus; may be NULL */
    unsigned units;
    uint64_t seed;
    const char *scenario;

    /* Time is to move by for_ns once after_tx frames of clients have been taken; control_run_done() is called then. False
     * with a sentence in why when it cannot. */
    bool (*run)(void *ctx, int64_t for_ns, uint64_t after_tx, char *why);
    void (*quit)(void *ctx);
    bool (*vcd_flush)(void *ctx, char *why);
    uint64_t (*can_rx)(void *ctx); /* frames delivered to the client that has been on the bus longest */
    bool (*client)(void *ctx, unsigned i,
                   struct control_client *out); /* i-th in order of coming; false past the last */
    void (*gone)(void *ctx, struct control_client *out);
    void (*pace)(void *ctx, struct control_pace *out);
};

struct control {
    const struct control_command *table;
    unsigned count;
    const struct control_bench *bench;
    const char *code; /* of the last refusal */
    char why[CONTROL_WHY_MAX];
    uint32_t commands, refused; /* since init */
    bool waiting;               /* a run is under way */
    cJSON *run_id;
    char reply[CONTROL_REPLY_MAX];
};

extern const struct control_command control_commands[]; /* of the control socket */
extern const unsigned control_command_count;
extern const struct control_command control_truth[]; /* of the truth port */
extern const unsigned control_truth_count;

void control_init(struct control *c, const struct control_command *table, unsigned count,
                  const struct control_bench *bench);

/* Carries out one line (NULL: it was too long). The reply, valid until the next call, or NULL: it comes later, from
 * control_run_done(). */
const char *control_line(struct control *c, const char *line, int64_t t_ns);

/* The reply to the run that has ended. */
const char *control_run_done(struct control *c, int64_t t_ns);

void control_run_forget(struct control *c); /* who asked has gone */

/* For handlers: remembers why; returns CONTROL_REFUSED. */
__attribute__((format(printf, 3, 4))) enum control_outcome control_refuse(struct control *c, const char *code,
                                                                          const char *format, ...);

/* The table as Markdown, for docs/emulator.md and --list-commands: next line into out, false at the end. */
bool control_markdown(const struct control_command *table, unsigned count, unsigned line, char *out, size_t cap);

#endif
