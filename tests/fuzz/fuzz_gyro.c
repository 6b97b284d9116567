/* Two gyro units, the same script of level frames, settings, modes, angles, power and time: the lines of one are watched and its
 * events heard now and then, of the other never. Readings and torques are the same, and each is what the header promises. */
#include "fuzz.h"
#include "listener.h"

#include "base/detmath.h"
#include "board/gyro/board.h"
#include "board/gyro/gyro.h"

#include <math.h>
#include <string.h>

#define RUN_NS INT64_C(20000000000) /* of simulated time: what bounds a run */

struct world {
    struct sched s;
    struct gyro b;
    double angle_rad, rate_radps; /* of the gimbal; moved by the torquer, or stuck */
    bool stuck;
    uint16_t seq;
    uint64_t trail;
    struct gyro_reading last;
    bool any;
    unsigned conditions;
    struct listener ear;
    bool attached;
};

static void mix(struct world *w, uint64_t v)
{
    w->trail = (w->trail ^ v) * UINT64_C(0x9E3779B97F4A7C15);
    w->trail ^= w->trail >> 29;
}

static void mix_real(struct world *w, double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    mix(w, bits);
}

/* ---- what the board calls ---- */

static void torque(void *ctx, double u1_radps, double u2_radps, int64_t t_ns)
{
    struct world *w = ctx;
    const double limit = w->b.profile.torquer_limit_dps * RAD_PER_DEG * (1.0 + 1e-12);
    assert(t_ns == w->s.now_ns && fabs(u1_radps) <= limit && fabs(u2_radps) <= limit);
    w->rate_radps = u2_radps;
    mix_real(w, u1_radps);
    mix_real(w, u2_radps);
}

static void reposition(void *ctx, int64_t t_ns)
{
    mix(ctx, (uint64_t)t_ns);
}

static double servo(void *ctx, int64_t t_ns)
{
    struct world *w = ctx;
    (void)t_ns;
    if (!w->stuck) w->angle_rad = gyro_wrap_rad(w->angle_rad + w->rate_radps * 1e-9 * w->b.profile.step_ns);
    return w->angle_rad;
}

static double encoder(void *ctx, int64_t t_ns)
{
    (void)t_ns;
    return ((struct world *)ctx)->angle_rad;
}

/* Fitted for some of the scripts' angles. */
static bool magnetic(void *ctx, int64_t t_ns, double *heading_rad)
{
    (void)t_ns;
    *heading_rad = ((struct world *)ctx)->angle_rad;
    return *heading_rad > 0.0;
}

static void on_event(void *ctx, unsigned e, int64_t t_ns)
{
    const struct world *w = ctx;
    assert(e < GYRO_EVENTS && t_ns == w->s.now_ns && w->b.base.observed);
}

static void on_reading(void *ctx, const struct gyro_reading *r, int64_t t_ns)
{
    struct world *w = ctx;
    assert(t_ns == w->s.now_ns && t_ns % w->b.profile.step_ns == 0 && w->b.on);
    assert(r->step == (w->any ? w->last.step + 1 : 1));
    assert(r->mode < GYRO_MODES && r->phase <= GYRO_WINDOW && r->position <= GYRO_RUN_MAX && r->flags < 16);
    const bool runs = r->mode == GYRO_COMPASS || r->mode == GYRO_CALIBRATE;
    if (!(w->b.base.faults & GYRO_FAULT_FROZEN_WORDS)) {
        assert(runs || r->phase == GYRO_IDLE || (r->mode == GYRO_SLEW && r->phase != GYRO_WINDOW));
        assert((r->mode == GYRO_COMPASS) == (r->position > 0));
    }
    assert(isfinite(r->beta_rad) && isfinite(r->gamma_rad) && fabs(r->encoder_rad) <= 3.15);
    assert(r->mode == GYRO_NAVIGATE || (w->b.nod.way == GYRO_NOD_NONE && w->b.nod.result == GYRO_TEST_NONE) ||
           (w->b.base.faults & GYRO_FAULT_FROZEN_WORDS));
    for (unsigned i = 0; i < GYRO_FLAGS; i++) {
        assert(w->b.past[i].step <= r->step + 1 && (w->b.past[i].begun > 0) == (w->b.past[i].step > 0));
        assert(!(w->conditions & 1U << i) || w->b.past[i].begun > 0);
    }
    mix(w, (uint64_t)r->mode ^ (uint64_t)r->phase << 8 ^ (uint64_t)r->position << 16 ^ (uint64_t)r->flags << 24);
    mix_real(w, r->beta_rad);
    mix_real(w, r->gamma_rad);
    w->last = *r;
    w->any = true;
}

static void on_condition(void *ctx, enum gyro_flag what, bool active, int64_t t_ns)
{
    struct world *w = ctx;
    assert(t_ns == w->s.now_ns && ((w->conditions & what) != 0) != active);
    w->conditions ^= what;
}

/* ---- operations ---- */

static void op_frames(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    const int32_t x = (int32_t)(script_uint(s, 3) << 8) / 256, y = (int32_t)(script_uint(s, 3) << 8) / 256;
    w->seq = (uint16_t)(w->seq + (b & 1 ? 1 + (b >> 4) : 1));
    if (w->b.on) gyro_take_level(&w->b, b & 2 ? x : x / 1024, b & 2 ? y : y / 1024, w->seq, w->s.now_ns);
}

/* Within what the object dictionary lets through. */
static void op_setting(struct world *w, struct script *s)
{
    struct gyro_settings *set = &w->b.set;
    const uint8_t what = script_byte(s), v = script_byte(s);
    const double part = v / 255.0;
    double *const slot[] = {&set->slew_deg,        &set->slew_dps,         &set->slew_dps2,
                            &set->settle_s,        &set->settle_limit_s,   &set->count,
                            &set->repeat,          &set->window_s,         &set->calibration_s,
                            &set->freeze,          &set->m1_per_s,         &set->m2_per_s,
                            &set->latitude_deg,    &set->speed_mps,        &set->track_deg,
                            &set->azimuth_deg,     &set->drift2_degph,     &set->zero_x_v,
                            &set->scale_y_v_per_g, &set->tolerance_arcmin, &set->position_deg[v % GYRO_POSITIONS]};
    const double value[] = {720 * part - 360,
                            0.1 + 49.9 * part,
                            1 + 999 * part,
                            6 * part,
                            3 * part,
                            1 + v % 32,
                            1 + v % 127,
                            0.1 + 3 * part,
                            0.1 + 3 * part,
                            v % 2,
                            0.01 + 19.99 * part,
                            0.01 + 19.99 * part,
                            178 * part - 89,
                            1000 * part,
                            720 * part - 360,
                            720 * part - 360,
                            2000 * part - 1000,
                            20 * part - 10,
                            v ? 10 * part : -1.2,
                            0.01 + 600 * part,
                            720 * part - 360};
    const unsigned i = what % (sizeof slot / sizeof *slot);
    const bool of_run = slot[i] == &set->count || slot[i] == &set->repeat || i == sizeof slot / sizeof *slot - 1;
    if (of_run && gyro_running(&w->b)) return;
    *slot[i] = value[i];
    gyro_settings_changed(&w->b);
}

static void op_mode(struct world *w, struct script *s)
{
    const char *why = gyro_set_mode(&w->b, (enum gyro_mode)(script_byte(s) % GYRO_MODES), w->s.now_ns);
    assert(!why || *why);
    mix(w, why != NULL);
}

static void op_self_test(struct world *w, struct script *s)
{
    const char *why = gyro_self_test(&w->b, w->s.now_ns);
    (void)s;
    assert((why != NULL) == (w->b.run.mode != GYRO_NAVIGATE) || w->b.nod.way != GYRO_NOD_NONE);
    mix(w, why != NULL);
}

static void op_angle(struct world *w, struct script *s)
{
    const uint8_t b = script_byte(s);
    w->stuck = b & 1;
    if (b & 2) w->angle_rad = gyro_wrap_rad((double)(int8_t)script_byte(s) / 20.0);
}

static void op_power(struct world *w, struct script *s)
{
    (void)s;
    if (w->b.on) gyro_board.power_down(&w->b.base, w->s.now_ns);
    else gyro_board.power_up(&w->b.base, w->s.now_ns);
    w->any = false;
    w->conditions = 0;
}

static void op_reset(struct world *w, struct script *s)
{
    (void)s;
    gyro_board.reset(&w->b.base, w->s.now_ns);
    if (!w->b.on) return;
    w->any = false;
    w->conditions = 0;
}

static void op_wrong(struct world *w, struct script *s)
{
    w->b.base.faults = (uint32_t)script_byte(s) & GYRO_FAULT_FROZEN_WORDS;
}

/* Half a second with frames that go on, so that runs get somewhere. */
static void op_go(struct world *w, struct script *s)
{
    const int32_t y = (int8_t)script_byte(s);
    for (unsigned i = 0; i < 50; i++) {
        if (w->b.on) gyro_take_level(&w->b, 0, y, ++w->seq, w->s.now_ns);
        sched_run_until(&w->s, w->s.now_ns + w->b.profile.step_ns);
        trace_advance(&w->b.base.trace, w->s.now_ns - TRACE_LAG_NS);
    }
}

static void (*const ops[])(struct world *w, struct script *s) = {
    op_frames, op_frames, op_setting, op_setting, op_mode,  op_go,
    op_go,     op_angle,  op_power,   op_reset,   op_wrong, op_self_test,
};

/* Only of the watched board, and no byte of the script: what it does must change nothing. */
static const struct board_platform_io platform = {torque, reposition, servo, encoder, magnetic};

static void listen(struct world *w, uint8_t how)
{
    w->b.base.observed = how & 1;
    if ((how & 2) && !w->attached) {
        w->ear.sink.mask = how & 4 ? TRACE_FIRST(GYRO_LINES) : TRACE_BIT(GYRO_LINE_WINDOW);
        w->ear.known = 0;
        trace_attach(&w->b.base.trace, &w->ear.sink);
        w->attached = true;
    } else if (!(how & 2) && w->attached) {
        trace_detach(&w->b.base.trace, &w->ear.sink);
        w->attached = false;
    }
}

static void begin(struct world *w)
{
    const struct board_io io = {.ctx = w, .event = on_event, .platform = &platform};
    const struct board_cfg cfg = {.seed = 3, .serial = 4, .level_node = 5};
    struct gyro_profile p;
    memset(w, 0, sizeof *w);
    sched_init(&w->s);
    fields_default(&gyro_fields, &p);
    gyro_board.init(&w->b.base, &p, &cfg, &io, &w->s);
    w->b.host = (struct gyro_host){.ctx = w, .reading = on_reading, .condition = on_condition};
    w->ear.sink = (struct trace_sink){.steps = listener_steps, .ctx = &w->ear};
    gyro_board.power_up(&w->b.base, 0);
}

static void same_digest(const struct world *a, const struct world *b)
{
    char hex[2][SHA256_HEX];
    const struct world *const both[2] = {a, b};
    for (unsigned i = 0; i < 2; i++) {
        struct sha256 s;
        sha256_init(&s);
        gyro_board.digest(&both[i]->b.base, &s);
        sha256_hex(&s, hex[i]);
    }
    assert(strcmp(hex[0], hex[1]) == 0);
}

static void run(struct world *w, int64_t ns)
{
    sched_run_until(&w->s, w->s.now_ns + ns);
    trace_advance(&w->b.base.trace, w->s.now_ns - TRACE_LAG_NS);
    assert(w->b.base.trace.late == 0 && w->b.base.trace.dropped == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct world heard, deaf;
    struct script s = script_of(data, size);
    begin(&heard);
    begin(&deaf);
    while (script_more(&s) && deaf.s.now_ns < RUN_NS) {
        const uint8_t b = script_byte(&s);
        const int64_t ns = script_span_ns(&s);
        struct script again = s;
        listen(&heard, b >> 4);
        ops[b % (sizeof ops / sizeof *ops)](&heard, &again);
        ops[b % (sizeof ops / sizeof *ops)](&deaf, &s);
        run(&heard, ns);
        run(&deaf, ns);
        assert(heard.trail == deaf.trail);
    }
    same_digest(&heard, &deaf);
    return 0;
}
