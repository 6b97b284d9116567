/* What a logic analyser sees on the lines of a PSD-1: the cycle of sources 4.5, row by row; and that looking changes nothing. */
#include "base/rng.h"
#include "psd1_rig.h"

static struct rig rig, other;

#define ALL TRACE_FIRST(PSD1_LINES)

/* Set up and watched, one whole cycle recorded from its A0 on. */
static void one_cycle(struct rig *r, const struct psd1_profile *p)
{
    rig_up(r, p);
    rig_run(r, 5000000);
    rig_await(r, PSD1_IDLE);
    rig_watch(r, ALL);
    const unsigned before = r->cycles;
    while (r->cycles == before) rig_run(r, 100000);
    rig_run(r, 100000);
    trace_advance(&r->b.base.trace, r->s.now_ns);
    assert_int_equal(r->b.base.trace.late + r->b.base.trace.dropped, 0);
    assert_true(r->edges < RIG_EDGES);
}

static const struct psd1_cycle *latest(const struct rig *r)
{
    return &r->cycle[r->cycles - 1];
}

static bool has_edge(const struct rig *r, unsigned sig, bool level, int64_t t_ns)
{
    for (unsigned i = 0; i < r->edges; i++)
        if (r->edge[i].sig == sig && r->edge[i].level == level && r->edge[i].t_ns == t_ns) return true;
    return false;
}

static unsigned count_edges(const struct rig *r, unsigned sig)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r->edges; i++) n += r->edge[i].sig == sig;
    return n;
}

/* Level of a line at an instant, changes at the instant included; from the levels at rest. */
static bool level_at(const struct rig *r, unsigned sig, int64_t t_ns)
{
    bool level = psd1_lines[sig].level;
    if (sig == PSD1_LINE_INT0 || sig == PSD1_LINE_FL1) level = !level;
    for (unsigned i = 0; i < r->edges && r->edge[i].t_ns <= t_ns; i++)
        if (r->edge[i].sig == sig) level = r->edge[i].level;
    return level;
}

/* Rows of sources 4.5 with the built-in host 1000 ns after FL2: T_Y = 16400, T_Z = 32400, end 48400. */
static void the_cycle_is_that_of_the_article(void **state)
{
    (void)state;
    static const struct {
        int64_t t_ns;
        unsigned sig;
        bool level;
    } rows[] = {
        {0, PSD1_LINE_A0, true},       {400, PSD1_LINE_RFX, false},   {13600, PSD1_LINE_DR, true},
        {14000, PSD1_LINE_RFX, true},  {14000, PSD1_LINE_FL2, true},  {15000, PSD1_LINE_CS, false},
        {15800, PSD1_LINE_CS, true},   {16400, PSD1_LINE_FL2, false}, {16400, PSD1_LINE_RFY, false},
        {30000, PSD1_LINE_RFY, true},  {30000, PSD1_LINE_FL2, true},  {31000, PSD1_LINE_CS, false},
        {31000, PSD1_LINE_AB0, true},  {31800, PSD1_LINE_CS, true},   {31800, PSD1_LINE_AB0, false},
        {32400, PSD1_LINE_FL2, false}, {32400, PSD1_LINE_RFZ, false}, {46000, PSD1_LINE_RFZ, true},
        {46000, PSD1_LINE_FL2, true},  {47000, PSD1_LINE_CS, false},  {47000, PSD1_LINE_AB0 + 1, true},
        {47800, PSD1_LINE_CS, true},   {48400, PSD1_LINE_FL2, false}, {48400, PSD1_LINE_A0, false},
    };
    const struct psd1_profile p = rig_exact();
    one_cycle(&rig, &p);
    const int64_t t0_ns = latest(&rig)->t_a0_ns;
    for (size_t i = 0; i < COUNT(rows); i++)
        if (!has_edge(&rig, rows[i].sig, rows[i].level, t0_ns + rows[i].t_ns))
            fail_msg("no %s = %d at %lld", psd1_lines[rows[i].sig].name, rows[i].level, (long long)rows[i].t_ns);
    static const struct {
        unsigned sig, edges;
    } counts[] = {{PSD1_LINE_A0, 2},   {PSD1_LINE_RFX, 2}, {PSD1_LINE_RFY, 2},   {PSD1_LINE_RFZ, 2},
                  {PSD1_LINE_FL2, 6},  {PSD1_LINE_CS, 6},  {PSD1_LINE_RW, 0},    {PSD1_LINE_TFS, 0},
                  {PSD1_LINE_INT0, 0}, {PSD1_LINE_FL1, 0}, {PSD1_LINE_SCLK, 96}, {PSD1_LINE_AB0 + 2, 0}};
    for (size_t i = 0; i < COUNT(counts); i++) assert_int_equal(count_edges(&rig, counts[i].sig), counts[i].edges);
}

/* 16 pulses, the first 700 ns after RFx, half a period each; SDAT carries the word: first bit 300 ns after RFx, the others
 * 100 ns after the falls, sampled at the rises; low again when RFx rises. */
static void sclk_and_sdat_carry_the_words(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    one_cycle(&rig, &p);
    static const int64_t rf_ns[3] = {400, 16400, 32400};
    for (unsigned a = 0; a < 3; a++) {
        const int64_t t_ns = latest(&rig)->t_a0_ns + rf_ns[a];
        const unsigned word = latest(&rig)->word[a];
        unsigned seen = 0;
        for (int64_t n = 0; n < 16; n++) {
            const int64_t rise_ns = t_ns + 700 + 800 * n;
            assert_true(has_edge(&rig, PSD1_LINE_SCLK, true, rise_ns));
            assert_true(has_edge(&rig, PSD1_LINE_SCLK, false, rise_ns + 400));
            seen = seen << 1 | level_at(&rig, PSD1_LINE_SDAT, rise_ns);
            const int64_t valid_ns = n ? rise_ns - 300 : t_ns + 300;
            assert_int_equal(level_at(&rig, PSD1_LINE_SDAT, valid_ns), word >> (15 - n) & 1);
            if (n) assert_int_equal(level_at(&rig, PSD1_LINE_SDAT, valid_ns - 1), word >> (16 - n) & 1);
        }
        assert_int_equal(seen, word);
        assert_false(level_at(&rig, PSD1_LINE_SDAT, t_ns + 299));
        assert_int_equal(level_at(&rig, PSD1_LINE_SDAT, t_ns + 13599), word & 1);
        assert_false(level_at(&rig, PSD1_LINE_SDAT, t_ns + 13600));
    }
}

/* While CS is low the address, R/W and the word; at rest before and after. */
static void the_bus_shows_the_words(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    one_cycle(&rig, &p);
    static const int64_t cs_ns[3] = {15000, 31000, 47000};
    for (unsigned a = 0; a < 3; a++) {
        const int64_t t_ns = latest(&rig)->t_a0_ns + cs_ns[a];
        for (int64_t k = 0; k < 4; k++) {
            static const int64_t at_ns[4] = {-1, 0, 799, 800};
            const bool low = k == 1 || k == 2;
            unsigned address = 0, data = 0;
            for (unsigned i = 0; i < 4; i++)
                address |= (unsigned)level_at(&rig, PSD1_LINE_AB0 + i, t_ns + at_ns[k]) << i;
            for (unsigned i = 0; i < 16; i++) data |= (unsigned)level_at(&rig, PSD1_LINE_D0 + i, t_ns + at_ns[k]) << i;
            assert_int_equal(level_at(&rig, PSD1_LINE_CS, t_ns + at_ns[k]), !low);
            assert_int_equal(address, low ? a : 0);
            assert_int_equal(data, low ? latest(&rig)->word[a] : 0);
        }
    }
}

/* 1M25: rises at multiples of 800 ns from power-up, falls between; without a gap, whoever else is watched. */
static void clock_runs_without_a_gap(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    for (unsigned with = 0; with < 2; with++) {
        rig_init(&rig, &p, 0.0);
        rig_until(&rig, 123457);
        rig_watch(&rig, with ? ALL : TRACE_BIT(PSD1_LINE_CLK));
        psd1_power_up(&rig.b, 123457);
        rig_until(&rig, 15000000);
        trace_advance(&rig.b.base.trace, rig.s.now_ns);
        int64_t due_ns = 123457;
        bool level = true;
        for (unsigned i = 0; i < rig.edges; i++) {
            if (rig.edge[i].sig != PSD1_LINE_CLK) continue;
            if (rig.edge[i].t_ns != due_ns || rig.edge[i].level != level)
                fail_msg("edge at %lld, due %lld", (long long)rig.edge[i].t_ns, (long long)due_ns);
            due_ns += 400;
            level = !level;
        }
        assert_in_range(due_ns, 15000000, 15000400);
        assert_int_equal(rig.b.base.trace.late + rig.b.base.trace.dropped, 0);
    }
}

/* 24 bits of UC1, high first, set at the falls, taken at the rises; A0 low; TFS as long as RFx for 24 bits. */
static void control_words_on_the_line(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_init(&rig, &p, 0.0);
    rig_watch(&rig, ALL & ~TRACE_BIT(PSD1_LINE_CLK));
    psd1_power_up(&rig.b, 0);
    rig_run(&rig, 1000000);
    const int64_t t_ns = rig.event_ns[PSD1_EV_UC];
    assert_int_equal(t_ns, 100400); /* the fall after reset_ns */
    unsigned seen = 0;
    for (int64_t n = 0; n < 24; n++) {
        assert_true(has_edge(&rig, PSD1_LINE_SCLK, true, t_ns + 700 + 800 * n));
        assert_true(has_edge(&rig, PSD1_LINE_SCLK, false, t_ns + 1100 + 800 * n));
        seen = seen << 1 | level_at(&rig, PSD1_LINE_SDAT, t_ns + 700 + 800 * n);
        const int64_t valid_ns = n ? t_ns + 300 + 800 * n : t_ns;
        assert_int_equal(level_at(&rig, PSD1_LINE_SDAT, valid_ns), 0x220013 >> (23 - n) & 1);
    }
    assert_int_equal(seen, 0x220013);
    assert_true(has_edge(&rig, PSD1_LINE_TFS, false, t_ns));
    assert_true(has_edge(&rig, PSD1_LINE_TFS, true, t_ns + 20000));
    assert_int_equal(count_edges(&rig, PSD1_LINE_SCLK), 48);
    assert_int_equal(count_edges(&rig, PSD1_LINE_A0), 0);
}

/* Coefficients: A0 high, RFX, RFY, RFZ for 24 SCLK each, one period of 1M25 between. */
static void coefficients_on_the_line(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_init(&rig, &p, 0.0);
    rig_watch(&rig, ALL & ~TRACE_BIT(PSD1_LINE_CLK));
    psd1_power_up(&rig.b, 0);
    rig_await(&rig, PSD1_COEF_A0);
    const int64_t a0_ns = rig.b.due_ns, tfs_ns = rig.event_ns[PSD1_EV_UC], end_ns = a0_ns + 400 + 2 * 20800 + 20000;
    rig_run(&rig, end_ns - rig.s.now_ns);
    assert_false(rig.b.frame.active); /* who looks now sees no frame */
    rig_run(&rig, 40000);
    trace_advance(&rig.b.base.trace, rig.s.now_ns);
    assert_true(has_edge(&rig, PSD1_LINE_SDAT, true, tfs_ns)); /* C20013h: its first bit with TFS */
    assert_true(has_edge(&rig, PSD1_LINE_SDAT, false, tfs_ns + 1900));
    assert_true(has_edge(&rig, PSD1_LINE_A0, true, a0_ns));
    for (unsigned a = 0; a < 3; a++) {
        const int64_t rf_ns = a0_ns + 400 + 20800 * a;
        assert_true(has_edge(&rig, PSD1_LINE_RFX + a, false, rf_ns));
        assert_true(has_edge(&rig, PSD1_LINE_RFX + a, true, rf_ns + 20000));
        for (int64_t n = 0; n < 24; n++) assert_true(has_edge(&rig, PSD1_LINE_SCLK, true, rf_ns + 700 + 800 * n));
        assert_true(level_at(&rig, PSD1_LINE_SDAT, rf_ns + 700)); /* 800000h */
        assert_false(level_at(&rig, PSD1_LINE_SDAT, rf_ns + 1500));
    }
    assert_true(has_edge(&rig, PSD1_LINE_A0, false, end_ns));
}

static void writes_show_the_hosts_data(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig_await(&rig, PSD1_IDLE);
    rig_watch(&rig, ALL & ~TRACE_BIT(PSD1_LINE_CLK));
    const int64_t t_ns = rig.s.now_ns;
    rig_write(&rig, PSD1_REG_UC_LOW, 0xA5C3);
    trace_advance(&rig.b.base.trace, rig.s.now_ns);
    unsigned data = 0;
    for (unsigned i = 0; i < 16; i++) data |= (unsigned)level_at(&rig, PSD1_LINE_D0 + i, t_ns + 799) << i;
    assert_int_equal(data, 0xA5C3);
    assert_true(has_edge(&rig, PSD1_LINE_RW, false, t_ns));
    assert_true(has_edge(&rig, PSD1_LINE_RW, true, t_ns + 800));
    /* a strobe that is refused moves CS and the address, no data */
    rig.edges = 0;
    const int64_t again_ns = rig.s.now_ns;
    assert_int_equal(rig_bus(&rig, false, 1, 0, 0), BOARD_CYCLE_TAKEN);
    rig_run(&rig, 2000);
    trace_advance(&rig.b.base.trace, rig.s.now_ns);
    assert_true(has_edge(&rig, PSD1_LINE_CS, false, again_ns));
    assert_true(has_edge(&rig, PSD1_LINE_CS, true, again_ns + 800));
    assert_true(has_edge(&rig, PSD1_LINE_AB0, true, again_ns));
    assert_int_equal(rig.edges, 4);
}

static void fl2_may_be_active_low(void **state)
{
    (void)state;
    struct psd1_profile p = rig_exact();
    p.fl2 = PSD1_ACTIVE_LOW;
    one_cycle(&rig, &p);
    const int64_t t_ns = latest(&rig)->t_a0_ns;
    assert_true(has_edge(&rig, PSD1_LINE_FL2, false, t_ns + 14000));
    assert_true(has_edge(&rig, PSD1_LINE_FL2, true, t_ns + 16400));
    assert_int_equal(count_edges(&rig, PSD1_LINE_FL2), 6);
}

static void cycles_equal(const struct rig *a, const struct rig *b)
{
    assert_int_equal(a->cycles, b->cycles);
    for (unsigned i = 0; i < a->cycles; i++) {
        assert_int_equal(a->cycle[i].t_a0_ns, b->cycle[i].t_a0_ns);
        assert_int_equal(a->cycle[i].t_end_ns, b->cycle[i].t_end_ns);
        for (unsigned k = 0; k < 3; k++) assert_int_equal(a->cycle[i].word[k], b->cycle[i].word[k]);
        assert_int_equal(a->cycle[i].status, b->cycle[i].status);
    }
}

static struct rig third; /* records only */

/* What `got` heard from from_ns on, in the lines of its mask, is what was heard from the beginning; level: of its beginning. */
static void heard_the_same(const struct rig *all, struct rig *got, unsigned first, int64_t from_ns, bool *level)
{
    unsigned at = first;
    for (unsigned i = 0; i < all->edges; i++) {
        const struct rig_edge *e = &all->edge[i];
        if (!(got->sink.mask >> e->sig & 1) || e->t_ns <= from_ns) continue;
        if (at >= got->edges || got->edge[at].t_ns != e->t_ns)
            fail_msg("from %lld: %s at %lld", (long long)from_ns, psd1_lines[e->sig].name, (long long)e->t_ns);
        unsigned j = at; /* order at one instant is free */
        while (j < got->edges && got->edge[j].t_ns == e->t_ns && got->edge[j].sig != e->sig) j++;
        assert_true(j < got->edges && got->edge[j].sig == e->sig && got->edge[j].level == e->level);
        got->edge[j] = got->edge[at++];
        if (level[e->sig] == e->level)
            fail_msg("from %lld: %s began wrong", (long long)from_ns, psd1_lines[e->sig].name);
        level[e->sig] = e->level;
    }
    assert_int_equal(at, got->edges);
}

/* Attaches; the levels that it is given at once are its beginning, if the trace has moved on to now. */
static unsigned join(struct rig *board, struct rig *ear, uint64_t mask, bool *level, bool now)
{
    ear->sink = (struct trace_sink){.mask = mask, .steps = rig_steps, .ctx = ear};
    ear->edges = 0;
    if (now) trace_advance(&board->b.base.trace, board->s.now_ns);
    trace_attach(&board->b.base.trace, &ear->sink);
    for (unsigned i = 0; i < ear->edges; i++) level[ear->edge[i].sig] = ear->edge[i].level;
    return ear->edges;
}

/* Whoever comes at any instant, for whichever lines, alone or while another listens to others, hears from then on what one
 * hears who was there from the beginning. */
static void late_listeners_hear_the_same(void **state)
{
    (void)state;
    static const uint64_t masks[] = {ALL, TRACE_BIT(PSD1_LINE_CLK),
                                     TRACE_BIT(PSD1_LINE_SCLK) | TRACE_BIT(PSD1_LINE_SDAT),
                                     ALL & ~TRACE_BIT(PSD1_LINE_CLK), ALL & ~TRACE_BIT(PSD1_LINE_SCLK)};
    const uint64_t seed = rig_seed(20261122);
    struct rng rng = rng_stream(seed, 1, "test");
    struct psd1_profile p;
    fields_default(&psd1_fields, &p);
    p.bit_access_ns = 120;
    rig_init(&rig, &p, 1.0);
    rig_watch(&rig, ALL);
    psd1_power_up(&rig.b, 0);
    rig_until(&rig, 12000000);
    trace_advance(&rig.b.base.trace, rig.s.now_ns);
    for (unsigned k = 0; k < 300; k++) {
        const bool inside = k % 4 < 3; /* of a cycle */
        const int64_t from_ns =
            (inside ? rig.cycle[0].t_a0_ns : 9500000) + (int64_t)(rng_uniform(&rng) * (inside ? 48400.0 : 1500000.0));
        const int64_t early_ns = from_ns - (int64_t)(rng_uniform(&rng) * 10000.0);
        bool level[2][PSD1_LINES] = {{false}};
        rig_init(&other, &p, 1.0);
        psd1_power_up(&other.b, 0);
        rig_until(&other, early_ns);
        const bool two = k & 1, now = k % 8 != 7; /* else: what is heard before from_ns is not looked at */
        const unsigned before = two ? join(&other, &third, masks[k / 5 % COUNT(masks)], level[1], true) : 0;
        rig_until(&other, from_ns);
        const unsigned first = join(&other, &other, masks[k % COUNT(masks)], level[0], now);
        rig_until(&other, 12000000);
        trace_advance(&other.b.base.trace, other.s.now_ns);
        if (now) heard_the_same(&rig, &other, first, from_ns, level[0]);
        if (two) heard_the_same(&rig, &third, before, early_ns, level[1]);
        assert_int_equal(other.b.base.trace.late + other.b.base.trace.dropped, 0);
    }
    cycles_equal(&rig, &other);
}

/* A second listener for more lines, in the middle of a frame, and one who goes. */
static void listeners_come_and_go(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_up(&rig, &p);
    rig_watch(&rig, TRACE_BIT(PSD1_LINE_CLK) | TRACE_BIT(PSD1_LINE_SCLK));
    struct trace_sink second = rig.sink;
    second.mask = TRACE_BIT(PSD1_LINE_SDAT);
    rig_await(&rig, PSD1_RF_RISE);
    rig_until(&rig, rig.b.frame.t_ns + 5000);
    trace_attach(&rig.b.base.trace, &second);
    rig_run(&rig, 5000);
    trace_detach(&rig.b.base.trace, &rig.sink);
    trace_detach(&rig.b.base.trace, &second);
    rig_run(&rig, 3000000);
    assert_false(rig.b.wave.on);
    rig.edges = 0;
    rig_await(&rig, PSD1_IDLE);
    rig_run(&rig, 200000);
    trace_attach(&rig.b.base.trace, &rig.sink);
    rig.edges = 0;
    rig_run(&rig, 972800 * 2);
    trace_advance(&rig.b.base.trace, rig.s.now_ns);
    assert_int_equal(count_edges(&rig, PSD1_LINE_SCLK), 192);
    assert_in_range(count_edges(&rig, PSD1_LINE_CLK), 2 * 2431, 2 * 2433);
    assert_int_equal(rig.b.base.trace.late + rig.b.base.trace.dropped, 0);
}

/* Ten milliseconds and more without trace_advance(): nothing is dropped. */
static void long_ways_drop_nothing(void **state)
{
    (void)state;
    const struct psd1_profile p = rig_exact();
    rig_init(&rig, &p, 0.0);
    rig_watch(&rig, ALL);
    psd1_power_up(&rig.b, 0);
    sched_run_until(&rig.s, 40000000);
    trace_advance(&rig.b.base.trace, rig.s.now_ns);
    assert_int_equal(rig.b.base.trace.late + rig.b.base.trace.dropped, 0);
    assert_int_equal(count_edges(&rig, PSD1_LINE_CLK), 100001);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_cycle_is_that_of_the_article), cmocka_unit_test(sclk_and_sdat_carry_the_words),
        cmocka_unit_test(the_bus_shows_the_words),          cmocka_unit_test(clock_runs_without_a_gap),
        cmocka_unit_test(control_words_on_the_line),        cmocka_unit_test(coefficients_on_the_line),
        cmocka_unit_test(writes_show_the_hosts_data),       cmocka_unit_test(fl2_may_be_active_low),
        cmocka_unit_test(late_listeners_hear_the_same),     cmocka_unit_test(listeners_come_and_go),
        cmocka_unit_test(long_ways_drop_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
