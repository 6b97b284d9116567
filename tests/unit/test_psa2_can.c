#include "base/bits.h"
#include "board/psa2_can.h"
#include "board/unit.h"
#include "gen/psabench_can.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum { NODE = 5, SEEN_MAX = 4096, FCLK_HZ = 4096000 };

struct rig {
    struct sched s;
    struct can_bus bus;
    struct psa2_can can;
    struct can_node host;
    struct can_msg seen[SEEN_MAX];
    int64_t seen_ns[SEEN_MAX];
    unsigned count;
    /* the fake board */
    struct psa2_request *request;
    enum psa2_result accept; /* what submit says */
    struct psa2_can_info info;
    unsigned resets, pulses;
    uint32_t seq;
    /* the listener */
    unsigned refusals;
    char told[PSA2_CAN_TEXT + 16];
};
static struct rig rig;

static enum psa2_result fake_submit(void *ctx, struct psa2_request *r, int64_t t_ns)
{
    struct rig *rg = ctx;
    (void)t_ns;
    if (rg->accept != PSA2_OK) return rg->accept;
    if (rg->request) return PSA2_BUSY;
    rg->pulses += r->op == PSA2_PULSE_SYNC;
    rg->request = r;
    return PSA2_OK;
}

static void fake_done(struct rig *r, enum psa2_result result)
{
    struct psa2_request *q = r->request;
    assert_non_null(q);
    r->request = NULL;
    q->done(q->ctx, q, result, r->s.now_ns);
}

/* As psa2.h has it: a reset ends a request with a time-out. */
static void fake_reset(void *ctx, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    r->resets++;
    if (r->request) fake_done(r, PSA2_TIMEOUT);
}

static void fake_info(void *ctx, struct psa2_can_info *out)
{
    *out = ((struct rig *)ctx)->info;
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
    if (r->count == SEEN_MAX) return;
    r->seen_ns[r->count] = t_ns;
    r->seen[r->count++] = *m;
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
    host_sends(r, 0, 2, (const uint8_t[]){command, NODE});
    r->count = 0;
}

static void join_bus(struct rig *r, const struct psa2_can_port *port, uint32_t bitrate_hz, uint32_t data_bitrate_hz)
{
    sched_init(&r->s);
    const struct can_bus_cfg bus = {bitrate_hz, data_bitrate_hz};
    can_bus_init(&r->bus, &bus, &r->s);
    r->host = (struct can_node){.name = "host", .fd = true, .rx = on_rx, .ctx = r};
    can_attach(&r->bus, &r->host);
    const struct board_can_cfg cfg = {.name = "unit", .node_id = NODE, .refused = on_refused, .ctx = r};
    psa2_can_init(&r->can, &cfg, port, &r->bus, &r->s);
}

/* A fake board at data_hz on a bus; operational. */
static struct rig *rig_up(uint32_t bitrate_hz, uint32_t data_bitrate_hz, uint32_t data_hz)
{
    struct rig *r = &rig;
    memset(r, 0, sizeof *r);
    r->info =
        (struct psa2_can_info){.period_ns = NS_PER_S / data_hz, .fclk_hz = FCLK_HZ, .serial = 1234, .word_bits = 32};
    const struct psa2_can_port port = {r, fake_submit, fake_reset, fake_info};
    join_bus(r, &port, bitrate_hz, data_bitrate_hz);
    psa2_can_power_up(&r->can, 0);
    settle(r);
    nmt(r, 1);
    return r;
}

static struct psa2_frame sample(struct rig *r)
{
    return (struct psa2_frame){
        .seq = r->seq++,
        .t_sample_ns = r->s.now_ns,
        .code = {0x123456, -2, -8388608},
        .raw = {0x12345678, 0xFFFFFEFF, 0x80000000},
        .temp_code = 0xFFF0,
        .temp_channel = 3,
        .status = PSA2_ST_SETTLED | PSA2_ST_TEMP_NEW,
    };
}

/* n frames of the board, one a data period; the instant given to the module is that of INT's rise. */
static void board_sends(struct rig *r, unsigned n)
{
    for (unsigned i = 0; i < n; i++) {
        const struct psa2_frame f = sample(r);
        psa2_can_frame(&r->can, &f, r->s.now_ns);
        sched_run_until(&r->s, r->s.now_ns + r->info.period_ns);
    }
}

/* One request; the answer is the newest frame seen, if there is one yet. */
static void ask(struct rig *r, uint8_t command, uint16_t index, uint8_t sub, uint32_t data)
{
    uint8_t frame[8] = {command};
    bits_put_le(&frame[1], index, 2);
    frame[3] = sub;
    bits_put_le(&frame[4], data, 4);
    r->count = 0;
    host_sends(r, 0x600 + NODE, 8, frame);
}

static uint32_t answer(const struct rig *r)
{
    for (unsigned i = r->count; i-- > 0;) {
        if (r->seen[i].id == 0x580 + NODE) return (uint32_t)bits_get_le(&r->seen[i].data[4], 4);
    }
    fail_msg("no SDO answer");
    return 0;
}

static uint32_t upload(struct rig *r, uint16_t index, uint8_t sub)
{
    ask(r, 0x40, index, sub, 0);
    return answer(r);
}

static uint32_t write_u8(struct rig *r, uint16_t index, uint8_t sub, uint8_t value)
{
    ask(r, 0x2F, index, sub, value);
    return answer(r);
}

static uint32_t write_u16(struct rig *r, uint16_t index, uint8_t sub, uint16_t value)
{
    ask(r, 0x2B, index, sub, value);
    return answer(r);
}

static const struct can_msg *seen_id(const struct rig *r, uint32_t id)
{
    for (unsigned i = 0; i < r->count; i++) {
        if (r->seen[i].id == id) return &r->seen[i];
    }
    return NULL;
}

static unsigned count_id(const struct rig *r, uint32_t id)
{
    unsigned n = 0;
    for (unsigned i = 0; i < r->count; i++) n += r->seen[i].id == id;
    return n;
}

static const char *refusal(struct rig *r)
{
    static char text[256];
    size_t at = 0;
    ask(r, 0x40, PSA2_OD_REFUSAL, 0, 0);
    for (uint8_t toggle = 0; at + 7 < sizeof text; toggle ^= 0x10) {
        ask(r, (uint8_t)(0x60 | toggle), 0, 0, 0);
        const struct can_msg *m = seen_id(r, 0x580 + NODE);
        assert_non_null(m);
        if (!m) break;
        memcpy(&text[at], &m->data[1], 7);
        at += 7u - (m->data[0] >> 1 & 7u);
        if (m->data[0] & 1) break;
    }
    text[at] = '\0';
    return text;
}

/* ---- frame forms ---- */

static void the_pair_carries_codes_sequence_status_and_time(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    r->seq = 0x1FFFF;
    board_sends(r, 1);
    assert_int_equal(r->count, 2);
    assert_int_equal(r->seen[0].id, 0x185);
    assert_int_equal(r->seen[1].id, 0x285);
    struct psabench_psa2_xy_t xy;
    struct psabench_psa2_zt_t zt;
    assert_int_equal(psabench_psa2_xy_unpack(&xy, r->seen[0].data, r->seen[0].len), 0);
    assert_int_equal(psabench_psa2_zt_unpack(&zt, r->seen[1].data, r->seen[1].len), 0);
    assert_int_equal(xy.x, 0x123456);
    assert_int_equal(xy.y, -2);
    assert_int_equal(xy.seq, 0xFFFF);
    assert_int_equal(zt.z, -8388608);
    assert_int_equal(zt.t, -16);
    assert_int_equal(zt.settled, 1);
    assert_int_equal(zt.clip, 0);
    assert_int_equal(zt.t_new, 1);
    assert_int_equal(zt.channel, 3);
    assert_int_equal(zt.tstamp, r->can.latest.t_sample_ns / 4000 % 65536);
    /* the bytes of sources can 3.3: little-endian, X first */
    static const uint8_t bytes[] = {0x56, 0x34, 0x12, 0xFE, 0xFF, 0xFF, 0xFF, 0xFF};
    assert_memory_equal(r->seen[0].data, bytes, sizeof bytes);
}

static void fast_form_drops_three_bits_towards_minus_infinity(void **state)
{
    (void)state;
    static const struct {
        int32_t code, want;
    } row[] = {{0, 0}, {7, 0}, {8, 1}, {-1, -1}, {-8, -1}, {-9, -2}, {8388607, 1048575}, {-8388608, -1048576}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct rig *r = rig_up(1000000, 0, 4000);
        assert_int_equal(write_u16(r, 0x2022, 0, 0), CO_AB_TOO_LONG);
        r->info.period_ns = NS_PER_S / 1000;
        assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FAST), 0);
        r->count = 0;
        struct psa2_frame f = sample(r);
        f.code[1] = row[i].code;
        psa2_can_frame(&r->can, &f, r->s.now_ns);
        settle(r);
        struct psabench_psa2_fast_t fast;
        assert_int_equal(r->seen[0].id, 0x385);
        assert_int_equal(psabench_psa2_fast_unpack(&fast, r->seen[0].data, 8), 0);
        assert_int_equal(fast.y, row[i].want);
        assert_int_equal(fast.tog, f.seq & 1);
    }
}

static void fd_frame_carries_the_whole_sample(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 5000000, 4000);
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FRAME), 0);
    r->count = 0;
    board_sends(r, 1);
    assert_int_equal(r->seen[0].id, 0x205);
    assert_int_equal(r->seen[0].flags, CAN_FD | CAN_BRS);
    assert_int_equal(r->seen[0].len, 16);
    struct psabench_psa2_frame_t all;
    assert_int_equal(psabench_psa2_frame_unpack(&all, r->seen[0].data, 16), 0);
    assert_int_equal(all.x, 0x123456);
    assert_int_equal(all.z, -8388608);
    assert_int_equal(all.t, -16);
    assert_int_equal(all.channel, 3);
    assert_int_equal(all.tstamp, r->can.latest.t_sample_ns / 1000);
}

static void blocks_carry_five_samples_and_start_anew_after_a_stop(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 5000000, 4000);
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_BLOCK), 0);
    board_sends(r, 3);
    nmt(r, 128);
    nmt(r, 1);
    const int64_t t0_ns = r->s.now_ns;
    board_sends(r, 10);
    settle(r);
    assert_int_equal(count_id(r, 0x485), 2);
    struct psabench_psa2_block_t b;
    assert_int_equal(r->seen[0].len, 64);
    assert_int_equal(psabench_psa2_block_unpack(&b, r->seen[0].data, 64), 0);
    assert_int_equal(b.tstamp, t0_ns / 1000);
    assert_int_equal(b.x0, 0x123456);
    assert_int_equal(b.z4, -8388608);
    assert_int_equal(b.t4, -16);
    assert_int_equal(b.status4, 0x39);
    assert_int_equal(psabench_psa2_block_unpack(&b, r->seen[1].data, 64), 0);
    assert_int_equal(b.tstamp, (t0_ns + 5 * r->info.period_ns) / 1000);
}

/* ---- what the bus can carry: sources can 3.1 ---- */

static void forms_are_taken_or_refused_by_the_worst_case(void **state)
{
    (void)state;
    static const struct {
        uint32_t bitrate_hz, data_bitrate_hz, data_hz;
        uint8_t form;
        uint32_t want;
    } row[] = {
        {1000000, 0, 2000, PSA2_FORM_PAIR, 0},                 /* 54 % */
        {1000000, 0, 4000, PSA2_FORM_PAIR, CO_AB_STATE},       /* 108 % */
        {1000000, 0, 4000, PSA2_FORM_FAST, 0},                 /* 54 % */
        {500000, 0, 4000, PSA2_FORM_FAST, CO_AB_STATE},        /* 108 % */
        {500000, 0, 2000, PSA2_FORM_PAIR, CO_AB_STATE},        /* 108 % */
        {500000, 0, 1000, PSA2_FORM_PAIR, 0},                  /* 54 % */
        {125000, 0, 250, PSA2_FORM_PAIR, 0},                   /* 54 % */
        {125000, 0, 500, PSA2_FORM_PAIR, CO_AB_STATE},         /* 108 % */
        {1000000, 0, 250, PSA2_FORM_FRAME, CO_AB_STATE},       /* no FD */
        {1000000, 0, 250, PSA2_FORM_BLOCK, CO_AB_STATE},       /* no FD */
        {1000000, 5000000, 4000, PSA2_FORM_FRAME, 0},          /* 29 % */
        {1000000, 5000000, 4000, PSA2_FORM_BLOCK, 0},          /* 14 % */
        {1000000, 5000000, 4000, PSA2_FORM_PAIR, CO_AB_STATE}, /* as on a classic bus */
        {125000, 500000, 4000, PSA2_FORM_FRAME, CO_AB_STATE},  /* 263 % */
        {0, 0, 4000, PSA2_FORM_PAIR, 0},                       /* ideal bus */
        {0, 0, 4000, PSA2_FORM_FRAME, CO_AB_STATE},            /* ideal, but classic */
        {0, 1, 4000, PSA2_FORM_FRAME, 0},                      /* ideal and FD */
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct rig *r = rig_up(row[i].bitrate_hz, row[i].data_bitrate_hz, row[i].data_hz);
        /* from a form or rate that fits for sure */
        r->info.period_ns = NS_PER_S;
        assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FAST), 0);
        r->info.period_ns = NS_PER_S / row[i].data_hz;
        assert_int_equal(write_u8(r, 0x2020, 0, row[i].form), row[i].want);
        const bool refused = row[i].want != 0;
        assert_int_equal(upload(r, 0x2020, 0) & 0xFF, refused ? PSA2_FORM_FAST : row[i].form);
        assert_int_equal(strncmp(refusal(r), "refused: ", 9) == 0, refused);
    }
}

static void a_refusal_shows_its_arithmetic_and_ends_with_a_form_that_fits(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 4000);
    assert_string_equal(refusal(r), "refused: form 0 (pair) is 2 frames, at worst 270.000 us at 1000000 bit/s, and due "
                                    "every 250.000 us (4000 /s): 108.0 % of the bus");
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FRAME), CO_AB_STATE);
    assert_string_equal(refusal(r), "refused: form 2 (frame) needs FD frames, this bus has no data bit rate");
    assert_int_equal(upload(r, 0x1001, 0) & 0xFF, 0x81);
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FAST), 0);
    const struct can_msg *m = seen_id(r, 0x085);
    assert_non_null(m);
    assert_int_equal(bits_get_le(m->data, 2), 0);
    assert_string_equal(refusal(r), "");
    assert_int_equal(upload(r, 0x1001, 0) & 0xFF, 0);
}

static void a_refusal_is_told_to_the_listener_once_for_each_reason(void **state)
{
    (void)state;
    struct rig *r = rig_up(125000, 0, 1000);
    assert_int_equal(r->refusals, 1);
    assert_string_equal(r->told,
                        "unit refused: form 0 (pair) is 2 frames, at worst 2160.000 us at 125000 bit/s, and due "
                        "every 1000.000 us (1000 /s): 216.0 % of the bus");
    board_sends(r, 8);
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_PAIR), CO_AB_STATE);
    assert_int_equal(r->refusals, 1); /* the same reason */
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FRAME), CO_AB_STATE);
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FRAME), CO_AB_STATE);
    assert_int_equal(r->refusals, 2);
    assert_string_equal(r->told, "unit refused: form 2 (frame) needs FD frames, this bus has no data bit rate");
    r->info.period_ns = NS_PER_S / 250;
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_PAIR), 0);
    assert_int_equal(r->refusals, 2); /* the end of a refusal is no refusal */
    assert_int_equal(write_u8(r, 0x2020, 0, PSA2_FORM_FRAME), CO_AB_STATE);
    assert_int_equal(r->refusals, 3); /* and after its end it is news again */
}

static void a_data_rate_that_the_form_cannot_carry_never_reaches_the_chip(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    assert_int_equal(write_u8(r, 0x2000, 2, 0x62), CO_AB_STATE); /* DR 100: 4000 SPS */
    assert_null(r->request);
    const struct can_msg *m = seen_id(r, 0x085);
    assert_non_null(m);
    assert_int_equal(bits_get_le(m->data, 2), PSA2_EMCY_STREAM_REFUSED);
    assert_int_equal(strncmp(refusal(r), "refused: form 0 (pair)", 22), 0);
    ask(r, 0x2F, 0x2003, 2, 0x5A); /* DR 011: 2000 SPS; through Y as well */
    assert_non_null(r->request);
    assert_int_equal(r->request->value, 0x5A);
    fake_done(r, PSA2_OK);
    settle(r);
    assert_int_equal(answer(r), 0);
    assert_int_equal(upload(r, 0x1001, 0) & 0xFF, 0);
}

static void a_rate_that_rises_by_itself_stops_the_stream_and_says_so(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    board_sends(r, 2);
    assert_int_equal(r->count, 4);
    r->info.period_ns = NS_PER_S / 4000;
    r->count = 0;
    board_sends(r, 8);
    assert_int_equal(count_id(r, 0x185), 0);
    assert_int_equal(count_id(r, 0x085), 1);
    assert_int_equal(upload(r, 0x2030, 3), 8);
    r->info.period_ns = NS_PER_S / 1000;
    r->count = 0;
    board_sends(r, 2);
    assert_int_equal(count_id(r, 0x185), 2);
    assert_int_equal(count_id(r, 0x085), 1); /* 0000h */
    assert_string_equal(refusal(r), "");
}

/* Two units at 54..62 % each: neither can know of the other, so the loss must show. */
static void samples_the_bus_does_not_take_are_counted_and_told(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 2000);
    struct can_node jammer = {.name = "jam"};
    can_attach(&r->bus, &jammer);
    r->count = 0;
    struct can_msg single = {.len = 8}; /* an odd backlog: room for one half only, at the end */
    assert_int_equal(co_pdo_offer(&r->can.node, PSA2_XY_TPDO, &single, r->s.now_ns), CO_PDO_SENT);
    for (unsigned i = 0; i < 100; i++) {
        const struct can_msg m = {.id = 0x001, .len = 8};
        while (can_room(&jammer) > 0) assert_int_equal(can_send(&r->bus, &jammer, &m, r->s.now_ns), CAN_OK);
        board_sends(r, 1);
    }
    assert_true(r->can.dropped > 80);
    assert_true(co_node_has_error(&r->can.node, PSA2_EMCY_CAN_OVERRUN));
    can_detach(&r->bus, &jammer);
    settle(r);
    assert_int_equal(count_id(r, 0x085), 1);
    assert_int_equal(count_id(r, 0x185), count_id(r, 0x285) + 1); /* halves are never lost alone */
    r->count = 0;
    board_sends(r, 2100);
    assert_int_equal(count_id(r, 0x085), 1);
    assert_int_equal(bits_get_le(seen_id(r, 0x085)->data, 2), 0);
}

/* ---- sample modes ---- */

static void every_nth_frame_is_one_whose_number_divides(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    assert_int_equal(write_u16(r, 0x2023, 0, 4), 0);
    assert_int_equal(write_u8(r, 0x2022, 0, 2), 0);
    r->count = 0;
    r->seq = 1;
    board_sends(r, 12);
    assert_int_equal(count_id(r, 0x185), 3);
    assert_int_equal(bits_get_le(&r->seen[0].data[6], 2), 4);
}

static void dividing_lets_a_high_rate_through(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 4000);
    assert_int_equal(write_u16(r, 0x2023, 0, 2), CO_AB_STATE); /* mode 0 yet: still 108 % */
    assert_int_equal(write_u8(r, 0x2022, 0, 1), 0);
    assert_int_equal(write_u16(r, 0x2023, 0, 2), 0);
    assert_int_equal(write_u8(r, 0x2022, 0, 2), 0); /* 54 % */
    assert_int_equal(write_u8(r, 0x2022, 0, 0), CO_AB_STATE);
}

static void on_sync_the_next_sample_is_sent_once(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    assert_int_equal(write_u8(r, 0x2022, 0, 1), 0);
    r->count = 0;
    board_sends(r, 3);
    assert_int_equal(r->count, 0);
    struct psa2_frame before = sample(r);
    host_sends(r, 0x080, 0, NULL);
    psa2_can_frame(&r->can, &before, r->s.now_ns); /* sampled before the SYNC */
    settle(r);
    assert_int_equal(count_id(r, 0x185), 0);
    board_sends(r, 3);
    assert_int_equal(count_id(r, 0x185), 1);
    assert_int_equal(r->pulses, 0);
}

static void sync_pulses_the_pin_when_it_is_told_to(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    assert_int_equal(write_u8(r, 0x2024, 0, 1), 0);
    host_sends(r, 0x080, 1, (const uint8_t[]){7});
    assert_int_equal(r->pulses, 1);
    host_sends(r, 0x080, 1, (const uint8_t[]){8}); /* the first is under way */
    assert_int_equal(r->can.syncs_missed, 1);
    assert_true(r->can.pulse_busy);
    fake_done(r, PSA2_OK);
    host_sends(r, 0x080, 1, (const uint8_t[]){9});
    assert_int_equal(r->pulses, 2);
}

/* ---- registers ---- */

static void registers_are_read_per_chip_and_written_to_all(void **state)
{
    (void)state;
    static const struct {
        uint16_t index;
        uint8_t sub;
        enum psa2_group group;
        uint8_t addr, want;
    } row[] = {
        {0x2000, 2, PSA2_ACCEL, 1, 0xA1},
        {0x2003, 2, PSA2_ACCEL, 1, 0xA2},
        {0x2004, 11, PSA2_ACCEL, 10, 0xA3},
        {0x2001, 1, PSA2_TEMP, 0, 0xA1},
    };
    struct rig *r = rig_up(1000000, 0, 1000);
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        ask(r, 0x40, row[i].index, row[i].sub, 0);
        assert_int_equal(r->count, 0); /* not before the board has answered */
        assert_int_equal(r->request->op, PSA2_READ_REG);
        assert_int_equal(r->request->group, row[i].group);
        assert_int_equal(r->request->addr, row[i].addr);
        memcpy(r->request->answer, (const uint8_t[]){0xA1, 0xA2, 0xA3}, 3);
        fake_done(r, PSA2_OK);
        settle(r);
        assert_int_equal(answer(r), row[i].want);
    }
}

static void results_of_the_board_become_abort_codes(void **state)
{
    (void)state;
    static const struct {
        enum psa2_result submit, done;
        uint32_t want;
    } row[] = {
        {PSA2_OK, PSA2_OK, 0},
        {PSA2_NO_SUCH_REG, PSA2_OK, 0x06090011},
        {PSA2_READ_ONLY, PSA2_OK, 0x06010002},
        {PSA2_BAD_VALUE, PSA2_OK, 0x06090030},
        {PSA2_BUSY, PSA2_OK, 0x08000022},
        {PSA2_OK, PSA2_BAD_VALUE, 0x06090030},
        {PSA2_OK, PSA2_TIMEOUT, 0x08000020},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct rig *r = rig_up(1000000, 0, 1000);
        r->accept = row[i].submit;
        ask(r, 0x2F, 0x2000, 4, 0x11);
        if (row[i].submit == PSA2_OK) fake_done(r, row[i].done);
        settle(r);
        assert_int_equal(answer(r), row[i].want);
        const bool timeout = row[i].done == PSA2_TIMEOUT;
        assert_int_equal(count_id(r, 0x085), timeout);
        if (timeout) assert_int_equal(bits_get_le(seen_id(r, 0x085)->data, 2), 0xFF01);
    }
}

static void objects_outside_the_map_have_the_codes_of_cia_301(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    assert_int_equal(upload(r, 0x2002, 0), CO_AB_NO_OBJECT); /* PSD-1's */
    assert_int_equal(upload(r, 0x2000, 12), CO_AB_NO_SUB);
    assert_int_equal(write_u8(r, 0x2000, 1, 0), CO_AB_READ_ONLY); /* ID */
    assert_int_equal(write_u8(r, 0x2020, 0, 4), CO_AB_VALUE);
    assert_int_equal(write_u8(r, 0x2021, 0, 16), CO_AB_READ_ONLY);
    assert_int_equal(upload(r, 0x2010, 1), CO_AB_WRITE_ONLY);
}

static void opcodes_reach_their_group_and_are_answered_when_accepted(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    for (uint8_t sub = 1; sub <= 2; sub++) {
        ask(r, 0x2F, 0x2010, sub, 0x04);
        assert_int_equal(r->request->op, PSA2_OPCODE);
        assert_int_equal(r->request->group, sub == 1 ? PSA2_ACCEL : PSA2_TEMP);
        assert_int_equal(r->request->value, 0x04);
        assert_int_equal(r->count, 0);
        fake_done(r, PSA2_OK);
        settle(r);
        assert_int_equal(answer(r), 0);
    }
}

static void a_client_that_gives_up_finds_the_port_busy_until_the_board_is_done(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    ask(r, 0x40, 0x2000, 2, 0);
    assert_int_equal(upload(r, 0x1000, 0), 0x194); /* other objects are served */
    assert_int_equal(upload(r, 0x2000, 3), CO_AB_STATE);
    assert_int_equal(r->request->addr, 1); /* the board still has the first, untouched */
    r->count = 0;
    fake_done(r, PSA2_OK);
    settle(r);
    assert_int_equal(r->count, 0); /* nobody waits for it */
    ask(r, 0x40, 0x2000, 3, 0);
    fake_done(r, PSA2_OK);
    settle(r);
    assert_int_equal(answer(r), 0);
}

static void a_port_fault_of_the_board_is_told_and_ends_with_data(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    psa2_can_fault(&r->can, PSA2_FAULT_ACCEL_PORT, r->s.now_ns);
    psa2_can_fault(&r->can, PSA2_FAULT_TEMP_PORT, r->s.now_ns);
    settle(r);
    assert_int_equal(count_id(r, 0x085), 2);
    struct psa2_frame f = sample(r);
    f.status = PSA2_ST_SETTLED;
    psa2_can_frame(&r->can, &f, r->s.now_ns);
    assert_false(co_node_has_error(&r->can.node, PSA2_EMCY_ACCEL_PORT));
    assert_true(co_node_has_error(&r->can.node, PSA2_EMCY_TEMP_PORT));
    f.status |= PSA2_ST_TEMP_NEW;
    psa2_can_frame(&r->can, &f, r->s.now_ns);
    assert_false(co_node_has_error(&r->can.node, PSA2_EMCY_TEMP_PORT));
}

/* ---- resets, mirrors, several units ---- */

static void reset_node_is_the_reset_pin_and_restores_defaults(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    write_u8(r, 0x2020, 0, PSA2_FORM_FAST);
    ask(r, 0x40, 0x2000, 2, 0); /* under way when the reset comes */
    nmt(r, 129);
    assert_int_equal(r->resets, 1);
    assert_null(r->request);
    assert_int_equal(upload(r, 0x2020, 0) & 0xFF, PSA2_FORM_PAIR);
    assert_int_equal(upload(r, 0x1001, 0) & 0xFF, 0); /* the time-out of the reset is no fault */
    assert_int_equal(upload(r, 0x1800, 1), 0x40000185);
    write_u8(r, 0x2020, 0, PSA2_FORM_FAST);
    nmt(r, 130);
    assert_int_equal(r->resets, 1);
    assert_int_equal(upload(r, 0x2020, 0) & 0xFF, PSA2_FORM_FAST);
    assert_int_equal(upload(r, 0x1800, 1), 0xC0000185);
    assert_int_equal(upload(r, 0x1802, 1), 0x40000385);
}

static void mirrors_show_the_latest_sample(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    board_sends(r, 1);
    assert_int_equal(upload(r, 0x2200, 1) & 0xFFFFFF, 0x123456);
    assert_int_equal(upload(r, 0x2200, 2) & 0xFFFFFF, 0xFFFFFE);
    assert_int_equal(upload(r, 0x2200, 4) & 0xFFFFFF, 0xFFFFF0);
    assert_int_equal(upload(r, 0x2201, 3), 0x80000000);
    assert_int_equal(upload(r, 0x2202, 2) & 0xFF, 0x39);
    assert_int_equal(upload(r, 0x1018, 4), 1234);
    assert_int_equal(upload(r, 0x2021, 0) & 0xFF, 32);
    /* Z is -10 V; u0 2.5 V, k 1 V/g by default: -12.5 g */
    float g = 0;
    const uint32_t raw = upload(r, 0x6130, 3);
    memcpy(&g, &raw, sizeof g);
    assert_true(g == -12.5f);
    assert_int_equal((int32_t)upload(r, 0x9130, 3), -12500000);
    ask(r, 0x23, 0x2211, 3, 0x40000000); /* 2 V/g */
    assert_int_equal((int32_t)upload(r, 0x9130, 3), -6250000);
}

static void bus_load_is_what_the_stream_takes(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    (void)upload(r, 0x2030, 4);
    board_sends(r, 1000);
    assert_in_range(upload(r, 0x2030, 4) & 0xFFFF, 222, 270); /* sources can 3.1: 22..27 % */
}

static void two_units_share_a_bus_by_their_identifiers(void **state)
{
    (void)state;
    struct rig *r = rig_up(1000000, 0, 1000);
    static struct psa2_can other;
    const struct psa2_can_port port = {r, fake_submit, fake_reset, fake_info};
    const struct board_can_cfg cfg = {.name = "other", .node_id = 7};
    psa2_can_init(&other, &cfg, &port, &r->bus, &r->s);
    psa2_can_power_up(&other, r->s.now_ns);
    settle(r);
    assert_non_null(seen_id(r, 0x707));
    host_sends(r, 0, 2, (const uint8_t[]){1, 0});
    r->count = 0;
    for (unsigned i = 0; i < 10; i++) {
        const struct psa2_frame f = sample(r);
        psa2_can_frame(&other, &f, r->s.now_ns);
        board_sends(r, 1);
    }
    assert_int_equal(count_id(r, 0x185), 10);
    assert_int_equal(count_id(r, 0x187), 10);
    assert_int_equal(count_id(r, 0x287), 10);
    psa2_can_power_down(&other);
    assert_int_equal(upload(r, 0x1000, 0), 0x194);
}

/* ---- a real board ---- */

static struct unit real;

static struct rig *real_up(void)
{
    struct rig *r = &rig;
    memset(r, 0, sizeof *r);
    memset(&real, 0, sizeof real);
    const struct psa2_can_port port = psa2_can_port(&real.store.psa2);
    join_bus(r, &port, 1000000, 0);
    struct unit_cfg cfg = unit_default("unit");
    static struct psa2_profile profile;
    profile = psa2_profile_default();
    cfg.profile = &profile;
    static struct lab lab;
    struct lab_cfg lab_cfg = lab_default();
    lab_cfg.head.turn_s = 1.0;
    lab_init(&lab, &lab_cfg, 1);
    unit_init(&real, &cfg, &lab, &r->s);
    psa2_attach(real.board, &(struct psa2_host){&r->can, psa2_can_frame, psa2_can_fault});
    psa2_power_up(real.board, 0);
    psa2_can_power_up(&r->can, 0);
    return r;
}

static void the_article_s_set_up_is_read_back_through_can(void **state)
{
    (void)state;
    struct rig *r = real_up();
    sched_run_until(&r->s, 2 * NS_PER_S);
    assert_true(psa2_ready(real.board));
    assert_int_equal(upload(r, 0x2000, 2) & 0xFF, 0x56); /* CONFIG0 */
    assert_int_equal(upload(r, 0x2004, 2) & 0xFF, 0x56);
    assert_int_equal(write_u8(r, 0x2003, 4, 0x77), 0); /* HPF0 through Y */
    assert_int_equal(upload(r, 0x2000, 4) & 0xFF, 0x77);
    assert_int_equal(write_u8(r, 0x2000, 2, 0x6E), CO_AB_VALUE); /* DR 101, reserved */
    assert_int_equal(write_u8(r, 0x2000, 2, 0x66), CO_AB_STATE); /* 4000 SPS as pairs */
}

static void a_real_board_streams_a_pair_a_millisecond_after_start(void **state)
{
    (void)state;
    struct rig *r = real_up();
    sched_run_until(&r->s, 2 * NS_PER_S);
    nmt(r, 1);
    sched_run_until(&r->s, r->s.now_ns + NS_PER_S);
    assert_in_range(count_id(r, 0x185), 999, 1006);
    assert_int_equal(count_id(r, 0x085), 0);
    const struct can_msg *last = NULL;
    for (unsigned i = 0; i < r->count; i++) {
        if (r->seen[i].id != 0x185) continue;
        if (last) assert_int_equal((uint16_t)(bits_get_le(&r->seen[i].data[6], 2) - bits_get_le(&last->data[6], 2)), 1);
        last = &r->seen[i];
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_pair_carries_codes_sequence_status_and_time),
        cmocka_unit_test(fast_form_drops_three_bits_towards_minus_infinity),
        cmocka_unit_test(fd_frame_carries_the_whole_sample),
        cmocka_unit_test(blocks_carry_five_samples_and_start_anew_after_a_stop),
        cmocka_unit_test(forms_are_taken_or_refused_by_the_worst_case),
        cmocka_unit_test(a_refusal_shows_its_arithmetic_and_ends_with_a_form_that_fits),
        cmocka_unit_test(a_refusal_is_told_to_the_listener_once_for_each_reason),
        cmocka_unit_test(a_data_rate_that_the_form_cannot_carry_never_reaches_the_chip),
        cmocka_unit_test(a_rate_that_rises_by_itself_stops_the_stream_and_says_so),
        cmocka_unit_test(samples_the_bus_does_not_take_are_counted_and_told),
        cmocka_unit_test(every_nth_frame_is_one_whose_number_divides),
        cmocka_unit_test(dividing_lets_a_high_rate_through),
        cmocka_unit_test(on_sync_the_next_sample_is_sent_once),
        cmocka_unit_test(sync_pulses_the_pin_when_it_is_told_to),
        cmocka_unit_test(registers_are_read_per_chip_and_written_to_all),
        cmocka_unit_test(results_of_the_board_become_abort_codes),
        cmocka_unit_test(objects_outside_the_map_have_the_codes_of_cia_301),
        cmocka_unit_test(opcodes_reach_their_group_and_are_answered_when_accepted),
        cmocka_unit_test(a_client_that_gives_up_finds_the_port_busy_until_the_board_is_done),
        cmocka_unit_test(a_port_fault_of_the_board_is_told_and_ends_with_data),
        cmocka_unit_test(reset_node_is_the_reset_pin_and_restores_defaults),
        cmocka_unit_test(mirrors_show_the_latest_sample),
        cmocka_unit_test(bus_load_is_what_the_stream_takes),
        cmocka_unit_test(two_units_share_a_bus_by_their_identifiers),
        cmocka_unit_test(the_article_s_set_up_is_read_back_through_can),
        cmocka_unit_test(a_real_board_streams_a_pair_a_millisecond_after_start),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
