/* One PSD-1 board with constant inputs, its cycles collected, and if wanted a listener on its lines. */
#ifndef PSABENCH_TESTS_PSD1_RIG_H
#define PSABENCH_TESTS_PSD1_RIG_H

#include "looks.h"
#include "rig.h"

#include "board/board.h"
#include "board/psd1/psd1.h"

#include <string.h>

#define RIG_CYCLES 4096u
#define RIG_EDGES  600000u

struct rig_edge {
    int64_t t_ns;
    uint8_t sig;
    bool level;
};

struct rig {
    struct sched s;
    struct psd1 b;
    double volts[3]; /* at the sensors */
    double degc[4];
    double supply_ratio;
    double w_radps[3], w_radps2; /* at 0, and how much more a second later */
    struct psd1_cycle cycle[RIG_CYCLES];
    unsigned cycles;
    uint16_t fault[16];
    unsigned faults;
    unsigned events[PSD1_EVENTS];
    int64_t event_ns[PSD1_EVENTS]; /* of the latest */
    struct trace_sink sink;
    struct rig_edge edge[RIG_EDGES];
    unsigned edges;
    struct board_cycle bus; /* of rig_read(), rig_write() */
    bool answered;
    enum board_cycle_result result;
    int64_t answered_ns;
    struct sched_ev stopper; /* armed by a test: INT0 becomes inactive */
    uint32_t lost_before[3]; /* conversions that the set-up left unread */
};

static inline double rig_accel(void *ctx, unsigned axis, int64_t t_ns)
{
    (void)t_ns;
    return ((struct rig *)ctx)->volts[axis];
}

LOOKS_ROW(rig_accel_row, rig_accel);

static inline double rig_supply_ratio(void *ctx, int64_t t_ns)
{
    (void)t_ns;
    return ((struct rig *)ctx)->supply_ratio;
}

static inline double rig_degc(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)t_ns;
    return ((struct rig *)ctx)->degc[channel];
}

static inline void rig_rate(void *ctx, int64_t t_ns, double w_radps[3])
{
    const struct rig *r = ctx;
    for (unsigned i = 0; i < 3; i++) w_radps[i] = r->w_radps[i] + r->w_radps2 * 1e-9 * (double)t_ns;
}

static inline void rig_event(void *ctx, unsigned event, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_true(event < PSD1_EVENTS);
    assert_int_equal(t_ns, r->s.now_ns);
    r->events[event]++;
    r->event_ns[event] = t_ns;
}

static inline void rig_cycle(void *ctx, const struct psd1_cycle *c, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_int_equal(t_ns, c->t_end_ns);
    if (r->cycles < RIG_CYCLES) r->cycle[r->cycles++] = *c;
}

static inline void rig_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (r->faults < COUNT(r->fault)) r->fault[r->faults++] = code;
}

static inline void rig_change(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    struct rig *r = ctx;
    if (r->edges < RIG_EDGES) r->edge[r->edges++] = (struct rig_edge){t_ns, (uint8_t)sig, level};
}

static inline void rig_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    trace_each(s, n, ((struct rig *)ctx)->sink.mask, rig_change, ctx);
}

static inline void rig_stop_int0(void *ctx, int64_t t_ns)
{
    psd1_flags(&((struct rig *)ctx)->b, false, true, t_ns);
}

static inline uint32_t psd1_lost_before(const struct rig *r, unsigned axis)
{
    return r->lost_before[axis];
}

static inline struct board_cfg rig_unit(double noise_scale)
{
    struct board_cfg u = {.adc_noise_scale = noise_scale, .temp_noise_scale = noise_scale, .seed = 7, .serial = 3};
    for (unsigned i = 0; i < 3; i++) {
        u.afe[i] = afe_nominal(AFE_VOLTAGE);
        u.afe[i].divider_ratio = 1.0;
    }
    return u;
}

/* The default without noise, and with a specimen that has no errors. */
static inline struct psd1_profile rig_exact(void)
{
    struct psd1_profile p;
    fields_default(&psd1_fields, &p);
    p.gyro_bias_sd_degph = p.gyro_scale_sd_ppm = p.gyro_arw_deg_rth = 0.0;
    p.rate_offset_sd_dps = p.rate_scale_sd_ppm = p.temp_offset_sd_k = p.supply_sd_v = 0.0;
    p.vref_sd_ppm = p.vref_tc_sd_ppm_per_k = p.adc_offset_sd_v = p.adc_gain_sd_ppm = 0.0;
    return p;
}

/* Off; psd1_power_up() switches it on. */
static inline void rig_init(struct rig *r, const struct psd1_profile *p, double noise_scale)
{
    const struct board_io io = {.ctx = r,
                                .accel = rig_accel_row,
                                .temp_degc = rig_degc,
                                .rate_radps = rig_rate,
                                .supply_ratio = rig_supply_ratio,
                                .event = rig_event};
    const struct board_cfg u = rig_unit(noise_scale);
    char why[300];
    if (!psd1_profile_check(p, why, sizeof why)) fail_msg("%s", why);
    memset(r, 0, sizeof *r);
    for (unsigned i = 0; i < 4; i++) r->degc[i] = 25.0;
    r->supply_ratio = 1.0;
    r->volts[0] = 2.4882;
    r->volts[1] = -7.0;
    r->volts[2] = 9.9;
    sched_init(&r->s);
    psd1_init(&r->b, p, &u, &io, &r->s);
    r->b.base.observed = true;
    sched_ev(&r->stopper, rig_stop_int0, r);
    r->b.host = (struct psd1_host){.ctx = r, .cycle = rig_cycle, .fault = rig_fault};
    r->sink = (struct trace_sink){.mask = TRACE_FIRST(PSD1_LINES), .steps = rig_steps, .ctx = r};
}

static inline void rig_watch(struct rig *r, uint64_t mask)
{
    r->sink.mask = mask;
    trace_attach(&r->b.base.trace, &r->sink);
    r->edges = 0; /* not the levels it begins with */
}

/* As the main loop does: the trace lags behind. */
static inline void rig_until(struct rig *r, int64_t t_ns)
{
    while (r->s.now_ns < t_ns) {
        const int64_t step_ns = t_ns - r->s.now_ns;
        sched_run_until(&r->s, r->s.now_ns + (step_ns < 1000000 ? step_ns : 1000000));
        trace_advance(&r->b.base.trace, r->s.now_ns - TRACE_LAG_NS);
    }
}

static inline void rig_run(struct rig *r, int64_t ns)
{
    rig_until(r, r->s.now_ns + ns);
}

/* Runs event by event until the phase is reached, 100 ms at most. */
static inline void rig_await(struct rig *r, enum psd1_phase phase)
{
    const int64_t end_ns = r->s.now_ns + 100000000;
    while (r->b.phase != phase) {
        const int64_t next_ns = sched_next_ns(&r->s);
        if (next_ns > end_ns) fail_msg("phase %d is not reached", (int)phase);
        sched_run_until(&r->s, next_ns);
    }
}

/* Powered up and set up. */
static inline void rig_up(struct rig *r, const struct psd1_profile *p)
{
    rig_init(r, p, 0.0);
    psd1_power_up(&r->b, 0);
    while (!r->b.ready) sched_run_until(&r->s, sched_next_ns(&r->s));
    for (unsigned i = 0; i < 3; i++) r->lost_before[i] = r->b.adc[i].n.overruns + r->b.adc[i].n.lost_words;
}

static inline void rig_done(void *ctx, struct board_cycle *c, enum board_cycle_result result, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_ptr_equal(c, &r->bus);
    assert_false(r->answered);
    r->answered = true;
    r->result = result;
    r->answered_ns = t_ns;
}

/* One bus cycle from now on, run to its end. */
static inline enum board_cycle_result rig_bus(struct rig *r, bool write, uint8_t address, uint16_t data,
                                              int64_t strobe_ns)
{
    r->bus = (struct board_cycle){
        .write = write, .address = address, .data = data, .strobe_ns = strobe_ns, .done = rig_done, .ctx = r};
    r->answered = false;
    const enum board_cycle_result result = psd1_bus.submit(&r->b.base, &r->bus, r->s.now_ns);
    if (result != BOARD_CYCLE_OK) return result;
    assert_false(r->answered);
    while (!r->answered) sched_run_until(&r->s, sched_next_ns(&r->s));
    return r->result;
}

static inline uint16_t rig_read(struct rig *r, uint8_t address)
{
    const enum board_cycle_result result = rig_bus(r, false, address, 0, 0);
    if (result != BOARD_CYCLE_OK) fail_msg("read of %u: %d", address, (int)result);
    return r->bus.data;
}

static inline void rig_write(struct rig *r, uint8_t address, uint16_t data)
{
    const enum board_cycle_result result = rig_bus(r, true, address, data, 0);
    if (result != BOARD_CYCLE_OK) fail_msg("write to %u: %d", address, (int)result);
}

static inline struct psd1_profile no_host(void)
{
    struct psd1_profile p = rig_exact();
    p.host_strobe_ns = 0;
    return p;
}

/* Reads the word that waits, `after_ns` after FL2. */
static inline uint16_t take(struct rig *r, int64_t after_ns)
{
    rig_await(r, PSD1_READY);
    rig_until(r, r->b.fl2_ns + after_ns);
    return rig_read(r, (uint8_t)r->b.axis);
}

static inline void request_done(void *ctx, struct psd1_request *r, enum board_cycle_result result, int64_t t_ns)
{
    struct rig *g = ctx;
    (void)r;
    g->answered = true;
    g->result = result;
    g->answered_ns = t_ns;
}

/* Asks the controller for a command and waits for its answer. */
static inline enum board_cycle_result command(struct rig *r, struct psd1_request *q, uint8_t code, uint32_t word)
{
    const char *why = NULL;
    *q = (struct psd1_request){.command = code, .word = word, .done = request_done, .ctx = r};
    r->answered = false;
    const enum board_cycle_result result = psd1_request(&r->b, q, &why, r->s.now_ns);
    assert_true((result == BOARD_CYCLE_BAD_VALUE) == (why != NULL));
    if (result != BOARD_CYCLE_OK) return result;
    const int64_t end_ns = r->s.now_ns + 3000000000;
    while (!r->answered && r->s.now_ns < end_ns) sched_run_until(&r->s, sched_next_ns(&r->s));
    assert_true(r->answered);
    return r->result;
}

#endif
