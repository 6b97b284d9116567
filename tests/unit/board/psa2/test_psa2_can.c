/* PSA-2 on CAN: frame forms, sample modes, mirrors, two units, a real board. */
#include "psa2_can_rig.h"

#include "board/psa2/board.h"

static uint32_t write_u16(struct rig *r, uint16_t index, uint8_t sub, uint16_t value)
{
    ask(r, 0x2B, index, sub, value);
    return answer(r);
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

/* ---- resets, mirrors, several units ---- */

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
    const struct psa2_can_port port = {r, fake_submit, fake_info};
    const struct board_can_cfg cfg = {.name = "other", .type = &fake_type, .node_id = 7};
    psa2_can_init(&other, &cfg, &port, &r->bus, &r->s);
    board_node_power_up(&other, r->s.now_ns);
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
    join_bus(r, &psa2_board, &port, 1000000, 0);
    struct unit_cfg cfg = unit_default("unit");
    static struct psa2_profile profile;
    fields_default(&psa2_fields, &profile);
    cfg.profile = &profile;
    static struct lab lab;
    struct lab_cfg lab_cfg = lab_default();
    lab_cfg.head.turn_s = 1.0;
    lab_init(&lab, &lab_cfg, 1);
    unit_init(&real, &cfg, &lab, &r->s);
    real.store.psa2.host = (struct psa2_host){.ctx = &r->can, .frame = psa2_can_frame, .fault = psa2_can_fault};
    psa2_power_up(&real.store.psa2, 0);
    board_node_power_up(&r->can, 0);
    return r;
}

static void the_article_s_set_up_is_read_back_through_can(void **state)
{
    (void)state;
    struct rig *r = real_up();
    sched_run_until(&r->s, 2 * NS_PER_S);
    assert_true(psa2_ready(&real.store.psa2));
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
        cmocka_unit_test(every_nth_frame_is_one_whose_number_divides),
        cmocka_unit_test(dividing_lets_a_high_rate_through),
        cmocka_unit_test(on_sync_the_next_sample_is_sent_once),
        cmocka_unit_test(sync_pulses_the_pin_when_it_is_told_to),
        cmocka_unit_test(mirrors_show_the_latest_sample),
        cmocka_unit_test(bus_load_is_what_the_stream_takes),
        cmocka_unit_test(two_units_share_a_bus_by_their_identifiers),
        cmocka_unit_test(the_article_s_set_up_is_read_back_through_can),
        cmocka_unit_test(a_real_board_streams_a_pair_a_millisecond_after_start),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
