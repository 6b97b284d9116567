/* A receiver on a unit and a bus: its grid, its serial port at the bit rate, CAN, lines, faults. */
#include "rig.h"

#include "base/detmath.h"
#include "board/receiver/nmea.h"
#include "board/receiver/ubx.h"
#include "canopen/co_node.h"
#include "gen/psabench_can.h"
#include "unit/unit.h"

#include <math.h>
#include <string.h>

#define MS      INT64_C(1000000)
#define BYTES   65536u
#define REPORTS 256u
#define EDGES   4096u

static struct world {
    struct sched s;
    struct lab lab;
    struct can_bus bus;
    struct can_node host;
    struct unit u;
    struct receiver_profile profile;
    uint8_t byte[BYTES]; /* of the serial port */
    int64_t byte_ns[BYTES];
    unsigned bytes;
    struct psabench_receiver_position_t position[REPORTS];
    struct psabench_receiver_time_t time[REPORTS];
    int64_t time_ns[REPORTS];
    unsigned positions, times;
    struct trace_sink sink;
    int64_t edge_ns[RECEIVER_LINES][EDGES];
    bool edge[RECEIVER_LINES][EDGES];
    unsigned edges[RECEIVER_LINES];
} w;

static void on_byte(void *ctx, uint8_t byte, int64_t t_ns)
{
    (void)ctx;
    assert_true(w.bytes < BYTES);
    w.byte[w.bytes] = byte;
    w.byte_ns[w.bytes++] = t_ns;
}

static void on_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    (void)ctx;
    if (m->id == 0x18C && w.positions < REPORTS)
        assert_int_equal(psabench_receiver_position_unpack(&w.position[w.positions++], m->data, m->len), 0);
    if (m->id == 0x48C && w.times < REPORTS) {
        w.time_ns[w.times] = t_ns;
        assert_int_equal(psabench_receiver_time_unpack(&w.time[w.times++], m->data, m->len), 0);
    }
}

static void on_change(void *ctx, unsigned sig, bool level, int64_t t_ns)
{
    (void)ctx;
    assert_true(w.edges[sig] < EDGES);
    w.edge_ns[sig][w.edges[sig]] = t_ns;
    w.edge[sig][w.edges[sig]++] = level;
}

static void on_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    trace_each(s, n, w.sink.mask, on_change, ctx);
}

static struct receiver *rx(void)
{
    return (struct receiver *)w.u.board;
}

static void run_to(int64_t t_ns)
{
    sched_run_until(&w.s, t_ns);
    trace_advance(unit_trace(&w.u), t_ns);
}

/* Profile without errors, to be changed; then power_up(). */
static struct receiver_profile *prepare(void)
{
    memset(&w, 0, sizeof w);
    fields_default(&receiver_fields, &w.profile);
    w.profile.white_m = w.profile.slow_m = w.profile.white_mps = w.profile.slow_mps = 0.0;
    return &w.profile;
}

static void power_up_at(double lat_deg, double lon_deg)
{
    struct lab_cfg lab = lab_default();
    const struct can_bus_cfg bus = {.bitrate_hz = 1000000};
    const struct board_can_cfg can = {.name = "a", .node_id = receiver_board.node};
    struct unit_cfg cfg = unit_default("a");
    char why[200];
    if (!receiver_profile_check(&w.profile, why, sizeof why)) fail_msg("%s", why);
    lab.site = (struct site){9.81, lat_deg * RAD_PER_DEG, lon_deg * RAD_PER_DEG, 150.0, 0.0, true};
    w.host = (struct can_node){.name = "host", .rx = on_frame};
    sched_init(&w.s);
    lab_init(&w.lab, &lab, 1);
    can_bus_init(&w.bus, &bus, &w.s);
    can_attach(&w.bus, &w.host);
    unit_cfg_type(&cfg, &receiver_board);
    cfg.profile = &w.profile;
    unit_init(&w.u, &cfg, &w.lab, &w.s);
    unit_connect(&w.u, &can, &w.bus, &w.s);
    receiver_board.serial->connect(w.u.board, on_byte, NULL);
    unit_power_up(&w.u, 0);
    const struct can_msg start = {.id = 0, .len = 2, .data = {1, 0}};
    run_to(10 * MS);
    can_send(&w.bus, &w.host, &start, w.s.now_ns);
}

static void power_up(void)
{
    power_up_at(55.75, 37.61);
}

static void watch_line(enum receiver_line line)
{
    w.sink = (struct trace_sink){.mask = TRACE_BIT(line), .steps = on_steps};
    trace_attach(unit_trace(&w.u), &w.sink);
    memset(w.edges, 0, sizeof w.edges);
}

/* ---- solutions */

static void solutions_lie_on_the_grid_of_the_bench_s_time(void **state)
{
    (void)state;
    prepare()->rate_hz = 5;
    power_up();
    run_to(10 * NS_PER_S + 50 * MS);
    assert_int_equal(w.times, 50);
    for (unsigned i = 0; i < w.times; i++) {
        assert_int_equal(w.time[i].tow, 86418000 + 200 * (i + 1)); /* Monday, and 18 leap seconds */
        assert_int_equal(w.time[i].week, 2400);
        assert_int_equal(w.time[i].seq, i + 1);
        assert_int_equal(w.time[i].fix, 3);
        const int64_t late_ns = w.time_ns[i] - (int64_t)(i + 1) * 200 * MS; /* compute_ms and four frames */
        assert_true(late_ns > 20 * MS && late_ns < 21 * MS);
    }
    assert_int_equal(rx()->counters.solutions, 50);
    assert_int_equal(rx()->counters.fixes, 50);
}

static void a_reading_on_can_is_the_report(void **state)
{
    (void)state;
    prepare();
    power_up();
    run_to(NS_PER_S / 2);
    assert_int_equal(w.positions, w.times);
    assert_int_equal(w.position[0].lat, 557500000);
    assert_int_equal(w.position[0].lon, 376100000);
    assert_int_equal(rx()->latest.report.h_mm, 150000);
}

static void the_antimeridian_and_a_pole_stay_on_the_earth(void **state)
{
    static const struct {
        double lat_deg, lon_deg;
    } at[] = {{0.0, 180.0}, {90.0, 0.0}, {-90.0, -77.0}, {89.99999, 180.0}, {10.0, 360.0}, {-10.0, -180.0}};
    (void)state;
    for (unsigned i = 0; i < COUNT(at); i++) {
        struct receiver_profile *p = prepare();
        p->white_m = 20.0;
        p->message_count = 1;
        power_up_at(at[i].lat_deg, at[i].lon_deg);
        run_to(20 * NS_PER_S);
        assert_true(w.positions > 190);
        for (unsigned k = 0; k < w.positions; k++) {
            assert_true(abs(w.position[k].lat) <= 900000000);
            assert_true(w.position[k].lon > -1800000000 && w.position[k].lon <= 1800000000);
        }
    }
}

static void what_rounds_to_the_antimeridian_is_east(void **state)
{
    (void)state;
    prepare();
    power_up_at(10.0, -179.99999999);
    run_to(NS_PER_S / 2);
    assert_int_equal(w.position[0].lon, 1800000000);
}

static void reset_and_power_begin_anew(void **state)
{
    (void)state;
    prepare();
    power_up();
    run_to(2 * NS_PER_S);
    assert_true(receiver_board.ready(w.u.board));
    receiver_board.reset(w.u.board, w.s.now_ns);
    assert_false(receiver_board.ready(w.u.board));
    assert_int_equal(rx()->tx.count, 0);
    run_to(2 * NS_PER_S + 150 * MS);
    assert_int_equal(rx()->latest.seq, 1);
    unit_power_down(&w.u, w.s.now_ns);
    w.bytes = w.times = 0;
    run_to(4 * NS_PER_S);
    assert_int_equal(w.bytes + w.times, 0);
    unit_power_up(&w.u, w.s.now_ns);
    run_to(4 * NS_PER_S + 250 * MS);
    assert_int_equal(rx()->latest.seq, 2);
    assert_int_equal(rx()->counters.resets, 1);
}

static void the_first_fix_takes_its_time(void **state)
{
    (void)state;
    prepare()->first_fix_s = 1.25;
    power_up();
    run_to(2 * NS_PER_S + 50 * MS);
    assert_int_equal(w.times, 20);
    for (unsigned i = 0; i < w.times; i++) assert_int_equal(w.time[i].fix, i + 1 >= 13 ? 3 : 0);
}

/* ---- serial port */

static void bytes_leave_at_the_bit_rate(void **state)
{
    static const uint32_t bauds[] = {4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800};
    (void)state;
    for (unsigned k = 0; k < COUNT(bauds); k++) {
        struct receiver_profile *p = prepare();
        p->rate_hz = 1;
        p->baud = bauds[k];
        p->message[0] = (enum receiver_message)NMEA_GGA;
        p->message[1] = (enum receiver_message)NMEA_RMC;
        p->message_count = 2;
        power_up();
        run_to(NS_PER_S + 900 * MS);
        assert_true(w.bytes > 100);
        for (unsigned i = 0; i < w.bytes;
             i++) { /* a start bit, eight, a stop bit each, from 20 ms after the second on */
            const double due_ns = 1e9 + 20e6 + (i + 1) * 10.0 * 1e9 / bauds[k];
            assert_true(fabs((double)w.byte_ns[i] - due_ns) <= 1.0);
        }
        assert_memory_equal(w.byte, "$GPGGA,000001.00,5545.00000,N,03736.60000,E,1,", 46);
    }
}

static void messages_come_in_the_order_of_the_profile(void **state)
{
    (void)state;
    prepare();
    power_up();
    run_to(190 * MS);
    static const char *const begin[] = {"$GPGGA,", "$GPGSA,", "$GPRMC,", "$GPVTG,", "$GPZDA,"};
    const uint8_t *at = w.byte;
    for (unsigned i = 0; i < COUNT(begin); i++) {
        assert_memory_equal(at, begin[i], 7);
        at = memchr(at, '\n', (size_t)(w.byte + w.bytes - at));
        assert_non_null(at++);
    }
    assert_memory_equal(at, ((const uint8_t[]){0xB5, 0x62, 1, 7}), 4);
    assert_int_equal(w.byte + w.bytes - at, UBX_PVT_LEN);
}

/* As a real receiver overruns: whole messages are lost, and none is torn. */
static void what_does_not_fit_is_lost_whole_and_named(void **state)
{
    char unfit[64];
    (void)state;
    struct receiver_profile *p = prepare();
    receiver_profile_unfit(p, unfit, sizeof unfit);
    assert_string_equal(unfit, "");
    p->baud = 38400; /* 384 bytes in a period: four sentences */
    receiver_profile_unfit(p, unfit, sizeof unfit);
    assert_string_equal(unfit, "ZDA, PVT");
    p->baud = 9600; /* 96 bytes */
    receiver_profile_unfit(p, unfit, sizeof unfit);
    assert_string_equal(unfit, "GSA, RMC, VTG, ZDA, PVT");
    p->message_count = 5; /* without the packet, so that lines are all there is */
    power_up();
    run_to(20 * NS_PER_S);
    assert_true(rx()->counters.lost_messages > 200);
    assert_true(w.bytes > 960 * 19 && w.bytes <= 960 * 20);
    unsigned lines = 0, from = 0;
    for (unsigned i = 0; i < w.bytes; i++) {
        if (w.byte[i] != '\n') continue;
        char sum[8];
        assert_int_equal(w.byte[from], '$');
        snprintf(sum, sizeof sum, "*%02X\r", nmea_checksum((const char *)w.byte + from + 1, i - from - 5));
        assert_memory_equal(w.byte + i - 4, sum, 4);
        from = i + 1;
        lines++;
    }
    assert_true(lines > 200);
    assert_int_equal(rx()->counters.messages + rx()->counters.lost_messages, 5 * 199);
}

/* ---- lines */

static void pps_rises_with_each_second(void **state)
{
    (void)state;
    prepare();
    power_up();
    run_to(NS_PER_S / 2);
    watch_line(RECEIVER_LINE_PPS);
    run_to(5 * NS_PER_S + 500 * MS);
    assert_int_equal(w.edges[RECEIVER_LINE_PPS], 10);
    for (unsigned i = 0; i < 5; i++) {
        assert_int_equal(w.edge_ns[RECEIVER_LINE_PPS][2 * i], (int64_t)(i + 1) * NS_PER_S);
        assert_int_equal(w.edge_ns[RECEIVER_LINE_PPS][1 + 2 * i], (int64_t)(i + 1) * NS_PER_S + 100 * MS);
    }
}

static void txd_carries_the_bytes(void **state)
{
    (void)state;
    struct receiver_profile *p = prepare();
    p->rate_hz = 1;
    p->baud = 9600;
    power_up();
    watch_line(RECEIVER_LINE_TXD);
    run_to(NS_PER_S + 200 * MS);
    bool level[2048];
    unsigned e = 0;
    for (unsigned k = 0; k < 100 * 10; k++) { /* in the middle of each bit */
        const int64_t t_ns = NS_PER_S + 20 * MS + (int64_t)((k + 0.5) * 1e9 / 9600);
        while (e + 1 < w.edges[RECEIVER_LINE_TXD] && w.edge_ns[RECEIVER_LINE_TXD][e + 1] <= t_ns) e++;
        level[k] = w.edge[RECEIVER_LINE_TXD][e];
    }
    for (unsigned i = 0; i < 100; i++) {
        unsigned byte = 0;
        for (unsigned bit = 0; bit < 8; bit++) byte |= (unsigned)level[10 * i + 1 + bit] << bit;
        assert_false(level[10 * i]);
        assert_true(level[10 * i + 9]);
        assert_int_equal(byte, w.byte[i]);
    }
}

/* ---- faults */

static void set_faults(const struct board_receiver_faults *f)
{
    receiver_board.receiver->set_faults(w.u.board, f, w.s.now_ns);
}

static double north_m(unsigned i)
{
    return (w.position[i].lat - 557500000) * 1e-7 * 111340.0; /* a degree of latitude at 55.75 */
}

static void faults_do_what_they_say(void **state)
{
    (void)state;
    prepare();
    power_up();
    run_to(NS_PER_S + 50 * MS);
    set_faults(&(struct board_receiver_faults){.outage = true});
    run_to(2 * NS_PER_S + 50 * MS);
    set_faults(&(struct board_receiver_faults){.frozen_time = true});
    run_to(3 * NS_PER_S + 50 * MS);
    set_faults(&(struct board_receiver_faults){.weeks = -1024});
    run_to(4 * NS_PER_S + 50 * MS);
    set_faults(&(struct board_receiver_faults){.jump_m = {0.0, 100.0}});
    run_to(5 * NS_PER_S + 50 * MS);
    set_faults(&(struct board_receiver_faults){.rate_mps = {0.0, 10.0}});
    run_to(7 * NS_PER_S + 50 * MS);
    set_faults(&(struct board_receiver_faults){.weeks = 0});
    run_to(8 * NS_PER_S + 50 * MS);
    assert_int_equal(w.times, 80);
    for (unsigned i = 0; i < 80; i++) {
        const bool frozen = i >= 20 && i < 30;
        assert_int_equal(w.time[i].fix, i >= 10 && i < 20 ? 0 : 3);
        assert_int_equal(w.time[i].week, i >= 30 && i < 40 ? 1376 : 2400);
        assert_int_equal(w.time[i].tow, 86418000 + 100 * (frozen ? 20 : i + 1));
        const double due_m = i >= 40 && i < 50 ? 100.0 : i >= 50 && i < 70 ? 10.0 * (0.1 * (i + 1) - 5.05) : 0.0;
        if (fabs(north_m(i) - due_m) > 0.05) fail_msg("%u: %.3f m north, expected %.3f", i, north_m(i), due_m);
    }
}

static void frozen_words_repeat_place_and_velocity_alone(void **state)
{
    (void)state;
    prepare()->white_m = 5.0;
    power_up();
    run_to(NS_PER_S + 50 * MS);
    board_set_faults(w.u.board, RECEIVER_FAULT_FROZEN_WORDS);
    run_to(2 * NS_PER_S + 50 * MS);
    for (unsigned i = 11; i < 20; i++) {
        assert_int_equal(w.position[i].lat, w.position[10].lat);
        assert_int_equal(w.time[i].tow, w.time[i - 1].tow + 100);
    }
    assert_true(w.position[9].lat != w.position[8].lat);
}

static unsigned count_bad(unsigned *all)
{
    unsigned bad = 0, from = 0;
    *all = 0;
    for (unsigned i = 0; i < w.bytes; i++) {
        if (w.byte[i] != '\n') continue;
        char sum[8];
        snprintf(sum, sizeof sum, "%02X", nmea_checksum((const char *)w.byte + from + 1, i - from - 5));
        bad += memcmp(w.byte + i - 3, sum, 2) != 0;
        from = i + 1;
        ++*all;
    }
    return bad;
}

static void a_share_of_the_checksums_is_wrong(void **state)
{
    unsigned all;
    (void)state;
    prepare()->message_count = 5;
    power_up();
    set_faults(&(struct board_receiver_faults){.checksum_probability = 0.3});
    run_to(8 * NS_PER_S);
    const unsigned bad = count_bad(&all);
    assert_int_equal(all, 5 * 79);
    assert_true(bad > 80 && bad < 160); /* 118 and 9 */
    set_faults(&(struct board_receiver_faults){.checksum_probability = 1.0});
    w.bytes = 0;
    run_to(9 * NS_PER_S);
    assert_int_equal(count_bad(&all), 50);
    assert_int_equal(all, 50);
}

/* ---- profile */

static void a_profile_that_cannot_be_is_rejected(void **state)
{
    char why[200];
    (void)state;
    prepare()->rate_hz = 3;
    assert_false(receiver_profile_check(&w.profile, why, sizeof why));
    assert_string_equal(why, "rate_hz: expected 1, 2, 4, 5 or 10, got 3");
    prepare()->baud = 14400;
    assert_false(receiver_profile_check(&w.profile, why, sizeof why));
    assert_memory_equal(why, "baud: expected 4800 times", 25);
    prepare()->compute_ms = 100;
    assert_false(receiver_profile_check(&w.profile, why, sizeof why));
    assert_string_equal(why, "compute_ms: expected less than the period, 100 ms, got 100");
    prepare()->velocity_delay_s = -0.11;
    assert_false(receiver_profile_check(&w.profile, why, sizeof why));
    snprintf(prepare()->start_utc, sizeof w.profile.start_utc, "2026-02-30T00:00:00");
    assert_false(receiver_profile_check(&w.profile, why, sizeof why));
    assert_memory_equal(why, "start_utc: expected a date", 26);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solutions_lie_on_the_grid_of_the_bench_s_time),
        cmocka_unit_test(a_reading_on_can_is_the_report),
        cmocka_unit_test(the_antimeridian_and_a_pole_stay_on_the_earth),
        cmocka_unit_test(what_rounds_to_the_antimeridian_is_east),
        cmocka_unit_test(reset_and_power_begin_anew),
        cmocka_unit_test(the_first_fix_takes_its_time),
        cmocka_unit_test(bytes_leave_at_the_bit_rate),
        cmocka_unit_test(messages_come_in_the_order_of_the_profile),
        cmocka_unit_test(what_does_not_fit_is_lost_whole_and_named),
        cmocka_unit_test(pps_rises_with_each_second),
        cmocka_unit_test(txd_carries_the_bytes),
        cmocka_unit_test(faults_do_what_they_say),
        cmocka_unit_test(frozen_words_repeat_place_and_velocity_alone),
        cmocka_unit_test(a_share_of_the_checksums_is_wrong),
        cmocka_unit_test(a_profile_that_cannot_be_is_rejected),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
