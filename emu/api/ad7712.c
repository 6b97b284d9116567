#include "api/internal.h"

#include "chip/ad7712/ad7712.h"

#include <stdio.h>

struct part_ad7712 {
    struct psabench_part part;
    struct ad7712_cfg cfg; /* of the options; its channels are alike */
    unsigned looks;        /* place in the list of cells_max */
    struct ad7712 chip;
};

static const struct ad7712 *const_chip_of(const struct psabench_part *p)
{
    return &((const struct part_ad7712 *)p)->chip;
}

#define OPTIONS(X)                                                                                                     \
    X("clkin_hz", API_UINT, part_ad7712, cfg.clkin_hz, "10000000", 400000, 10000000, NULL, "clock at MCLK IN, Hz")     \
    X("vref_v", API_REAL, part_ad7712, cfg.vref_v, "2.5", 0.5, 5, NULL,                                                \
      "REF IN(+) - REF IN(-), V; full scale at gain 1")                                                                \
    X("noise_scale", API_REAL, part_ad7712, cfg.noise_scale, "1", 0, 1000, NULL, "noise, 1: published, 0: none")       \
    X("offset_v", API_REAL, part_ad7712, cfg.offset_v[0], "0", -1, 1, NULL,                                            \
      "offset of the uncalibrated path, V, which self-calibration takes away")                                         \
    X("gain_error", API_REAL, part_ad7712, cfg.gain_error[0], "0", -0.5, 0.5, NULL,                                    \
      "relative gain error of the uncalibrated path, which self-calibration removes")                                  \
    X("source_ohm", API_REAL, part_ad7712, part.source_ohm, "0", 0, 1e9, NULL,                                         \
      "resistance behind each input, ohm: the input's capacitor and the burn-out current meet it")                     \
    X("looks", API_CHOICE, part_ad7712, looks, "auto", 0, 7, "auto|1|2|4|8|16|32|64",                                  \
      "looks at the input per output period; auto: as many as make 4 kHz, at least 4")                                 \
    X("rfs_access_ns", API_UINT, part_ad7712, cfg.rfs_access_ns, "0", 0, 10000, NULL,                                  \
      "RFS low to the first bit, ns; 0: 3 periods of MCLK")                                                            \
    X("bit_access_ns", API_UINT, part_ad7712, cfg.bit_access_ns, "0", 0, 10000, NULL,                                  \
      "SCLK fall to the next bit, ns; 0: 1 period of MCLK")                                                            \
    X("drdy_rise_ns", API_UINT, part_ad7712, cfg.drdy_rise_ns, "0", 0, 10000, NULL,                                    \
      "last SCLK fall to DRDY high, ns; 0: 1 period of MCLK")                                                          \
    X("strict_timing", API_BOOL, part_ad7712, cfg.strict_timing, "0", 0, 1, NULL,                                      \
      "breaches of the limits garble words and lose writes, not only count")                                           \
    X("strict_drdy", API_BOOL, part_ad7712, cfg.strict_drdy, "0", 0, 1, NULL,                                          \
      "a word read while DRDY is high reads as ones, not as the old word")                                             \
    X("free_settling", API_BOOL, part_ad7712, cfg.free_settling, "0", 0, 1, NULL,                                      \
      "a new channel or gain does not restart the filter")

static const struct api_option options[] = {OPTIONS(API_OPTION_ROW)};

/* ---- pins ---- */

API_SET_PIN(set_sdata, part_ad7712, ad7712_sdata_pin);
API_SET_PIN(set_sclk, part_ad7712, ad7712_sclk_pin);
API_SET_PIN(set_a0, part_ad7712, ad7712_a0_pin);
API_SET_PIN(set_rfs, part_ad7712, ad7712_rfs_pin);
API_SET_PIN(set_tfs, part_ad7712, ad7712_tfs_pin);
API_SET_PIN(set_mode, part_ad7712, ad7712_mode_pin);
API_SET_PIN(set_sync, part_ad7712, ad7712_sync_pin);
API_SET_PIN(set_standby, part_ad7712, ad7712_standby_pin);
API_GET_PIN(get_drdy, part_ad7712, ad7712_drdy);

/* Levels on the wires: of the side that drives them. */
static bool get_sdata(const struct psabench_part *p, unsigned arg)
{
    (void)arg;
    const int64_t now_ns = p->bench->sched.now_ns;
    return ad7712_sdata_driven(const_chip_of(p), now_ns) ? ad7712_sdata(const_chip_of(p), now_ns)
                                                         : const_chip_of(p)->port.sdata;
}

static bool get_sclk(const struct psabench_part *p, unsigned arg)
{
    (void)arg;
    return const_chip_of(p)->port.mode ? ad7712_sclk(const_chip_of(p)) : const_chip_of(p)->port.sclk;
}

static const struct api_pin pins[] = {
    {"DRDY", API_OUT, .get = get_drdy},
    {"SDATA", API_BOTH, .set = set_sdata, .get = get_sdata},
    {"SCLK", API_BOTH, .set = set_sclk, .get = get_sclk},
    {"A0", API_IN, .set = set_a0},
    {"RFS", API_IN, .idle = true, .set = set_rfs},
    {"TFS", API_IN, .idle = true, .set = set_tfs},
    {"MODE", API_IN, .set = set_mode},
    {"SYNC", API_IN, .idle = true, .set = set_sync},
    {"STANDBY", API_IN, .idle = true, .set = set_standby},
};

/* ---- the chip ---- */

/* Inputs 2 * channel and, where the part has it, the one after it; VBIAS is 0 V. */
static double vin_v(void *ctx, unsigned channel, int64_t t_ns)
{
    struct psabench_part *p = ctx;
    const double v = api_input(p, 2 * channel, t_ns);
    return p->kind->inputs >> (2 * channel + 1) & 1 ? v - api_input(p, 2 * channel + 1, t_ns) : v;
}

static void open_ad7712(struct psabench_part *p)
{
    struct part_ad7712 *s = (struct part_ad7712 *)p;
    s->cfg.part = (enum ad7712_part)p->kind->variant;
    s->cfg.cells_max = (uint8_t)(s->looks ? 1u << (s->looks - 1) : 0);
    s->cfg.offset_v[1] = s->cfg.offset_v[0];
    s->cfg.gain_error[1] = s->cfg.gain_error[0];
    const struct ad7712_io io = {.ctx = p,
                                 .vin_v = vin_v,
                                 .source_ohm = api_source(p),
                                 .drdy = api_ignore_edge,
                                 .sdata = api_ignore_edge,
                                 .sclk = api_ignore_edge};
    ad7712_init(&s->chip, &s->cfg, &io, &p->bench->sched, api_noise(p, "adc"));
    ad7712_power_up(&s->chip, p->bench->sched.now_ns);
}

static void before_input(struct psabench_part *p, int64_t t_ns)
{
    ad7712_sample_until(&((struct part_ad7712 *)p)->chip, t_ns);
}

static int peek_register(const struct psabench_part *p, unsigned address)
{
    const struct ad7712 *a = const_chip_of(p);
    const uint32_t word[] = {a->control, a->zero[0], a->full[0], a->zero[1], a->full[1], a->word};
    if (address >= 3 * sizeof word / sizeof *word) return -1;
    return (int)(word[address / 3] >> (16 - 8 * (address % 3)) & 0xFF);
}

static uint64_t sampling_hz(const struct psabench_part *p)
{
    return ad7712_sampling_hz(const_chip_of(p));
}

static uint64_t iout_na(const struct psabench_part *p)
{
    return (uint64_t)(ad7712_iout_a(const_chip_of(p)) * 1e9 + 0.5);
}

#define N(field) API_COUNTER(#field, part_ad7712, chip.n.field)
#define V(field) API_VIOLATION(#field, part_ad7712, chip.n.field)
#define G        API_COUNTER_GET
static const struct api_counter counters[] = {
    N(conversions),     N(calibrations),     N(restarts),         N(power_downs),   N(overruns),
    N(lost_words),      V(torn_reads),       V(stale_reads),      V(blocked_reads), V(over_reads),
    V(dropped),         V(refused),          V(over_writes),      N(clipped),       N(overloads),
    N(cal_clamped),     V(bad_fs),           V(bad_channel),      N(bad_bit),       V(a0_violations),
    V(sclk_violations), V(sdata_violations), V(frame_violations), G(sampling_hz),   G(iout_na),
};
#undef N
#undef V
#undef G

#define COMMON                                                                                                         \
    .size = sizeof(struct part_ad7712), .options = API_ROWS(options), .options_text = OPTIONS(API_OPTION_TEXT),        \
    .pins = API_ROWS(pins), .counters = API_ROWS(counters), .spi = API_NO_SPI, .open = open_ad7712,                    \
    .before_input = before_input, .peek = peek_register

const struct api_kind api_ad7710 = {COMMON, .name = "ad7710", .variant = AD7712_PART_7710, .inputs = 0xF,
                                    .fn_inputs = 0xF};
const struct api_kind api_ad7711 = {COMMON, .name = "ad7711", .variant = AD7712_PART_7711, .inputs = 0x7,
                                    .fn_inputs = 0x7};
const struct api_kind api_ad7711a = {COMMON, .name = "ad7711a", .variant = AD7712_PART_7711A, .inputs = 0x3,
                                     .fn_inputs = 0x3};
const struct api_kind api_ad7712 = {COMMON, .name = "ad7712", .variant = AD7712_PART_7712, .inputs = 0x7,
                                    .fn_inputs = 0x7};
