/* Two PIK boards, the same script of inputs, cycles, faults, power and time: the lines of one are watched and its events heard now
 * and then, of the other never. Readings and answers are the same, and each is what the header promises. */
#include "fuzz.h"
#include "listener.h"
#include "looks.h"
#include "twin.h"

#include "board/pik/pik.h"

#include <string.h>

enum { RUN_NS = 200000000 }; /* of simulated time after the beginning: what bounds a run */

struct world {
    struct sched s;
    struct pik b;
    double v[PIK_AXES];
    int64_t asked_ns[PIK_AXES]; /* last */
    uint64_t trail;             /* of readings and answers */
    struct pik_reading last;
    bool any;
    struct board_cycle cycle;
    bool waiting, submitting;
    struct listener ear;
    bool attached;
    struct pik_counters seen;
    unsigned on_told;
};

static void mix(struct world *w, uint64_t v)
{
    twin_mix(&w->trail, v);
}

/* ---- what the board calls ---- */

static double accel(void *ctx, unsigned axis, int64_t t_ns)
{
    struct world *w = ctx;
    assert(axis < PIK_AXES && t_ns <= w->s.now_ns && t_ns >= w->asked_ns[axis]);
    w->asked_ns[axis] = t_ns;
    return w->v[axis];
}

LOOKS_ROW(accel_row, accel);

static double degc(void *ctx, unsigned channel, int64_t t_ns)
{
    const struct world *w = ctx;
    assert(channel == 3 && t_ns == w->s.now_ns);
    return 25.0 + w->v[0];
}

static void on_event(void *ctx, unsigned e, int64_t t_ns)
{
    const struct world *w = ctx;
    assert(e < PIK_EVENTS && t_ns == w->s.now_ns && w->b.base.observed);
}

static void on_reading(void *ctx, const struct pik_reading *r, int64_t t_ns)
{
    struct world *w = ctx;
    assert(t_ns == w->s.now_ns && r->t_ns == t_ns && r->seq > 0 && r->status & PIK_ST_NEW);
    if (w->any && r->seq > 1) assert(r->seq == w->last.seq + 1 && t_ns > w->last.t_ns);
    for (unsigned i = 0; i < PIK_AXES; i++) {
        if (!w->b.base.faults) assert((uint32_t)r->total[i] == (uint32_t)(r->plus[i] - r->minus[i]));
        mix(w, (uint64_t)r->total[i] << 16 ^ (uint16_t)r->increment[i]);
        mix(w, r->plus[i] ^ r->status);
    }
    mix(w, (uint64_t)t_ns);
    w->last = *r;
    w->any = true;
}

static void on_saturated(void *ctx, bool on, int64_t t_ns)
{
    struct world *w = ctx;
    assert(on == w->b.saturated);
    w->on_told += on;
    mix(w, (uint64_t)t_ns + on);
}

static void on_done(void *ctx, struct board_cycle *c, enum board_cycle_result r, int64_t t_ns)
{
    struct world *w = ctx;
    assert(w->waiting && !w->submitting && c == &w->cycle);
    assert(r == BOARD_CYCLE_OK || r == BOARD_CYCLE_OFF);
    w->waiting = false;
    mix(w, (uint64_t)t_ns ^ (uint64_t)r << 60 ^ c->data);
}

/* ---- operations ---- */

static void check(struct world *w)
{
    twin_counters(&w->seen, &w->b.counters, sizeof w->seen, &w->b.base.trace);
    for (unsigned i = 0; i < PIK_AXES; i++) {
        const struct pik_axis *a = &w->b.channel[i].axis;
        assert(a->begun_tick <= a->tick);
        assert(pik_axis_next(a) > a->tick);
    }
}

static void run(struct world *w, int64_t ns)
{
    twin_run_until(&w->s, &w->b.base.trace, w->s.now_ns + ns, 100000);
}

static void op_input(struct world *w, struct script *s)
{
    const uint8_t axis = script_byte(s) % PIK_AXES;
    pik_sample_until(&w->b, w->s.now_ns);
    w->v[axis] = (double)(int8_t)script_byte(s) / 8.0;
}

static void op_submit(struct world *w, struct script *s)
{
    struct board_cycle c = {.write = script_byte(s) & 1, .done = on_done, .ctx = w};
    c.address = script_byte(s) % 16;
    c.data = (uint16_t)script_uint(s, 2);
    c.strobe_ns = script_span_ns(s);
    struct board_cycle *const at = w->waiting ? &c : &w->cycle;
    if (!w->waiting) w->cycle = c;
    w->submitting = true;
    const enum board_cycle_result r = pik_bus.submit(&w->b.base, at, w->s.now_ns);
    w->submitting = false;
    if (!w->b.on) assert(r == BOARD_CYCLE_OFF);
    else if (w->waiting) assert(r != BOARD_CYCLE_OK);
    if (r == BOARD_CYCLE_OK) w->waiting = true;
    mix(w, r);
}

static void op_power(struct world *w, struct script *s)
{
    (void)s;
    if (w->b.on) pik_power_down(&w->b, w->s.now_ns);
    else pik_power_up(&w->b, w->s.now_ns);
    w->any = false;
}

static void op_reset(struct world *w, struct script *s)
{
    (void)s;
    pik_reset(&w->b, w->s.now_ns);
    w->any = w->any && !w->b.on;
}

static void op_clock(struct world *w, struct script *s)
{
    pik_clock(&w->b, (int8_t)script_byte(s) * 7, w->s.now_ns);
}

static void op_stick(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    pik_stick(&w->b, b % PIK_AXES,
              &(struct chip_fault){.dout = b & 64 ? b & 128 ? CHIP_STUCK_HIGH : CHIP_STUCK_LOW : CHIP_FREE},
              w->s.now_ns);
}

static void op_flip(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    assert(pik_flip(&w->b, b % PIK_AXES, b >> 4 & 3, script_byte(s), w->s.now_ns) == w->b.on);
}

static void op_freeze(struct world *w, struct script *s)
{
    (void)s;
    w->b.base.faults ^= PIK_FAULT_FROZEN_WORDS;
}

static void (*const ops[])(struct world *w, struct script *s) = {
    op_input, op_input, op_submit, op_submit, op_power, op_reset, op_clock, op_stick, op_flip, op_freeze,
};

/* Only of the watched board, and no byte of the script: what it does must change nothing. */
static void listen(struct world *w, uint8_t how)
{
    pik_observe(&w->b, how & 1);
    if ((how & 2) && !w->attached) {
        w->ear.sink.mask = how & 4 ? UINT64_MAX >> (64 - PIK_LINES) : UINT64_C(0x55);
        w->ear.known = 0;
        trace_attach(&w->b.base.trace, &w->ear.sink);
        w->attached = true;
    } else if (!(how & 2) && w->attached) {
        trace_detach(&w->b.base.trace, &w->ear.sink);
        w->attached = false;
    }
}

static void begin(struct world *w, const struct pik_profile *p)
{
    const struct board_io io = {.ctx = w, .accel = accel_row, .temp_degc = degc, .event = on_event};
    struct board_cfg cfg = {.adc_noise_scale = 1.0, .seed = 3, .serial = 4};
    memset(w, 0, sizeof *w);
    for (unsigned i = 0; i < PIK_AXES; i++) {
        cfg.afe[i] = afe_nominal(AFE_VOLTAGE);
        cfg.afe[i].divider_ratio = 1.0;
        cfg.afe[i].clip_v = 30.0;
    }
    sched_init(&w->s);
    pik_init(&w->b, p, &cfg, &io, &w->s);
    w->b.host = (struct pik_host){.ctx = w, .reading = on_reading, .saturated = on_saturated};
    w->ear.sink = (struct trace_sink){.steps = listener_steps, .ctx = &w->ear};
}

static struct pik_profile profile_of(struct script *s)
{
    struct pik_profile p;
    fields_default(&pik_fields, &p);
    const uint8_t b = script_byte(s);
    char why[300];
    if (b & 1) {
        p.clock_hz = 40000;
        p.c_int_nf = 4.7;
        p.uc_v = 3.9;
    }
    p.grid = b & 2 ? 16 : 1;
    p.look_ticks = p.grid * 175 * (p.clock_hz / 10) / 100000 + (p.clock_hz < 40000 && p.grid == 1);
    p.recovery_ticks = (b >> 2 & 3) * p.grid / 2;
    if (b & 16) p.input_off_ns = 5000.0;
    if (b & 32) p.noise_v_rthz = 1e-2;
    if (b & 64) p.c_int_nf *= 1.35;
    assert(pik_profile_check(&p, why, sizeof why));
    return p;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct world heard, deaf;
    struct script s = script_of(data, size);
    const struct pik_profile p = profile_of(&s);
    begin(&heard, &p);
    begin(&deaf, &p);
    pik_power_up(&heard.b, 0);
    pik_power_up(&deaf.b, 0);
    while (script_more(&s) && deaf.s.now_ns < RUN_NS) {
        const uint8_t b = script_byte(&s);
        const int64_t ns = script_span_ns(&s);
        struct script again = s;
        listen(&heard, b >> 4);
        ops[b % (sizeof ops / sizeof *ops)](&heard, &again);
        ops[b % (sizeof ops / sizeof *ops)](&deaf, &s);
        run(&heard, ns);
        run(&deaf, ns);
        check(&heard);
        check(&deaf);
        assert(heard.trail == deaf.trail);
        for (unsigned i = 0; i < PIK_AXES; i++) {
            const struct pik_axis *x = &heard.b.channel[i].axis, *y = &deaf.b.channel[i].axis;
            assert(x->tick == y->tick && x->charge == y->charge && x->plus == y->plus && x->minus == y->minus &&
                   x->lost == y->lost);
        }
    }
    return 0;
}
