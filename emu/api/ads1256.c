#include "api/internal.h"

#include "chip/ads1256/ads1256.h"

#include <stdio.h>

enum { PINS_1255 = 9, PINS = 11 };

struct part_ads1256 {
    struct psabench_part part;
    struct ads1256_cfg cfg; /* of the options */
    uint32_t cells_max;
    struct ads1256 chip;
};

static const struct ads1256 *const_chip_of(const struct psabench_part *p)
{
    return &((const struct part_ads1256 *)p)->chip;
}

#define OPTIONS(X)                                                                                                     \
    X("clkin_hz", API_UINT, part_ads1256, cfg.clkin_hz, "7680000", 100000, 10000000, NULL, "clock at CLKIN, Hz")       \
    X("start", API_CHOICE, part_ads1256, cfg.start, "clock", 0, 2, "at_once|clock|crystal",                            \
      "what power-up and the end of power-down wait for: nothing, 8192 periods of a clock, 30 ms of a crystal")        \
    X("sclk_hz", API_UINT, part_ads1256, part.sclk_hz, "1000000", 1, 50000000, NULL, "SCLK of psabench_spi(), Hz")     \
    X("vref_v", API_REAL, part_ads1256, cfg.vref_v, "2.5", 0.5, 5.5, NULL,                                             \
      "VREFP - VREFN, V; full scale is twice this")                                                                    \
    X("avdd_v", API_REAL, part_ads1256, cfg.avdd_v, "5", 3, 6, NULL, "analog supply, V; the buffer passes AVDD - 2 V") \
    X("noise_scale", API_REAL, part_ads1256, cfg.noise_scale, "1", 0, 1000, NULL, "noise, 1: published, 0: none")      \
    X("offset_v", API_REAL, part_ads1256, cfg.offset_v, "0", -1, 1, NULL,                                              \
      "offset of the uncalibrated path, V, which self-calibration takes away")                                         \
    X("gain_error", API_REAL, part_ads1256, cfg.gain_error, "0", -0.5, 0.5, NULL,                                      \
      "relative gain error of the uncalibrated path, which self-calibration removes")                                  \
    X("source_ohm", API_REAL, part_ads1256, part.source_ohm, "0", 0, 1e9, NULL,                                        \
      "resistance behind each input, ohm: sensor-detect currents meet it, an input without buffer loads it")           \
    X("cells_max", API_UINT, part_ads1256, cells_max, "0", 0, 65535, NULL,                                             \
      "looks at the input per conversion at 500 SPS and below; 0: one a millisecond")                                  \
    X("every_word", API_BOOL, part_ads1256, cfg.every_word, "0", 0, 1, NULL,                                           \
      "a look at the input for each word of the sinc5, 256 periods of CLKIN, at 500 SPS and below too")                \
    X("strict_timing", API_BOOL, part_ads1256, cfg.strict_timing, "0", 0, 1, NULL,                                     \
      "a data read inside t6 of its command gives FFh")                                                                \
    X("strict_bus", API_BOOL, part_ads1256, cfg.strict_bus, "0", 0, 1, NULL,                                           \
      "other breaches of timing do what silicon may do, not only count")                                               \
    X("sync_halts", API_BOOL, part_ads1256, cfg.sync_halts, "0", 0, 1, NULL,                                           \
      "the SYNC command halts the conversion, DRDY is high until WAKEUP")                                              \
    X("strict_cs", API_BOOL, part_ads1256, cfg.strict_cs, "0", 0, 1, NULL, "CS high ends RDATAC")

static const struct api_option options[] = {OPTIONS(API_OPTION_ROW)};

/* ---- pins ---- */

API_SET_PIN(set_cs, part_ads1256, ads1256_cs_pin);
API_SET_PIN(set_sclk, part_ads1256, ads1256_sclk_pin);
API_SET_PIN(set_din, part_ads1256, ads1256_din_pin);
API_SET_PIN(set_sync, part_ads1256, ads1256_sync_pin);
API_SET_PIN(set_reset, part_ads1256, ads1256_reset_pin);

static void set_gpio(struct psabench_part *p, unsigned d, bool level, int64_t t_ns)
{
    ads1256_gpio_pin(&((struct part_ads1256 *)p)->chip, d, level, t_ns);
}

API_GET_PIN(get_drdy, part_ads1256, ads1256_drdy);
API_GET_PIN(get_dout, part_ads1256, ads1256_dout);

/* D0 as CLKOUT is drawn low: its edges are no events (counter clkout_hz). */
static bool get_gpio(const struct psabench_part *p, unsigned d)
{
    return !(d == 0 && ads1256_clkout_hz(const_chip_of(p))) && ads1256_gpio(const_chip_of(p), d);
}

/* The ADS1255 has the first nine. */
static const struct api_pin pins[PINS] = {
    {"DRDY", API_OUT, .get = get_drdy},
    {"DOUT", API_OUT, .get = get_dout},
    {"SCLK", API_IN, .set = set_sclk},
    {"DIN", API_IN, .set = set_din},
    {"CS", API_IN, .idle = true, .set = set_cs},
    {"SYNC", API_IN, .idle = true, .set = set_sync},
    {"RESET", API_IN, .idle = true, .set = set_reset},
    {"D0", API_BOTH, .set = set_gpio, .get = get_gpio, .arg = 0},
    {"D1", API_BOTH, .set = set_gpio, .get = get_gpio, .arg = 1},
    {"D2", API_BOTH, .set = set_gpio, .get = get_gpio, .arg = 2},
    {"D3", API_BOTH, .set = set_gpio, .get = get_gpio, .arg = 3},
};

/* ---- the chip ---- */

static double ain_v(void *ctx, unsigned ain, int64_t t_ns)
{
    struct psabench_part *p = ctx;
    return p->kind->inputs >> ain & 1 ? api_input(p, ain, t_ns) : 0.0;
}

static void open_ads1256(struct psabench_part *p)
{
    struct part_ads1256 *s = (struct part_ads1256 *)p;
    s->cfg.part = (enum ads1256_part)p->kind->variant;
    s->cfg.cells_max = (uint16_t)s->cells_max;
    const struct ads1256_io io = {.ctx = p, .ain_v = ain_v, .source_ohm = api_source(p)};
    ads1256_init(&s->chip, &s->cfg, &io, &p->bench->sched, api_noise(p, "adc"));
    ads1256_power_up(&s->chip, p->bench->sched.now_ns);
}

static uint64_t clkout_hz(const struct psabench_part *p)
{
    return ads1256_clkout_hz(const_chip_of(p));
}

#define N(field) API_COUNTER(#field, part_ads1256, chip.n.field)
#define G        API_COUNTER_GET
#define R(field) API_COUNTER(#field, part_ads1256, chip.regs.field)
#define V(field) API_VIOLATION(#field, part_ads1256, chip.n.field)
static const struct api_counter counters[] = {
    N(conversions),    N(calibrations),
    N(restarts),       N(power_downs),
    N(overruns),       V(torn_reads),
    V(window_reads),   N(clipped),
    N(buffer_clipped), N(range_exceeded),
    V(bad_mux),        N(cal_clamped),
    V(bad_opcodes),    V(refused),
    V(bad_drate),      N(dropped),
    V(gap_violations), V(sclk_violations),
    V(din_violations), API_VIOLATION("bad_access", part_ads1256, chip.regs.bad_access),
    R(ro_write),       R(unimp_access),
    G(clkout_hz),
};
#undef N
#undef G
#undef R
#undef V

#define COMMON                                                                                                         \
    .size = sizeof(struct part_ads1256), .options = API_ROWS(options), .options_text = OPTIONS(API_OPTION_TEXT),       \
    .pins = pins, .counters = API_ROWS(counters), .spi = API_SPI_MODE1, .open = open_ads1256,                          \
    .regs = offsetof(struct part_ads1256, chip.regs)

const struct api_kind api_ads1255 = {
    COMMON,          .name = "ads1255", .variant = ADS1256_PART_1255, .pin_count = PINS_1255,
    .inputs = 0x103, .fn_inputs = 0x103};
const struct api_kind api_ads1256 = {
    COMMON, .name = "ads1256", .variant = ADS1256_PART_1256, .pin_count = PINS, .inputs = 0x1FF, .fn_inputs = 0x1FF};
