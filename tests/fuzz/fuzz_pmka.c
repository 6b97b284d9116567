/* Two PMKA boards, the same script of inputs, cycles, faults, power and time: the lines of one are watched and its events heard
 * now and then, of the other never. Readings and answers are the same, and each is what the header promises. */
#include "fuzz.h"
#include "listener.h"
#include "looks.h"
#include "twin.h"

#include "board/pmka/board.h"
#include "board/pmka/pmka.h"

#include <math.h>
#include <string.h>

enum { RUN_NS = 1000000000 }; /* of simulated time after the beginning: what bounds a run */

struct world {
    struct sched s;
    struct pmka b;
    double v[3];
    int64_t asked_ns[3];
    uint64_t trail; /* of readings and answers */
    struct pmka_reading last;
    bool any;
    struct board_cycle cycle;
    bool waiting, submitting;
    struct listener ear;
    bool attached;
    struct pmka_counters seen;
};

static void mix(struct world *w, uint64_t v)
{
    twin_mix(&w->trail, v);
}

/* ---- what the board calls ---- */

static double accel(void *ctx, unsigned axis, int64_t t_ns)
{
    struct world *w = ctx;
    assert(axis < 3 && t_ns >= w->asked_ns[axis] && t_ns <= w->s.now_ns);
    w->asked_ns[axis] = t_ns;
    return w->v[axis];
}

LOOKS_ROW(accel_row, accel);

static double degc(void *ctx, unsigned channel, int64_t t_ns)
{
    const struct world *w = ctx;
    assert(channel == 3 && t_ns == w->s.now_ns);
    return 25.0 + 3.0 * w->v[0];
}

static void on_event(void *ctx, unsigned e, int64_t t_ns)
{
    const struct world *w = ctx;
    assert(e < PMKA_EVENTS && t_ns == w->s.now_ns && w->b.base.observed);
}

static void on_reading(void *ctx, const struct pmka_reading *r, int64_t t_ns)
{
    struct world *w = ctx;
    const struct pmka_profile *p = &w->b.profile;
    assert(t_ns == w->s.now_ns && t_ns == r->t_ns + 3 * (int64_t)p->mux_step_ns + p->convert_ns);
    assert(r->seq == 0 || (w->any && r->seq == w->last.seq + 1 && r->t_ns == w->last.t_ns + p->ts_ns));
    assert(r->tau <= PMKA_TAUS && r->cal <= PMKA_CAL_RESET);
    unsigned served[4] = {0};
    for (unsigned i = 0; i < PMKA_INTS; i++) {
        assert(r->reset[i] >= -1 && r->reset[i] <= 1);
        assert(i == PMKA_K ? r->serves[i] <= 3 : r->serves[i] == 0 || r->serves[i] == i + 1);
        served[r->serves[i]]++;
        mix(w, (uint16_t)r->code[i] ^ (uint64_t)(r->reset[i] + 1) << 20 ^ (uint64_t)r->serves[i] << 24);
    }
    for (unsigned a = 1; a <= 3; a++) assert(r->seq == 0 || (served[a] >= 1 && served[a] <= 2));
    mix(w, (uint64_t)t_ns ^ (uint64_t)(uint16_t)r->temp_code << 48);
    w->last = *r;
    w->any = true;
}

static void on_done(void *ctx, struct board_cycle *c, enum board_cycle_result r, int64_t t_ns)
{
    struct world *w = ctx;
    assert(w->waiting && !w->submitting && c == &w->cycle);
    assert(r == BOARD_CYCLE_OK || r == BOARD_CYCLE_OFF || (r == BOARD_CYCLE_BAD_VALUE && c->write));
    w->waiting = false;
    mix(w, (uint64_t)t_ns ^ (uint64_t)r << 60 ^ c->data);
}

/* ---- operations ---- */

static void check(struct world *w)
{
    twin_counters(&w->seen, &w->b.counters, sizeof w->seen, &w->b.base.trace);
    for (unsigned i = 0; i < PMKA_INTS; i++) {
        const struct pmka_channel *c = &w->b.channel[i];
        const double most_c = c->integrator.cfg.limit_v * c->integrator.cap_f / c->integrator.cap_left * 1.5;
        assert(isfinite(c->integrator.charge_c) && fabs(c->integrator.charge_c) <= most_c);
        assert(c->said_axis < 0 || i == PMKA_K || c->said_axis == (int)i);
    }
    for (int a = 0; a < 3; a++) { /* each axis has one integrator, as the controller believes */
        unsigned has = 0;
        for (unsigned i = 0; i < PMKA_INTS; i++) has += w->b.channel[i].said_axis == a;
        assert(has == 1);
    }
}

static void run(struct world *w, int64_t ns)
{
    twin_run_until(&w->s, &w->b.base.trace, w->s.now_ns + ns, 100000);
}

static void op_input(struct world *w, struct script *s)
{
    const uint8_t axis = script_byte(s) % 3;
    pmka_board.sample_until(&w->b.base, w->s.now_ns);
    w->v[axis] = (double)(int8_t)script_byte(s) / 10.0;
}

static void op_submit(struct world *w, struct script *s)
{
    struct board_cycle c = {.write = script_byte(s) & 1, .done = on_done, .ctx = w};
    c.address = script_byte(s) % 18;
    c.data = (uint16_t)script_uint(s, 2);
    c.strobe_ns = script_span_ns(s);
    struct board_cycle *const at = w->waiting ? &c : &w->cycle;
    if (!w->waiting) w->cycle = c;
    w->submitting = true;
    const enum board_cycle_result r = pmka_bus.submit(&w->b.base, at, w->s.now_ns);
    w->submitting = false;
    if (w->b.life == PMKA_OFF) assert(r == BOARD_CYCLE_OFF);
    else if (w->waiting) assert(r != BOARD_CYCLE_OK);
    if (r == BOARD_CYCLE_OK) w->waiting = true;
    mix(w, r);
}

/* What a host does: it turns the calibration. */
static void op_turn(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    pmka_set_mode(&w->b, b & 128 ? PMKA_AUTONOMOUS : PMKA_PROGRAM);
    mix(w, pmka_command(&w->b, b & 7, (enum pmka_cal)((b >> 3 & 3) % 3)));
}

static void op_power(struct world *w, struct script *s)
{
    (void)s;
    if (w->b.life == PMKA_OFF) pmka_board.power_up(&w->b.base, w->s.now_ns);
    else pmka_board.power_down(&w->b.base, w->s.now_ns);
    w->any = false;
}

static void op_reset(struct world *w, struct script *s)
{
    (void)s;
    pmka_board.reset(&w->b.base, w->s.now_ns);
    if (w->b.life != PMKA_OFF) w->any = false;
}

static void op_wrong(struct world *w, struct script *s)
{
    const uint32_t all = PMKA_FAULT_FROZEN_WORDS | PMKA_FAULT_CAPACITOR | PMKA_FAULT_STUCK_RESET | PMKA_FAULT_STUCK_KEY;
    pmka_set_faults(&w->b, (uint32_t)script_byte(s) & all);
}

static void op_chip(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    const struct board_part *adc = &pmka_board.parts[1], *rom = &pmka_board.parts[2];
    if (b & 1)
        adc->fault(&w->b.base, 1,
                   &(struct chip_fault){.dout = b & 2 ? b & 4 ? CHIP_STUCK_HIGH : CHIP_STUCK_LOW : CHIP_FREE},
                   w->s.now_ns);
    else assert(rom->flip(&w->b.base, 2, script_byte(s) % rom->registers, b, w->s.now_ns));
}

static void (*const ops[])(struct world *w, struct script *s) = {
    op_input, op_input, op_submit, op_submit, op_turn, op_power, op_reset, op_wrong, op_chip,
};

/* Only of the watched board, and no byte of the script: what it does must change nothing. */
static void listen(struct world *w, uint8_t how)
{
    w->b.base.observed = how & 1;
    if ((how & 2) && !w->attached) {
        w->ear.sink.mask = how & 4 ? UINT64_MAX >> (64 - PMKA_LINES) : UINT64_C(0x15555);
        w->ear.known = 0;
        trace_attach(&w->b.base.trace, &w->ear.sink);
        w->attached = true;
    } else if (!(how & 2) && w->attached) {
        trace_detach(&w->b.base.trace, &w->ear.sink);
        w->attached = false;
    }
}

static void begin(struct world *w, const struct pmka_profile *p)
{
    const struct board_io io = {.ctx = w, .accel = accel_row, .temp_degc = degc, .event = on_event};
    struct board_cfg cfg = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .seed = 3, .serial = 4};
    memset(w, 0, sizeof *w);
    for (unsigned i = 0; i < 3; i++) cfg.afe[i] = afe_nominal(AFE_VOLTAGE);
    pmka_board.cfg_default(&cfg);
    sched_init(&w->s);
    pmka_board.init(&w->b.base, p, &cfg, &io, &w->s);
    w->b.host = (struct pmka_host){.ctx = w, .reading = on_reading};
    w->ear.sink = (struct trace_sink){.steps = listener_steps, .ctx = &w->ear};
}

static struct pmka_profile profile_of(struct script *s)
{
    struct pmka_profile p;
    const uint8_t b = script_byte(s);
    char why[300];
    fields_default(&pmka_fields, &p);
    p.beat_periods = 8 + (b & 15);
    p.zero_periods = 1 + (b & 1);
    if (b & 16) p.rotation = PMKA_PROGRAM;
    if (b & 32) p.start_ns = 1000;
    if (b & 64) p.mux_step_ns = 500000;
    if (b & 128) p.cap_ageing_per_h = -0.5;
    assert(pmka_profile_check(&p, why, sizeof why));
    return p;
}

static void same_digest(const struct world *a, const struct world *b)
{
    char hex[2][SHA256_HEX];
    struct sha256 s;
    sha256_init(&s);
    pmka_board.digest(&a->b.base, &s);
    sha256_hex(&s, hex[0]);
    sha256_init(&s);
    pmka_board.digest(&b->b.base, &s);
    sha256_hex(&s, hex[1]);
    assert(strcmp(hex[0], hex[1]) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct world heard, deaf;
    struct script s = script_of(data, size);
    const struct pmka_profile p = profile_of(&s);
    begin(&heard, &p);
    begin(&deaf, &p);
    pmka_board.power_up(&heard.b.base, 0);
    pmka_board.power_up(&deaf.b.base, 0);
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
    }
    same_digest(&heard, &deaf);
    return 0;
}
