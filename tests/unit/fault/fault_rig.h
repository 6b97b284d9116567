/* The fault engine over two PSA-2, what is asked of it, and what it tells. */
#ifndef PSABENCH_TESTS_FAULT_RIG_H
#define PSABENCH_TESTS_FAULT_RIG_H

#include "fault_call.h"

#include <string.h>

#define MS INT64_C(1000000)

enum { UNITS = 2, PROGRAMS = 2, EVENTS_MAX = 4096, CHANGES_MAX = 64 };

struct heard {
    enum psa2_event e;
    int64_t t_ns;
};

struct change {
    uint32_t id;
    enum fault_state state;
    int64_t t_ns;
};

static struct {
    struct sched s;
    struct can_bus bus;
    struct lab lab;
    struct unit unit[UNITS];
    struct can_node node[UNITS], program[PROGRAMS];
    uint32_t came[PROGRAMS + 1]; /* who is on the bus, up to 0 */
    struct control_bench view;
    struct fault_engine engine;
    struct control control;
    struct unit_observer listener;
    struct heard heard[EVENTS_MAX];
    unsigned events;
    struct change change[CHANGES_MAX];
    unsigned changes;
    struct psa2_frame frame; /* latest of unit a */
    unsigned frames;
} r;

static inline void on_event(void *ctx, enum psa2_event e, int64_t t_ns)
{
    (void)ctx;
    if (r.events < EVENTS_MAX) r.heard[r.events++] = (struct heard){e, t_ns};
}

static inline void on_change(void *ctx, const struct fault *f, int64_t t_ns)
{
    (void)ctx;
    assert_true(r.changes < CHANGES_MAX);
    r.change[r.changes++] = (struct change){f->id, f->state, t_ns};
}

static inline void on_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    r.frame = *f;
    r.frames++;
}

static inline bool on_client(void *ctx, unsigned i, struct control_client *out)
{
    (void)ctx;
    *out = (struct control_client){.adapter = "socketcand", .name = "can0", .connection = r.came[i], .slot = r.came[i]};
    return r.came[i] != 0;
}

static inline struct can_node *on_client_node(void *ctx, uint32_t place)
{
    (void)ctx;
    for (unsigned i = 0; r.came[i]; i++) {
        if (r.came[i] == place) return &r.program[place - 1];
    }
    return NULL;
}

static inline void init_unit(unsigned i)
{
    static const char *const name[UNITS] = {"a", "b"};
    struct unit_cfg cfg = unit_default(name[i]);
    cfg.axis[0].sensor = UNIT_MEMS;
    cfg.axis[0].mems = (struct mems_g){.u0_v = 2.5, .kx_v_per_g = 1.0};
    cfg.board.adc_noise_scale = cfg.board.temp_noise_scale = 0.0;
    cfg.board.serial = i + 1;
    if (i == 1) cfg.board.afe[0] = afe_nominal(AFE_CURRENT);
    if (i == 1) cfg.board.afe[0].clip_v = 5.0;
    unit_init(&r.unit[i], &cfg, &r.lab, &r.s);
    r.node[i] = (struct can_node){.name = name[i]};
    can_attach(&r.bus, &r.node[i]);
    r.view.unit[i] = &r.unit[i];
    r.view.unit_name[i] = name[i];
    r.view.node[i] = &r.node[i];
}

static inline int fresh(void **state)
{
    struct lab_cfg lab = lab_default();
    lab.supply.present = true;
    lab.platform.present = true;
    (void)state;
    memset(&r, 0, sizeof r);
    sched_init(&r.s);
    can_bus_init(&r.bus, &(struct can_bus_cfg){.bitrate_hz = 1000000}, &r.s);
    lab_init(&r.lab, &lab, 1);
    r.view = (struct control_bench){.lab = &r.lab,
                                    .bus = {&r.bus},
                                    .bus_name = {"can0"},
                                    .buses = 1,
                                    .units = UNITS,
                                    .seed = 7,
                                    .faults = &r.engine,
                                    .clients.nth = on_client,
                                    .clients.node = on_client_node};
    for (unsigned i = 0; i < UNITS; i++) init_unit(i);
    r.program[0].name = "program";
    can_attach(&r.bus, &r.program[0]);
    r.came[0] = 1;
    fault_init(&r.engine, &r.view, &r.s);
    r.engine.changed = on_change;
    control_init(&r.control, control_tables, &r.view);
    r.unit[0].store.psa2.host = (struct psa2_host){.frame = on_frame};
    r.listener.fn = on_event;
    unit_subscribe(&r.unit[0], &r.listener);
    for (unsigned i = 0; i < UNITS; i++) psa2_power_up(&r.unit[i].store.psa2, 0);
    return 0;
}

static inline void run_to(int64_t t_ns)
{
    sched_run_until(&r.s, t_ns);
}

/* As add_fault(). */
static inline uint32_t add(const char *args)
{
    return add_fault(&r.control, args, r.s.now_ns);
}

/* The n-th event of a kind that comes after t_ns. */
static inline int64_t nth_ns(enum psa2_event e, unsigned n, int64_t after_ns)
{
    for (unsigned i = 0; i < r.events; i++) {
        if (r.heard[i].e == e && r.heard[i].t_ns > after_ns && --n == 0) return r.heard[i].t_ns;
    }
    fail_msg("no such event");
    return 0;
}

static inline void assert_change(unsigned i, uint32_t id, enum fault_state state, int64_t t_ns)
{
    assert_true(i < r.changes);
    assert_int_equal(r.change[i].id, id);
    assert_int_equal(r.change[i].state, state);
    assert_int_equal(r.change[i].t_ns, t_ns);
}

#endif
