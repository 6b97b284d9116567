/* Faults of sensors and of the analog chains behind them. */
#include "fault/internal.h"

#include "base/why.h"

#include <math.h>
#include <stdio.h>

/* The inputs up to now belong to the chain as it was. */
static struct unit *settled_unit(struct fault *f, int64_t t_ns)
{
    struct unit *u = fault_unit(f);
    unit_sample_until(u, t_ns);
    return u;
}

/* ---- sensors */

/* Volts in the arguments are volts at the load: a sensor with current output gives the current that makes them. */
static double signal_per_v(const struct unit *u, unsigned axis)
{
    const struct afe_cfg *afe = &u->cfg.board.afe[axis];
    return afe->input == AFE_CURRENT ? 1.0 / afe->load_ohm : 1.0;
}

static bool has_sensor(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct unit *u = b->unit[f->point.unit];
    if (u->cfg.axis[f->point.index].sensor != UNIT_NO_SENSOR) return true;
    snprintf(why, CONTROL_WHY_MAX, "%s: the channel has no sensor", f->name);
    return false;
}

static double range_v(const struct unit *u)
{
    return u->type->range_v ? u->type->range_v(u->board) : 10.0;
}

/* What a board tells apart: less is rejected. */
static double least_v(const struct unit *u)
{
    return u->type->code_v ? fmax(FAULT_LEAST_V, u->type->code_v(u->board)) : FAULT_LEAST_V;
}

static double least_ppm(const struct unit *u)
{
    return u->type->code_v ? fmax(FAULT_LEAST_PPM, least_v(u) / range_v(u) * 1e6) : FAULT_LEAST_PPM;
}

static bool at_least(const struct fault *f, enum fault_arg arg, double least, const char *unit, char *why)
{
    if (fabs(f->value[arg]) >= least) return true;
    return why_fail(why, CONTROL_WHY_MAX, "%s: expected at least %.4g %s, one code of this board, got %.10g",
                    fault_args[arg].name, least, unit, f->value[arg]);
}

static bool seen_volts(const struct control_bench *b, const struct fault *f, char *why)
{
    const enum fault_arg arg = fault_given(f, FAULT_BIAS_V) ? FAULT_BIAS_V : FAULT_RMS_V;
    return has_sensor(b, f, why) && at_least(f, arg, least_v(b->unit[f->point.unit]), "V", why);
}

static bool seen_scale(const struct control_bench *b, const struct fault *f, char *why)
{
    return has_sensor(b, f, why) && at_least(f, FAULT_SCALE_PPM, least_ppm(b->unit[f->point.unit]), "ppm", why);
}

static bool passes_chain(const struct control_bench *b, const struct fault *f, enum fault_arg limit, char *why)
{
    const struct unit *u = b->unit[f->point.unit];
    const double most_v = fmin(u->cfg.board.afe[f->point.index].clip_v, range_v(u)); /* buffer, converter */
    if (!fault_given(f, limit) || fabs(f->value[limit]) < most_v) return true;
    return why_fail(why, CONTROL_WHY_MAX,
                    "%s: expected a limit within %.10g to %.10g V, which the analog chain passes, got %.10g",
                    fault_args[limit].name, -most_v, most_v, f->value[limit]);
}

/* What has grown to next to nothing when it ends was never seen. */
static bool grows_enough(const struct control_bench *b, const struct fault *f, char *why)
{
    const double least = least_v(b->unit[f->point.unit]);
    const double end_v = fabs(f->value[FAULT_DRIFT_V_PER_S]) * (double)f->for_ns / (double)NS_PER_S;
    if (!has_sensor(b, f, why)) return false;
    if (f->for_ns == 0 || end_v >= least) return true;
    snprintf(why, CONTROL_WHY_MAX, "drift_v_per_s: %.10g: in %.10g s it comes to %.10g V, less than %.4g V, a code",
             f->value[FAULT_DRIFT_V_PER_S], f->value[FAULT_FOR_S], end_v, least);
    return false;
}

static bool has_limits(const struct control_bench *b, const struct fault *f, char *why)
{
    if (!has_sensor(b, f, why)) return false;
    if (!fault_given(f, FAULT_LOW_V) && !fault_given(f, FAULT_HIGH_V))
        return why_fail(why, CONTROL_WHY_MAX, "expected low_v or high_v, where the output stops, got neither");
    if (!passes_chain(b, f, FAULT_LOW_V, why) || !passes_chain(b, f, FAULT_HIGH_V, why)) return false;
    if (!fault_given(f, FAULT_LOW_V) || !fault_given(f, FAULT_HIGH_V)) return true;
    if (f->value[FAULT_LOW_V] < f->value[FAULT_HIGH_V]) return true;
    return why_fail(why, CONTROL_WHY_MAX, "low_v: expected less than high_v, %.10g, got %.10g", f->value[FAULT_HIGH_V],
                    f->value[FAULT_LOW_V]);
}

static double value_or(const struct fault *f, enum fault_arg arg, double otherwise)
{
    return fault_given(f, arg) ? f->value[arg] * signal_per_v(fault_unit(f), f->point.index) : otherwise;
}

#define READING_NS 1000000 /* noise of a fault before, as in a reading at 1000 SPS */

static double output_now(const struct fault *f, int64_t t_ns)
{
    struct unit *u = fault_unit(f);
    const unsigned axis = f->point.index;
    double out = unit_sensor_out(u, axis, t_ns);
    sensor_fault_row(u->sensor_faults[axis], &(struct looks){&t_ns, 1, READING_NS}, &out);
    return out;
}

/* Its output without motion; of others than MEMS about 0. */
static double still_v(const struct unit *u, unsigned axis)
{
    const enum unit_sensor sensor = u->cfg.axis[axis].sensor;
    if (sensor == UNIT_CVG) return u->cvg[axis].cfg.u0_v;
    return sensor == UNIT_MEMS ? u->mems[axis].cfg.u0_v : 0.0;
}

/* Value and upper value of each kind, by enum sensor_fault_kind. */
static bool apply_sensor(struct fault *f, int64_t t_ns)
{
    const double infinite = (double)INFINITY;
    struct unit *u = settled_unit(f, t_ns);
    const double values[SENSOR_FAULTS][2] = {
        [SENSOR_STUCK] = {value_or(f, FAULT_OUT_V, output_now(f, t_ns))},
        [SENSOR_BIAS] = {value_or(f, FAULT_BIAS_V, 0.0)},
        [SENSOR_DRIFT] = {value_or(f, FAULT_DRIFT_V_PER_S, 0.0)},
        [SENSOR_SCALE] = {f->value[FAULT_SCALE_PPM] * 1e-6},
        [SENSOR_NOISE] = {mems_density_v_rthz(value_or(f, FAULT_RMS_V, 0.0), 1000.0)},
        [SENSOR_SATURATION] = {value_or(f, FAULT_LOW_V, -infinite), value_or(f, FAULT_HIGH_V, infinite)},
    };
    const unsigned k = f->kind->variant;
    f->as.sensor = (struct sensor_fault){.kind = (enum sensor_fault_kind)k,
                                         .value = values[k][0],
                                         .value_high = values[k][1],
                                         .zero = still_v(u, f->point.index),
                                         .from_ns = t_ns,
                                         .noise = draws_of(f->engine->seed, f->id, "fault")};
    sensor_fault_add(&u->sensor_faults[f->point.index], &f->as.sensor);
    return true;
}

static void lift_sensor(struct fault *f, int64_t t_ns)
{
    struct unit *u = settled_unit(f, t_ns);
    sensor_fault_remove(&u->sensor_faults[f->point.index], &f->as.sensor);
}

static void reseed_sensor(struct fault *f, uint64_t seed, int64_t t_ns)
{
    (void)t_ns;
    draws_reseed(&f->as.sensor.noise, seed);
}

/* ---- temperature sensors */

static bool reads_temp(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct unit *u = b->unit[f->point.unit];
    const unsigned count = u->type->temp_count(u->board);
    if (f->point.index < count) return true;
    return why_fail(why, CONTROL_WHY_MAX, "%s: expected one of the %u channels that the board scans", f->name, count);
}

static void refresh_temps(struct fault *f, int64_t t_ns)
{
    struct unit *u = settled_unit(f, t_ns);
    uint32_t open = 0;
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        const struct fault *other = &f->engine->fault[i];
        const bool of_unit = other->point.place == FAULT_AT_TEMP && other->point.unit == f->point.unit;
        if (other->id && other->state == FAULT_ACTIVE && of_unit) open |= UINT32_C(1) << other->point.index;
    }
    u->type->open_temps(u->board, open);
}

// clang-format off
#define SENSOR(v) .variant = (v), .places = FAULT_BIT(FAULT_AT_SENSOR), .apply = apply_sensor, .lift = lift_sensor, .reseed = reseed_sensor
static const struct fault_kind sensor[] = {
    {"sensor.stuck", "The sensor output freezes at out_v (default: its present value).", "the axis shows a constant plus converter noise at any head angle",
     SENSOR(SENSOR_STUCK), .may = FAULT_BIT(FAULT_OUT_V), .unless = "the channel has no sensor", .fits = has_sensor},
    {"sensor.bias", "Adds bias_v to the sensor output.", "a step in the codes of the axis",
     SENSOR(SENSOR_BIAS), .need = FAULT_BIT(FAULT_BIAS_V), .nonzero = FAULT_BIT(FAULT_BIAS_V), .unless = "the channel has no sensor; it is less than a code of the board", .fits = seen_volts},
    {"sensor.drift", "The sensor output drifts by drift_v_per_s.", "a slope in the codes of the axis",
     SENSOR(SENSOR_DRIFT), .need = FAULT_BIT(FAULT_DRIFT_V_PER_S), .nonzero = FAULT_BIT(FAULT_DRIFT_V_PER_S), .unless = "the channel has no sensor; the total drift is less than a code of the board", .fits = grows_enough},
    {"sensor.scale", "The scale factor of the sensor changes by scale_ppm.", "an error of the axis proportional to its specific force",
     SENSOR(SENSOR_SCALE), .need = FAULT_BIT(FAULT_SCALE_PPM), .nonzero = FAULT_BIT(FAULT_SCALE_PPM), .unless = "the channel has no sensor; it is less than a code of the board", .fits = seen_scale},
    {"sensor.noise", "Adds white noise of rms rms_v in a settled reading at 1000 SPS.", "more scatter in the codes of the axis",
     SENSOR(SENSOR_NOISE), .need = FAULT_BIT(FAULT_RMS_V), .unless = "the channel has no sensor; it is less than a code of the board", .fits = seen_volts},
    {"sensor.open", "The lead of a temperature sensor is open: no current, the load alone is left at the input.", "the temperature codes of that channel stay near 0, which is 0 K",
     .places = FAULT_BIT(FAULT_AT_TEMP), .unless = "the profile does not scan that channel", .fits = reads_temp, .lift = refresh_temps},
    {"sensor.saturation", "The sensor output saturates at low_v and high_v.", "the codes of the axis stop below the converter's full scale",
     SENSOR(SENSOR_SATURATION), .may = FAULT_BIT(FAULT_LOW_V) | FAULT_BIT(FAULT_HIGH_V), .unless = "the channel has no sensor; low_v is not below high_v; a limit is beyond what the chain passes", .fits = has_limits},
};
// clang-format on
const struct fault_table fault_sensor = {sensor, sizeof sensor / sizeof *sensor};

/* ---- analog chain */

static bool has_load(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct unit *u = b->unit[f->point.unit];
    if (u->cfg.board.afe[f->point.index].input == AFE_CURRENT) return true;
    snprintf(why, CONTROL_WHY_MAX, "%s: no load resistor in the chain of a sensor with voltage output", f->name);
    return false;
}

static bool has_error(const struct control_bench *b, const struct fault *f, char *why)
{
    const double least = least_ppm(b->unit[f->point.unit]);
    const double grown_ppm = f->value[FAULT_DRIFT_PPM_PER_S] * (double)f->for_ns / (double)NS_PER_S;
    const bool drifts = f->value[FAULT_DRIFT_PPM_PER_S] != 0.0;
    if (f->value[FAULT_REFERENCE_PPM] == 0.0 && !drifts)
        return why_fail(why, CONTROL_WHY_MAX, "expected reference_ppm other than 0, or drift_ppm_per_s, got neither");
    if (!drifts) return at_least(f, FAULT_REFERENCE_PPM, least, "ppm", why);
    if (f->value[FAULT_REFERENCE_PPM] != 0.0 || f->for_ns == 0 || grown_ppm >= least) return true;
    snprintf(why, CONTROL_WHY_MAX, "drift_ppm_per_s: %.10g: in %.10g s it comes to %.10g ppm, less than %.4g ppm",
             f->value[FAULT_DRIFT_PPM_PER_S], f->value[FAULT_FOR_S], grown_ppm, least);
    return false;
}

/* A model that looks at its input less often than the part's modulator would show a fast ripple at a frequency of its own. */
static bool looks_fast(const struct unit *u, const struct fault *f, char *why)
{
    const double hz = f->value[FAULT_FREQUENCY_HZ];
    if (hz <= AFE_SLOW_HZ) return true;
    if (board_has(u->type, "adc_chain") && u->cfg.board.adc_chain == BOARD_CHAIN_MODULATOR) return true;
    return why_fail(why, CONTROL_WHY_MAX,
                    "frequency_hz: expected 0.1 to %g Hz (above: a unit with adc_chain: modulator), got %.10g",
                    AFE_SLOW_HZ, hz);
}

/* Behind the pole: what the converter makes of it is the host's to see. */
static bool ripples_enough(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct unit *u = b->unit[f->point.unit];
    const double filter_hz = u->cfg.board.afe[f->point.index].filter_hz, hz = f->value[FAULT_FREQUENCY_HZ];
    const double ratio = hz > AFE_SLOW_HZ && filter_hz > 0.0 ? hz / filter_hz : 0.0;
    return looks_fast(u, f, why) && at_least(f, FAULT_AMPLITUDE_V, least_v(u) * sqrt(1.0 + ratio * ratio), "V", why);
}

static bool apply_afe(struct fault *f, int64_t t_ns)
{
    const bool ripple = f->kind->variant == AFE_RIPPLE;
    struct unit *u = settled_unit(f, t_ns);
    f->as.afe = (struct afe_fault){.kind = (enum afe_fault_kind)f->kind->variant,
                                   .value = ripple ? f->value[FAULT_AMPLITUDE_V] : f->value[FAULT_REFERENCE_PPM] * 1e-6,
                                   .rate_per_s = f->value[FAULT_DRIFT_PPM_PER_S] * 1e-6,
                                   .frequency_hz = f->value[FAULT_FREQUENCY_HZ],
                                   .from_ns = t_ns};
    afe_fault_add(&u->board->afe[f->point.index], &f->as.afe);
    return true;
}

static void lift_afe(struct fault *f, int64_t t_ns)
{
    struct unit *u = settled_unit(f, t_ns);
    afe_fault_remove(&u->board->afe[f->point.index], &f->as.afe);
}

// clang-format off
#define CHAIN(v) .variant = (v), .places = FAULT_BIT(FAULT_AT_AFE), .apply = apply_afe, .lift = lift_afe
static const struct fault_kind analog[] = {
    {"analog.load_open", "The load resistor of a current-output sensor is open; the buffer saturates.", "full-scale codes of the axis, status CLIP",
     CHAIN(AFE_LOAD_OPEN), .unless = "the sensor has voltage output: no load resistor", .fits = has_load},
    {"analog.load_short", "The load resistor of a current-output sensor is shorted; the input is 0 V.", "codes of the axis near 0 at any head angle",
     CHAIN(AFE_LOAD_SHORT), .unless = "the sensor has voltage output: no load resistor", .fits = has_load},
    {"analog.reference", "The converter's reference voltage is off by reference_ppm and drifts by drift_ppm_per_s.", "all codes of the axis scaled, offset included",
     CHAIN(AFE_REFERENCE), .may = FAULT_BIT(FAULT_REFERENCE_PPM) | FAULT_BIT(FAULT_DRIFT_PPM_PER_S), .unless = "neither is given; the error or total drift is less than a code of the board", .fits = has_error},
    {"analog.ripple", "Supply ripple couples through the buffer, as a sine of amplitude_v at the load.", "a spectral line in the codes of the axis, at frequency_hz or where the converter's sampling puts it",
     CHAIN(AFE_RIPPLE), .need = FAULT_BIT(FAULT_AMPLITUDE_V) | FAULT_BIT(FAULT_FREQUENCY_HZ), .unless = "it is less than a code of the board; frequency_hz is above 100 and the unit has no adc_chain: modulator", .fits = ripples_enough},
};
// clang-format on
const struct fault_table fault_analog = {analog, sizeof analog / sizeof *analog};
