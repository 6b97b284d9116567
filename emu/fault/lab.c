/* Faults of the instruments: the supply; the chamber; the dividing head; an axis of the table; of the gyro-stabilised platform the torquers and
 * the drift of an axis, and the gimbal's angle sensor. */
#include "fault/internal.h"

#include "base/why.h"

#include <math.h>
#include <stdio.h>

#define RATE_PART_LEAST 1e-9 /* of several faults at once */

/* ---- supply */

_Static_assert(SUPPLY_DIPS_MAX >= FAULTS_MAX, "each brown-out that was accepted has room in the supply");

static bool reaches_brownout(const struct control_bench *b, const struct fault *f, char *why)
{
    const struct supply *s = b->lab ? &b->lab->supply : NULL;
    if (!s || !s->cfg.present) {
        snprintf(why, CONTROL_WHY_MAX, "%s: this scenario has none (section supply): the boards are always fed",
                 f->name);
        return false;
    }
    if (s->set_v - f->value[FAULT_DROP_V] < s->cfg.brownout_v) return true;
    snprintf(why, CONTROL_WHY_MAX, "drop_v: %.10g: %.10g V less that is not below the threshold of the boards, %.10g V",
             f->value[FAULT_DROP_V], s->set_v, s->cfg.brownout_v);
    return false;
}

static bool turns_units(const struct control_bench *b, const struct fault *f, char *why)
{
    for (unsigned i = 0; i < b->units; i++)
        if (b->unit[i]->cfg.mounting.on == LAB_HEAD) return true;
    snprintf(why, CONTROL_WHY_MAX, "%s: expected a unit on the head, got none", f->name);
    return false;
}

static bool dip_supply(struct fault *f, int64_t t_ns)
{
    const struct control_bench *b = f->engine->bench;
    char why[CONTROL_WHY_MAX];
    if (!reaches_brownout(b, f, why)) return false; /* it has been set higher meanwhile */
    if (supply_dip(&b->lab->supply, f->value[FAULT_DROP_V], t_ns, f->for_ns, t_ns) != SUPPLY_OK) return false;
    if (b->sim.supply_changed) b->sim.supply_changed(b->ctx, t_ns);
    return true;
}

/* It ends by itself; one that is cleared ends now. */
static void lift_supply(struct fault *f, int64_t t_ns)
{
    const struct control_bench *b = f->engine->bench;
    supply_dip_end(&b->lab->supply, f->value[FAULT_DROP_V], f->began_ns, f->for_ns, t_ns);
    if (b->sim.supply_changed) b->sim.supply_changed(b->ctx, t_ns);
}

/* ---- platform */

static struct platform *platform_of(const struct fault *f)
{
    return &f->engine->bench->lab->platform;
}

/* What is active of the kind at the point: its number, and the sum of its value. */
static unsigned count_active(const struct fault *f, enum fault_arg arg, double *sum)
{
    unsigned n = 0;
    *sum = 0.0;
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        const struct fault *other = &f->engine->fault[i];
        if (other->kind != f->kind || !fault_lasts_at(f, other)) continue;
        n++;
        *sum += other->value[arg];
    }
    return n;
}

static void refresh_torquer(struct fault *f, int64_t t_ns)
{
    double unused;
    const double gain = count_active(f, FAULT_ID, &unused) ? 0.0 : 1.0;
    platform_set_torquer(platform_of(f), (enum platform_axis)f->point.index, gain, t_ns);
}

static void refresh_drift(struct fault *f, int64_t t_ns)
{
    double degph;
    (void)count_active(f, FAULT_DRIFT_DEGPH, &degph);
    platform_step_drift(platform_of(f), (enum platform_axis)f->point.index, degph, t_ns);
}

static void refresh_sensor(struct fault *f, int64_t t_ns)
{
    double unused;
    platform_stick(platform_of(f), count_active(f, FAULT_ID, &unused) > 0, t_ns);
}

/* ---- chamber */

static void refresh_chamber(struct fault *f, int64_t t_ns)
{
    struct chamber *c = &f->engine->bench->lab->chamber;
    double part = 1.0, misreading_k = 0.0, overshoot_k = 0.0;
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        const struct fault *other = &f->engine->fault[i];
        if (!fault_lasts_at(f, other)) continue;
        if (fault_given(other, FAULT_RATE_PART)) part *= other->value[FAULT_RATE_PART];
        if (fault_given(other, FAULT_READOUT_K)) misreading_k += other->value[FAULT_READOUT_K];
        if (fault_given(other, FAULT_OVERSHOOT_K)) overshoot_k += other->value[FAULT_OVERSHOOT_K];
    }
    control_settle_inputs(f->engine->bench, t_ns);
    chamber_hinder(c, fmax(part, RATE_PART_LEAST), t_ns);
    chamber_overshoot(c, overshoot_k, t_ns);
    chamber_mislead(c, misreading_k);
}

/* ---- dividing head */

static void refresh_stick(struct fault *f, int64_t t_ns)
{
    double unused;
    control_settle_inputs(f->engine->bench, t_ns);
    head_stick(&f->engine->bench->lab->head, count_active(f, FAULT_ID, &unused) > 0, t_ns);
}

static void refresh_slip(struct fault *f, int64_t t_ns)
{
    double step_deg;
    (void)t_ns; /* it waits for a turn */
    (void)count_active(f, FAULT_SLIP_DEG, &step_deg);
    head_slip(&f->engine->bench->lab->head, step_deg);
}

/* ---- table */

static struct table *table_of(const struct fault *f)
{
    return &f->engine->bench->lab->table;
}

/* No servo does more. */
static bool servo_follows(const struct control_bench *b, const struct fault *f, char *why)
{
    (void)b;
    return f->value[FAULT_FREQUENCY_HZ] <= AFE_SLOW_HZ ||
           why_fail(why, CONTROL_WHY_MAX, "frequency_hz: expected 0.1 to %g Hz, got %.10g", AFE_SLOW_HZ,
                    f->value[FAULT_FREQUENCY_HZ]);
}

static bool ripple_axis(struct fault *f, int64_t t_ns)
{
    control_settle_inputs(f->engine->bench, t_ns);
    f->as.ripple = (struct table_ripple){.axis = f->point.index,
                                         .rate_radps = f->value[FAULT_RIPPLE_DPS] * RAD_PER_DEG,
                                         .hz = f->value[FAULT_FREQUENCY_HZ],
                                         .from_ns = t_ns};
    table_ripple_add(table_of(f), &f->as.ripple);
    return true;
}

static void lift_ripple(struct fault *f, int64_t t_ns)
{
    control_settle_inputs(f->engine->bench, t_ns);
    table_ripple_remove(table_of(f), &f->as.ripple);
}

// clang-format off
static const struct fault_kind lab[] = {
    {"supply.brownout", "The supply voltage drops by drop_v for for_s, below the boards' threshold.", "frames break off; after the supply returns: boot-up message, set-up, frame numbers from 0",
     .places = FAULT_BIT(FAULT_AT_SUPPLY), .need = FAULT_BIT(FAULT_DROP_V) | FAULT_BIT(FAULT_FOR_S), .nonzero = FAULT_BIT(FAULT_FOR_S),
     .unless = "the scenario has no supply; the voltage stays above the threshold of the boards", .fits = reaches_brownout, .apply = dip_supply, .lift = lift_supply},
    {"platform.torquer", "The torquer of the axis gives no torque.", "the gyro unit gives no windows. Level: it does not settle (EMCY FF23h). Azimuth: the angle sensor does not follow (EMCY FF22h)",
     .places = FAULT_BIT(FAULT_AT_TORQUER), .lift = refresh_torquer},
    {"platform.drift_step", "The gyroscope drift about the axis changes by drift_degph.", "the levelling rate (azimuth: the rate of the azimuth torquer) changes by drift_degph",
     .places = FAULT_BIT(FAULT_AT_TORQUER), .need = FAULT_BIT(FAULT_DRIFT_DEGPH), .nonzero = FAULT_BIT(FAULT_DRIFT_DEGPH), .lift = refresh_drift},
    {"platform.encoder_stuck", "The angle sensor of the outer gimbal freezes at its last value.", "ENCODER is constant; during a turn the unit reports it (EMCY FF22h)",
     .places = FAULT_BIT(FAULT_AT_ENCODER), .lift = refresh_sensor},
    {"chamber.slow", "The air of the chamber makes only rate_part of its ramp, as a worn compressor; with 1e-6 it sticks.", "the chamber's reading and the temperature codes are late at the set point, or never there; CHAMBER reports SETTLING longer than its ramp takes",
     .places = FAULT_BIT(FAULT_AT_CHAMBER), .need = FAULT_BIT(FAULT_RATE_PART), .lift = refresh_chamber},
    {"chamber.readout", "The thermometer of the chamber reads readout_k too much.", "the chamber's reading differs from the temperature codes by readout_k; at rest it is off its set point",
     .places = FAULT_BIT(FAULT_AT_CHAMBER), .need = FAULT_BIT(FAULT_READOUT_K), .nonzero = FAULT_BIT(FAULT_READOUT_K), .lift = refresh_chamber},
    {"chamber.overshoot", "The air of the chamber goes overshoot_k past its set point (no farther than the step) and comes back with its ramp.", "the chamber's reading and the temperature codes pass the set point; CHAMBER reports SETTLING longer than its ramp takes",
     .places = FAULT_BIT(FAULT_AT_CHAMBER), .need = FAULT_BIT(FAULT_OVERSHOOT_K), .lift = refresh_chamber},
    {"head.stick", "The dividing head sticks: it stops at once, and turns move nothing.", "the scale shows another angle than was set; the codes stay",
     .places = FAULT_BIT(FAULT_AT_HEAD), .lift = refresh_stick},
    {"head.slip", "The mount slips on its axis: each turn leaves it slip_deg short of the scale, one after another. The first turn after the fault makes it good.", "the scale shows what was set, the codes belong to another angle",
     .places = FAULT_BIT(FAULT_AT_HEAD), .need = FAULT_BIT(FAULT_SLIP_DEG), .nonzero = FAULT_BIT(FAULT_SLIP_DEG),
     .unless = "no unit is on the head", .fits = turns_units, .lift = refresh_slip},
    {"table.ripple", "The servo of the axis ripples: a sine of amplitude ripple_dps in its rate.", "a spectral line at frequency_hz in the readout of the rate, and in the codes of a unit on the table",
     .places = FAULT_BIT(FAULT_AT_TABLE), .need = FAULT_BIT(FAULT_RIPPLE_DPS) | FAULT_BIT(FAULT_FREQUENCY_HZ),
     .unless = "frequency_hz is above 100", .fits = servo_follows, .apply = ripple_axis, .lift = lift_ripple},
};
// clang-format on
const struct fault_table fault_lab = {lab, sizeof lab / sizeof *lab};
