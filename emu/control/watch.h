/* Notifications of what happens on the bench: `run.until` waits for an event of a board, subscribers get a line for each.
 *
 *   {"event":"DRD_A","unit":"a","t_ns":20000000}
 *   {"event":"status","t_ns":20000000,"pace":"wall",...}
 *   {"event":"fault","t_ns":20000000,"id":1,"kind":"line.stuck","point":"a.line.INT","state":"active"}
 *   {"event":"file","t_ns":20000000,"path":"run.vcd","bytes":999999984,"ended":"its limit of 1000 MB is reached"}
 *
 * Boards compute events only while somebody listens; listening changes nothing else. One thread. */
#ifndef PSABENCH_CONTROL_WATCH_H
#define PSABENCH_CONTROL_WATCH_H

#include "base/sched.h"
#include "command/view.h"

#define CONTROL_SUBS_MAX 32u

struct control;
struct fault_kind;

enum control_topic { CONTROL_STATUS, CONTROL_EVENTS, CONTROL_FAULTS, CONTROL_FILES, CONTROL_TOPICS };

extern const char *const control_topics[]; /* their names, up to NULL */

struct control_sub {
    struct control *control; /* NULL: free */
    void *client;
    enum control_topic topic;
    int64_t every_ns; /* of status */
    struct sched_ev ev;
};

struct control_observer {
    struct unit_observer listener;
    struct control *control;
    unsigned unit;
};

struct control_until {
    bool active, reached;
    unsigned event, unit; /* event: number in the list of the unit's board */
    uint64_t count, seen;
};

/* What a capture waits for, beside lines: the count-th such thing from now on, and again. */
struct control_arm {
    bool on_fault, on_event;
    const struct fault_kind *fault; /* NULL: any */
    unsigned event, unit;           /* event: number in the list of the unit's board */
    uint64_t count, seen;
};

struct control_watch { /* read-only outside watch.c */
    struct control_sub sub[CONTROL_SUBS_MAX];
    struct control_observer observer[CONTROL_UNITS_MAX];
    bool listening;
    struct control_until until;
    struct control_arm arm;
    struct trace_sink probe[CONTROL_UNITS_MAX]; /* keeps the lines of a unit alive once somebody has looked at them */
};

/* run.until: the bench's run_stop() is called at the very instant of the count-th event from now on. */
void control_watch_until(struct control *c, unsigned event, unsigned unit, uint64_t count);

/* The run is over: what came, and no client waits any more. */
struct control_until control_watch_end(struct control *c);

/* capture.trigger() of the bench is called at the very instant of each such fault or event, until disarmed. */
void control_watch_arm(struct control *c, const struct control_arm *arm);
void control_watch_disarm(struct control *c);

/* False: there is no room, or the client has that topic already and its interval was changed instead (true). */
bool control_subscribe(struct control *c, void *client, enum control_topic topic, int64_t every_ns, int64_t t_ns);
void control_unsubscribe(struct control *c, void *client, enum control_topic topic);

/* For fault_engine.changed; ctx is the control. */
struct fault;
void control_fault_changed(void *ctx, const struct fault *f, int64_t t_ns);

/* A file that the emulator wrote has ended before it was closed; why: its limit, a full disk. */
void control_file_ended(struct control *c, const char *path, uint64_t bytes, const char *why, int64_t t_ns);

/* The client has gone: its subscriptions and its run with it. */
void control_gone(struct control *c, void *client);

/* Levels of a unit's lines now, bit per line. From the first call on they are watched: what went on then may be missed. */
uint64_t control_lines(struct control *c, unsigned unit, int64_t t_ns);

#endif
