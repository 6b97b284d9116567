/* Two PSD-1 boards, the same script of bus cycles, commands, flags, resets, power and time: the lines of one are watched now
 * and then, of the other never. Words, times and answers are the same, and each is what the header promises. */
#include "fuzz.h"
#include "listener.h"
#include "looks.h"
#include "twin.h"

#include "board/board.h"
#include "board/psd1/psd1.h"

#include <string.h>

enum { RUN_NS = 30000000, CYCLES_MAX = 40 }; /* of simulated time after the beginning: what bounds a run */

struct world {
    struct sched s;
    struct psd1 b;
    double v[3], w_radps;
    unsigned cycles;
    struct psd1_cycle last;
    bool any; /* a cycle since the last reset */
    struct board_cycle cycle;
    struct psd1_request request;
    bool waiting, asking,
        submitting; /* for the cycle's, for the request's done(); inside of a call that must not call it */
    uint64_t trail; /* of cycles and answers */
    struct listener ear;
    int64_t next_ns;
    struct psd1_counters seen;
};

static void mix(struct world *w, uint64_t v)
{
    twin_mix(&w->trail, v);
}

/* ---- what the board calls ---- */

static double accel(void *ctx, unsigned axis, int64_t t_ns)
{
    const struct world *w = ctx;
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

static void rate(void *ctx, int64_t t_ns, double w_radps[3])
{
    const struct world *w = ctx;
    assert(t_ns <= w->s.now_ns);
    for (unsigned i = 0; i < 3; i++) w_radps[i] = w->w_radps;
}

static void on_cycle(void *ctx, const struct psd1_cycle *c, int64_t t_ns)
{
    struct world *w = ctx;
    assert(t_ns == c->t_end_ns && t_ns == w->s.now_ns);
    assert(c->t_a0_ns > c->t_dr_ns && c->t_end_ns >= c->t_a0_ns + 43600); /* the shortest: sources 4.5 */
    assert((c->t_a0_ns - w->b.t0_ns) % 800 == 0 && (c->t_end_ns - w->b.t0_ns) % 800 == 400);
    assert((c->status & PSD1_CY_READ) == PSD1_CY_READ);
    if (w->any) assert(c->seq > w->last.seq && c->t_a0_ns > w->last.t_end_ns);
    w->last = *c;
    w->any = true;
    w->cycles++;
    mix(w, (uint64_t)c->t_a0_ns);
    mix(w, (uint64_t)c->t_end_ns ^ (uint64_t)c->status << 56);
    for (unsigned i = 0; i < 3; i++) mix(w, c->word[i] | (uint64_t)(uint32_t)c->gyro[i] << 16);
}

static void on_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    assert(code == 0 || code == PSD1_FAULT_DR);
    mix(ctx, code + (uint64_t)t_ns);
}

static void on_bus(void *ctx, struct board_cycle *c, enum board_cycle_result r, int64_t t_ns)
{
    struct world *w = ctx;
    assert(w->waiting && !w->submitting && c == &w->cycle && t_ns == w->s.now_ns);
    w->waiting = false;
    mix(w, (uint64_t)t_ns ^ (uint64_t)r << 60 ^ (uint64_t)c->data << 40);
}

static void on_request(void *ctx, struct psd1_request *q, enum board_cycle_result r, int64_t t_ns)
{
    struct world *w = ctx;
    assert(w->asking && !w->submitting && q == &w->request);
    w->asking = false;
    mix(w, (uint64_t)t_ns ^ (uint64_t)r << 60 ^ q->word);
}

/* ---- operations ---- */

static void check(struct world *w)
{
    twin_counters(&w->seen, &w->b.counters, sizeof w->seen, &w->b.base.trace);
    assert(sched_next_ns(&w->s) > w->s.now_ns);
    assert(w->b.phase != PSD1_OFF || (!w->waiting && !w->asking));
    for (unsigned i = 0; i < 3; i++) {
        const struct ad7712_counters *n = &w->b.adc[i].n;
        assert(n->a0_violations + n->sclk_violations + n->sdata_violations + n->torn_reads == 0);
    }
}

static void run_until(struct world *w, int64_t t_ns)
{
    twin_run_until(&w->s, &w->b.base.trace, t_ns, 1000000);
}

static void op_cycle(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s), address = script_byte(s);
    const uint16_t data = (uint16_t)script_uint(s, b & 2 ? 2 : 1);
    const struct board_cycle c = {.write = b & 1,
                                  .address = address % 18,
                                  .data = data,
                                  .strobe_ns = b & 4 ? script_span_ns(s) : 0,
                                  .done = on_bus,
                                  .ctx = w};
    if (w->waiting) {
        struct board_cycle second = c;
        assert(psd1_bus.submit(&w->b.base, &second, w->s.now_ns) == BOARD_CYCLE_BUSY);
        return;
    }
    w->cycle = c;
    w->submitting = true;
    const enum board_cycle_result r = psd1_bus.submit(&w->b.base, &w->cycle, w->s.now_ns);
    w->submitting = false;
    w->waiting = r == BOARD_CYCLE_OK;
    mix(w, (uint64_t)r);
}

/* The word that waits, if one does. */
static void op_take(struct world *w, struct script *s)
{
    const int64_t strobe_ns = script_span_ns(s);
    if (w->waiting || !w->b.fl2) return;
    w->cycle = (struct board_cycle){.address = (uint8_t)w->b.axis, .strobe_ns = strobe_ns, .done = on_bus, .ctx = w};
    w->waiting = psd1_bus.submit(&w->b.base, &w->cycle, w->s.now_ns) == BOARD_CYCLE_OK;
}

static void op_request(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    const char *why = NULL;
    if (w->asking) return;
    w->request = (struct psd1_request){.command = b & 1   ? PSD1_CMD_UC2
                                                  : b & 2 ? PSD1_CMD_UC1
                                                          : (uint8_t)(0x30 + b % 4),
                                       .word = b & 4   ? (uint32_t)script_uint(s, 3)
                                               : b & 1 ? 0x020013u
                                                       : 0x220013u,
                                       .done = on_request,
                                       .ctx = w};
    w->submitting = true;
    w->asking = psd1_request(&w->b, &w->request, &why, w->s.now_ns) == BOARD_CYCLE_OK;
    w->submitting = false;
    assert(!(w->asking && why));
}

static void op_reset(struct world *w, struct script *s)
{
    (void)s;
    psd1_reset(&w->b, w->s.now_ns);
    assert(!w->waiting && !w->asking); /* both end with the reset */
    w->any = false;
}

static void op_power(struct world *w, struct script *s)
{
    (void)s;
    if (w->b.phase == PSD1_OFF) psd1_power_up(&w->b, w->s.now_ns);
    else psd1_power_down(&w->b, w->s.now_ns);
    w->any = false;
}

static void op_flags(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    psd1_flags(&w->b, b & 1, b & 2, w->s.now_ns);
}

static void op_wait(struct world *w, struct script *s)
{
    run_until(w, w->s.now_ns + script_span_ns(s));
}

/* To the next event of the board that without observers, a nanosecond before it, or after it. */
static void op_next(struct world *w, struct script *s)
{
    run_until(w, w->next_ns + script_byte(s) % 3 - 1);
}

static void op_input(struct world *w, struct script *s)
{
    static const double v[] = {0.0, 2.5, -2.5, 5.0, 9.99, -10.01, 1e30, 2.488};
    const uint8_t b = script_byte(s);
    psd1_sample_until(&w->b, w->s.now_ns);
    w->v[b % 3] = v[b >> 3 & 7];
    w->w_radps = 0.1 * (b >> 3 & 7);
}

/* Some or all of the lines are watched from now on, or none; the other board's never. */
static void op_watch(struct world *w, struct script *s)
{
    const uint64_t mask =
        (script_byte(s) & 1 ? UINT64_MAX : script_byte(s) * UINT64_C(0x0101010101010101)) & TRACE_FIRST(PSD1_LINES);
    if (!w->ear.sink.steps) return;
    trace_detach(&w->b.base.trace, &w->ear.sink);
    w->ear.known = 0;
    w->ear.edge_ns = 0;
    w->ear.sink.mask = mask;
    if (mask) trace_attach(&w->b.base.trace, &w->ear.sink);
}

static void op_fault(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    const struct chip_fault f = {.drdy = (enum chip_stuck)(b >> 2 & 3) % 3,
                                 .dout = (enum chip_stuck)(b >> 4 & 3) % 3,
                                 .clock_ppm = b & 64 ? 30000 : 0};
    ad7712_fault(&w->b.adc[b % 3], &f, w->s.now_ns);
}

static void step(struct world *w, struct script *s)
{
    static void (*const ops[])(struct world * w, struct script * s) = {
        op_cycle, op_wait,  op_next,  op_take, op_request, op_reset, op_flags, op_power,
        op_input, op_watch, op_fault, op_take, op_next,    op_wait,  op_watch, op_take,
    };
    ops[script_byte(s) % (sizeof ops / sizeof ops[0])](w, s);
    check(w);
}

/* ---- the boards ---- */

static void power_up(struct world *w, bool watched, bool host)
{
    const struct board_io io = {.ctx = w, .accel = accel_row, .temp_degc = degc, .rate_radps = rate};
    struct board_cfg u = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .seed = 7, .serial = 3};
    struct psd1_profile p;
    fields_default(&psd1_fields, &p);
    if (!host) p.host_strobe_ns = 0;
    for (unsigned i = 0; i < 3; i++) u.afe[i] = afe_nominal(AFE_VOLTAGE);
    memset(w, 0, sizeof *w);
    sched_init(&w->s);
    psd1_init(&w->b, &p, &u, &io, &w->s);
    w->b.host = (struct psd1_host){.ctx = w, .cycle = on_cycle, .fault = on_fault};
    w->ear.sink = (struct trace_sink){.steps = watched ? listener_steps : NULL, .ctx = &w->ear};
    psd1_power_up(&w->b, 0);
}

/* Boards that have just been switched on, or that have finished their set-up, with a host and without: made once, then copied
 * back to the same place, for what they point at is themselves. */
static struct world watched, unwatched, began[4][2];

static void prepare(void)
{
    struct world *both[] = {&watched, &unwatched};
    for (unsigned k = 0; k < 4; k++) {
        for (unsigned i = 0; i < 2; i++) {
            power_up(both[i], i == 0, k & 2);
            if (k & 1) run_until(both[i], 10000000);
            began[k][i] = *both[i];
        }
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
    const unsigned kind = script_byte(&s) & 3;
    restore(&watched, &began[kind][0]);
    restore(&unwatched, &began[kind][1]);
    const int64_t end_ns = watched.s.now_ns + RUN_NS;
    while (script_more(&s) && watched.s.now_ns < end_ns && watched.cycles < CYCLES_MAX) {
        struct script t = s;
        const int64_t next_ns = sched_next_ns(&unwatched.s);
        watched.next_ns = unwatched.next_ns = next_ns == SCHED_NEVER ? unwatched.s.now_ns : next_ns;
        step(&watched, &s);
        step(&unwatched, &t);
        assert(watched.trail == unwatched.trail && watched.cycles == unwatched.cycles);
        assert(memcmp(&watched.b.counters, &unwatched.b.counters, sizeof watched.b.counters) == 0);
    }
    return 0;
}
