/* Faults of the converters and of the controller. Those of a chip add up: its hook is given the sum of what is active. */
#include "control/fault_parts.h"

#include <math.h>
#include <stdio.h>

enum { DRDY_STUCK, DOUT_DEAD, LOST_SYNC, SLOW_CLOCK };

struct sum {
    bool drdy, drdy_high, dout, dout_high, lost_sync;
    double ppm;
};

static void add_to_sum(const struct fault *f, struct sum *s)
{
    const bool high = f->value[FAULT_LEVEL] != 0.0;
    if (f->kind->variant == DRDY_STUCK) s->drdy = true, s->drdy_high = high;
    if (f->kind->variant == DOUT_DEAD) s->dout = true, s->dout_high = high;
    if (f->kind->variant == LOST_SYNC) s->lost_sync = true;
    if (f->kind->variant == SLOW_CLOCK) s->ppm += f->value[FAULT_CLOCK_PPM];
}

static bool here(const struct fault *f, const struct fault *other)
{
    return other->id != 0 && other->state == FAULT_ACTIVE && !other->kind->once &&
           other->point.place == f->point.place && other->point.unit == f->point.unit &&
           other->point.index == f->point.index;
}

static struct psa2 *board_of(const struct fault *f)
{
    return fault_unit(f)->board;
}

static void set_accel(struct fault *f, const struct sum *s, int64_t t_ns)
{
    static const enum ads1282_stuck stuck[] = {ADS1282_STUCK_LOW, ADS1282_STUCK_HIGH};
    const struct ads1282_fault all = {.drdy = s->drdy ? stuck[s->drdy_high] : ADS1282_FREE,
                                      .dout = s->dout ? stuck[s->dout_high] : ADS1282_FREE,
                                      .lost_sync = s->lost_sync,
                                      .clock_ppm = (int32_t)nearbyint(s->ppm)};
    ads1282_fault(&board_of(f)->adc[f->point.index], &all, t_ns);
}

static void set_temp(struct fault *f, const struct sum *s, int64_t t_ns)
{
    static const enum ads1256_stuck stuck[] = {ADS1256_STUCK_LOW, ADS1256_STUCK_HIGH};
    const struct ads1256_fault all = {.drdy = s->drdy ? stuck[s->drdy_high] : ADS1256_FREE,
                                      .dout = s->dout ? stuck[s->dout_high] : ADS1256_FREE,
                                      .lost_sync = s->lost_sync,
                                      .clock_ppm = (int32_t)nearbyint(s->ppm)};
    ads1256_fault(&board_of(f)->tadc, &all, t_ns);
}

static void refresh_chip(struct fault *f, int64_t t_ns)
{
    struct sum s = {0};
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        if (here(f, &f->engine->fault[i])) add_to_sum(&f->engine->fault[i], &s);
    }
    s.ppm = fmin(fmax(s.ppm, -FAULT_PPM_MAX), FAULT_PPM_MAX);
    if (f->point.place == FAULT_AT_ADC) set_accel(f, &s, t_ns);
    else set_temp(f, &s, t_ns);
}

static bool apply_chip(struct fault *f, int64_t t_ns)
{
    refresh_chip(f, t_ns);
    return true;
}

static bool flip(struct fault *f, int64_t t_ns)
{
    struct psa2 *b = board_of(f);
    if (b->mode == PSA2_OFF) return false; /* registers without power hold nothing */
    const unsigned reg = (unsigned)f->value[FAULT_REGISTER];
    const uint8_t mask = (uint8_t)f->value[FAULT_MASK];
    if (f->point.place == FAULT_AT_ADC) return ads1282_flip(&b->adc[f->point.index], reg, mask, t_ns);
    return ads1256_flip(&b->tadc, reg, mask, t_ns);
}

/* One wire for three converters: it rides on converter X. */
static bool has_drdy(const struct control_bench *b, const struct fault *f, char *why)
{
    if (f->point.place == FAULT_AT_TADC || f->point.index == 0) return true;
    snprintf(why, CONTROL_WHY_MAX, "%s: DRD_A is the pin of converter X alone, nobody hears this one; %s.adc.x has it",
             f->name, b->unit_name[f->point.unit]);
    return false;
}

/* A clock is off by whole ppm. */
static bool has_ppm(const struct control_bench *b, const struct fault *f, char *why)
{
    (void)b;
    const double ppm = f->value[FAULT_CLOCK_PPM];
    if (ppm == nearbyint(ppm)) return true;
    snprintf(why, CONTROL_WHY_MAX, "clock_ppm: %.10g: whole ppm are wanted", ppm);
    return false;
}

static bool has_register(const struct control_bench *b, const struct fault *f, char *why)
{
    (void)b;
    const unsigned registers = f->point.place == FAULT_AT_ADC ? ADS1282_REGS : ADS1256_REGS;
    if (f->value[FAULT_REGISTER] < registers) return true;
    snprintf(why, CONTROL_WHY_MAX, "register: %.0f: %s has 0 to %u", f->value[FAULT_REGISTER], f->name, registers - 1);
    return false;
}

// clang-format off
#define CHIP(v) .variant = (v), .places = FAULT_BIT(FAULT_AT_ADC) | FAULT_BIT(FAULT_AT_TADC), .apply = apply_chip, .lift = refresh_chip
static const struct fault_kind chip[] = {
    {"chip.drdy_stuck", "The data-ready pin stays at level; inside, conversions go on.", "no frames and EMCY FF01h (adc.x), no new temperatures and EMCY FF02h (tadc)",
     CHIP(DRDY_STUCK), .need = FAULT_BIT(FAULT_LEVEL), .unless = "adc.y, adc.z: DRD_A is the pin of converter X alone", .fits = has_drdy},
    {"chip.dout_dead", "The data pin stays at level.", "all ones or all zeros in the words of that chip",
     CHIP(DOUT_DEAD), .need = FAULT_BIT(FAULT_LEVEL)},
    {"chip.lost_sync", "The chip does not hear SYNC, neither pin nor command.", "after a pulse on SYNC the chip goes on in its old phase: no gap in the frames (adc.x), another answer to a step than the other axes (adc.y, adc.z), temperature codes every 10.00 ms (tadc)",
     CHIP(LOST_SYNC)},
    {"chip.clock", "The clock of the chip is off by clock_ppm (negative: slow).", "the data rate is off by as much (adc.x, tadc), or the axis answers to a step in another time than the others (adc.y, adc.z)",
     CHIP(SLOW_CLOCK), .need = FAULT_BIT(FAULT_CLOCK_PPM), .nonzero = FAULT_BIT(FAULT_CLOCK_PPM), .unless = "clock_ppm is no whole number", .fits = has_ppm},
    {"chip.flip", "Bits of a register are inverted, once.", "the register reads otherwise, and the chip does what it now says",
     .places = FAULT_BIT(FAULT_AT_ADC) | FAULT_BIT(FAULT_AT_TADC), .need = FAULT_BIT(FAULT_REGISTER) | FAULT_BIT(FAULT_MASK),
     .once = true, .unless = "no such register", .fits = has_register, .apply = flip},
};
// clang-format on
const struct fault_table fault_chip = {chip, sizeof chip / sizeof *chip};

/* ---- controller */

enum { SKIP_SYNC_T, SETUP_ORDER, FROZEN_WORDS };

static void refresh_controller(struct fault *f, int64_t t_ns)
{
    struct psa2_controller_fault all = {0};
    (void)t_ns;
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        const struct fault *other = &f->engine->fault[i];
        if (!here(f, other)) continue;
        all.skip_sync_t |= other->kind->variant == SKIP_SYNC_T;
        all.wrong_setup_order |= other->kind->variant == SETUP_ORDER;
        all.frozen_words |= other->kind->variant == FROZEN_WORDS;
    }
    psa2_fault_set(board_of(f), &all);
}

static bool apply_controller(struct fault *f, int64_t t_ns)
{
    refresh_controller(f, t_ns);
    return true;
}

// clang-format off
#define KPSA(v) .variant = (v), .places = FAULT_BIT(FAULT_AT_KPSA), .apply = apply_controller, .lift = refresh_controller
static const struct fault_kind controller[] = {
    {"controller.skip_sync_t", "KPSA gives no pulse on SYNC_T.", "SYNC_T rests; temperature codes come every 10.00 ms at 100 SPS instead of every 10.25 ms",
     KPSA(SKIP_SYNC_T)},
    {"controller.setup_order", "KPSA carries out the steps of the set-up in reverse order, from the next Res on.", "after Res the registers of the converters differ from those of the article",
     KPSA(SETUP_ORDER)},
    {"controller.frozen_words", "KPSA sends the codes of the frame before, over and over.", "numbers and times of the frames go on, their codes stand still to the bit",
     KPSA(FROZEN_WORDS)},
};
// clang-format on
const struct fault_table fault_controller = {controller, sizeof controller / sizeof *controller};
