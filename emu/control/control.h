/* The command table and its JSON form: one object a line in, one object a line out.
 *
 *   {"id":1,"cmd":"head.turn","args":{"angle_deg":5}}
 *   {"id":1,"ok":true,"t_ns":20000000,"can_rx":12,"rx":{"1":12},"result":{...}}
 *   {"id":1,"ok":false,"t_ns":20000000,"can_rx":12,"rx":{"1":12},"error":{"code":"range","text":"..."}}
 *
 * Every command is a row {name, one sentence, arguments with unit and range, handler}; JSON, SCPI, help, the rejections and the
 * pages of the manual come from the same rows. Arguments are checked before a handler runs: a rejected command changes
 * nothing. The bench is reached through struct control_bench; the application fills it in and moves the time. One thread. */
#ifndef PSABENCH_CONTROL_CONTROL_H
#define PSABENCH_CONTROL_CONTROL_H

#include "command/args.h"
#include "control/watch.h"

#define CONTROL_REPLY_MAX  (8u << 20) /* counters or truth of 1000 units: 2 MiB */
#define CONTROL_CYCLES_MAX 64u

/* A cycle on the parallel bus of a board, bus.read or bus.write, until it is over. */
struct control_cycle {
    struct control *control; /* NULL: free */
    void *client;            /* who waits for the answer; NULL: no one */
    cJSON *id;
    unsigned unit;
    struct board_cycle cycle;
    bool over;
    enum board_cycle_result result;
    int64_t ended_ns;
};

/* A run that ends early, once frames have come: it goes in pieces, and looks after each. */
struct control_arrival {
    bool active, any; /* any: no client was named, the one that has been on the bus longest */
    uint32_t connection;
    uint64_t rx;
    int64_t piece_ns, piece_end_ns, end_ns;
};

struct control {
    const struct control_table *const *tables;
    const struct control_bench *bench;
    struct control_error error; /* the latest */
    uint32_t commands, refused; /* lines since init */
    void *client;               /* who sent the line: the application sets it before control_line() */
    bool waiting;               /* a run is under way */
    cJSON *run_id;
    struct control_arrival arrival;
    struct control_cycle cycle[CONTROL_CYCLES_MAX];
    struct control_cycle *started; /* by the line that is being carried out */
    struct control_cycle *running; /* for which a run is under way; NULL: it is for itself */
    struct control_watch watch;
    char reply[CONTROL_REPLY_MAX]; /* last: pages beyond the longest reply so far are never touched */
};

void control_init(struct control *c, const struct control_table *const *tables, const struct control_bench *bench);

/* Carries out one line (NULL: it was too long). The reply, valid until the next call, or NULL: it comes later, from
 * control_run_done(), or through control_bench.reply() if no run was asked for. */
const char *control_line(struct control *c, const char *line, int64_t t_ns);

/* The reply to the run that has ended; NULL: it goes on, control_bench.run() was asked for its next piece. */
const char *control_run_done(struct control *c, int64_t t_ns);

void control_run_forget(struct control *c);                        /* who asked has gone */
void control_cycles_forget(struct control *c, const void *client); /* the same for cycles; NULL: all clients */

/* ---- a command without a line: scenarios, SCPI, the journal */

/* Runs the handler of a command and tells the journal; the error is in c. */
enum control_outcome control_call(struct control *c, const char *cmd, const cJSON *args, cJSON *result, int64_t t_ns);

/* Whether control_call() of a control with these tables would get as far as the handler; does nothing. False with the reason in why[CONTROL_WHY_MAX]. */
bool control_check(const struct control_table *const *tables, const struct control_bench *b, const char *cmd,
                   const cJSON *args, char *why);

#endif
