/* What a logic analyser sees on the PSA-2's lines: the article's set-up, reads, frames; and that looking changes nothing. */
#include "psa2_rig.h"

#define BYTES 4000u

static struct rig rig, other;
static struct rig_byte bytes[BYTES];

/* Up to some frames past the set-up, all lines watched. */
static void watched_run(struct rig *r, const char *profile, int64_t ns)
{
    const struct psa2_profile p = psa2_profile_file(profile);
    rig_init(r, &p, 1.0);
    r->volts[0] = 2.4882;
    r->volts[1] = -7.0;
    r->volts[2] = 9.9;
    trace_attach(&r->b.base.trace, &r->sink);
    psa2_power_up(&r->b, 0);
    rig_run(r, ns);
    trace_advance(&r->b.base.trace, r->s.now_ns);
    assert_int_equal(r->b.base.trace.late, 0);
    assert_int_equal(r->b.base.trace.dropped, 0);
    assert_true(r->edges < RIG_EDGES);
}

/* Instant of the latest change of a line to a level, before t. */
static int64_t last_change_ns(const struct rig *r, enum psa2_line line, bool level, int64_t t_ns)
{
    int64_t found_ns = -1;
    for (unsigned i = 0; i < r->edges && r->edge[i].t_ns < t_ns; i++)
        if (r->edge[i].sig == line && r->edge[i].level == level) found_ns = r->edge[i].t_ns;
    return found_ns;
}

static unsigned count_changes(const struct rig *r, enum psa2_line line, bool level, int64_t from_ns, int64_t to_ns)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r->edges; i++) {
        const struct rig_edge *e = &r->edge[i];
        n += e->sig == line && e->level == level && e->t_ns >= from_ns && e->t_ns < to_ns;
    }
    return n;
}

/* The names of the article's table, section 5. */
static void the_sixteen_lines_are_those_of_the_article(void **state)
{
    (void)state;
    static const char *const want[] = {
        "SYNC_A", "SClk",  "DRD_A", "DIn",   "DOutX", "DOutY", "DOutZ", "SYNC_T",
        "CST",    "DRD_T", "DInT",  "DOutT", "Res",   "Data",  "CLK",   "Int",
    };
    watched_run(&rig, "article", 1000000);
    const struct trace *const t = &rig.b.base.trace;
    assert_int_equal(t->count, COUNT(want) + 2 * PSA2_PAIRS);
    assert_int_equal(t->wires, TRACE_FIRST(t->count) & ~TRACE_FIRST(COUNT(want)));
    for (size_t i = 0; i < COUNT(want); i++) assert_true(trace_find(t, want[i]) >= 0);
}

/* The article's bytes, then what the article does not show, then the first read. */
static void set_up_is_the_articles_in_its_order(void **state)
{
    (void)state;
    const struct {
        enum psa2_group group;
        uint8_t mosi;
    } want[] = {
        {PSA2_ACCEL, 0x41}, {PSA2_ACCEL, 0x00}, {PSA2_ACCEL, 0x56}, /* 1st DRD_A: CONFIG0 */
        {PSA2_TEMP, 0x50},  {PSA2_TEMP, 0x00},  {PSA2_TEMP, 0x02},  /* 1st DRD_T */
        {PSA2_TEMP, 0x50},  {PSA2_TEMP, 0x00},  {PSA2_TEMP, 0x04},  /* 2nd DRD_T */
        {PSA2_TEMP, 0x53},  {PSA2_TEMP, 0x00},  {PSA2_TEMP, 0x82},  /* 3rd DRD_T */
        {PSA2_ACCEL, 0x42}, {PSA2_ACCEL, 0x00}, {PSA2_ACCEL, 0x09}, /* E0: gain 2 */
        {PSA2_TEMP, 0x51},  {PSA2_TEMP, 0x00},  {PSA2_TEMP, 0x08},  /* E0: AIN0 to AINCOM */
        {PSA2_TEMP, 0x01},                                          /* E0: RDATA, first temperature */
    };
    watched_run(&rig, "article", 150000000);
    const unsigned n = rig_decode_spi(&rig, bytes, BYTES);
    assert_true(n > COUNT(want));
    for (size_t i = 0; i < COUNT(want); i++) {
        assert_int_equal(bytes[i].group, want[i].group);
        assert_int_equal(bytes[i].mosi, want[i].mosi);
    }
}

/* Each transfer answers its data-ready event: its first clock comes within 3 SClk periods (2.93 us) of the fall; and these
 * are the 1st and 2nd DRD_A and the 1st to 4th DRD_T as far as the order allows. */
static void each_transfer_follows_its_event(void **state)
{
    (void)state;
    watched_run(&rig, "article", 190000000);
    (void)rig_decode_spi(&rig, bytes, BYTES);
    const struct {
        unsigned byte;
        enum psa2_line event;
        unsigned event_us; /* docs/boards/psa2.md, set-up */
    } rows[] = {{0, PSA2_LINE_DRD_A, 63105},
                {3, PSA2_LINE_DRD_T, 63173},
                {6, PSA2_LINE_DRD_T, 63206},
                {9, PSA2_LINE_DRD_T, 63826}};
    for (size_t i = 0; i < COUNT(rows); i++) {
        const int64_t rise_ns = bytes[rows[i].byte].first_rise_ns;
        const int64_t fall_ns = last_change_ns(&rig, rows[i].event, false, rise_ns);
        if (rise_ns - fall_ns > 2930)
            fail_msg("byte %u: %lld ns after its event", rows[i].byte, (long long)(rise_ns - fall_ns));
        assert_int_equal((fall_ns + 500) / 1000, rows[i].event_us);
    }
    const int64_t sync_t_ns = last_change_ns(&rig, PSA2_LINE_SYNC_T, false, bytes[12].first_rise_ns);
    const int64_t sync_a_ns = last_change_ns(&rig, PSA2_LINE_SYNC_A, true, INT64_MAX);
    assert_true(bytes[11].last_sample_ns < sync_t_ns && sync_t_ns < sync_a_ns && sync_a_ns < bytes[12].first_rise_ns);
    assert_in_range(sync_t_ns - last_change_ns(&rig, PSA2_LINE_DRD_T, false, sync_t_ns), 0, 1000);
    assert_in_range(sync_a_ns - last_change_ns(&rig, PSA2_LINE_DRD_A, false, sync_a_ns), 0, 1000);
    assert_int_equal((sync_t_ns + 500) / 1000, 95050);
    assert_int_equal((sync_a_ns + 500) / 1000, 126235);
    assert_int_equal((bytes[12].first_rise_ns + 500) / 1000, 126238); /* E0: gain */
    assert_int_equal((bytes[15].first_rise_ns + 500) / 1000, 126274); /* E0: first temperature channel */
    assert_int_equal((rig.frame[0].t_sample_ns + 500) / 1000, 189330);
    assert_int_equal(count_changes(&rig, PSA2_LINE_DRD_A, false, 0, sync_a_ns), 2);
    /* after the DRATE write a self-calibration runs at the new rate: 31.2 ms (sources 4.2) */
    assert_in_range(sync_t_ns - bytes[11].last_sample_ns, 31100000, 31300000);
}

/* CST low from before the first clock to 8 tau (1.042 us) after the last; no accelerometer byte inside. */
static void cst_frames_the_temperature_port(void **state)
{
    (void)state;
    watched_run(&rig, "article", 230000000);
    bool low = false;
    int64_t last_clock_ns = 0, fell_ns = 0;
    unsigned frames = 0;
    for (unsigned i = 0; i < rig.edges; i++) {
        const struct rig_edge *e = &rig.edge[i];
        if (e->sig == PSA2_LINE_SCLK) {
            if (low && last_clock_ns < fell_ns) assert_true(e->t_ns - fell_ns >= 976);
            last_clock_ns = e->t_ns;
        }
        if (e->sig == PSA2_LINE_DOUTX && low)
            fail_msg("DOutX moves in a temperature burst at %lld", (long long)e->t_ns);
        if (e->sig != PSA2_LINE_CST || e->level == !low) continue;
        low = !e->level;
        if (low) fell_ns = e->t_ns;
        else assert_in_range(e->t_ns - last_clock_ns, 1041, 1100);
        frames += low;
    }
    assert_true(frames > 10);
}

/* 24 tCLK = 5.859 us between command bytes (last rise to first rise); reads have none. */
static void command_bytes_keep_their_gap(void **state)
{
    (void)state;
    watched_run(&rig, "article", 200000000);
    const unsigned n = rig_decode_spi(&rig, bytes, BYTES);
    unsigned reads = 0;
    for (unsigned i = 1; i < n; i++) {
        if (bytes[i].group != PSA2_ACCEL || bytes[i - 1].group != PSA2_ACCEL) continue;
        const int64_t gap_ns = bytes[i].first_rise_ns - bytes[i - 1].last_sample_ns;
        if (bytes[i - 1].mosi) assert_true(gap_ns >= 5859);
        else if (gap_ns < 2000) reads++;
    }
    assert_true(reads >= 2 * rig.frames);
    for (unsigned i = 0; i < 3; i++) assert_int_equal(rig.b.adc[i].count.gap_violations, 0);
    assert_int_equal(rig.b.tadc.n.gap_violations, 0);
}

static bool level_before(const struct rig *r, enum psa2_line line, int64_t t_ns)
{
    return last_change_ns(r, line, true, t_ns) > last_change_ns(r, line, false, t_ns);
}

/* Bytes of the article's writes: 41h ends in a 1, 42h in a 0; after the last byte of each, which ends in 0 and in 1, DIn is low. */
static void din_keeps_its_last_bit_up_to_the_next_byte(void **state)
{
    (void)state;
    static const unsigned first_of_write[] = {0, 12};
    watched_run(&rig, "article", 200000000);
    (void)rig_decode_spi(&rig, bytes, BYTES);
    for (size_t k = 0; k < COUNT(first_of_write); k++) {
        const struct rig_byte *w = bytes + first_of_write[k];
        for (unsigned i = 0; i < 3; i++) {
            const bool want = i < 2 && w[i].mosi & 1;
            assert_int_equal(level_before(&rig, PSA2_LINE_DIN, w[i].last_sample_ns + 2000), want);
        }
    }
    assert_int_equal(bytes[0].mosi & 1, 1);
    assert_int_equal(bytes[12].mosi & 1, 0);
    assert_int_equal(bytes[14].mosi & 1, 1);
}

/* The 24 bits of each read on DOutX, Y, Z are the codes of the frame. */
static void dout_carries_the_codes(void **state)
{
    (void)state;
    watched_run(&rig, "article", 200000000);
    const unsigned n = rig_decode_spi(&rig, bytes, BYTES);
    unsigned f = 0;
    for (unsigned i = 0; i + 2 < n && f < rig.frames; i++) {
        if (bytes[i].group != PSA2_ACCEL || bytes[i].first_rise_ns < rig.frame[f].t_sample_ns) continue;
        for (unsigned k = 0; k < 3; k++) {
            const uint32_t raw = (uint32_t)bytes[i].miso[k] << 24 | (uint32_t)bytes[i + 1].miso[k] << 16 |
                                 (uint32_t)bytes[i + 2].miso[k] << 8;
            assert_int_equal(raw, rig.frame[f].raw[k]);
        }
        f++;
    }
    assert_int_equal(f, rig.frames);
    assert_true(f >= 9);
}

/* One frame of each profile, decoded on the rising edges of CLK as the navigation computer would. */
static void frame_waveform(void **state)
{
    (void)state;
    const struct {
        const char *profile;
        unsigned bits;
        double period_ns, lead_in_clk, int_low_ns;
    } rows[] = {
        {"article", 32, 500.0, 8, 74000.0}, {"w24", 24, 732.421875, 0, 79101.5625}, {"w16", 16, 976.5625, 0, 74218.75}};
    for (size_t p = 0; p < COUNT(rows); p++) {
        watched_run(&rig, rows[p].profile, 195000000);
        assert_true(rig.frames >= 5);
        const struct psa2_frame *f = &rig.frame[3];
        bool data = false;
        unsigned bit = 0;
        uint32_t word[PSA2_WORDS] = {0};
        for (unsigned i = 0; i < rig.edges; i++) {
            const struct rig_edge *e = &rig.edge[i];
            const double clks = (double)(e->t_ns - f->t_int_fall_ns) / rows[p].period_ns;
            const bool inside = e->t_ns >= f->t_int_fall_ns && e->t_ns <= f->t_int_rise_ns;
            if (!inside) continue;
            if (e->sig == PSA2_LINE_DATA) {
                data = e->level; /* on the grid of falling edges */
                if ((clks + 0.005) - (double)(int)(clks + 0.005) > 0.01) fail_msg("DATA moves at %f CLK", clks);
            }
            if (e->sig != PSA2_LINE_CLK || !e->level) continue;
            const double want =
                rows[p].lead_in_clk + bit / rows[p].bits * (rows[p].bits + 4.0) + bit % rows[p].bits + 0.5;
            if (clks < want - 0.005 || clks > want + 0.005)
                fail_msg("bit %u rises at %f CLK, want %f", bit, clks, want);
            if (bit < 4 * rows[p].bits) word[bit / rows[p].bits] |= (uint32_t)data << bit % rows[p].bits;
            bit++;
        }
        assert_int_equal(bit, 4 * rows[p].bits);
        for (unsigned w = 0; w < PSA2_WORDS; w++) assert_int_equal(word[w], f->word[w]);
        assert_int_equal(last_change_ns(&rig, PSA2_LINE_INT, true, f->t_int_rise_ns + 1), f->t_int_rise_ns);
        assert_int_equal(last_change_ns(&rig, PSA2_LINE_INT, false, f->t_int_rise_ns), f->t_int_fall_ns);
        assert_true((double)(f->t_int_rise_ns - f->t_int_fall_ns) > rows[p].int_low_ns - 1.0);
        assert_true((double)(f->t_int_rise_ns - f->t_int_fall_ns) < rows[p].int_low_ns + 1.0);
        assert_int_equal(last_change_ns(&rig, PSA2_LINE_CLK, false, f->t_int_rise_ns + 1), f->t_int_rise_ns);
    }
}

static void between_frames_the_line_rests(void **state)
{
    (void)state;
    watched_run(&rig, "article", 200000000);
    for (unsigned k = 0; k + 1 < rig.frames; k++) {
        const int64_t from_ns = rig.frame[k].t_int_rise_ns + 1;
        const int64_t to_ns = rig.frame[k + 1].t_int_fall_ns;
        const enum psa2_line lines[] = {PSA2_LINE_CLK, PSA2_LINE_DATA, PSA2_LINE_INT};
        for (size_t i = 0; i < COUNT(lines); i++)
            for (int level = 0; level < 2; level++)
                assert_int_equal(count_changes(&rig, lines[i], level, from_ns, to_ns), 0);
    }
}

static void same_frames(const struct rig *a, const struct rig *b)
{
    assert_int_equal(a->frames, b->frames);
    for (unsigned i = 0; i < a->frames; i++) {
        const struct psa2_frame *x = &a->frame[i];
        const struct psa2_frame *y = &b->frame[i];
        assert_int_equal(x->seq, y->seq);
        assert_int_equal(x->t_sample_ns, y->t_sample_ns);
        assert_int_equal(x->t_int_fall_ns, y->t_int_fall_ns);
        assert_int_equal(x->t_int_rise_ns, y->t_int_rise_ns);
        assert_memory_equal(x->raw, y->raw, sizeof x->raw);
        assert_memory_equal(x->word, y->word, sizeof x->word);
    }
}

/* Unwatched, watched from the start, and watched in the middle for a while: same seed, same words, times and counters. */
static void watching_changes_nothing(void **state)
{
    (void)state;
    const char *const profiles[] = {"article", "ungated", "w24", "lab32"};
    for (size_t p = 0; p < COUNT(profiles); p++) {
        for (int late = 0; late < 2; late++) {
            const struct psa2_profile profile = psa2_profile_file(profiles[p]);
            struct rig *const rigs[] = {&rig, &other};
            for (int i = 0; i < 2; i++) {
                struct rig *r = rigs[i];
                rig_init(r, &profile, 1.0);
                r->volts[0] = 2.4882;
                if (i && !late) trace_attach(&r->b.base.trace, &r->sink);
                psa2_power_up(&r->b, 0);
                rig_run(r, 200030000);
                if (i && late) trace_attach(&r->b.base.trace, &r->sink);
                rig_run(r, 20000000);
                if (i && late) trace_detach(&r->b.base.trace, &r->sink);
                rig_run(r, 20000000);
            }
            assert_int_equal(rig.edges, 0);
            assert_true(other.edges > 1000);
            same_frames(&rig, &other);
            assert_memory_equal(&rig.b.counters, &other.b.counters, sizeof rig.b.counters);
            assert_memory_equal(&rig.b.adc[0].count, &other.b.adc[0].count, sizeof rig.b.adc[0].count);
            assert_memory_equal(&rig.b.tadc.n, &other.b.tadc.n, sizeof rig.b.tadc.n);
        }
    }
}

/* Res in the middle of a frame: the line stops there, rests, and later frames are whole. */
static void a_reset_cuts_the_frame_short(void **state)
{
    (void)state;
    watched_run(&rig, "article", 195000000);
    const int64_t next_ns = rig.frame[rig.frames - 1].t_int_fall_ns + 1000000;
    rig_run(&rig, next_ns + 30300 - rig.s.now_ns);
    const unsigned frames = rig.frames;
    const int64_t t_ns = rig.s.now_ns;
    psa2_reset(&rig.b, t_ns);
    rig_run(&rig, 50000000);
    assert_int_equal(rig.frames, frames);
    assert_int_equal(last_change_ns(&rig, PSA2_LINE_INT, true, t_ns + 1), t_ns);
    assert_int_equal(last_change_ns(&rig, PSA2_LINE_RES, false, t_ns + 1), t_ns);
    for (unsigned i = 0; i < rig.edges; i++) {
        const struct rig_edge *e = &rig.edge[i];
        if (e->t_ns > t_ns && (e->sig == PSA2_LINE_CLK || e->sig == PSA2_LINE_DATA || e->sig == PSA2_LINE_INT))
            fail_msg("line %u moves at %lld", e->sig, (long long)e->t_ns);
    }
    assert_int_equal(count_changes(&rig, PSA2_LINE_CLK, true, next_ns, t_ns),
                     32 + 17); /* (30.3 - 4) us / 0.5 us = 52.6 CLK */
    rig_run(&rig, 250000000);
    assert_true(rig.frames > frames);
    assert_int_equal(rig.frame[frames].seq, 0);
    assert_int_equal(rig.b.counters.resets, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_sixteen_lines_are_those_of_the_article),
        cmocka_unit_test(set_up_is_the_articles_in_its_order),
        cmocka_unit_test(each_transfer_follows_its_event),
        cmocka_unit_test(cst_frames_the_temperature_port),
        cmocka_unit_test(command_bytes_keep_their_gap),
        cmocka_unit_test(din_keeps_its_last_bit_up_to_the_next_byte),
        cmocka_unit_test(dout_carries_the_codes),
        cmocka_unit_test(frame_waveform),
        cmocka_unit_test(between_frames_the_line_rests),
        cmocka_unit_test(watching_changes_nothing),
        cmocka_unit_test(a_reset_cuts_the_frame_short),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
