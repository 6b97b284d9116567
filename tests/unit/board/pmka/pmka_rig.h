/* One PMKA with inputs that are sums of sines, its readings collected, and who wants their increments from the truth. */
#ifndef PSABENCH_TESTS_PMKA_RIG_H
#define PSABENCH_TESTS_PMKA_RIG_H

#include "looks.h"
#include "rig.h"

#include "board/pmka/board.h"
#include "board/pmka/pmka.h"

#include <math.h>
#include <string.h>

#define RIG_READINGS 70000u
#define RIG_SINES    6u

struct rig_input { /* mean_v + sum of amp sin(2 pi f t + phase) */
    double mean_v, amp_v[RIG_SINES], hz[RIG_SINES], phase[RIG_SINES];
};

struct rig {
    struct sched s;
    struct pmka b;
    struct rig_input input[3];
    double degc, degc_per_s;
    struct pmka_reading reading[RIG_READINGS];
    unsigned readings;
    unsigned events[PMKA_EVENTS];
    int64_t event_ns[PMKA_EVENTS]; /* last */
    int64_t asked_ns[3];           /* last instant at which an axis was pulled */
    bool answered;
    enum board_cycle_result result;
    int64_t answered_ns;
};

static const double rig_two_pi = 6.283185307179586;

static inline double rig_volts(const struct rig_input *in, double t_s)
{
    double v = in->mean_v;
    for (unsigned k = 0; k < RIG_SINES; k++) v += in->amp_v[k] * sin(rig_two_pi * in->hz[k] * t_s + in->phase[k]);
    return v;
}

/* The exact integral up to t_s. */
static inline double rig_integral_vs(const struct rig_input *in, double from_s, double to_s)
{
    double s = in->mean_v * (to_s - from_s);
    for (unsigned k = 0; k < RIG_SINES; k++) {
        const double w = rig_two_pi * in->hz[k];
        if (w > 0.0) s += in->amp_v[k] / w * (cos(w * from_s + in->phase[k]) - cos(w * to_s + in->phase[k]));
        else s += in->amp_v[k] * sin(in->phase[k]) * (to_s - from_s);
    }
    return s;
}

static inline double rig_accel(void *ctx, unsigned axis, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_true(t_ns >= r->asked_ns[axis]); /* never earlier than the last call */
    r->asked_ns[axis] = t_ns;
    return rig_volts(&r->input[axis], 1e-9 * (double)t_ns);
}

LOOKS_ROW(rig_accel_row, rig_accel);

static inline double rig_degc(void *ctx, unsigned channel, int64_t t_ns)
{
    const struct rig *r = ctx;
    assert_int_equal(channel, 3);
    return r->degc + r->degc_per_s * 1e-9 * (double)t_ns;
}

static inline void rig_event(void *ctx, unsigned event, int64_t t_ns)
{
    struct rig *r = ctx;
    r->events[event]++;
    r->event_ns[event] = t_ns;
}

static inline void rig_reading(void *ctx, const struct pmka_reading *reading, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_int_equal(t_ns, reading->t_ns + 3 * r->b.profile.mux_step_ns + r->b.profile.convert_ns);
    if (r->readings < RIG_READINGS) r->reading[r->readings++] = *reading;
}

static inline struct pmka_profile rig_profile(void)
{
    struct pmka_profile p;
    fields_default(&pmka_fields, &p);
    return p;
}

/* Without tolerances, zero, noise, drift: what is left is the converter's resolution. */
static inline struct pmka_profile rig_ideal(void)
{
    struct pmka_profile p = rig_profile();
    p.reset_asymmetry_ppm = p.cap_tol_sd = p.cap_tc_ppm_per_k = p.r_tol_sd_ppm = p.r_tc_sd_ppm_per_k = 0.0;
    p.uref_tol_sd_ppm = p.uref_tc_sd_ppm_per_k = p.zero_sd_v = p.zero_tc_sd_v_per_k = p.uc_sd_v = 0.0;
    p.adc_noise_lsb = p.adc_offset_sd_lsb = p.adc_gain_sd_ppm = p.temp_noise_k = p.temp_offset_sd_k = 0.0;
    p.rom_ct_sd_ppm = 0.0;
    return p;
}

static inline struct board_cfg rig_cfg(void)
{
    struct board_cfg cfg = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .seed = 7, .serial = 3};
    for (unsigned i = 0; i < 3; i++) cfg.afe[i] = afe_nominal(AFE_VOLTAGE);
    pmka_board.cfg_default(&cfg);
    return cfg;
}

/* Off, all inputs at 0 V. */
static inline void rig_init(struct rig *r, const struct pmka_profile *p)
{
    const struct board_cfg cfg = rig_cfg();
    const struct board_io io = {.ctx = r, .accel = rig_accel_row, .temp_degc = rig_degc, .event = rig_event};
    char why[300];
    if (!pmka_profile_check(p, why, sizeof why)) fail_msg("%s", why);
    memset(r, 0, sizeof *r);
    r->degc = 25.0;
    sched_init(&r->s);
    pmka_board.init(&r->b.base, p, &cfg, &io, &r->s);
    r->b.base.observed = true;
    r->b.host = (struct pmka_host){.ctx = r, .reading = rig_reading};
}

static inline void rig_run(struct rig *r, int64_t ns)
{
    const int64_t end_ns = r->s.now_ns + ns;
    while (r->s.now_ns < end_ns) { /* as the main loop does: the trace lags behind */
        const int64_t step_ns = end_ns - r->s.now_ns;
        sched_run_until(&r->s, r->s.now_ns + (step_ns < 100000 ? step_ns : 100000));
        trace_advance(&r->b.base.trace, r->s.now_ns - TRACE_LAG_NS);
    }
}

/* Up to and including the n-th reading since the last call of rig_init(). */
static inline void rig_readings(struct rig *r, unsigned n)
{
    const int64_t give_up_ns = r->s.now_ns + (n - r->readings + 10) * (int64_t)r->b.profile.ts_ns;
    while (r->readings < n) {
        assert_true(r->s.now_ns < give_up_ns);
        sched_run_until(&r->s, r->s.now_ns + 100000);
    }
}

static inline void rig_up(struct rig *r, const struct pmka_profile *p)
{
    rig_init(r, p);
    pmka_board.power_up(&r->b.base, 0);
}

/* Codes of one reset of integrator i by the truth, at t_s. */
static inline double rig_nr(const struct rig *r, unsigned i, enum pmka_sign sign, double t_s)
{
    const struct pmka_int *n = &r->b.channel[i].integrator;
    const double cap_f = n->cap_f * (1.0 + n->cfg.cap_ageing_per_s * t_s);
    const double ur_v = r->b.uref_v * 0.5e-9 * r->b.profile.ts_ns / (n->rr_ohm[sign] * cap_f);
    return ur_v * r->b.specimen.adc_gain / r->b.profile.adc_range_v * 32768.0;
}

/* Formula (7) with the true constants: what integrator i took in the period that ended with reading k, V s. */
static inline double rig_increment_vs(const struct rig *r, unsigned i, unsigned k)
{
    const struct pmka_reading *now = &r->reading[k], *was = &r->reading[k - 1];
    const struct pmka_int *n = &r->b.channel[i].integrator;
    const double ts_s = 1e-9 * r->b.profile.ts_ns, half_s = 0.5 * ts_s;
    const double t_s = 1e-9 * (double)now->t_ns, lsb_vs = r->b.uref_v * half_s * n->r_in_ohm / n->rr_ohm[PMKA_PLUS];
    double s = now->code[i] * lsb_vs / rig_nr(r, i, PMKA_PLUS, t_s) -
               was->code[i] * lsb_vs / rig_nr(r, i, PMKA_PLUS, t_s - ts_s);
    if (now->reset[i] > 0) s += lsb_vs;
    if (now->reset[i] < 0) s -= r->b.uref_v * half_s * n->r_in_ohm / n->rr_ohm[PMKA_MINUS];
    return s - n->zero_v * ts_s;
}

/* What all integrators took for an axis from reading `from` to reading `to`. */
static inline double rig_axis_vs(const struct rig *r, unsigned axis, unsigned from, unsigned to)
{
    double s = 0.0;
    for (unsigned k = from + 1; k <= to; k++)
        for (unsigned i = 0; i < PMKA_INTS; i++)
            if (r->reading[k].serves[i] == axis + 1) s += rig_increment_vs(r, i, k);
    return s;
}

static inline bool rig_k_has(const struct rig *r, unsigned axis, unsigned k)
{
    return r->reading[k].serves[PMKA_K] == axis + 1;
}

/* Up to when rig_axis_vs() counts with reading k; the reading after it is there. K gives back just before it is sampled. */
static inline double rig_until_s(const struct rig *r, unsigned axis, unsigned k)
{
    const struct pmka_profile *p = &r->b.profile;
    const int64_t x_ns = r->reading[k].t_ns;
    assert_true(k + 1 < r->readings);
    if (!rig_k_has(r, axis, k)) return 1e-9 * (double)(x_ns + axis * (int64_t)p->mux_step_ns);
    return 1e-9 *
           (double)(x_ns + 3 * (int64_t)p->mux_step_ns - (rig_k_has(r, axis, k + 1) ? 0 : (int64_t)p->key_gap_ns));
}

static inline void rig_done(void *ctx, struct board_cycle *c, enum board_cycle_result result, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)c;
    r->answered = true;
    r->result = result;
    r->answered_ns = t_ns;
}

/* A whole cycle. */
static inline enum board_cycle_result rig_cycle(struct rig *r, bool write, unsigned address, uint16_t *data)
{
    struct board_cycle c = {.write = write, .address = (uint8_t)address, .data = *data, .done = rig_done, .ctx = r};
    r->answered = false;
    const enum board_cycle_result refused = pmka_board.bus->submit(&r->b.base, &c, r->s.now_ns);
    if (refused != BOARD_CYCLE_OK) return refused;
    assert_false(r->answered); /* never from inside */
    sched_run_until(&r->s, r->s.now_ns + r->b.profile.strobe_ns);
    assert_true(r->answered);
    *data = c.data;
    return r->result;
}

static inline uint16_t rig_read(struct rig *r, unsigned address)
{
    uint16_t data = 0;
    assert_int_equal(rig_cycle(r, false, address, &data), BOARD_CYCLE_OK);
    return data;
}

static inline enum board_cycle_result rig_write(struct rig *r, unsigned address, uint16_t data)
{
    return rig_cycle(r, true, address, &data);
}

#endif
