#include "rig.h"

#include "base/bits.h"
#include "base/clk.h"
#include "base/rng.h"

static void edges_are_exact_after_an_hour(void **state)
{
    (void)state;
    const struct {
        struct clk clk;
        int64_t k, t_ns;
    } row[] = {
        {{0, 4096000, 1}, 1, 244},                                 /* 244.140625 ns */
        {{0, 4096000, 1}, INT64_C(4096000) * 3600, 3600000000000}, /* an hour: adding 244 would be 2.1 s short */
        {{0, 4096000, 3}, 4096000, 3000000000},                    /* 4.096 MHz / 3: 3 s exactly */
        {{0, 4096000, 3}, 1, 732},                                 /* 732.42 ns */
        {{500, 2000000, 1}, 148, 74500},                           /* the INT low of the default profile */
        {{0, 7680000, 1}, INT64_C(7680000) * 86400 * 365, INT64_C(86400) * 365 * 1000000000},
    };
    for (size_t i = 0; i < COUNT(row); i++) assert_int_equal(clk_edge_ns(&row[i].clk, row[i].k), row[i].t_ns);
}

static void count_at_finds_the_first_edge_not_before(void **state)
{
    (void)state;
    const struct clk c = {.t0_ns = 7, .hz = 4096000, .div = 3};
    for (int64_t k = 0; k < 5000; k++) {
        const int64_t t_ns = clk_edge_ns(&c, k);
        assert_int_equal(clk_count_at(&c, t_ns), k);
        assert_int_equal(clk_count_at(&c, t_ns + 1), k + 1);
    }
}

/* The definition, at and around edges that are and that are not whole nanoseconds, near and far. */
static void count_at_is_the_first_edge_of_any_clock(void **state)
{
    (void)state;
    const struct clk clocks[] = {{0, 4096000, 1},   {7, 4096000, 3},    {0, 2000000, 1}, {0, 7680000, 7},
                                 {0, 999999937, 1}, {3, 1000000000, 1}, {0, 1, 1}};
    struct rng r = rng_stream(rig_seed(1), 0, "clk");
    for (size_t i = 0; i < COUNT(clocks); i++)
        for (int n = 0; n < 20000; n++) {
            const struct clk *c = &clocks[i];
            const int64_t t_ns = c->t0_ns + (int64_t)(rng_u64(&r) % (n % 2 ? 10000 : UINT64_C(100000000000000)));
            const int64_t at_ns = n % 3 ? t_ns : clk_edge_ns(c, clk_count_at(c, t_ns)) + n % 9 / 3 - 1;
            if (at_ns < c->t0_ns) continue;
            const int64_t k = clk_count_at(c, at_ns);
            assert_true(clk_edge_ns(c, k) >= at_ns);
            assert_true(k == 0 || clk_edge_ns(c, k - 1) < at_ns);
            const struct clk_pos p = clk_pos_at(c, at_ns);
            const struct clk_pos want = clk_pos(c, k);
            assert_true(p.k == want.k && p.t_ns == want.t_ns && p.rest == want.rest);
        }
}

static void steps_meet_every_edge(void **state)
{
    (void)state;
    const struct clk clocks[] = {{0, 4096000, 1},  {7, 4096000, 3},   {0, 2000000, 1},
                                 {-3, 7680000, 2}, {0, 999999937, 1}, {0, 1, 1}};
    const int64_t starts[] = {0, 1, 12345, INT64_C(4096000) * 3600};
    const int64_t steps[] = {1, 2, 128, 4096};
    for (size_t c = 0; c < COUNT(clocks); c++)
        for (size_t s = 0; s < COUNT(starts); s++)
            for (size_t e = 0; e < COUNT(steps); e++) {
                if (clocks[c].hz == 1 && s == 3) continue; /* beyond what 64 bits of ns hold */
                struct clk_pos p = clk_pos(&clocks[c], starts[s]);
                const struct clk_step step = clk_step(&clocks[c], steps[e]);
                for (int64_t k = starts[s]; k < starts[s] + 5000 * steps[e]; k += steps[e], p = clk_on(p, &step)) {
                    assert_int_equal(p.k, k);
                    assert_int_equal(p.t_ns, clk_edge_ns(&clocks[c], k));
                }
                const struct clk_step back = clk_step(&clocks[c], -steps[e]);
                for (int n = 0; n < 5000; n++) p = clk_on(p, &back);
                assert_int_equal(p.k, starts[s]);
                assert_int_equal(p.t_ns, clk_edge_ns(&clocks[c], starts[s]));
                assert_int_equal(p.rest, clk_pos(&clocks[c], starts[s]).rest);
            }
}

static void many_steps_at_once_end_where_one_after_another_does(void **state)
{
    (void)state;
    struct rng r = rng_stream(rig_seed(1), 0, "clk");
    for (unsigned run = 0; run < 20000; run++) {
        const struct clk c = {.hz = 1 + (int64_t)(rng_u64(&r) % 1000000000), .div = 1 + (int64_t)(rng_u64(&r) % 5)};
        const struct clk_step step = clk_step(&c, 1 + (int64_t)(rng_u64(&r) % 5000));
        const struct clk_pos from = clk_pos(&c, (int64_t)(rng_u64(&r) % 100000));
        struct clk_pos edge = from;
        for (uint64_t n = rng_u64(&r) % 50; n > 0; n--) edge = clk_on(edge, &step);
        const int64_t gap_ns = clk_on(edge, &step).t_ns - edge.t_ns; /* clocks of 1 ns and less have equal instants */
        if (gap_ns == 0) continue;
        const int64_t t_ns = edge.t_ns + (int64_t)(rng_u64(&r) % (uint64_t)gap_ns);
        const struct clk_pos at = clk_on_to(from, &step, t_ns);
        assert_int_equal(at.k, edge.k);
        assert_int_equal(at.t_ns, edge.t_ns);
        assert_int_equal(at.rest, edge.rest);
    }
}

static void rounding_and_sign_extension_keep_their_signs(void **state)
{
    (void)state;
    const struct {
        uint32_t v;
        unsigned bits;
        int32_t want;
    } ext[] = {
        {0x800000, 24, -8388608}, {0x7FFFFF, 24, 8388607},     {0xFFFFFF, 24, -1},
        {0xFF000001, 24, 1},      {0x80000000, 32, INT32_MIN}, {1, 1, -1},
    };
    for (size_t i = 0; i < COUNT(ext); i++) assert_int_equal(bits_sign_extend(ext[i].v, ext[i].bits), ext[i].want);
    const struct {
        int64_t v;
        unsigned shift;
        int64_t want;
    } rnd[] = {
        {5, 1, 3}, {-5, 1, -2}, {-6, 2, -1}, {-7, 2, -2}, {7, 0, 7}, {-7, 0, -7}, {6, 2, 2}, {-1, 4, 0}, {-9, 4, -1},
    };
    for (size_t i = 0; i < COUNT(rnd); i++) assert_int_equal(bits_round_shift(rnd[i].v, rnd[i].shift), rnd[i].want);
    assert_int_equal(bits_clip(8388608, 24), 8388607);
    assert_int_equal(bits_clip(-8388609, 24), -8388608);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(edges_are_exact_after_an_hour),
        cmocka_unit_test(count_at_finds_the_first_edge_not_before),
        cmocka_unit_test(count_at_is_the_first_edge_of_any_clock),
        cmocka_unit_test(steps_meet_every_edge),
        cmocka_unit_test(many_steps_at_once_end_where_one_after_another_does),
        cmocka_unit_test(rounding_and_sign_extension_keep_their_signs),
    };
    return cmocka_run_group_tests_name("clk", tests, NULL, NULL);
}
