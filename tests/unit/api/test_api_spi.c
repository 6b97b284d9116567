/* libpsabench: psabench_spi() against the same edges set pin by pin, and its edges in the recording. */
#include "api_rig.h"

#include "base/rng.h"

static const struct {
    const char *kind, *options;
    bool mode1, cs;
} chips[] = {
    {"ads1281", "power_up_tclk=0", false, false},
    {"ads1282", "power_up_tclk=0", false, false},
    {"ads1255", "start=at_once", true, true},
    {"ads1256", "start=at_once strict_timing=1", true, true},
};

/* Edge of SCLK: byte i, half period h of its sixteen. */
static int64_t edge_ns(int64_t t0_ns, uint32_t hz, int64_t gap_ns, size_t i, int h)
{
    const int64_t halves = 16 * (int64_t)i + h;
    return t0_ns + (int64_t)i * gap_ns + halves / (2 * hz) * S + halves % (2 * hz) * S / (2 * hz);
}

/* A bus master of the test's own, on psabench_set() and psabench_get(). */
static void spi_by_pins(psabench_part *p, bool mode1, uint32_t hz, int64_t gap_ns, const uint8_t *tx, uint8_t *rx,
                        size_t n)
{
    psabench *b = psabench_of(p);
    const int64_t t0_ns = psabench_now_ns(b);
    for (size_t i = 0; i < n; i++)
        for (int bit = 0; bit < 8; bit++) {
            const int mosi = tx[i] >> (7 - bit) & 1;
            good(b, psabench_run_until(b, edge_ns(t0_ns, hz, gap_ns, i, 2 * bit)));
            if (!mode1) set(p, "DIN", mosi);
            good(b, psabench_run_until(b, edge_ns(t0_ns, hz, gap_ns, i, 2 * bit + 1)));
            if (!mode1) rx[i] = (uint8_t)(rx[i] << 1 | get(p, "DOUT"));
            set(p, "SCLK", 1);
            if (mode1) set(p, "DIN", mosi);
            good(b, psabench_run_until(b, edge_ns(t0_ns, hz, gap_ns, i, 2 * bit + 2)));
            if (mode1) rx[i] = (uint8_t)(rx[i] << 1 | get(p, "DOUT"));
            set(p, "SCLK", 0);
        }
}

static void assert_same_state(const psabench_part *a, const psabench_part *b)
{
    uint64_t value_a;
    uint64_t value_b;
    const char *name;
    assert_true(psabench_now_ns(psabench_of(a)) == psabench_now_ns(psabench_of(b)));
    for (int i = 0; (name = psabench_counter(a, i, &value_a)); i++) {
        (void)psabench_counter(b, i, &value_b);
        if (value_a != value_b) fail_msg("%s: %" PRIu64 " and %" PRIu64, name, value_a, value_b);
    }
    for (int i = 0; psabench_pin_name(a, i); i++)
        if (psabench_get(a, i) != psabench_get(b, i)) fail_msg("pin %s differs", psabench_pin_name(a, i));
    for (unsigned i = 0; i < 11; i++) assert_int_equal(psabench_peek(a, i), psabench_peek(b, i));
}

/* Bytes of which many are commands: RDATA, RDATAC, SDATAC, RREG, WREG, SYNC, WAKEUP, RESET of either family. */
static uint8_t likely_byte(struct rng *r)
{
    static const uint8_t some[] = {0x00, 0x01, 0x03, 0x04, 0x06, 0x0F, 0x10, 0x11, 0x12, 0x21, 0x41, 0x45, 0x50,
                                   0x53, 0x55, 0x82, 0xC0, 0xF0, 0xF1, 0xFC, 0xFE, 0xFF, 0x56, 0x4A, 0x2A, 0x1A};
    const uint64_t u = rng_u64(r);
    return u & 0x300 ? some[(u >> 16) % sizeof some] : (uint8_t)u;
}

static void other_pins(struct rng *r, psabench_part *two[2], bool cs)
{
    static const char *const names[] = {"CS", "CS", "SYNC", "RESET"};
    const char *name = names[rng_u64(r) % COUNT(names)];
    const int level = (int)(rng_u64(r) & 1);
    if (!cs && strcmp(name, "CS") == 0) return;
    for (int i = 0; i < 2; i++) set(two[i], name, level);
}

static void random_bytes_do_the_same_by_bytes_and_by_pins(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(3), 0, "spi");
    for (size_t c = 0; c < COUNT(chips); c++) {
        psabench *bench[2] = {psabench_new(5), psabench_new(5)};
        psabench_part *two[2];
        for (int i = 0; i < 2; i++) {
            two[i] = part(bench[i], chips[c].kind, "u", chips[c].options);
            good(bench[i], psabench_set_volts(two[i], 0, 0.7));
        }
        for (int k = 0; k < 2000; k++) {
            uint8_t tx[12];
            uint8_t rx[2][12] = {{0}};
            const size_t n = rng_u64(&r) % sizeof tx;
            const uint32_t hz = (uint32_t)(100000 + rng_u64(&r) % 3000000);
            const int64_t gap_ns = rng_u64(&r) & 1 ? 0 : (int64_t)(rng_u64(&r) % 20000);
            const int64_t wait_ns = (int64_t)(rng_u64(&r) % (rng_u64(&r) % 8 ? 20000 : 3 * (uint64_t)MS));
            for (size_t i = 0; i < n; i++) tx[i] = likely_byte(&r);
            good(bench[0], psabench_spi_clock(two[0], hz, gap_ns));
            good(bench[0], psabench_spi(two[0], tx, rx[0], n));
            spi_by_pins(two[1], chips[c].mode1, hz, gap_ns, tx, rx[1], n);
            assert_memory_equal(rx[0], rx[1], sizeof rx[0]);
            for (int i = 0; i < 2; i++) run(bench[i], wait_ns);
            if (rng_u64(&r) % 4 == 0) other_pins(&r, two, chips[c].cs);
            assert_same_state(two[0], two[1]);
        }
        assert_true(counter(two[0], "conversions") > 20); /* the bytes did not silence it */
        for (int i = 0; i < 2; i++) psabench_free(bench[i]);
    }
}

/* 3 MHz has no whole nanoseconds: 166.67 ns a half period. */
static void edges_come_from_a_count(void **state)
{
    (void)state;
    static const uint8_t tx[3] = {0xA5, 0x00, 0xFF};
    static struct rig_vcd v;
    for (size_t c = 0; c < COUNT(chips); c++) {
        psabench *b = psabench_new(1);
        psabench_part *p = part(b, chips[c].kind, "u", chips[c].options);
        run(b, 1234567);
        if (chips[c].cs) set(p, "CS", 0);
        rig_vcd_path(&v);
        good(b, psabench_vcd(b, v.path));
        good(b, psabench_spi_clock(p, 3000000, 1001));
        good(b, psabench_spi(p, tx, NULL, sizeof tx));
        assert_true(psabench_now_ns(b) == edge_ns(1234567, 3000000, 1001, 2, 16));
        good(b, psabench_vcd_close(b));
        rig_vcd_read(&v);
        size_t edges = 0;
        uint8_t seen[3] = {0};
        int din = 0;
        for (unsigned i = 0; i < v.count; i++) {
            const struct rig_change *e = &v.change[i];
            if (strcmp(e->name, "u.DIN") == 0) din = e->level;
            if (strcmp(e->name, "u.SCLK") != 0) continue;
            const int64_t want_ns = edge_ns(1234567, 3000000, 1001, edges / 16, (int)(edges % 16) + 1);
            if (e->t_ns != want_ns) fail_msg("edge %zu at %" PRId64 ", want %" PRId64, edges, e->t_ns, want_ns);
            assert_int_equal(e->level, !(edges & 1));
            if (e->level != chips[c].mode1) seen[edges / 16] = (uint8_t)(seen[edges / 16] << 1 | din);
            edges++;
        }
        assert_int_equal(edges, 48);
        assert_memory_equal(seen, tx, sizeof tx);
        assert_true(v.start_ns == 1234567 && v.end_ns == psabench_now_ns(b) + 1); /* the last edge was now */
        psabench_free(b);
    }
}

struct fall { /* the first of each */
    int64_t rise_ns, fall_ns;
};

static void note(void *ctx, psabench_part *p, int number, int level, int64_t t_ns)
{
    (void)p;
    (void)number;
    struct fall *f = ctx;
    if (level && !f->rise_ns) f->rise_ns = t_ns;
    if (!level && !f->fall_ns) f->fall_ns = t_ns;
}

static void drdy_answers_to_the_first_fall_of_a_read(void **state)
{
    (void)state;
    struct fall f = {0, 0};
    uint8_t word[4];
    psabench *b = psabench_new(1);
    psabench_part *p = part(b, "ads1282", "u", "power_up_tclk=0 noise_scale=0 sclk_hz=1000000");
    good(b, psabench_set_volts(p, 0, 1.25));
    until(p, "DRDY", 0);
    good(b, psabench_watch(p, pin(p, "DRDY"), note, &f));
    run(b, 10000);
    const int64_t t0_ns = psabench_now_ns(b);
    good(b, psabench_spi(p, NULL, word, 4));
    assert_true(f.rise_ns == t0_ns + 1000); /* rise at 500 ns, fall at 1000 ns */
    const double volts = 2.5 * ((word[0] << 24) | word[1] << 16 | word[2] << 8 | word[3]) / 2147483648.0;
    assert_true(volts > 1.2499 && volts < 1.2502); /* the chain's gain at DC is 1.00003 */
    psabench_free(b);
}

/* A conversion ends while a slow transfer is under way: at its own instant, as if nothing were transferred. */
static void what_happens_during_a_transfer_keeps_its_instant(void **state)
{
    (void)state;
    for (size_t c = 0; c < COUNT(chips); c++) {
        int64_t fall_ns[2];
        for (int k = 0; k < 2; k++) {
            struct fall f = {0, 0};
            psabench *b = psabench_new(1);
            psabench_part *p = part(b, chips[c].kind, "u", chips[c].options);
            until(p, "DRDY", 0);
            run(b, 1);
            good(b, psabench_watch(p, pin(p, "DRDY"), note, &f));
            good(b, psabench_spi_clock(p, 1001, 0));        /* 8 ms */
            if (k) good(b, psabench_spi(p, NULL, NULL, 1)); /* CS, where there is one, is high */
            else run(b, 8 * MS);
            fall_ns[k] = f.fall_ns;
            psabench_free(b);
        }
        assert_true(fall_ns[0] > 0);
        assert_true(fall_ns[0] == fall_ns[1]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_bytes_do_the_same_by_bytes_and_by_pins),
        cmocka_unit_test(edges_come_from_a_count),
        cmocka_unit_test(drdy_answers_to_the_first_fall_of_a_read),
        cmocka_unit_test(what_happens_during_a_transfer_keeps_its_instant),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
