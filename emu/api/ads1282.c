#include "api/internal.h"

#include "base/clk.h"
#include "chip/ads1282/ads1282.h"

#include <stdio.h>

enum { MUX_AIN1 = 0, MUX_AIN2 = 1, MUX_BOTH = 3, PINS_1282 = 11, PINS = 16 };

/* Mode pins of an ADS1281, with pin_mode. */
enum mode_pin { MODE_DR0, MODE_DR1, MODE_PHS, MODE_HPF, MODE_CSYNC };

struct part_ads1282 {
    struct psabench_part part;
    struct ads1282_cfg cfg; /* of the options */
    bool m0, m1, mclk;
    struct sched_ev mclk_fall;
    unsigned mode; /* bit i: enum mode_pin i is high */
    struct ads1282 chip;
};

#define OPTIONS(X)                                                                                                     \
    X("clk_hz", API_UINT, part_ads1282, cfg.clk_hz, "4096000", 1000000, 4096000, NULL, "clock at CLK, Hz")             \
    X("power_up_tclk", API_UINT, part_ads1282, cfg.power_up_tclk, "65536", 0, 16777216, NULL,                          \
      "internal reset after power-up and PWDN, periods of CLK")                                                        \
    X("sclk_hz", API_UINT, part_ads1282, part.sclk_hz, "1024000", 1, 50000000, NULL, "SCLK of psabench_spi(), Hz")     \
    X("vref_v", API_REAL, part_ads1282, cfg.vref_v, "5", 0.5, 5.5, NULL, "VREFP - VREFN, V; full scale is half of it") \
    X("noise_scale", API_REAL, part_ads1282, cfg.noise_scale, "1", 0, 1000, NULL, "noise, 1: published, 0: none")      \
    X("chain", API_CHOICE, part_ads1282, cfg.chain, "exact", 0, 2, "exact|modulator|direct",                           \
      "ideal modulator and bit-true filters; bit-true modulator too; settled value at the chain's delay")              \
    X("strict_sdatac", API_BOOL, part_ads1282, cfg.strict_sdatac, "0", 0, 1, NULL,                                     \
      "in RDATAC obeys only WAKEUP, SDATAC and RESET")                                                                 \
    X("strict_gap", API_BOOL, part_ads1282, cfg.strict_gap, "0", 0, 1, NULL,                                           \
      "a byte sooner than 24 tCLK after a command's last is lost, and its command with it")                            \
    X("wreg_gap_free", API_BOOL, part_ads1282, cfg.wreg_gap_free, "0", 0, 1, NULL,                                     \
      "the bytes of WREG and the command bytes of RREG need no gap")                                                   \
    X("strict_sync", API_BOOL, part_ads1282, cfg.strict_sync, "0", 0, 1, NULL,                                         \
      "limits of a SYNC pulse matter: too close to CLK it is taken late, too short by none")                           \
    X("strict_config0", API_BOOL, part_ads1282, cfg.strict_config0, "0", 0, 1, NULL,                                   \
      "each write to CONFIG0 restarts, even one that changes nothing")                                                 \
    X("cal_corrected", API_BOOL, part_ads1282, cfg.cal_corrected, "0", 0, 1, NULL,                                     \
      "OFSCAL and GANCAL measure with OFC and FSC acting")

#define OPTIONS_1281(X)                                                                                                \
    OPTIONS(X)                                                                                                         \
    X("pin_mode", API_BOOL, part_ads1282, cfg.pin_mode, "0", 0, 1, NULL,                                               \
      "PINMODE is high: DR0 DR1 PHS HPF CSYNC instead of registers and commands")

static const struct api_option options_1282[] = {OPTIONS(API_OPTION_ROW)};
static const struct api_option options_1281[] = {OPTIONS_1281(API_OPTION_ROW)};

/* ---- pins ---- */

API_SET_PIN(set_sclk, part_ads1282, ads1282_sclk_pin);
API_SET_PIN(set_din, part_ads1282, ads1282_din_pin);
API_SET_PIN(set_sync, part_ads1282, ads1282_sync_pin);
API_SET_PIN(set_reset, part_ads1282, ads1282_reset_pin);
API_SET_PIN(set_pwdn, part_ads1282, ads1282_pwdn_pin);

/* In register mode the part does not look at them. */
static void set_mode(struct psabench_part *p, unsigned bit, bool level, int64_t t_ns)
{
    struct part_ads1282 *s = (struct part_ads1282 *)p;
    s->mode = (s->mode & ~(1u << bit)) | (unsigned)level << bit;
    const struct ads1282_mode_pins mode = {.dr = s->mode & 3,
                                           .minimum_phase = s->mode >> MODE_PHS & 1,
                                           .high_pass = s->mode >> MODE_HPF & 1,
                                           .continuous_sync = s->mode >> MODE_CSYNC & 1};
    if (s->cfg.pin_mode) ads1282_mode_pins(&s->chip, &mode, t_ns);
}

API_GET_PIN(get_drdy, part_ads1282, ads1282_drdy);
API_GET_PIN(get_dout, part_ads1282, ads1282_dout);
API_GET_PIN(get_mflag, part_ads1282, ads1282_mflag);

static bool get_modulator(const struct psabench_part *p, unsigned arg)
{
    const struct part_ads1282 *s = (const struct part_ads1282 *)p;
    return arg == 0 ? s->m0 : arg == 1 ? s->m1 : s->mclk;
}

/* The ADS1282 has the first eleven; the mode pins of an ADS1281 have their names from what they say (E0). */
static const struct api_pin pins[PINS] = {
    {"DRDY", API_OUT, .get = get_drdy},
    {"DOUT", API_OUT, .get = get_dout},
    {"SCLK", API_IN, .set = set_sclk},
    {"DIN", API_IN, .set = set_din},
    {"SYNC", API_IN, .set = set_sync},
    {"RESET", API_IN, .idle = true, .set = set_reset},
    {"PWDN", API_IN, .idle = true, .set = set_pwdn},
    {"MFLAG", API_OUT, .get = get_mflag},
    {"M0", API_OUT, .get = get_modulator, .arg = 0},
    {"M1", API_OUT, .get = get_modulator, .arg = 1},
    {"MCLK", API_OUT, .get = get_modulator, .arg = 2},
    {"DR0", API_IN, .set = set_mode, .arg = MODE_DR0},
    {"DR1", API_IN, .set = set_mode, .arg = MODE_DR1},
    {"PHS", API_IN, .set = set_mode, .arg = MODE_PHS},
    {"HPF", API_IN, .set = set_mode, .arg = MODE_HPF},
    {"CSYNC", API_IN, .set = set_mode, .arg = MODE_CSYNC},
};

/* ---- the chip ---- */

static double vin_v(void *ctx, unsigned mux, int64_t t_ns)
{
    struct psabench_part *p = ctx;
    const unsigned second = p->kind->inputs >> 1 & 1;
    if (mux == MUX_AIN1 || !second) return api_input(p, 0, t_ns);
    if (mux == MUX_AIN2) return api_input(p, 1, t_ns);
    if (mux == MUX_BOTH) return 0.5 * (api_input(p, 0, t_ns) + api_input(p, 1, t_ns)); /* equal sources: E0 */
    return 0.0;
}

/* M0 and M1 change with the rise of MCLK (E0); it falls half a period, 2 tCLK, later. */
static void on_modulator(void *ctx, bool m0, bool m1, int64_t t_ns)
{
    struct part_ads1282 *s = ctx;
    s->m0 = m0;
    s->m1 = m1;
    s->mclk = true;
    const struct clk *clk = &s->chip.clk;
    sched_at(&s->part.bench->sched, &s->mclk_fall, clk_edge_ns(clk, clk_count_at(clk, t_ns) + 2));
}

static void on_mclk_fall(void *ctx, int64_t t_ns)
{
    (void)t_ns;
    ((struct part_ads1282 *)ctx)->mclk = false;
}

static void open_ads1282(struct psabench_part *p)
{
    struct part_ads1282 *s = (struct part_ads1282 *)p;
    s->cfg.part = (enum ads1282_part)p->kind->variant;
    const struct ads1282_io io = {.ctx = p, .vin_v = vin_v, .mflag = api_ignore_edge, .modulator = on_modulator};
    sched_ev(&s->mclk_fall, on_mclk_fall, s);
    ads1282_init(&s->chip, &s->cfg, &io, &p->bench->sched, api_noise(p, "adc"));
    ads1282_power_up(&s->chip, p->bench->sched.now_ns);
}

static void before_input(struct psabench_part *p, int64_t t_ns)
{
    ads1282_sample_until(&((struct part_ads1282 *)p)->chip, t_ns);
}

static void play_bits(struct psabench_part *p, const uint8_t *bits, size_t n, bool one_bit, int64_t t_ns)
{
    const struct ads1282_recording r = {.bits = bits, .count = (int64_t)n, .one_bit = one_bit};
    ads1282_play(&((struct part_ads1282 *)p)->chip, &r, t_ns);
}

#define N(field) API_COUNTER(#field, part_ads1282, chip.count.field)
#define V(field) API_VIOLATION(#field, part_ads1282, chip.count.field)
#define L(field) API_VIOLATION("limit_" #field, part_ads1282, chip.limit.field)
#define R(field) API_COUNTER(#field, part_ads1282, chip.regs.field)
/* A SYNC pulse near an edge of CLK is chance: no violation. */
static const struct api_counter counters[] = {
    N(conversions),    N(overruns),
    V(torn_reads),     V(late_reads),
    V(bad_opcodes),    V(refused),
    V(gap_violations), N(restarts),
    N(clipped),        N(realigned),
    N(calibrations),   L(sclk_period),
    L(sclk_width),     L(din_setup),
    L(din_hold),       L(drdy_to_sclk),
    L(sync_width),     API_COUNTER("limit_sync_keepout", part_ads1282, chip.limit.sync_keepout),
    L(reset_width),    API_VIOLATION("bad_access", part_ads1282, chip.regs.bad_access),
    R(ro_write),       R(unimp_access),
    N(bits_missing),   N(range_exceeded),
};
#undef N
#undef V
#undef L
#undef R

#define COMMON                                                                                                         \
    .size = sizeof(struct part_ads1282), .pins = pins, .counters = API_ROWS(counters), .spi = API_SPI_MODE0,           \
    .open = open_ads1282, .before_input = before_input, .play_bits = play_bits,                                        \
    .regs = offsetof(struct part_ads1282, chip.regs)

const struct api_kind api_ads1281 = {COMMON,
                                     .name = "ads1281",
                                     .variant = ADS1282_PART_1281,
                                     .options = API_ROWS(options_1281),
                                     .options_text = OPTIONS_1281(API_OPTION_TEXT),
                                     .pin_count = PINS,
                                     .inputs = 0x1,
                                     .fn_inputs = 0x1};
const struct api_kind api_ads1282 = {COMMON,
                                     .name = "ads1282",
                                     .variant = ADS1282_PART_1282,
                                     .options = API_ROWS(options_1282),
                                     .options_text = OPTIONS(API_OPTION_TEXT),
                                     .pin_count = PINS_1282,
                                     .inputs = 0x3,
                                     .fn_inputs = 0x3};
