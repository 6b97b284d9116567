/* Calibrations of the ADS1256: the whole table of durations, and what they leave in OFC and FSC (sources 2.7). */
#include "ads1256_rig.h"
#include "base/bits.h"

#define FS 8388608.0

#define ALL(us)                                                                                                        \
    {                                                                                                                  \
        us, us, us, us, us                                                                                             \
    }

/* Printed durations at 7.68 MHz in us: SELFOCAL and SYSOCAL; SYSGCAL; SELFGCAL and SELFCAL at PGA 1, 2, 4, 8, 16..64; and the
 * unit of the last digit of the row. */
static const struct {
    uint8_t drate;
    double ocal, sysgcal, selfgcal[5], selfcal[5], digit;
} printed[ADS1256_RATES] = {
    {0xF0, 387, 417, {417, 417, 451, 517, 651}, {596, 596, 692, 696, 892}, 1},
    {0xE0, 453, 484, {484, 484, 484, 551, 617}, {696, 696, 696, 762, 896}, 1},
    {0xD0, 587, 617, {617, 617, 617, 617, 751}, {896, 896, 896, 896, 1029}, 1},
    {0xC0, 853, 884, ALL(884), ALL(1300), 1},
    {0xB0, 1300, 1400, ALL(1400), ALL(2000), 100},
    {0xA1, 2300, 2400, ALL(2400), ALL(3600), 100},
    {0x92, 4300, 4500, ALL(4500), ALL(6600), 100},
    {0x82, 20300, 21000, ALL(21000), ALL(31200), 100},
    {0x72, 33700, 34100, ALL(34100), ALL(50900), 100},
    {0x63, 40300, 41700, ALL(41700), ALL(61800), 100},
    {0x53, 67000, 67800, ALL(67800), ALL(101300), 100},
    {0x43, 80300, 83000, ALL(83000), ALL(123200), 100},
    {0x33, 133700, 135300, ALL(135300), ALL(202100), 100},
    {0x23, 200300, 207000, ALL(207000), ALL(307200), 100},
    {0x13, 400300, 413700, ALL(413700), ALL(613800), 100},
    {0x03, 800300, 827000, ALL(827000), ALL(1227200), 100},
};

static double printed_us(unsigned rate, unsigned gain_log2, uint8_t opcode)
{
    const unsigned column = gain_log2 < 4 ? gain_log2 : 4;
    const double us[] = {printed[rate].selfcal[column], printed[rate].ocal, printed[rate].selfgcal[column],
                         printed[rate].ocal, printed[rate].sysgcal};
    return us[opcode & 7];
}

/* From the command's last bit to the fall of DRDY, DRDY high meanwhile: 5 commands, 16 rates, 7 gains. */
static void every_calibration_lasts_as_printed(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.cells_max = 1;
    unsigned rows = 0;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        for (unsigned g = 0; g < 7; g++) {
            struct rig r;
            rig_up(&r, &cfg);
            wreg(&r, ADS1256_ADCON, (uint8_t)(0x20 | g));
            wreg(&r, ADS1256_DRATE, printed[i].drate);
            for (uint8_t opcode = 0xF0; opcode <= 0xF4; opcode++, rows++) {
                xfer(&r, opcode);
                r.edges = 0;
                assert_true(ads1256_drdy(&r.a));
                const int64_t from_ns = r.s.now_ns;
                const double us = (double)(await_fall(&r) - from_ns) * 1e-3;
                const double want_us = printed_us(i, g, opcode);
                if (fabs(us - want_us) > 0.5 * printed[i].digit + 0.2)
                    fail_msg("%02X at %02X, gain %u: %.1f us, printed %.0f", opcode, printed[i].drate, 1u << g, us,
                             want_us);
                assert_int_equal(r.edges, 1); /* nothing before the end */
            }
            assert_int_equal(r.a.n.calibrations, 6);
        }
    }
    assert_int_equal(rows, 560);
}

static void durations_scale_with_the_clock(void **state)
{
    (void)state;
    static const uint32_t clocks_hz[] = {100000, 4096000, 10000000};
    for (unsigned c = 0; c < COUNT(clocks_hz); c++) {
        for (uint8_t opcode = 0xF0; opcode <= 0xF4; opcode++) {
            struct ads1256_cfg cfg = quiet;
            cfg.clkin_hz = clocks_hz[c];
            struct rig r;
            rig_up(&r, &cfg);
            xfer(&r, opcode);
            const int64_t from_ns = r.s.now_ns;
            const double us = (double)(await_fall(&r) - from_ns) * 1e-3 * clocks_hz[c] / 7680000;
            near(us, printed_us(0, 0, opcode), 0.7);
        }
    }
}

static int32_t ofc(const struct rig *r)
{
    const uint8_t *v = r->a.value;
    const int32_t u = v[ADS1256_OFC0] | v[ADS1256_OFC1] << 8 | v[ADS1256_OFC2] << 16;
    return (u ^ 0x800000) - 0x800000;
}

static uint32_t fsc(const struct rig *r)
{
    const uint8_t *v = r->a.value;
    return v[ADS1256_FSC0] | (uint32_t)v[ADS1256_FSC1] << 8 | (uint32_t)v[ADS1256_FSC2] << 16;
}

static void calibrate(struct rig *r, uint8_t opcode)
{
    xfer(r, opcode);
    await_fall(r);
}

/* OFC is the raw of what is at the pins; the same voltage then reads zero. At every rate and gain. */
static void system_offset_calibration_stores_the_raw_of_the_pins(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.offset_v = 1e-3;
    cfg.gain_error = 0.003;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        for (unsigned g = 0; g < 7; g++) {
            struct rig r;
            rig_up(&r, &cfg);
            wreg(&r, ADS1256_ADCON, (uint8_t)(0x20 | g));
            set_rate(&r, printed[i].drate);
            const uint32_t fsc_before = fsc(&r);
            r.v[0] = 0.031;
            r.v[1] = 0.013;
            calibrate(&r, 0xF3);
            const double raw = ads1256_rates[i].alpha * 1.003 * (1 << g) * (0.018 + 1e-3) / 5.0;
            near(ofc(&r), raw, 0.5001);
            near(r.a.word, 0.0, 2.0);
            assert_int_equal(fsc(&r), fsc_before);
            assert_int_equal(r.a.n.cal_clamped, 0);
        }
    }
}

/* FSC makes full scale of what is at the pins, whatever it is; half of it then reads half. */
static void system_gain_calibration_makes_full_scale_of_the_pins(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.offset_v = -2e-3;
    cfg.gain_error = -0.01;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        for (unsigned g = 0; g < 7; g++) {
            struct rig r;
            rig_up(&r, &cfg);
            wreg(&r, ADS1256_ADCON, (uint8_t)(0x20 | g));
            set_rate(&r, printed[i].drate);
            calibrate(&r, 0xF3); /* the inputs are at 0 V: the offset of the path */
            const int32_t ofc_before = ofc(&r);
            const double full_v = 0.9 * 5.0 / (1 << g); /* a tenth less than the converter's own */
            r.v[0] = full_v;
            calibrate(&r, 0xF4);
            near(fsc(&r), ads1256_rates[i].fsc_ideal / (0.99 * 0.9), 3.0);
            near(r.a.word, FS - 1, 3.0);
            assert_int_equal(ofc(&r), ofc_before);
            r.v[0] = -0.5 * full_v;
            await_fall(&r);
            for (unsigned k = 0; k < 6; k++) await_fall(&r);
            near(r.a.word, -0.5 * FS, 4.0);
        }
    }
}

/* A wrong input gives what the arithmetic gives, and 24 bits are their limit. */
static void system_calibrations_of_a_wrong_input(void **state)
{
    (void)state;
    static const struct {
        uint8_t opcode;
        double v;
        uint32_t fsc, clamped;
        int32_t ofc;
    } rows[] = {
        {0xF4, 0.0, 0xFFFFFF, 1, 0},           /* zero for full scale */
        {0xF4, -1.0, 0x000000, 1, 0},          /* and the wrong sign */
        {0xF4, 5.0 * 0.25, 0xFFFFFF, 1, 0},    /* 4 times 44AC08h is more than 24 bits */
        {0xF4, 5.0 * 0.5, 2 * 0x44AC08, 0, 0}, /* twice is not */
        {0xF4, 10.0, 0x44AC08 / 2, 0, 0},      /* beyond full scale */
        {0xF3, 5.0, 0x44AC08, 0, 0x400000},    /* full scale for zero */
        {0xF3, -10.0, 0x44AC08, 0, -0x800000}, /* just fits */
        {0xF3, 10.1, 0x44AC08, 1, 0x7FFFFF},   /* does not */
        {0xF3, -10.1, 0x44AC08, 1, -0x800000},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        rig_up(&r, &quiet);
        r.v[0] = rows[i].v;
        calibrate(&r, rows[i].opcode);
        near(fsc(&r), rows[i].fsc, 1.0);
        assert_int_equal(ofc(&r), rows[i].ofc);
        assert_int_equal(r.a.n.cal_clamped, rows[i].clamped);
    }
}

/* What counts is the pins while it measures: not before the command, not in the settling after it. */
static void system_calibration_measures_before_it_settles(void **state)
{
    (void)state;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        struct rig r;
        rig_up(&r, &quiet);
        set_rate(&r, printed[i].drate);
        r.v[0] = -4.0;
        await_fall(&r);
        for (unsigned late = 0; late < 2; late++) {
            xfer(&r, 0xF3);
            r.v[0] = 1.0;
            const int64_t cal_ns = tau_ns(2458 + 512 * (int64_t)ads1256_rates[i].navg);
            const int64_t settle_ns = ads1256_settle_ns(&r.a);
            wait_ns(&r, cal_ns - settle_ns + (late ? -tau_ns(512 + 256 * (int64_t)ads1256_rates[i].cell_words) : 200));
            r.v[0] = -4.0; /* late: the last cell is of the other voltage */
            await_fall(&r);
            if (late) assert_true(ofc(&r) < 0.2 * ads1256_rates[i].alpha - 10);
            else near(ofc(&r), 0.2 * ads1256_rates[i].alpha, 0.51);
        }
    }
}

/* 30 seeds of both: the spread of OFC, and of FSC about full scale, is the published noise (5-sigma band of chi2). */
static void system_calibrations_carry_the_noise(void **state)
{
    (void)state;
    static const struct {
        uint8_t drate, pga;
        double rms_uv;
    } rows[] = {{0xF0, 0, 10.73}, {0xF0, 6, 1.74}, {0xA1, 3, 1.07}, {0x82, 0, 0.875}};
    enum { SEEDS = 30, RUNS = 10 };
    const uint64_t seed = rig_seed(5);
    for (unsigned i = 0; i < COUNT(rows); i++) {
        const struct ads1256_rate *rate = ads1256_rate_of(rows[i].drate);
        const double sigma = rate->alpha * (1 << rows[i].pga) * rows[i].rms_uv * 1e-6 / 5.0;
        const double with_rounding = sqrt(sigma * sigma + 1.0 / 12.0);
        double chi2[2] = {0.0, 0.0};
        for (unsigned k = 0; k < SEEDS; k++) {
            struct ads1256_cfg cfg = quiet;
            cfg.noise_scale = 1.0;
            cfg.cells_max = 1;
            struct rig r;
            rig_up_seeded(&r, &cfg, seed + k);
            wreg(&r, ADS1256_ADCON, 0x20 | rows[i].pga);
            set_rate(&r, rows[i].drate);
            for (unsigned n = 0; n < RUNS; n++) {
                r.v[0] = 0.0;
                calibrate(&r, 0xF3);
                const double error = ofc(&r) / with_rounding;
                chi2[0] += error * error;
                for (uint8_t addr = ADS1256_OFC0; addr <= ADS1256_OFC2; addr++) wreg(&r, addr, 0);
                r.v[0] = 5.0 / (1 << rows[i].pga);
                calibrate(&r, 0xF4);
                const double span = (double)rate->alpha * rate->fsc_ideal / fsc(&r);
                chi2[1] += (span - rate->alpha) * (span - rate->alpha) / (with_rounding * with_rounding);
            }
        }
        for (unsigned k = 0; k < 2; k++) near(chi2[k], SEEDS * RUNS, 5.0 * sqrt(2.0 * SEEDS * RUNS));
    }
}

struct spread {
    double ofc, fsc, correlation; /* standard deviations in counts; of OFC with FSC */
};

enum { CALIBRATIONS = 400 };

static struct spread spread_of(uint8_t opcode, uint8_t drate, uint8_t pga_code)
{
    static struct rig r;
    struct ads1256_cfg cfg = quiet;
    cfg.noise_scale = 1.0;
    cfg.cells_max = 1;
    rig_up(&r, &cfg);
    wreg(&r, ADS1256_ADCON, (uint8_t)(0x20 | pga_code));
    set_rate(&r, drate);
    double sum[2] = {0}, square[3] = {0};
    const double usual = reg_peek24(&r.a.regs, ADS1256_FSC0);
    for (int i = 0; i < CALIBRATIONS; i++) {
        r.edges = 0;
        command(&r, opcode);
        await_fall(&r);
        const double x[2] = {bits_sign_extend(reg_peek24(&r.a.regs, ADS1256_OFC0), 24),
                             reg_peek24(&r.a.regs, ADS1256_FSC0) - usual};
        for (int k = 0; k < 2; k++) sum[k] += x[k] / CALIBRATIONS;
        square[0] += x[0] * x[0] / CALIBRATIONS, square[1] += x[1] * x[1] / CALIBRATIONS;
        square[2] += x[0] * x[1] / CALIBRATIONS;
    }
    const double ofc = sqrt(fmax(square[0] - sum[0] * sum[0], 0.0)), fsc = sqrt(fmax(square[1] - sum[1] * sum[1], 0.0));
    const double both = (square[2] - sum[0] * sum[1]) / (ofc * fsc);
    return (struct spread){ofc, fsc, ofc > 0.0 && fsc > 0.0 ? both : 0.0};
}

/* Self-calibration measures zero at its own gain and VREF at gain 1 or 2; FSC has the noise of both. Published noise at
 * VREF 2.5 V, in uV: at the gain, at gain 1 or 2. */
static void self_calibrations_have_the_noise_of_what_they_measure(void **state)
{
    (void)state;
    static const struct {
        uint8_t drate, pga_code;
        double alpha, fsc, zero_uv, vref_uv;
    } rows[] = {{0xF0, 0, 0x400000, 0x44AC08, 10.73, 10.73}, {0xF0, 1, 0x400000, 0x44AC08, 6.71, 6.71},
                {0xF0, 3, 0x400000, 0x44AC08, 3.28, 6.71},   {0xF0, 6, 0x400000, 0x44AC08, 1.74, 6.71},
                {0xA1, 0, 0x3C0000, 0x494008, 2.93, 2.93},   {0xA1, 2, 0x3C0000, 0x494008, 1.33, 1.89}};
    const double tolerance = 5.0 / sqrt(2.0 * CALIBRATIONS); /* five standard deviations of one */
    for (unsigned k = 0; k < COUNT(rows); k++) {
        const double gain = 1 << rows[k].pga_code, vref_gain = gain > 1.0 ? 2.0 : 1.0;
        const double zero_fs = gain * rows[k].zero_uv * 1e-6 / 5.0, vref_fs = vref_gain * rows[k].vref_uv * 1e-6 / 5.0;
        const double span_fs = vref_gain / 2.0;
        const struct spread both = spread_of(0xF0, rows[k].drate, rows[k].pga_code);
        const double fsc = rows[k].fsc * hypot(zero_fs, vref_fs) / span_fs;
        near(both.ofc / (rows[k].alpha * zero_fs), 1.0, tolerance);
        near(both.fsc / fsc, 1.0, tolerance);
        near(both.correlation, zero_fs / hypot(zero_fs, vref_fs), 0.15);
        const struct spread gain_alone = spread_of(0xF2, rows[k].drate, rows[k].pga_code);
        near(gain_alone.fsc / (rows[k].fsc * vref_fs / span_fs), 1.0, tolerance);
        near(gain_alone.ofc, 0.0, 0.01);
        near(spread_of(0xF1, rows[k].drate, rows[k].pga_code).fsc, 0.0, 0.01);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_calibration_lasts_as_printed),
        cmocka_unit_test(durations_scale_with_the_clock),
        cmocka_unit_test(system_offset_calibration_stores_the_raw_of_the_pins),
        cmocka_unit_test(system_gain_calibration_makes_full_scale_of_the_pins),
        cmocka_unit_test(system_calibrations_of_a_wrong_input),
        cmocka_unit_test(system_calibration_measures_before_it_settles),
        cmocka_unit_test(system_calibrations_carry_the_noise),
        cmocka_unit_test(self_calibrations_have_the_noise_of_what_they_measure),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
