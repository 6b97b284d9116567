#include "base/bits.h"
#include "board/node.h"
#include "gen/pik_od.h"
#include "gen/pmka_od.h"
#include "gen/psd1_od.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum { NODE = 6, SEEN_MAX = 1024, COUNTERS_MAX = 64, ADDRESSES = 4, OWN_OBJECT = 0x1009 };

/* The fake board: what it will say, and what it was asked. */
struct fake {
    uint32_t counter[COUNTERS_MAX];
    enum board_cycle_result accept;
    struct board_cycle *cycle;
    unsigned submits, resets;
    int64_t period_ns;
};

struct rig {
    struct sched s;
    struct can_bus bus;
    struct board_node can;
    struct can_node host;
    struct can_msg seen[SEEN_MAX];
    unsigned count;
    struct fake board;
    unsigned refusals, syncs, starts, defaults;
    char told[BOARD_NODE_TEXT + 16];
};
static struct rig rig;

static enum board_cycle_result fake_submit(void *board, struct board_cycle *c, int64_t t_ns)
{
    struct fake *f = board;
    (void)t_ns;
    f->submits++;
    if (f->accept != BOARD_CYCLE_OK) return f->accept;
    f->cycle = c;
    return BOARD_CYCLE_OK;
}

static const char *fake_name(unsigned address)
{
    static const char *const names[ADDRESSES] = {"X", "Y", "Z", "STATUS"};
    return address < ADDRESSES ? names[address] : NULL;
}

static void fake_done(struct rig *r, enum board_cycle_result result, uint16_t data)
{
    struct board_cycle *c = r->board.cycle;
    assert_non_null(c);
    r->board.cycle = NULL;
    c->data = data;
    c->done(c->ctx, c, result, r->s.now_ns);
}

/* As board.h has it: a reset cuts the cycle under way. */
static void fake_reset(void *board, int64_t t_ns)
{
    struct fake *f = board;
    struct board_cycle *c = f->cycle;
    f->resets++;
    f->cycle = NULL;
    if (c) c->done(c->ctx, c, BOARD_CYCLE_OFF, t_ns);
}

static uint32_t fake_serial(const void *board)
{
    (void)board;
    return 4711;
}

static int64_t fake_period(const void *board)
{
    return ((const struct fake *)board)->period_ns;
}

/* An object of the board's own, with a value that no common handler would give. */
static uint32_t own_read(struct board_node *n, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    (void)e;
    (void)t_ns;
    v->number = 40000 + ((const struct fake *)n->board)->counter[0];
    return CO_OK;
}

static struct rig *rig_of(struct board_node *n)
{
    return (struct rig *)((char *)n - offsetof(struct rig, can));
}

static struct board_strobe fake_strobe(const void *board)
{
    (void)board;
    return (struct board_strobe){800, 200};
}

static void on_defaults(struct board_node *n)
{
    rig_of(n)->defaults++;
}

static void on_sync(struct board_node *n, int64_t t_ns)
{
    (void)t_ns;
    rig_of(n)->syncs++;
}

static void on_started(struct board_node *n, int64_t t_ns)
{
    (void)t_ns;
    rig_of(n)->starts++;
}

static void on_refused(void *ctx, const char *name, const char *why)
{
    struct rig *r = ctx;
    r->refusals++;
    (void)snprintf(r->told, sizeof r->told, "%s %s", name, why);
}

static void on_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (r->count < SEEN_MAX) r->seen[r->count++] = *m;
}

static void settle(struct rig *r)
{
    sched_run_until(&r->s, r->s.now_ns + NS_PER_S / 200);
}

static void host_sends(struct rig *r, uint32_t id, uint8_t len, const uint8_t *data)
{
    struct can_msg m = {.id = id, .len = len};
    if (data) memcpy(m.data, data, len);
    assert_int_equal(can_send(&r->bus, &r->host, &m, r->s.now_ns), CAN_OK);
    settle(r);
}

static void nmt(struct rig *r, uint8_t command)
{
    r->count = 0;
    host_sends(r, 0, 2, (const uint8_t[]){command, NODE});
}

/* A fake board with all counters that the device has, on a bus; pre-operational. */
static struct rig *rig_of_device(const struct co_device *d, uint32_t bitrate_hz)
{
    static struct board_counter counters[COUNTERS_MAX];
    static struct board_part part;
    static const struct board_bus bus = {
        .submit = fake_submit, .addresses = ADDRESSES, .name = fake_name, .strobe = fake_strobe};
    static struct board_type board;
    static const struct board_object own[] = {{OWN_OBJECT, own_read, NULL}};
    static struct board_node_type type;
    struct rig *r = &rig;
    memset(r, 0, sizeof *r);
    assert_true(d->counter_count <= COUNTERS_MAX);
    for (unsigned i = 0; i < d->counter_count; i++) /* in reverse: they are found by name */
        counters[i] = (struct board_counter){d->counters[d->counter_count - 1 - i], i * sizeof(uint32_t)};
    part = (struct board_part){.label = "board",
                               .offset = offsetof(struct fake, counter),
                               .counters = counters,
                               .counter_count = d->counter_count};
    board = (struct board_type){.parts = &part, .part_count = 1, .bus = &bus, .reset = fake_reset};
    type = (struct board_node_type){.board = &board,
                                    .device = d,
                                    .objects = own,
                                    .object_count = sizeof own / sizeof own[0],
                                    .serial = fake_serial,
                                    .period_ns = fake_period,
                                    .defaults = on_defaults,
                                    .sync = on_sync,
                                    .started = on_started};
    sched_init(&r->s);
    can_bus_init(&r->bus, &(struct can_bus_cfg){bitrate_hz, 0}, &r->s);
    r->host = (struct can_node){.name = "host", .rx = on_rx, .ctx = r};
    can_attach(&r->bus, &r->host);
    r->board.period_ns = NS_PER_S / 1000;
    const struct board_can_cfg cfg = {.name = "unit", .node_id = NODE, .refused = on_refused, .ctx = r};
    board_node_init(&r->can, &type, &cfg, &r->board, &r->bus, &r->s);
    board_node_power_up(&r->can, 0);
    settle(r);
    return r;
}

static struct rig *rig_up(void)
{
    return rig_of_device(&psd1_device, 1000000);
}

static void ask(struct rig *r, uint8_t command, uint16_t index, uint8_t sub, uint32_t data)
{
    uint8_t frame[8] = {command};
    bits_put_le(&frame[1], index, 2);
    frame[3] = sub;
    bits_put_le(&frame[4], data, 4);
    r->count = 0;
    host_sends(r, 0x600 + NODE, 8, frame);
}

static const struct can_msg *seen_id(const struct rig *r, uint32_t id)
{
    for (unsigned i = r->count; i-- > 0;) {
        if (r->seen[i].id == id) return &r->seen[i];
    }
    return NULL;
}

/* Data of the newest SDO answer: a value, or an abort code. */
static uint32_t answer(const struct rig *r)
{
    const struct can_msg *m = seen_id(r, 0x580 + NODE);
    assert_non_null(m);
    return m ? (uint32_t)bits_get_le(&m->data[4], 4) : 0;
}

static bool aborted(const struct rig *r)
{
    const struct can_msg *m = seen_id(r, 0x580 + NODE);
    return m && m->data[0] == 0x80;
}

static uint32_t upload(struct rig *r, uint16_t index, uint8_t sub)
{
    ask(r, 0x40, index, sub, 0);
    return answer(r);
}

static const char *upload_text(struct rig *r, uint16_t index)
{
    static char text[256];
    size_t at = 0;
    ask(r, 0x40, index, 0, 0);
    for (uint8_t toggle = 0; at + 7 < sizeof text; toggle ^= 0x10) {
        ask(r, (uint8_t)(0x60 | toggle), 0, 0, 0);
        const struct can_msg *m = seen_id(r, 0x580 + NODE);
        assert_non_null(m);
        if (!m || m->data[0] == 0x80) break;
        memcpy(&text[at], &m->data[1], 7);
        at += 7u - (m->data[0] >> 1 & 7u);
        if (m->data[0] & 1) break;
    }
    text[at] = '\0';
    return text;
}

static void write_u32(struct rig *r, uint16_t index, uint8_t sub, uint32_t value)
{
    ask(r, 0x23, index, sub, value);
}

static void write_u16(struct rig *r, uint16_t index, uint8_t sub, uint16_t value)
{
    ask(r, 0x2B, index, sub, value);
}

/* Sub-indices of 2030h, as docs/protocol_psd1.md numbers them. */
enum { READINGS = 1, DROPPED, LOAD, TEC, REC, INHIBITED, SYNCS, SDO_REFUSED, MALFORMED, CYCLES, CYCLES_REFUSED };

/* ---- bus cycles ---- */

static void a_read_is_answered_when_the_cycle_is_done(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x40, PSD1_OD_BUS, 3, 0);
    assert_null(seen_id(r, 0x580 + NODE));
    assert_non_null(r->board.cycle);
    assert_false(r->board.cycle->write);
    assert_int_equal(r->board.cycle->address, 2);
    assert_int_equal(r->board.cycle->strobe_ns, 0);
    fake_done(r, BOARD_CYCLE_OK, 0xBEEF);
    settle(r);
    assert_false(aborted(r));
    assert_int_equal(answer(r) & 0xFFFF, 0xBEEF);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, CYCLES), 1);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, CYCLES_REFUSED), 0);
}

static void a_write_carries_data_and_the_strobe_that_was_set(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    write_u32(r, PSD1_OD_STROBE_NS, 0, 1600);
    assert_false(aborted(r));
    assert_int_equal(upload(r, PSD1_OD_STROBE_NS, 0), 1600);
    write_u16(r, PSD1_OD_BUS, 4, 0xA55A);
    assert_true(r->board.cycle->write);
    assert_int_equal(r->board.cycle->address, 3);
    assert_int_equal(r->board.cycle->data, 0xA55A);
    assert_int_equal(r->board.cycle->strobe_ns, 1600);
    assert_null(seen_id(r, 0x580 + NODE));
    fake_done(r, BOARD_CYCLE_OK, 0);
    settle(r);
    assert_int_equal(seen_id(r, 0x580 + NODE)->data[0], 0x60);
}

/* Sources can 3.3. */
static void each_refusal_has_its_code_its_words_and_is_counted(void **state)
{
    static const struct {
        enum board_cycle_result result;
        uint32_t abort;
        const char *words;
    } rows[] = {
        {BOARD_CYCLE_NO_ADDRESS, 0x06090011, "nothing answers"},
        {BOARD_CYCLE_READ_ONLY, 0x06010002, "read-only"},
        {BOARD_CYCLE_WRITE_ONLY, 0x06010001, "write-only"},
        {BOARD_CYCLE_NOT_READY, 0x08000022, "too early"},
        {BOARD_CYCLE_TAKEN, 0x08000022, "profile psd1_host"},
        {BOARD_CYCLE_TOO_SHORT, 0x06090030, "strobe is shorter"},
        {BOARD_CYCLE_BUSY, 0x08000022, "another cycle"},
        {BOARD_CYCLE_BAD_VALUE, 0x06090030, "value"},
        {BOARD_CYCLE_OFF, 0x08000022, "power"},
    };
    (void)state;
    struct rig *r = rig_up();
    write_u32(r, PSD1_OD_STROBE_NS, 0, 50);
    for (unsigned i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        r->board.accept = rows[i].result;
        write_u16(r, PSD1_OD_BUS, 2, 7);
        assert_true(aborted(r));
        assert_int_equal(answer(r), rows[i].abort);
        const char *text = upload_text(r, PSD1_OD_REFUSAL);
        assert_non_null(strstr(text, rows[i].words));
        assert_non_null(strstr(text, "refused: write of 7 to address 01h (Y), strobe 50 ns: "));
        assert_int_equal(upload(r, PSD1_OD_COUNTERS, CYCLES_REFUSED), i + 1);
    }
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, SDO_REFUSED), sizeof rows / sizeof rows[0]);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, CYCLES), 0);
    assert_int_equal(r->refusals, 0); /* the log hears of settings, not of each cycle */
}

/* Whether an address is there, and which way it goes, the board says and counts. */
static void every_address_reaches_the_board_and_no_other_sub_index(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->board.accept = BOARD_CYCLE_NO_ADDRESS;
    for (uint8_t sub = 1; sub <= 16; sub++) {
        assert_int_equal(upload(r, PSD1_OD_BUS, sub), 0x06090011);
        write_u16(r, PSD1_OD_BUS, sub, 0);
        assert_int_equal(answer(r), 0x06090011);
    }
    assert_int_equal(r->board.submits, 32);
    assert_int_equal(upload(r, PSD1_OD_BUS, 17), 0x06090011);
    assert_int_equal(r->board.submits, 32);
    assert_non_null(strstr(upload_text(r, PSD1_OD_REFUSAL), "(nothing)"));
}

static void a_value_of_the_wrong_length_never_becomes_a_cycle(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x2F, PSD1_OD_BUS, 1, 1);
    assert_int_equal(answer(r), 0x06070013);
    ask(r, 0x23, PSD1_OD_BUS, 1, 1);
    assert_int_equal(answer(r), 0x06070012);
    assert_int_equal(r->board.submits, 0);
}

static void a_refusal_at_the_end_of_a_cycle_is_answered_too(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x40, PSD1_OD_BUS, 1, 0);
    fake_done(r, BOARD_CYCLE_TOO_SHORT, 0);
    settle(r);
    assert_true(aborted(r));
    assert_int_equal(answer(r), 0x06090030);
    assert_non_null(strstr(upload_text(r, PSD1_OD_REFUSAL), "read of address 00h (X), strobe 800 ns"));
}

static void a_cycle_that_a_reset_cuts_says_so(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x40, PSD1_OD_BUS, 1, 0);
    fake_reset(&r->board, r->s.now_ns); /* by the control socket, or a brown-out */
    settle(r);
    assert_int_equal(answer(r), 0x08000020);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, CYCLES_REFUSED), 1);
    ask(r, 0x40, PSD1_OD_BUS, 1, 0);
    fake_done(r, BOARD_CYCLE_OK, 5);
    settle(r);
    assert_int_equal(answer(r) & 0xFFFF, 5);
}

static void who_gives_up_a_cycle_finds_the_bus_busy_until_it_ends(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x40, PSD1_OD_BUS, 1, 0);
    assert_int_equal(upload(r, PSD1_OD_BUS, 2), 0x08000022);
    assert_non_null(strstr(upload_text(r, PSD1_OD_REFUSAL), "address 01h (Y)"));
    assert_int_equal(r->board.submits, 1);
    r->count = 0;
    fake_done(r, BOARD_CYCLE_OK, 0x1234);
    settle(r);
    assert_null(seen_id(r, 0x580 + NODE)); /* nobody waits for it any more */
    ask(r, 0x40, PSD1_OD_BUS, 2, 0);
    assert_int_equal(r->board.submits, 2);
    fake_done(r, BOARD_CYCLE_OK, 2);
    settle(r);
    assert_int_equal(answer(r) & 0xFFFF, 2);
}

static void a_cycle_that_never_ends_times_out_and_hangs_nothing(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    ask(r, 0x40, PSD1_OD_BUS, 1, 0);
    sched_run_until(&r->s, r->s.now_ns + 2 * NS_PER_S);
    assert_int_equal(answer(r), 0x05040000);
    assert_int_equal(upload(r, PSD1_OD_IDENTITY, 4), 4711);
}

/* ---- what every unit has ---- */

static void counters_of_the_board_are_found_by_their_names(void **state)
{
    (void)state;
    static const struct co_device *const devices[] = {&psd1_device, &pmka_device, &pik_device};
    for (unsigned k = 0; k < sizeof devices / sizeof devices[0]; k++) {
        struct rig *r = rig_of_device(devices[k], 1000000);
        const unsigned n = devices[k]->counter_count;
        for (unsigned i = 0; i < n; i++) r->board.counter[i] = 1000 + i;
        for (unsigned i = 0; i < n; i++)
            assert_int_equal(upload(r, PSD1_OD_COUNTERS, (uint8_t)(devices[k]->counter_sub + i)), 1000 + n - 1 - i);
        assert_int_equal(upload(r, PSD1_OD_COUNTERS, (uint8_t)(devices[k]->counter_sub + n)), CO_AB_NO_SUB);
        assert_int_equal(upload(r, PSD1_OD_COUNTERS, 0), devices[k]->counter_sub + n - 1);
    }
}

/* In whatever order the board has them. */
static void the_order_of_the_board_s_counters_does_not_matter(void **state)
{
    (void)state;
    static const char *const names[] = {"one", "two", "three"};
    static struct co_device d;
    d = psd1_device;
    d.counters = names;
    d.counter_count = 3;
    struct rig *r = rig_of_device(&d, 1000000);
    for (unsigned i = 0; i < 3; i++) r->board.counter[i] = 10 + i; /* three, two, one */
    for (unsigned i = 0; i < 3; i++) {
        const struct co_entry e = {.index = PSD1_OD_COUNTERS, .sub = (uint8_t)(d.counter_sub + i)};
        struct co_value v = {0};
        assert_int_equal(r->can.node.io.read(r->can.node.io.ctx, &e, &v, 0), CO_OK);
        assert_int_equal((int)v.number, 12 - (int)i);
    }
}

static void error_counters_read_255_at_most(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->can.node.services.tec = 300;
    r->can.node.services.rec = 17;
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, TEC), 255);
    r->can.node.services.rec = 17; /* a frame that passes counts it down */
    const uint32_t rec = upload(r, PSD1_OD_COUNTERS, REC);
    assert_in_range(rec, 16, 17);
}

/* The numbers that node.c knows stand in every device's table. */
static void every_device_has_the_common_objects(void **state)
{
    (void)state;
    static const struct co_device *const devices[] = {&psd1_device, &pmka_device, &pik_device};
    for (unsigned k = 0; k < sizeof devices / sizeof devices[0]; k++) {
        struct rig *r = rig_of_device(devices[k], 1000000);
        assert_int_equal(upload(r, 0x1018, 4), 4711);
        r->board.accept = BOARD_CYCLE_NOT_READY;
        assert_int_equal(upload(r, 0x2002, 1), 0x08000022);
        assert_string_not_equal(upload_text(r, 0x2031), "");
        assert_int_equal(upload(r, 0x2051, 0), 0);
        write_u32(r, 0x2040, 0, 0x64636261);
        assert_false(aborted(r));
        assert_int_equal(upload(r, 0x2040, 0), 0x64636261);
    }
}

static void objects_of_the_board_s_own_go_to_its_handlers(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->board.counter[0] = 5;
    struct co_value v = {0};
    const struct co_entry e = {.index = OWN_OBJECT};
    assert_int_equal(r->can.node.io.read(r->can.node.io.ctx, &e, &v, 0), CO_OK);
    assert_int_equal((int)v.number, 40005);
    assert_int_equal(r->can.node.io.write(r->can.node.io.ctx, &e, &v, 0), CO_AB_NO_OBJECT);
    const struct co_entry nobody = {.index = 0x5FFF};
    assert_int_equal(r->can.node.io.read(r->can.node.io.ctx, &nobody, &v, 0), CO_AB_NO_OBJECT);
}

static void reset_node_resets_the_board_and_its_settings(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    const unsigned before = r->defaults;
    assert_int_equal(before, 1);
    write_u32(r, PSD1_OD_STROBE_NS, 0, 77);
    r->board.accept = BOARD_CYCLE_NOT_READY;
    assert_int_equal(upload(r, PSD1_OD_BUS, 1), 0x08000022);
    r->board.accept = BOARD_CYCLE_OK;
    ask(r, 0x40, PSD1_OD_BUS, 1, 0); /* a cycle is under way */
    nmt(r, 130);
    assert_int_equal(r->board.resets, 0);
    assert_int_equal(upload(r, PSD1_OD_STROBE_NS, 0), 77);
    assert_string_not_equal(upload_text(r, PSD1_OD_REFUSAL), "");
    nmt(r, 129);
    assert_int_equal(r->board.resets, 1);
    assert_int_equal(r->defaults, before + 1);
    assert_null(seen_id(r, 0x580 + NODE)); /* communication began anew: no answer to what was asked before */
    assert_int_equal(upload(r, PSD1_OD_STROBE_NS, 0), 0);
    assert_string_equal(upload_text(r, PSD1_OD_REFUSAL), "");
}

static void power_forgets_the_remark(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    write_u32(r, PSD1_OD_REMARK, 0, 0x64636261);
    write_u32(r, PSD1_OD_STROBE_NS, 0, 77);
    board_node_power_down(&r->can);
    board_node_power_up(&r->can, r->s.now_ns);
    settle(r);
    assert_string_equal(r->can.remark, "");
    assert_int_equal(upload(r, PSD1_OD_STROBE_NS, 0), 0);
}

static void sync_and_start_reach_the_board(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    host_sends(r, 0x80, 0, NULL);
    assert_int_equal(r->syncs, 1);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, SYNCS), 1);
    assert_int_equal(r->starts, 0);
    nmt(r, 1);
    assert_int_equal(r->starts, 1);
}

static void cut_frames_are_counted_and_not_answered(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->count = 0;
    host_sends(r, 0x600 + NODE, 4, (const uint8_t[]){0x40, 0x02, 0x20, 0x01});
    assert_int_equal(r->count, 0);
    assert_int_equal(r->board.submits, 0);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, MALFORMED), 1);
}

static void a_board_says_in_words_why_it_refused_a_setting(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    board_node_say(&r->can, "refused: no such gain");
    board_node_say(&r->can, "refused: no such gain");
    assert_string_equal(upload_text(r, PSD1_OD_REFUSAL), "refused: no such gain");
    assert_string_equal(r->told, "unit refused: no such gain");
    assert_int_equal(r->refusals, 1);
    board_node_say(&r->can, "refused: no such rate");
    assert_int_equal(r->refusals, 2);
}

/* ---- stream ---- */

static void readings(struct rig *r, unsigned n)
{
    for (unsigned i = 0; i < n; i++) {
        struct can_msg m = {.len = 8, .data = {(uint8_t)i, 1, 2, 3}};
        board_node_stream(&r->can, PSD1_CYCLE_TPDO, &m, 1, r->s.now_ns);
        sched_run_until(&r->s, r->s.now_ns + r->board.period_ns);
    }
}

static unsigned count_id(const struct rig *r, uint32_t id)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r->count; i++) n += r->seen[i].id == id;
    return n;
}

static void readings_flow_while_operational(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    readings(r, 2);
    nmt(r, 1);
    readings(r, 3);
    assert_int_equal(count_id(r, 0x180 + NODE), 3);
    assert_int_equal(r->seen[0].data[3], 3);
    nmt(r, 128);
    readings(r, 2);
    assert_int_equal(count_id(r, 0x180 + NODE), 0);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, READINGS), 7);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, DROPPED), 0);
}

/* 135 us a frame at 1 Mbit/s, 1080 us at 125 kbit/s: 1000 readings a second want 1000 us. */
static void a_stream_that_does_not_fit_stands_and_says_why(void **state)
{
    (void)state;
    struct rig *r = rig_of_device(&psd1_device, 125000);
    nmt(r, 1);
    assert_int_equal(r->refusals, 1);
    assert_string_equal(r->told,
                        "unit refused: a reading is 1 frame, at worst 1080.000 us at 125000 bit/s, and due every "
                        "1000.000 us (1000 /s): 108.0 % of the bus");
    assert_int_equal(bits_get_le(seen_id(r, 0x80 + NODE)->data, 2), PSD1_EMCY_STREAM_REFUSED);
    readings(r, 5);
    assert_int_equal(count_id(r, 0x180 + NODE), 0);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, DROPPED), 5);
    assert_string_equal(upload_text(r, PSD1_OD_REFUSAL), r->told + sizeof "unit " - 1);
    nmt(r, 130);
    nmt(r, 1); /* told anew after a reset of communication */
    assert_int_equal(bits_get_le(seen_id(r, 0x80 + NODE)->data, 2), PSD1_EMCY_STREAM_REFUSED);
    assert_int_equal(r->refusals, 2);
    r->board.period_ns = 1080000;
    r->count = 0;
    readings(r, 3);
    settle(r);
    assert_int_equal(count_id(r, 0x180 + NODE), 3);
    assert_int_equal(bits_get_le(seen_id(r, 0x80 + NODE)->data, 2), 0);
    assert_string_equal(upload_text(r, PSD1_OD_REFUSAL), "");
    assert_int_equal(r->refusals, 2);
}

static void a_stream_at_the_pace_of_sync_is_not_judged(void **state)
{
    (void)state;
    struct rig *r = rig_of_device(&psd1_device, 125000);
    ask(r, 0x2F, 0x1800, 2, 1);
    assert_false(aborted(r));
    nmt(r, 1);
    assert_int_equal(r->refusals, 0);
    readings(r, 3);
    assert_int_equal(count_id(r, 0x180 + NODE), 0);
    host_sends(r, 0x80, 0, NULL);
    assert_int_equal(count_id(r, 0x180 + NODE), 1);
}

/* More than the backlog at once: dropped whole, counted, told once, and calm again after a second without a loss. */
static void what_the_bus_does_not_take_is_dropped_counted_and_told(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    nmt(r, 1);
    for (unsigned i = 0; i < CO_PDO_BACKLOG + 4; i++) {
        struct can_msg m = {.len = 8};
        board_node_stream(&r->can, PSD1_CYCLE_TPDO, &m, 1, r->s.now_ns);
    }
    settle(r);
    assert_int_equal(count_id(r, 0x180 + NODE), CO_PDO_BACKLOG);
    assert_int_equal(count_id(r, 0x80 + NODE), 1);
    assert_int_equal(bits_get_le(seen_id(r, 0x80 + NODE)->data, 2), PSD1_EMCY_CAN_OVERRUN);
    assert_int_equal(upload(r, PSD1_OD_COUNTERS, DROPPED), 4);
    r->count = 0;
    readings(r, 1);
    assert_int_equal(count_id(r, 0x80 + NODE), 0);
    sched_run_until(&r->s, r->s.now_ns + BOARD_NODE_CALM_NS);
    readings(r, 1);
    assert_int_equal(bits_get_le(seen_id(r, 0x80 + NODE)->data, 2), 0);
}

/* A device made here, with a second TPDO that is off. */
static void a_tpdo_that_is_off_flows_once_the_host_says_so(void **state)
{
    (void)state;
    static const uint8_t len[] = {8};
    static struct co_device d;
    d = psd1_device;
    d.tpdos = 1;
    d.tpdo_len = len;
    d.tpdo_off = 1;
    struct rig *r = rig_of_device(&d, 1000000);
    nmt(r, 1);
    readings(r, 2);
    assert_int_equal(count_id(r, 0x180 + NODE), 0);
    assert_int_equal(upload(r, 0x1800, 1), 0xC0000180 + NODE);
    write_u32(r, 0x1800, 1, 0x40000180 + NODE);
    assert_false(aborted(r));
    readings(r, 2);
    assert_int_equal(count_id(r, 0x180 + NODE), 2);
    nmt(r, 130);
    assert_int_equal(upload(r, 0x1800, 1), 0xC0000180 + NODE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_read_is_answered_when_the_cycle_is_done),
        cmocka_unit_test(a_write_carries_data_and_the_strobe_that_was_set),
        cmocka_unit_test(each_refusal_has_its_code_its_words_and_is_counted),
        cmocka_unit_test(every_address_reaches_the_board_and_no_other_sub_index),
        cmocka_unit_test(a_value_of_the_wrong_length_never_becomes_a_cycle),
        cmocka_unit_test(a_refusal_at_the_end_of_a_cycle_is_answered_too),
        cmocka_unit_test(a_cycle_that_a_reset_cuts_says_so),
        cmocka_unit_test(who_gives_up_a_cycle_finds_the_bus_busy_until_it_ends),
        cmocka_unit_test(a_cycle_that_never_ends_times_out_and_hangs_nothing),
        cmocka_unit_test(counters_of_the_board_are_found_by_their_names),
        cmocka_unit_test(the_order_of_the_board_s_counters_does_not_matter),
        cmocka_unit_test(error_counters_read_255_at_most),
        cmocka_unit_test(every_device_has_the_common_objects),
        cmocka_unit_test(objects_of_the_board_s_own_go_to_its_handlers),
        cmocka_unit_test(reset_node_resets_the_board_and_its_settings),
        cmocka_unit_test(power_forgets_the_remark),
        cmocka_unit_test(sync_and_start_reach_the_board),
        cmocka_unit_test(cut_frames_are_counted_and_not_answered),
        cmocka_unit_test(a_board_says_in_words_why_it_refused_a_setting),
        cmocka_unit_test(readings_flow_while_operational),
        cmocka_unit_test(a_stream_that_does_not_fit_stands_and_says_why),
        cmocka_unit_test(a_stream_at_the_pace_of_sync_is_not_judged),
        cmocka_unit_test(what_the_bus_does_not_take_is_dropped_counted_and_told),
        cmocka_unit_test(a_tpdo_that_is_off_flows_once_the_host_says_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
