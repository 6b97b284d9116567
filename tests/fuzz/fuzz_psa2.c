/* Two PSA-2 boards, the same script of requests, resets, streams and time: the lines of one are watched now and then, of the
 * other never. Frames and answers are the same, and each is what the header promises. */
#include "fuzz.h"
#include "listener.h"
#include "looks.h"
#include "twin.h"

#include "base/clk.h"
#include "board/psa2/psa2.h"

#include <string.h>

enum { RUN_NS = 30000000, FRAMES_MAX = 40 }; /* of simulated time after the beginning: what bounds a run */

struct world {
    struct sched s;
    struct psa2 b;
    double v[3];
    struct psa2_frame last; /* of the stream */
    unsigned frames;
    bool any; /* a frame since the last reset */
    struct psa2_request request;
    bool waiting, submitting; /* for done(); inside psa2_submit() */
    bool clean;               /* KPSA's rules alone reached the converters: registers are what it was given */
    uint64_t trail;           /* of frames and answers */
    struct listener ear;
    bool attached;
    int64_t next_ns;
    struct psa2_counters seen;
};

static void mix(struct world *w, uint64_t v)
{
    twin_mix(&w->trail, v);
}

/* ---- what the board calls ---- */

static double accel(void *ctx, unsigned axis, int64_t t_ns)
{
    struct world *w = ctx;
    assert(axis < 3 && t_ns <= w->s.now_ns);
    return w->v[axis];
}

LOOKS_ROW(accel_row, accel);

static double degc(void *ctx, unsigned channel, int64_t t_ns)
{
    const struct world *w = ctx;
    assert(channel < 4 && t_ns <= w->s.now_ns);
    return 25.0;
}

static void on_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    struct world *w = ctx;
    assert(t_ns == f->t_int_rise_ns && t_ns == w->s.now_ns);
    assert(f->t_sample_ns <= f->t_int_fall_ns);
    const int64_t low_ns = f->t_int_rise_ns - f->t_int_fall_ns, want_ns = psa2_int_low_ns(&w->b.profile);
    assert(low_ns == want_ns || low_ns == want_ns + 1); /* edges are rounded down one by one */
    if (w->any) assert(f->seq > w->last.seq && f->t_int_fall_ns > w->last.t_int_rise_ns);
    for (unsigned i = 0; i < 3; i++) assert(f->code[i] >= -0x800000 && f->code[i] <= 0x7FFFFF);
    assert(f->temp_channel < 8 && (f->status & ~15) == 0);
    w->last = *f;
    w->any = true;
    w->frames++;
    mix(w, (uint64_t)f->t_int_fall_ns);
    for (unsigned i = 0; i < PSA2_WORDS; i++) mix(w, f->word[i]);
}

static void on_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    struct world *w = ctx;
    assert(code == PSA2_FAULT_ACCEL_PORT || code == PSA2_FAULT_TEMP_PORT);
    mix(w, code + (uint64_t)t_ns);
}

/* An answer is what is in the register, and it comes once, never from inside psa2_submit(). */
static void on_done(void *ctx, struct psa2_request *r, enum psa2_result result, int64_t t_ns)
{
    struct world *w = ctx;
    assert(w->waiting && !w->submitting && r == &w->request);
    assert(result == PSA2_OK || result == PSA2_TIMEOUT);
    w->waiting = false;
    mix(w, (uint64_t)t_ns ^ (uint64_t)result << 60);
    if (result != PSA2_OK || r->op != PSA2_READ_REG) return;
    for (unsigned i = 0; i < 3; i++) mix(w, r->answer[i]);
    for (unsigned i = 0; i < 3 && r->group == PSA2_ACCEL && w->clean; i++)
        assert(r->answer[i] == reg_peek(&w->b.adc[i].regs, r->addr));
}

/* ---- operations ---- */

static void check(struct world *w)
{
    twin_counters(&w->seen, &w->b.counters, sizeof w->seen, &w->b.base.trace);
    assert(sched_next_ns(&w->s) > w->s.now_ns);
    for (unsigned i = 0; i < 3; i++) assert(w->b.adc[i].count.torn_reads == 0 || !w->clean);
}

static void run_until(struct world *w, int64_t t_ns)
{
    twin_run_until(&w->s, &w->b.base.trace, t_ns, 100000);
}

static void op_submit(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s), addr = script_byte(s), value = script_byte(s);
    if (w->waiting) {
        struct psa2_request second = w->request;
        assert(psa2_submit(&w->b, &second, w->s.now_ns) == PSA2_BUSY);
        return;
    }
    w->request = (struct psa2_request){.group = b & 1 ? PSA2_TEMP : PSA2_ACCEL,
                                       .op = (enum psa2_op)(b >> 1 & 3),
                                       .addr = addr % 12,
                                       .value = value,
                                       .done = on_done,
                                       .ctx = w};
    w->submitting = true;
    w->waiting = psa2_submit(&w->b, &w->request, w->s.now_ns) == PSA2_OK;
    w->submitting = false;
    if (w->waiting && w->request.op == PSA2_OPCODE) w->clean = false;
}

static void op_reset(struct world *w, struct script *s)
{
    (void)s;
    psa2_reset(&w->b, w->s.now_ns);
    assert(!w->waiting); /* a request ends with the reset */
    w->any = false;
}

static void op_host(struct world *w, struct script *s)
{
    w->b.host.frame = script_byte(s) & 1 ? on_frame : NULL;
}

static void op_wait(struct world *w, struct script *s)
{
    run_until(w, w->s.now_ns + script_span_ns(s));
}

/* To the next event of the board that without observers (the other has more of them), a nanosecond before it, or after it. */
static void op_next(struct world *w, struct script *s)
{
    run_until(w, w->next_ns + script_byte(s) % 3 - 1);
}

static void op_input(struct world *w, struct script *s)
{
    static const double v[] = {0.0, 2.5, -2.5, 5.0, 4.99, -5.01, 1e30, 2.488};
    const uint8_t b = script_byte(s);
    psa2_sample_until(&w->b, w->s.now_ns);
    w->v[b % 3] = v[b >> 3 & 7];
}

/* Some or all of the lines are watched from now on, or none; the other board's never. */
static void op_watch(struct world *w, struct script *s)
{
    const uint32_t mask = script_byte(s) & 1 ? 0xFFFF : script_byte(s) * UINT32_C(0x0101);
    if (!w->ear.sink.steps) return;
    trace_detach(&w->b.base.trace, &w->ear.sink);
    w->ear.known = 0;
    w->ear.edge_ns = 0;
    w->ear.sink.mask = mask;
    if (mask) trace_attach(&w->b.base.trace, &w->ear.sink);
}

static void step(struct world *w, struct script *s)
{
    static void (*const ops[])(struct world * w, struct script * s) = {
        op_submit, op_wait, op_next, op_submit, op_reset, op_host, op_input, op_watch,
    };
    ops[script_byte(s) % (sizeof ops / sizeof ops[0])](w, s);
    check(w);
}

/* ---- the boards ---- */

static void power_up(struct world *w, bool watched)
{
    struct psa2_profile p;
    fields_default(&psa2_fields, &p);
    const struct board_io io = {.ctx = w, .accel = accel_row, .temp_degc = degc};
    struct board_cfg u = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .seed = 7, .serial = 3};
    for (unsigned i = 0; i < 3; i++) u.afe[i] = afe_nominal(AFE_VOLTAGE);
    memset(w, 0, sizeof *w);
    w->clean = true;
    sched_init(&w->s);
    psa2_init(&w->b, &p, &u, &io, &w->s);
    w->b.host = (struct psa2_host){.ctx = w, .frame = on_frame, .fault = on_fault};
    w->ear.sink = (struct trace_sink){.steps = watched ? listener_steps : NULL, .ctx = &w->ear};
    psa2_power_up(&w->b, 0);
}

/* Boards that have just been switched on, or that have finished their set-up and sent a frame: made once, then copied back
 * to the same place, for what they point at is themselves. */
static struct world watched, unwatched, began[2][2];

static void prepare(void)
{
    struct world *both[] = {&watched, &unwatched};
    for (unsigned i = 0; i < 2; i++) {
        power_up(both[i], i == 0);
        began[0][i] = *both[i];
        while (!both[i]->frames) run_until(both[i], both[i]->s.now_ns + 1000000);
        began[1][i] = *both[i];
    }
}

static void restore(struct world *to, const struct world *from)
{
    assert(from->b.base.trace.pending_count == 0);
    twin_restore(to, from, sizeof *to, offsetof(struct world, b.base.trace.pending));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct script s = script_of(data, size);
    if (!began[0][0].b.base.sched) prepare();
    const unsigned ready = script_byte(&s) & 1;
    restore(&watched, &began[ready][0]);
    restore(&unwatched, &began[ready][1]);
    const int64_t end_ns = watched.s.now_ns + (ready ? RUN_NS : 5 * RUN_NS);
    while (script_more(&s) && watched.s.now_ns < end_ns && watched.frames < FRAMES_MAX) {
        struct script t = s;
        watched.next_ns = unwatched.next_ns = sched_next_ns(&unwatched.s);
        step(&watched, &s);
        step(&unwatched, &t);
        assert(watched.trail == unwatched.trail && watched.frames == unwatched.frames);
        assert(memcmp(&watched.b.counters, &unwatched.b.counters, sizeof watched.b.counters) == 0);
    }
    return 0;
}
