/* Settling of the ADS1256 with and without synchronisation, at all sixteen rates (sources 2.2, 2.6). */
#include "ads1256_rig.h"

#define FS 8388608.0

/* DRATE and the printed column "settling without synchronisation", in DRDY periods. */
static const struct {
    uint8_t drate;
    unsigned periods;
} column[ADS1256_RATES] = {{0xF0, 5}, {0xE0, 3}, {0xD0, 2}, {0xC0, 1}, {0xB0, 1}, {0xA1, 1}, {0x92, 1}, {0x82, 1},
                           {0x72, 1}, {0x63, 1}, {0x53, 1}, {0x43, 1}, {0x33, 1}, {0x23, 1}, {0x13, 1}, {0x03, 1}};

/* The column is the whole part of (Navg + 4) / Navg, the length of sinc5 and mean in periods. */
static void column_is_the_length_of_the_filter(void **state)
{
    (void)state;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        assert_int_equal(column[i].drate, ads1256_rates[i].code);
        assert_int_equal(column[i].periods, (ads1256_rates[i].navg + 4u) / ads1256_rates[i].navg);
    }
}

/* T18 at all rates from the slowest to the fastest clock, to one clock and one nanosecond; printed at 7.68 MHz. */
static void t18_at_every_rate_and_clock(void **state)
{
    (void)state;
    static const uint32_t clocks_hz[] = {100000, 1000000, 4096000, 7372800, 7680000, 10000000};
    for (unsigned c = 0; c < COUNT(clocks_hz); c++) {
        for (unsigned i = 0; i < ADS1256_RATES; i++) {
            struct ads1256_cfg cfg = quiet;
            cfg.clkin_hz = clocks_hz[c];
            cfg.cells_max = 1;
            struct rig r;
            rig_up(&r, &cfg);
            wreg(&r, ADS1256_DRATE, column[i].drate);
            command(&r, 0xFC);
            wait_ns(&r, 24 * 10000);
            const int64_t first_ns = r.s.now_ns + FIRST_NS;
            xfer(&r, 0x00);
            const double tau = 1e9 / clocks_hz[c];
            const double t18_ns = (double)(await_fall(&r) - first_ns);
            near(t18_ns, (1382 + 256.0 * ads1256_rates[i].navg) * tau + 0.5 * tau, 0.5 * tau + 1.0);
            const int64_t from_ns = r.s.now_ns;
            near((double)(await_fall(&r) - from_ns), 256.0 * ads1256_rates[i].navg * tau, 1.0);
        }
    }
}

/* SBAS288 p. 21, table 14: conversions a second while cycling the multiplexer, 1/(t18 + 118 tau of commands). One constant
 * for sixteen rows, four digits: 1382 tau and 256 Navg cannot be far off. */
static void throughput_of_cycling_is_the_printed_one(void **state)
{
    (void)state;
    static const double printed_hz[ADS1256_RATES] = {4374, 3817, 3043, 2165, 1438, 837, 456, 98,
                                                     59,   50,   30,   25,   15,   10,  5,   2.5};
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        const double hz = 7.68e6 / (double)(ads1256_settle_tau(&ads1256_rates[i]) + 118);
        near(hz, printed_hz[i], 0.51);
    }
}

enum change { MUX, PGA, BUFEN, INPUT, RATE_AND_INPUT, CHANGES };

static const char *const change_name[] = {"MUX", "PGA", "BUFEN", "input", "DRATE and input"};

/* A chip at rest on a rate, just after a DRDY: AIN0 at 3.5 V, AIN2 at 1 V, AIN1 at 0 V. */
static void rest(struct rig *r, uint8_t drate)
{
    rig_up(r, &quiet);
    r->v[0] = 1.75;
    r->v[2] = 1.0;
    set_rate(r, drate);
    for (unsigned k = 0; k < 6; k++) await_fall(r);
}

static void make_change(struct rig *r, enum change what)
{
    switch (what) {
    case MUX:
        wreg(r, ADS1256_MUX, 0x21);
        break;
    case PGA:
        wreg(r, ADS1256_ADCON, 0x21);
        break;
    case BUFEN:
        wreg(r, ADS1256_STATUS, 0x02);
        break;
    case INPUT:
    case RATE_AND_INPUT:
    case CHANGES:
        r->v[0] = 1.0;
        break;
    }
}

/* Number of the first settled word after a change, counted in falls of DRDY; *first: what is left of the step in the first
 * one, as a fraction. */
static unsigned words_to_settle(struct rig *r, double from, double to, double *first)
{
    unsigned settled = 0;
    for (unsigned k = 1; k <= 9; k++) {
        await_fall(r);
        if (k == 1) *first = (r->a.word - to) / (from - to);
        if (fabs(r->a.word - to) > 6.0) settled = 0;
        else if (!settled) settled = k;
    }
    return settled;
}

static double settled_code(enum change what)
{
    switch (what) {
    case PGA:
        return 2 * 1.75 / 5.0 * FS;
    case BUFEN:
        return 3.0 / 5.0 * FS; /* of 3.5 V, see below */
    case MUX:
    case INPUT:
    case RATE_AND_INPUT:
    case CHANGES:
        break;
    }
    return 1.0 / 5.0 * FS;
}

/* A change right at a DRDY: the words of the printed column settle where sinc5 and mean are whole periods (Navg 1, 2, 4). With
 * Navg of 8 and more four words of the sinc5 still mix into the first mean: 2/Navg of the step is left in it. Where the model
 * takes the sinc5 as flat (Navg 300 and more, 0.7 % and less) nothing is left. */
static void change_at_a_drdy_settles_as_the_column_says(void **state)
{
    (void)state;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        for (unsigned what = MUX; what <= INPUT; what++) {
            struct rig r;
            rest(&r, column[i].drate);
            const bool buffer = what == BUFEN;
            if (buffer) {
                r.v[0] = 3.5;
                for (unsigned k = 0; k < 6; k++) await_fall(&r);
            }
            make_change(&r, (enum change)what);
            double first = 0.0;
            const double from = (buffer ? 3.5 : 1.75) / 5.0 * FS;
            const unsigned words = words_to_settle(&r, from, settled_code((enum change)what), &first);
            const unsigned navg = ads1256_rates[i].navg;
            const unsigned want = column[i].periods + (navg >= 8 && navg <= 60);
            if (words != want) fail_msg("%02X, %s: %u words", column[i].drate, change_name[what], words);
            if (navg >= 8) near(first, navg <= 60 ? 2.0 / navg : 0.0, 1e-4);
        }
    }
}

/* A change inside a period needs one more, at every rate. */
static void change_inside_a_period_needs_one_more(void **state)
{
    (void)state;
    for (unsigned i = 0; i < ADS1256_RATES; i++) {
        struct rig r;
        rest(&r, column[i].drate);
        const int64_t period_ns = tau_ns(256 * (int64_t)ads1256_rates[i].navg);
        wait_ns(&r, ads1256_rates[i].navg < 8 ? period_ns * 6 / 10 : period_ns * 45 / 100);
        r.v[0] = 1.0;
        double first = 0.0;
        const unsigned words = words_to_settle(&r, 0.35 * FS, 0.2 * FS, &first);
        if (words != column[i].periods + 1) fail_msg("%02X: %u words", column[i].drate, words);
        assert_true(first > 0.1 && first < 1.00001); /* at 30 kSPS the look of the period has been */
    }
}

/* DRATE without SYNC, all 256 pairs: the running period ends at its old length, the next have the new one. The sinc5 runs on:
 * with an input at rest every word is settled, with a step at the change the column of the new rate holds. */
static void rate_change_follows_the_column_of_the_new_rate(void **state)
{
    (void)state;
    for (unsigned from = 0; from < ADS1256_RATES; from++) {
        for (unsigned to = 0; to < ADS1256_RATES; to++) {
            if (from == to) continue;
            for (unsigned step = 0; step < 2; step++) {
                struct rig r;
                rest(&r, column[from].drate);
                int64_t t_ns = r.s.now_ns;
                wreg(&r, ADS1256_DRATE, column[to].drate);
                const int64_t old_ns = tau_ns(256 * (int64_t)ads1256_rates[from].navg);
                const int64_t new_ns = tau_ns(256 * (int64_t)ads1256_rates[to].navg);
                near((double)(await_fall(&r) - t_ns), (double)old_ns, 1.0);
                if (step) r.v[0] = 1.0;
                const double ratio = (double)ads1256_rates[to].alpha / ads1256_rates[from].alpha; /* FSC is kept */
                unsigned settled = 0;
                double first = 0.0;
                for (unsigned k = 1; k <= 7 && (k < 4 || new_ns < 1000000); k++) {
                    t_ns = r.s.now_ns;
                    near((double)(await_fall(&r) - t_ns), (double)new_ns, 1.0);
                    if (k == 1) first = (r.a.word / (ratio * FS) - 0.2) / 0.15;
                    if (!settled && fabs(r.a.word - (step ? 0.2 : 0.35) * ratio * FS) <= 6.0) settled = k;
                }
                const unsigned navg = ads1256_rates[to].navg;
                const unsigned want = step ? column[to].periods + (navg >= 8 && navg <= 60) : 1;
                if (step && navg >= 8 && navg <= 30) near(first, 2.0 / navg, 1e-4);
                if (settled != want)
                    fail_msg("%02X to %02X: %u, want %u", column[from].drate, column[to].drate, settled, want);
            }
        }
    }
}

static double ramp_v(void *ctx, unsigned ain, int64_t t_ns)
{
    (void)ctx;
    return ain == 0 ? 10.0 * (double)t_ns * 1e-9 : 0.0;
}

/* A ramp through a change between rates whose sinc5 is computed: the first word already lags as the filter does. */
static void sinc5_keeps_its_history_through_a_rate_change(void **state)
{
    (void)state;
    for (unsigned from = 0; from < 6; from++) {
        for (unsigned to = 0; to < 6; to++) {
            if (from == to) continue;
            struct rig r;
            power_up_io(&r, &quiet, (struct ads1256_io){.ain_v = ramp_v, .drdy = on_drdy}, 1);
            await_fall(&r);
            set_rate(&r, column[from].drate);
            for (unsigned k = 0; k < 6; k++) await_fall(&r);
            wreg(&r, ADS1256_DRATE, column[to].drate);
            await_fall(&r);
            const double ratio = (double)ads1256_rates[to].alpha / ads1256_rates[from].alpha;
            for (unsigned k = 0; k < 3; k++) {
                const double lag_ns = (ads1256_rates[to].navg + 4) * 128e9 / 7680000;
                const double seen_v = 10e-9 * ((double)await_fall(&r) - lag_ns);
                near(r.a.word, seen_v / 5.0 * ratio * FS, 12.0); /* cells lie on whole ns, and FSC has 22 bits */
            }
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(column_is_the_length_of_the_filter),
        cmocka_unit_test(t18_at_every_rate_and_clock),
        cmocka_unit_test(throughput_of_cycling_is_the_printed_one),
        cmocka_unit_test(change_at_a_drdy_settles_as_the_column_says),
        cmocka_unit_test(change_inside_a_period_needs_one_more),
        cmocka_unit_test(rate_change_follows_the_column_of_the_new_rate),
        cmocka_unit_test(sinc5_keeps_its_history_through_a_rate_change),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
