#include "board/pmka/pmka.h"

#include "board/bus_lines.h"
#include "board/pmka/internal.h"

#include <assert.h>
#include <math.h>
#include <string.h>

const char *const pmka_events[PMKA_EVENTS] = {PMKA_EVENT_LIST(BOARD_EVENT_NAME)};

const struct board_line pmka_lines[PMKA_LINES] = {
    [PMKA_LINE_KL1] = {"KL1", true},    [PMKA_LINE_KL2] = {"KL2", true},    [PMKA_LINE_KL3] = {"KL3", true},
    [PMKA_LINE_KL4] = {"KL4", false},   [PMKA_LINE_TAU0] = {"TAU0", false}, [PMKA_LINE_TAU1] = {"TAU1", false},
    [PMKA_LINE_TAU2] = {"TAU2", false}, [PMKA_LINE_RP1] = {"RP1", false},   [PMKA_LINE_RN1] = {"RN1", false},
    [PMKA_LINE_RP2] = {"RP2", false},   [PMKA_LINE_RN2] = {"RN2", false},   [PMKA_LINE_RP3] = {"RP3", false},
    [PMKA_LINE_RN3] = {"RN3", false},   [PMKA_LINE_RP4] = {"RP4", false},   [PMKA_LINE_RN4] = {"RN4", false},
    [PMKA_LINE_SH] = {"SH", false},     [PMKA_LINE_CONV] = {"CONV", false}, [PMKA_LINE_MUX0] = {"MUX0", false},
    [PMKA_LINE_MUX1] = {"MUX1", false}, [PMKA_LINE_CS] = {"CS", true},      [PMKA_LINE_RW] = {"RW", true},
    BUS_LINES_AB(PMKA_LINE_AB0),        BUS_LINES_D(PMKA_LINE_D0),
};

/* ---- the specimen ---- */

static double draw_gauss(struct rng *r, double sd)
{
    return sd * rng_gauss(r);
}

static double from_ppm(double x)
{
    return 1e-6 * x;
}

/* One draw for each value and integrator, whatever the profile: to change one value does not shift another. */
static void draw_integrators(struct pmka *b)
{
    const struct pmka_profile *p = &b->profile;
    struct rng cap = board_noise(&b->base, "pmka.capacitor"), res = board_noise(&b->base, "pmka.resistors"),
               tc = board_noise(&b->base, "pmka.resistor_tc"), zero = board_noise(&b->base, "pmka.zero"),
               zero_tc = board_noise(&b->base, "pmka.zero_tc");
    for (unsigned i = 0; i < PMKA_INTS; i++) {
        struct pmka_int_cfg c = {.cap_f = p->cap_f * (1.0 + draw_gauss(&cap, p->cap_tol_sd)),
                                 .cap_tc_per_k = from_ppm(p->cap_tc_ppm_per_k),
                                 .cap_ageing_per_s = p->cap_ageing_per_h / 3600.0,
                                 .limit_v = p->limit_v};
        c.r_in_ohm = p->r_in_ohm * (1.0 + from_ppm(draw_gauss(&res, p->r_tol_sd_ppm)));
        c.r_in_tc_per_k = from_ppm(draw_gauss(&tc, p->r_tc_sd_ppm_per_k));
        for (unsigned s = 0; s < 2; s++) {
            const double asymmetry = 0.5 * from_ppm(p->reset_asymmetry_ppm) * (s == PMKA_MINUS ? 1.0 : -1.0);
            c.rr_ohm[s] = p->rr_ohm * (1.0 + asymmetry + from_ppm(draw_gauss(&res, p->r_tol_sd_ppm)));
            c.rr_tc_per_k[s] = from_ppm(draw_gauss(&tc, p->r_tc_sd_ppm_per_k));
        }
        c.zero_v = draw_gauss(&zero, p->zero_sd_v);
        c.zero_tc_v_per_k = draw_gauss(&zero_tc, p->zero_tc_sd_v_per_k);
        pmka_int_init(&b->channel[i].integrator, &c);
    }
}

static void draw_specimen(struct pmka *b)
{
    const struct pmka_profile *p = &b->profile;
    struct rng uref = board_noise(&b->base, "pmka.uref"), uc = board_noise(&b->base, "pmka.uc"),
               adc = board_noise(&b->base, "pmka.adc"), temp = board_noise(&b->base, "pmka.thermometer");
    struct pmka_specimen *s = &b->specimen;
    s->uref_v = p->uref_v * (1.0 + from_ppm(draw_gauss(&uref, p->uref_tol_sd_ppm)));
    s->uref_tc_v_per_k = p->uref_v * from_ppm(draw_gauss(&uref, p->uref_tc_sd_ppm_per_k));
    for (unsigned i = 0; i < PMKA_INTS; i++)
        for (unsigned sign = 0; sign < 2; sign++) s->uc_v[i][sign] = p->uc_v + draw_gauss(&uc, p->uc_sd_v);
    s->adc_offset_lsb = draw_gauss(&adc, p->adc_offset_sd_lsb);
    s->adc_gain = 1.0 + from_ppm(draw_gauss(&adc, p->adc_gain_sd_ppm));
    s->temp_offset_k = draw_gauss(&temp, p->temp_offset_sd_k);
}

static double uref_at_v(const struct pmka *b, double degc)
{
    return b->specimen.uref_v + b->specimen.uref_tc_v_per_k * (degc - PMKA_NOMINAL_DEGC);
}

static void burn_rom(struct pmka *b)
{
    struct pmka_rom_cfg cfg = {
        .uref_nominal_v = b->profile.uref_v, .ts_s = 1e-9 * b->profile.ts_ns, .serial = b->base.cfg.serial};
    struct rng factory = board_noise(&b->base, "pmka.factory");
    for (unsigned i = 0; i < PMKA_INTS; i++) {
        cfg.integrator[i] = &b->channel[i].integrator.cfg;
        cfg.ct_error[i] = from_ppm(draw_gauss(&factory, b->profile.rom_ct_sd_ppm));
    }
    for (unsigned point = 0; point < PMKA_ROM_POINTS; point++) cfg.uref_v[point] = uref_at_v(b, pmka_rom_degc(point));
    pmka_rom_burn(b->rom, &cfg);
}

/* ---- a period ---- */

static int16_t temp_code(const struct pmka *b, int64_t t_ns)
{
    double k = b->board_degc + b->specimen.temp_offset_k;
    if (b->profile.temp_noise_k > 0.0 && b->base.cfg.temp_noise_scale > 0.0)
        k += b->profile.temp_noise_k * b->base.cfg.temp_noise_scale * draws_gauss(&b->temp_noise, t_ns);
    const double code = floor(128.0 * k + 0.5);
    return (int16_t)(code > 32767.0 ? 32767.0 : code < -32768.0 ? -32768.0 : code);
}

static void begin_set(struct pmka *b, int64_t t_ns)
{
    b->set_ns = t_ns;
    b->board_degc = b->base.io.temp_degc(b->base.io.ctx, 3, t_ns);
    b->uref_v = uref_at_v(b, b->board_degc);
    b->next.t_ns = t_ns;
    b->next.cal = b->rotation.cal;
    b->next.tau = (uint8_t)b->rotation.tau;
    b->next.autonomous = b->rotation.mode == PMKA_AUTONOMOUS;
    b->next.temp_code = temp_code(b, t_ns);
    pmka_rotation_next(b);
}

static void end_set(struct pmka *b, int64_t t_ns)
{
    board_notify(&b->base, PMKA_EV_READING, t_ns);
    if (b->base.faults & PMKA_FAULT_FROZEN_WORDS && b->any) memcpy(b->next.code, b->latest.code, sizeof b->next.code);
    b->bus.overrun |= b->bus.fresh;
    b->bus.fresh = b->any = true;
    b->latest = b->next;
    b->next.seq++;
    b->counters.readings++;
    if (b->host.reading) b->host.reading(b->host.ctx, &b->latest, t_ns);
}

/* The instant of a stage, counted from that of X. */
static int64_t stage_ns(const struct pmka *b, enum pmka_stage stage)
{
    const struct pmka_profile *p = &b->profile;
    const int64_t step_ns = p->mux_step_ns, k_ns = PMKA_K * step_ns;
    const int64_t at_ns[] = {[PMKA_AT_X] = 0,
                             [PMKA_AT_Y] = step_ns,
                             [PMKA_AT_Z] = 2 * step_ns,
                             [PMKA_AT_RELEASE] = k_ns - p->key_gap_ns,
                             [PMKA_AT_K] = k_ns,
                             [PMKA_AT_TAKE] = k_ns + p->key_gap_ns,
                             [PMKA_AT_READING] = k_ns + p->convert_ns};
    return at_ns[stage];
}

static void do_stage(struct pmka *b, enum pmka_stage stage, int64_t t_ns)
{
    if (stage == PMKA_AT_X) begin_set(b, t_ns);
    if (stage <= PMKA_AT_Z) pmka_sample(b, stage, t_ns);
    else if (stage == PMKA_AT_K) pmka_sample(b, PMKA_K, t_ns);
    else if (stage == PMKA_AT_TAKE) pmka_take_axis(b, t_ns);
    else if (stage == PMKA_AT_READING) end_set(b, t_ns);
    else if (pmka_rotation_turns(b)) pmka_release_axis(b, t_ns);
}

static void run_stage(void *ctx, int64_t t_ns)
{
    struct pmka *b = ctx;
    const enum pmka_stage stage = b->stage;
    if (b->life == PMKA_STARTING) {
        b->life = PMKA_RUNNING;
        board_notify(&b->base, PMKA_EV_START, t_ns);
    }
    do_stage(b, stage, t_ns);
    b->stage = stage == PMKA_AT_READING ? PMKA_AT_X : (enum pmka_stage)(stage + 1);
    const int64_t ts_ns = stage == PMKA_AT_READING ? b->profile.ts_ns : 0;
    sched_at(b->base.sched, &b->step, b->set_ns + ts_ns + stage_ns(b, b->stage));
}

/* ---- life ---- */

static void wake_lines(void *ctx, uint64_t mask)
{
    struct pmka *b = ctx;
    (void)mask;
    pmka_converter_wake(b, b->base.sched->now_ns);
}

static void init_trace(struct pmka *b)
{
    b->base.trace.source = (struct trace_source){.wake = wake_lines, .ctx = b};
}

void pmka_init(struct pmka *b, const struct pmka_profile *p, const struct board_cfg *cfg, const struct board_io *io,
               struct sched *s)
{
    assert(io->accel && io->temp_degc);
    board_clear(&b->base, sizeof *b);
    b->profile = *p;
    board_init(&b->base, pmka_lines, PMKA_LINES, cfg, io, s);
    init_trace(b);
    pmka_probes_init(b);
    sched_ev_inner(&b->step, run_stage, b);
    pmka_sample_init(b);
    pmka_bus_init(b);
    draw_integrators(b);
    draw_specimen(b);
    burn_rom(b);
    b->adc_noise = board_draws(&b->base, "adc");
    b->temp_noise = board_draws(&b->base, "temp");
    pmka_rotation_start(b);
    for (unsigned i = 0; i < PMKA_INTS; i++) b->channel[i].axis = b->channel[i].said_axis = i < PMKA_K ? (int)i : -1;
}

/* The controller restarts. */
static void start_controller(struct pmka *b, int64_t t_ns)
{
    b->life = PMKA_STARTING;
    b->stage = PMKA_AT_X;
    b->any = false;
    b->next = b->latest = (struct pmka_reading){0};
    pmka_rotation_start(b);
    for (unsigned i = 0; i < PMKA_INTS; i++) {
        struct pmka_channel *c = &b->channel[i];
        c->done = 0;
        c->served = 0;
        c->count[PMKA_PLUS] = c->count[PMKA_MINUS] = 0;
    }
    sched_at(b->base.sched, &b->step, t_ns + b->profile.start_ns);
}

/* Ends all activity; the integrators keep their charge. */
static void stop_controller(struct pmka *b, int64_t t_ns)
{
    sched_cancel(b->base.sched, &b->step);
    for (unsigned i = 0; i < PMKA_INTS; i++) pmka_cut_reset(b, i, t_ns);
    pmka_converter_stop(b, t_ns);
    pmka_keys_home(b, t_ns);
    for (unsigned line = PMKA_LINE_TAU0; line <= PMKA_LINE_TAU2; line++) pmka_line(b, line, false, t_ns);
    pmka_line(b, PMKA_LINE_MUX0, false, t_ns);
    pmka_line(b, PMKA_LINE_MUX1, false, t_ns);
}

/* Until the first sampling instant the capacitors are shorted (E0). */
static void empty_integrators(struct pmka *b, int64_t t_ns)
{
    const int64_t from_ns = t_ns + b->profile.start_ns;
    b->board_degc = b->base.io.temp_degc(b->base.io.ctx, 3, t_ns);
    b->uref_v = uref_at_v(b, b->board_degc);
    for (unsigned i = 0; i < PMKA_INTS; i++) {
        struct pmka_channel *c = &b->channel[i];
        pmka_int_warm(&c->integrator, b->board_degc);
        c->integrator.charge_c = 0.0;
        c->integrator.saturated = false;
        c->at_ns = c->cell_ns = c->reset_until_ns = from_ns;
    }
    for (unsigned a = 0; a < BOARD_AXES; a++) b->axis[a] = (struct pmka_axis){.at_ns = from_ns};
}

static void put_all_lines(struct pmka *b, bool rest, int64_t t_ns)
{
    for (unsigned i = 0; i < PMKA_LINES; i++) pmka_line(b, i, rest && pmka_lines[i].level, t_ns);
}

void pmka_power_up(struct pmka *b, int64_t t_ns)
{
    if (b->life != PMKA_OFF) return;
    board_notify(&b->base, PMKA_EV_POWER_UP, t_ns);
    empty_integrators(b, t_ns);
    start_controller(b, t_ns);
    if (b->unpowered) put_all_lines(b, true, t_ns);
    b->unpowered = false;
}

void pmka_reset(struct pmka *b, int64_t t_ns)
{
    if (b->life == PMKA_OFF) return;
    b->counters.res++;
    stop_controller(b, t_ns);
    start_controller(b, t_ns);
    board_notify(&b->base, PMKA_EV_RES, t_ns);
    pmka_bus_cut(b, t_ns);
}

void pmka_power_down(struct pmka *b, int64_t t_ns)
{
    if (b->life == PMKA_OFF) return;
    stop_controller(b, t_ns);
    b->life = PMKA_OFF;
    b->unpowered = true;
    b->any = false;
    put_all_lines(b, false, t_ns);
    board_notify(&b->base, PMKA_EV_POWER_DOWN, t_ns);
    pmka_bus_cut(b, t_ns);
}

bool pmka_ready(const struct pmka *b)
{
    return b->life == PMKA_RUNNING;
}

void pmka_sample_until(struct pmka *b, int64_t t_ns)
{
    if (b->life == PMKA_OFF) return;
    for (unsigned i = 0; i < PMKA_INTS; i++) pmka_integrate(b, i, t_ns);
    for (unsigned a = 0; a < BOARD_AXES; a++) pmka_integrate_axis(b, a, t_ns);
}

void pmka_set_faults(struct pmka *b, uint32_t faults)
{
    const int64_t t_ns = b->base.sched->now_ns;
    pmka_sample_until(b, t_ns);
    b->base.faults = faults;
    b->channel[0].integrator.cap_left = faults & PMKA_FAULT_CAPACITOR ? 0.7 : 1.0;
    if (b->life != PMKA_OFF) pmka_key_stuck(b, t_ns);
}
