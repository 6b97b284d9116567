/* Lines of the parallel bus of every board that has one: what they show is what was done, and looking changes nothing. */
#include "lone_unit.h"
#include "rig.h"

#include "base/rng.h"
#include "unit/unit.h"

#include <stdio.h>
#include <string.h>

enum { CYCLES = 300, STROBES = 4000 };

struct strobe {
    int64_t from_ns, to_ns;
    bool write;
    unsigned address, data;
};

static struct world {
    struct sched s;
    struct lab lab;
    struct unit u;
    struct trace_sink sink;
    /* cycles */
    bool over;
    enum board_cycle_result result;
    int64_t over_ns;
    struct strobe done[CYCLES];
    unsigned dones, tried[BOARD_CYCLE_OFF + 1];
    uint32_t words; /* of all that was read, and how each cycle ended: a sum */
    /* what the lines show */
    uint64_t cs, rw, ab, d; /* masks */
    struct strobe seen[STROBES];
    unsigned strobes;
    uint64_t level;
    int64_t t_ns;
} w;

/* All changes of an instant have come: what is there now. */
static void settled(void)
{
    const bool open = w.strobes && w.seen[w.strobes - 1].to_ns < 0;
    struct strobe *s = &w.seen[open ? w.strobes - 1 : w.strobes];
    const unsigned address = (unsigned)((w.level & w.ab) / (w.ab & -w.ab));
    const unsigned data = (unsigned)((w.level & w.d) / (w.d & -w.d));
    if (w.level & w.cs) {
        if (open) s->to_ns = w.t_ns;
        assert_true(w.level & w.rw);
        assert_int_equal(address + data, 0);
        return;
    }
    if (!open) {
        assert_true(w.strobes++ < STROBES);
        *s = (struct strobe){w.t_ns, -1, !(w.level & w.rw), address, data};
    }
    assert_int_equal(s->write, !(w.level & w.rw)); /* nothing moves within a strobe */
    assert_int_equal(s->address, address);
    assert_int_equal(s->data, data);
}

static void on_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    (void)ctx;
    for (unsigned i = 0; i < n; i++) {
        const uint64_t lines = s[i].lines & (w.cs | w.rw | w.ab | w.d);
        if (!lines) continue;
        if (s[i].t_ns != w.t_ns) settled();
        w.t_ns = s[i].t_ns;
        w.level = (w.level & ~lines) | (s[i].level & lines);
        if (lines & s[i].level & w.cs) settled(); /* the next may begin at the same instant */
    }
}

static uint64_t lines_named(const char *stem, unsigned count)
{
    uint64_t mask = 0;
    for (unsigned i = 0; i < count; i++) {
        char name[16];
        (void)snprintf(name, sizeof name, "%s%u", stem, i);
        const int sig = trace_find(unit_trace(&w.u), name);
        assert_true(sig >= 0);
        mask |= TRACE_BIT((unsigned)sig);
    }
    return mask;
}

static void watch(void)
{
    w.cs = TRACE_BIT((unsigned)trace_find(unit_trace(&w.u), "CS"));
    w.rw = TRACE_BIT((unsigned)trace_find(unit_trace(&w.u), "RW"));
    w.ab = lines_named("AB", 4);
    w.d = lines_named("D", 16);
    w.level = w.cs | w.rw;
    w.sink = (struct trace_sink){.mask = w.cs | w.rw | w.ab | w.d, .steps = on_steps};
    trace_attach(unit_trace(&w.u), &w.sink);
}

static void live(const struct board_type *t, bool watched)
{
    memset(&w, 0, sizeof w);
    lone_unit(&w.u, &w.lab, &w.s, t, 1);
    if (watched) watch();
    unit_power_up(&w.u, 0);
}

static void run_until(int64_t t_ns)
{
    while (w.s.now_ns < t_ns) {
        sched_run_until(&w.s, t_ns - w.s.now_ns > 100000 ? w.s.now_ns + 100000 : t_ns);
        trace_advance(unit_trace(&w.u), w.s.now_ns - TRACE_LAG_NS);
    }
}

static void on_done(void *ctx, struct board_cycle *c, enum board_cycle_result r, int64_t t_ns)
{
    (void)ctx;
    (void)c;
    w.over = true;
    w.result = r;
    w.over_ns = t_ns;
}

static void cycle(struct rng *rng)
{
    const struct board_bus *bus = w.u.type->bus;
    const uint64_t v = rng_u64(rng);
    struct board_cycle c = {.write = v & 1,
                            .address = (uint8_t)((v >> 1) % (bus->addresses + 1)),
                            .data = (uint16_t)(v & 2 ? v >> 16 : v >> 16 & 7),
                            .strobe_ns = v & 4 ? (int64_t)(100 + (v >> 40) % 3000) : 0,
                            .done = on_done};
    const int64_t len_ns = c.strobe_ns ? c.strobe_ns : bus->strobe(w.u.board).own_ns;
    c.data = c.write ? c.data : 0;
    w.over = false;
    w.result = bus->submit(w.u.board, &c, w.s.now_ns);
    const bool taken = w.result == BOARD_CYCLE_OK;
    run_until(w.s.now_ns + 2 * len_ns + 5000 + (int64_t)(v >> 50));
    assert_int_equal(w.over, taken);
    w.tried[w.result]++;
    w.words = w.words * 31 + c.data + (uint32_t)w.result;
    if (w.over) w.done[w.dones++] = (struct strobe){w.over_ns - len_ns, w.over_ns, c.write, c.address, c.data};
}

static void some_cycles(const struct board_type *t, bool watched, uint64_t seed)
{
    struct rng rng = rng_stream(seed, 1, "cycles");
    live(t, watched);
    run_until(NS_PER_S / 2);
    for (unsigned n = 0; n < CYCLES; n++) cycle(&rng);
    run_until(w.s.now_ns + 1000000);
    trace_advance(unit_trace(&w.u), w.s.now_ns);
    if (watched) settled();
}

static bool same(const struct strobe *a, const struct strobe *b)
{
    return a->from_ns == b->from_ns && a->to_ns == b->to_ns && a->write == b->write && a->address == b->address &&
           a->data == b->data;
}

/* In order. Beside them PSD-1 shows those of its built-in host, and refused ones; the others have none. */
static void each_cycle_is_a_strobe_on_the_lines(void **state)
{
    (void)state;
    const uint64_t seed = rig_seed(11);
    for (const struct board_type *const *t = board_types; *t; t++) {
        if (!(*t)->bus) continue;
        some_cycles(*t, true, seed);
        assert_true(w.dones > CYCLES / 10 && w.tried[BOARD_CYCLE_OK] > 0 && w.tried[BOARD_CYCLE_NO_ADDRESS] > 0);
        unsigned at = 0;
        for (unsigned i = 0; i < w.dones; i++, at++) {
            while (at < w.strobes && !same(&w.seen[at], &w.done[i])) at++;
            if (at == w.strobes)
                fail_msg("%s: cycle %u, address %u from %lld ns: not on the lines", (*t)->name, i, w.done[i].address,
                         (long long)w.done[i].from_ns);
        }
        if (strcmp((*t)->name, "psd1") != 0) assert_int_equal(w.strobes, w.dones);
        assert_int_equal(unit_trace(&w.u)->late, 0);
    }
}

static void digest(char hex[SHA256_HEX])
{
    struct sha256 s;
    sha256_init(&s);
    w.u.type->digest(w.u.board, &s);
    sha256_hex(&s, hex);
}

static void words_are_the_same_whoever_looks(void **state)
{
    (void)state;
    const uint64_t seed = rig_seed(12);
    for (const struct board_type *const *t = board_types; *t; t++) {
        char watched[SHA256_HEX], unwatched[SHA256_HEX];
        if (!(*t)->bus) continue;
        some_cycles(*t, true, seed);
        const uint32_t words = w.words;
        digest(watched);
        some_cycles(*t, false, seed);
        digest(unwatched);
        assert_int_equal(w.words, words);
        assert_string_equal(watched, unwatched);
    }
}

/* The power goes, or Res comes, within a strobe. */
static void a_cycle_that_is_cut_leaves_the_lines_at_rest(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        for (unsigned power = 0; (*t)->bus && power < 2; power++) {
            struct board_cycle c = {.address = 3, .strobe_ns = 100000, .done = on_done};
            live(*t, true);
            run_until(NS_PER_S / 2);
            assert_int_equal((*t)->bus->submit(w.u.board, &c, w.s.now_ns), BOARD_CYCLE_OK);
            run_until(w.s.now_ns + 50000);
            if (power) unit_power_down(&w.u, w.s.now_ns);
            else (*t)->reset(w.u.board, w.s.now_ns);
            const int64_t cut_ns = w.s.now_ns;
            assert_true(w.over && w.result == BOARD_CYCLE_OFF);
            trace_detach(unit_trace(&w.u), &w.sink);
            run_until(cut_ns + 1000000);
            assert_int_equal(unit_trace(&w.u)->level & w.sink.mask, power ? 0 : w.cs | w.rw);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_cycle_is_a_strobe_on_the_lines),
        cmocka_unit_test(words_are_the_same_whoever_looks),
        cmocka_unit_test(a_cycle_that_is_cut_leaves_the_lines_at_rest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
