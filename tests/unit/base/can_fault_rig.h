/* A bus with four queues of three controllers, and a log of all that each of them is given. */
#ifndef PSABENCH_TESTS_CAN_FAULT_RIG_H
#define PSABENCH_TESTS_CAN_FAULT_RIG_H

#include "base/can/fault.h"
#include "base/rng.h"

#include "rig.h"

#include <string.h>

enum { LOG_MAX = 1024, BIT_NS = 2000 }; /* 500 kbit/s */

struct got {
    char who, what; /* r: received, s: sent, e: error message, a w p o: state */
    struct can_msg m;
    int64_t t_ns;
};

struct bench;
struct station {
    struct bench *bench;
    char name;
    struct can_node node;
};

struct bench {
    struct sched s;
    struct can_bus bus;
    struct station a, b, c, second; /* second: another queue of a's controller */
    struct got log[LOG_MAX];
    unsigned logged;
};

static struct bench bench;

static inline void note(struct station *st, char what, const struct can_msg *m, int64_t t_ns)
{
    struct bench *r = st->bench;
    if (r->logged < LOG_MAX) r->log[r->logged++] = (struct got){st->name, what, m ? *m : (struct can_msg){0}, t_ns};
}

static inline void on_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    note(ctx, 'r', m, t_ns);
}

static inline void on_sent(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    note(ctx, 's', m, t_ns);
}

static inline void on_error(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    assert_true(m->flags & CAN_ERROR);
    assert_int_equal(m->len, 8);
    note(ctx, 'e', m, t_ns);
}

static inline void on_state(void *ctx, enum can_state s, int64_t t_ns)
{
    note(ctx, "awpo"[s], NULL, t_ns);
}

static inline void join(struct bench *r, struct station *st, char name, struct can_node *of)
{
    st->bench = r;
    st->name = name;
    st->node = (struct can_node){
        .name = "x", .rx = on_rx, .sent = on_sent, .error = on_error, .state = on_state, .of = of, .ctx = st};
    can_attach(&r->bus, &st->node);
}

static inline struct bench *up(uint32_t bitrate_hz)
{
    struct bench *r = &bench;
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    can_bus_init(&r->bus, &(struct can_bus_cfg){.bitrate_hz = bitrate_hz}, &r->s);
    join(r, &r->a, 'A', NULL);
    join(r, &r->second, 'S', &r->a.node);
    join(r, &r->b, 'B', NULL);
    join(r, &r->c, 'C', NULL);
    return r;
}

static inline struct can_fault fault(enum can_fault_kind kind)
{
    return (struct can_fault){.kind = kind, .probability = 1.0, .rng = rng_stream(1, 1, "fault")};
}

static inline struct can_msg frame(uint32_t id)
{
    return (struct can_msg){.id = id, .len = 8, .data = {1, 2, 3, 4, 5, 6, 7, (uint8_t)id}};
}

static inline void send(struct bench *r, struct station *st, uint32_t id)
{
    const struct can_msg m = frame(id);
    assert_int_equal(can_send(&r->bus, &st->node, &m, r->s.now_ns), CAN_OK);
}

static inline void run(struct bench *r, int64_t ns)
{
    sched_run_until(&r->s, r->s.now_ns + ns);
}

static inline unsigned count(const struct bench *r, char who, char what)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r->logged; i++) n += r->log[i].who == who && r->log[i].what == what;
    return n;
}

/* The k-th of its kind, from 0. */
static inline const struct got *entry(const struct bench *r, char who, char what, unsigned k)
{
    for (unsigned i = 0; i < r->logged; i++)
        if (r->log[i].who == who && r->log[i].what == what && k-- == 0) return &r->log[i];
    fail_msg("no %c %c", who, what);
    return NULL;
}

static inline int64_t frame_ns(uint32_t id)
{
    const struct can_msg m = frame(id);
    return can_frame_ns(&bench.bus.cfg, &m);
}

#endif
