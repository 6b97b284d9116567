#include "rig.h"

#include "app/options.h"

#include <string.h>

static struct options o;
static char why[512];

/* Splits at blanks. */
static bool parse(const char *line)
{
    static char copy[512];
    char *argv[64] = {"psa-emu"};
    int argc = 1;
    snprintf(copy, sizeof copy, "%s", line);
    for (char *w = strtok(copy, " "); w; w = strtok(NULL, " ")) argv[argc++] = w;
    return options_parse(argc, argv, &o, why, sizeof why);
}

static void without_options_a_bench_for_socketcand_in_real_time(void **state)
{
    (void)state;
    assert_true(parse(""));
    assert_int_equal(o.action, OPTIONS_RUN);
    assert_int_equal(o.pace, PACE_WALL);
    assert_int_equal(o.can_count, 1);
    assert_int_equal(o.can[0].kind, OPTIONS_SOCKETCAND);
    assert_int_equal(o.can[0].port, 29536);
    assert_true(o.for_ns == INT64_MAX && !o.scenario && !o.seed_given && o.line_hz == 8000000 && o.vcd_unit_ns == 10);
}

static void every_option_reaches_its_field(void **state)
{
    (void)state;
    assert_true(
        parse("--can socketcand:0 quiet --can slcan:/tmp/x --can slcan --can socketcan:vcan0 --can log:x.log --pace "
              "step --for 300ms "
              "--seed 18446744073709551615 --vcd a.vcd --vcd-unit 100 --line b --line-hz 1000 --control c --truth d "
              "--unit u --bitrate 500000 --data-bitrate 0 --epoch 1.5 --start --quiet --until-eof"));
    assert_string_equal(o.scenario, "quiet");
    assert_int_equal(o.can_count, 5);
    assert_int_equal(o.can[4].kind, OPTIONS_CAN_LOG);
    assert_string_equal(o.can[4].arg, "x.log");
    assert_int_equal(o.can[0].port, 0);
    assert_string_equal(o.can[1].arg, "/tmp/x");
    assert_null(o.can[2].arg);
    assert_int_equal(o.can[3].kind, OPTIONS_SOCKETCAN);
    assert_string_equal(o.can[3].arg, "vcan0");
    assert_int_equal(o.pace, PACE_STEP);
    assert_true(o.for_ns == 300000000 && o.seed_given && o.seed == UINT64_MAX && o.epoch_ns == 1500000000);
    assert_true(o.bitrate.given && o.bitrate.hz == 500000 && o.data_bitrate.given && o.data_bitrate.hz == 0);
    assert_true(o.vcd_unit_ns == 100 && o.line_hz == 1000 && o.start && o.quiet && o.until_eof && !o.wait_client);
    assert_string_equal(o.vcd, "a.vcd");
    assert_string_equal(o.line, "b");
    assert_string_equal(o.control, "c");
    assert_string_equal(o.truth, "d");
    assert_string_equal(o.unit, "u");
}

static void none_and_the_end_of_options_are_understood(void **state)
{
    (void)state;
    assert_true(parse("--can none --pace free --wait-client -- stream"));
    assert_true(o.can_count == 0 && o.wait_client && o.pace == PACE_FREE);
    assert_string_equal(o.scenario, "stream");
    assert_true(parse("--list-scenarios"));
    assert_int_equal(o.action, OPTIONS_LIST_SCENARIOS);
    assert_true(parse("--help"));
    assert_int_equal(o.action, OPTIONS_HELP);
}

static const struct {
    const char *line, *why;
} bad[] = {
    {"--fly", "expected an option that --help lists, got --fly"},
    {"--help=yes", "expected an option that --help lists, got --help=yes"},
    {"--seed", "--seed: expected an argument, got none"},
    {"--seed -1", "--seed: expected an integer from 0 to 2^64 - 1, got \"-1\""},
    {"--seed 18446744073709551616", "--seed: expected an integer"},
    {"--seed 1x", "--seed: expected an integer"},
    {"--pace slow", "--pace: expected wall, step or free, got \"slow\""},
    {"--pace step", "--pace step: expected --control PATH"},
    {"--pace step --control c --wait-client", "--wait-client: expected --pace wall or free, got step"},
    {"--for 3parsec", "--for: expected a time such as 300ms, 10s or 2min, up to 1e6 s, got \"3parsec\""},
    {"--for -1s", "--for: expected a time such as 300ms, 10s or 2min, up to 1e6 s, got \"-1s\""},
    {"--for nan", "--for: expected a time such as 300ms, 10s or 2min, up to 1e6 s, got \"nan\""},
    {"--for 1e7s", "--for: expected a time such as 300ms, 10s or 2min, up to 1e6 s, got \"1e7s\""},
    {"--can", "--can: expected an argument, got none"},
    {"--can can0", "--can: expected socketcand[:PORT], slcan[:LINK], socketcan:IFACE, udp[:GROUP[:PORT]], "
                   "cannelloni[:PORT[:PEER_PORT]], log:FILE or none, got \"can0\""},
    {"--can cannelloni:1:1",
     "--can: expected cannelloni[:PORT[:PEER_PORT]], two ports from 1 to 65535, PORT 0: any free "
     "port, got \"cannelloni:1:1\""},
    {"--can socketcan", "--can: expected socketcand[:PORT]"},
    {"--can socketcan:", "--can: expected socketcand[:PORT]"},
    {"--can socketcand:65536", "--can: expected a port from 0 (any free port) to 65535, got \"socketcand:65536\""},
    {"--can socketcand:http", "--can: expected a port from 0 (any free port) to 65535, got \"socketcand:http\""},
    {"--bitrate 9999", "--bitrate: expected 0 or 10000"},
    {"--data-bitrate 1e6", "--data-bitrate: expected 0 or 10000"},
    {"--vcd-unit 20", "--vcd-unit: expected 1, 10, 100"},
    {"--vcd-unit 0", "--vcd-unit: expected 1, 10, 100"},
    {"--line-hz 999", "--line-hz: expected 1000 to"},
    {"--epoch -1", "--epoch: expected seconds from 0 to 9e9, as date +%s prints them, got \"-1\""},
    {"a b", "SCENARIO: expected one, got a and b"},
    {"a b\nc", "SCENARIO: expected one, got a and b?c"}, /* a message is one line */
};

static void what_cannot_be_used_is_refused_in_one_line(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(bad); i++) {
        if (parse(bad[i].line)) fail_msg("accepted: %s", bad[i].line);
        if (strncmp(why, bad[i].why, strlen(bad[i].why)) != 0) fail_msg("gave %s\nwant %s", why, bad[i].why);
        assert_null(strchr(why, '\n'));
    }
    const char *nine =
        "--can slcan --can slcan --can slcan --can slcan --can slcan --can slcan --can slcan --can slcan --can slcan";
    assert_false(parse(nine));
    assert_string_equal(why, "--can: expected up to 8 adapters, got \"slcan\"");
}

static void durations_have_units(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        int64_t ns;
    } rows[] = {
        {"0", 0},   {"2", 2000000000},      {"2.5s", 2500000000},  {"300ms", 300000000}, {"7us", 7000},
        {"9ns", 9}, {"2min", 120000000000}, {"1h", 3600000000000}, {"0.1s", 100000000},  {"1e6", 1000000000000000},
    };
    for (size_t i = 0; i < COUNT(rows); i++) {
        int64_t ns = -1;
        assert_true(options_duration(rows[i].text, &ns));
        assert_int_equal(ns, rows[i].ns);
    }
    int64_t ns = 5;
    assert_false(options_duration("1 s", &ns));
    assert_false(options_duration("", &ns));
    assert_int_equal(ns, 5);
}

static void a_mavlink_link_has_a_kind_and_keys(void **state)
{
    (void)state;
    assert_true(parse("--mavlink udp --mavlink tcp:0,imu=1000,hil=250,unit=b,sysid=255,compid=200,autopilot=px4 "
                      "--mavlink pty:/tmp/m,angles=0 --mavlink udpin:7"));
    assert_int_equal(o.mavlink_count, 4);
    const struct mav_options *m = o.mavlink;
    assert_true(m[0].kind == MAV_UDP_OUT && m[0].port == 14550 && m[0].sysid == 1 && m[0].compid == 1);
    assert_true(m[0].imu_hz == 50 && m[0].angles_hz == 10 && m[0].hil_hz == 0 && !m[0].unit[0] && m[0].autopilot == 0);
    assert_true(m[1].kind == MAV_TCP && m[1].port == 0 && m[1].imu_hz == 1000 && m[1].hil_hz == 250);
    assert_true(m[1].sysid == 255 && m[1].compid == 200 && m[1].autopilot == 12);
    assert_string_equal(m[1].unit, "b");
    assert_true(m[2].kind == MAV_PTY && m[2].angles_hz == 0);
    assert_string_equal(m[2].link, "/tmp/m");
    assert_true(m[3].kind == MAV_UDP_IN && m[3].port == 7);
}

static void a_mavlink_link_that_is_wrong_is_told_what_would_be_right(void **state)
{
    (void)state;
    static const struct {
        const char *arg, *expected;
    } rows[] = {
        {"", "udp[:PORT]"},
        {"usb", "udp[:PORT]"},
        {"udp:0", "from 1 to 65535"},
        {"udp:65536", "from 1 to 65535"},
        {"tcp:-1", "from 0"},
        {"tcp:", "from 0"},
        {"pty:", "pty[:LINK]"},
        {"tcp,imu", "KEY=VALUE"},
        {"tcp,", "KEY=VALUE"},
        {"tcp,rate=5", "KEY=VALUE"},
        {"tcp,imu=nan", "imu=HZ"},
        {"tcp,imu=1e9", "imu=HZ"},
        {"tcp,hil=-1", "hil=HZ"},
        {"tcp,sysid=0", "sysid=N"},
        {"tcp,compid=256", "compid=N"},
        {"tcp,autopilot=apm", "generic, px4"},
        {"tcp,unit=", "unit=NAME"},
        {"tcp,unit=a_name_that_is_longer_than_any_name_of_a_unit", "unit=NAME"},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        char line[256];
        snprintf(line, sizeof line, "--mavlink %s", rows[i].arg);
        char *argv[] = {"psa-emu", "--mavlink", (char *)rows[i].arg};
        assert_false(options_parse(3, argv, &o, why, sizeof why));
        assert_non_null(strstr(why, "--mavlink: expected"));
        if (!strstr(why, rows[i].expected)) fail_msg("%s: %s", line, why);
    }
    assert_false(parse("--mavlink tcp --mavlink tcp --mavlink tcp --mavlink tcp --mavlink tcp"));
    assert_non_null(strstr(why, "up to 4 MAVLink links"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_options_a_bench_for_socketcand_in_real_time),
        cmocka_unit_test(every_option_reaches_its_field),
        cmocka_unit_test(none_and_the_end_of_options_are_understood),
        cmocka_unit_test(what_cannot_be_used_is_refused_in_one_line),
        cmocka_unit_test(durations_have_units),
        cmocka_unit_test(a_mavlink_link_has_a_kind_and_keys),
        cmocka_unit_test(a_mavlink_link_that_is_wrong_is_told_what_would_be_right),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
