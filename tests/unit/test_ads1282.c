/* ADS1281/ADS1282 at its pins: registers, commands, reset, what is refused (sources 1.2 to 1.6). */
#include "ads1282_rig.h"

/* ---- Registers ---- */

static const struct {
    uint8_t addr;
    const char *name;
    uint8_t reset, rw_1282, rw_1281;
} registers[] = {
    {0x00, "ID", 0x00, 0x00, 0x00},   {0x01, "CONFIG0", 0x52, 0xFF, 0xFF}, {0x02, "CONFIG1", 0x08, 0x7F, 0xFF},
    {0x03, "HPF0", 0x32, 0xFF, 0xFF}, {0x04, "HPF1", 0x03, 0xFF, 0xFF},    {0x05, "OFC0", 0x00, 0xFF, 0xFF},
    {0x06, "OFC1", 0x00, 0xFF, 0xFF}, {0x07, "OFC2", 0x00, 0xFF, 0xFF},    {0x08, "FSC0", 0x00, 0xFF, 0xFF},
    {0x09, "FSC1", 0x00, 0xFF, 0xFF}, {0x0A, "FSC2", 0x40, 0xFF, 0xFF},
};

static void registers_have_their_reset_values_and_rights(void **state)
{
    (void)state;
    for (int part = 0; part < 2; part++) {
        struct ads1282_cfg cfg = quiet;
        cfg.part = (enum ads1282_part)part;
        for (unsigned k = 0; k < COUNT(registers); k++) {
            struct rig r;
            powered(&r, &cfg);
            SEND(&r, 0x11);
            const uint8_t addr = registers[k].addr;
            const uint8_t rw = part == ADS1282_PART_1282 ? registers[k].rw_1282 : registers[k].rw_1281;
            assert_string_equal(r.a.regs.map[addr].name, registers[k].name);
            assert_true(strlen(r.a.regs.map[addr].src) > 0);
            hex_is(rreg(&r, addr), registers[k].reset);
            wreg(&r, addr, 0xFF);
            hex_is(rreg(&r, addr), (registers[k].reset & ~(unsigned)rw) | rw);
            wreg(&r, addr, 0x00);
            hex_is(rreg(&r, addr), registers[k].reset & ~(unsigned)rw);
            assert_int_equal(r.a.regs.ro_write, rw == 0xFF ? 0 : 1);
            ads1282_reset_pin(&r.a, false, r.s.now_ns);
            hex_is(reg_peek(&r.a.regs, addr), registers[k].reset);
        }
    }
}

static void all_registers_are_read_and_written_in_one_command(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    SEND(&r, 0x11, 0x43, 0x07, 1, 2, 3, 4, 5, 6, 7, 8, 0x21, 0x09);
    const uint8_t want[10] = {0x52, 0x08, 1, 2, 3, 4, 5, 6, 7, 8};
    for (unsigned i = 0; i < sizeof want; i++) hex_is(byte(&r, 0), want[i]);
    hex_is(byte(&r, 0), 0); /* the command is over */
    assert_null(r.a.op);
}

static void beyond_the_map_reads_zero_ignores_writes_and_is_counted(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    SEND(&r, 0x11);
    wreg(&r, 0x0B, 0xAA);
    hex_is(rreg(&r, 0x0B), 0);
    hex_is(rreg(&r, 0x1F), 0);
    assert_int_equal(r.a.regs.bad_access, 3);
    assert_int_equal(r.a.count.bad_opcodes, 0);
}

/* ---- Commands ---- */

enum { CONT, STOP, STRICT }; /* RDATAC; after SDATAC; RDATAC of a strict part */

static const struct {
    const char *name;
    int mode;
    uint8_t n, bytes[4];
    uint8_t refused, bad, restarts, config0; /* counters and CONFIG0 afterwards */
    bool rdatac;
} commands[] = {
    {"WAKEUP", CONT, 1, {0x00}, 0, 0, 0, 0x52, true},
    {"WAKEUP, other code", STOP, 1, {0x01}, 0, 0, 0, 0x52, false},
    {"WAKEUP", STRICT, 1, {0x00}, 0, 0, 0, 0x52, true},
    {"STANDBY is absent", CONT, 1, {0x02}, 1, 0, 0, 0x52, true},
    {"STANDBY is absent", STOP, 1, {0x03}, 1, 0, 0, 0x52, false},
    {"SYNC", CONT, 1, {0x04}, 0, 0, 1, 0x52, true},
    {"SYNC, other code", STOP, 1, {0x05}, 0, 0, 1, 0x52, false},
    {"SYNC", STRICT, 1, {0x04}, 1, 0, 0, 0x52, true},
    {"RESET", STOP, 1, {0x06}, 0, 0, 0, 0x52, true},
    {"RESET after WREG", STOP, 4, {0x43, 0x00, 0x99, 0x07}, 0, 0, 0, 0x52, true},
    {"RESET", STRICT, 1, {0x06}, 0, 0, 0, 0x52, true},
    {"RDATAC", STOP, 1, {0x10}, 0, 0, 0, 0x52, true},
    {"RDATAC", STRICT, 1, {0x10}, 1, 0, 0, 0x52, true},
    {"SDATAC", CONT, 1, {0x11}, 0, 0, 0, 0x52, false},
    {"SDATAC", STRICT, 1, {0x11}, 0, 0, 0, 0x52, false},
    {"RDATA", STOP, 1, {0x12}, 0, 0, 0, 0x52, false},
    {"RDATA wants SDATAC", CONT, 1, {0x12}, 1, 0, 0, 0x52, true},
    {"RREG", STOP, 3, {0x21, 0x00, 0x00}, 0, 0, 0, 0x52, false},
    {"RREG wants SDATAC; its count byte is no STANDBY", CONT, 2, {0x21, 0x02}, 1, 0, 0, 0x52, true},
    {"WREG", STOP, 3, {0x41, 0x00, 0x56}, 0, 0, 1, 0x56, false},
    {"WREG in RDATAC: the article's 41 00 56", CONT, 3, {0x41, 0x00, 0x56}, 0, 0, 1, 0x56, true},
    {"WREG that changes nothing", CONT, 3, {0x41, 0x00, 0x52}, 0, 0, 0, 0x52, true},
    {"WREG; its data byte is no SDATAC", STRICT, 3, {0x41, 0x00, 0x11}, 1, 0, 0, 0x52, true},
    {"the drawing's 56 41 00: two bytes to 16h", CONT, 3, {0x56, 0x41, 0x00}, 0, 0, 0, 0x52, true},
    {"OFSCAL is absent", STOP, 1, {0x60}, 1, 0, 0, 0x52, false},
    {"GANCAL is absent", STOP, 1, {0x61}, 1, 0, 0, 0x52, false},
    {"unknown", STOP, 1, {0x13}, 0, 1, 0, 0x52, false},
    {"unknown", CONT, 1, {0xFF}, 0, 1, 0, 0x52, true},
};

static void commands_do_what_their_row_says(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(commands); k++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.strict_sdatac = commands[k].mode == STRICT;
        powered(&r, &cfg);
        to_fall(&r);
        if (commands[k].mode == STOP) SEND(&r, 0x11);
        send(&r, commands[k].n, commands[k].bytes);
        const struct ads1282_counters *c = &r.a.count;
        if (c->refused != commands[k].refused || c->bad_opcodes != commands[k].bad ||
            c->restarts != commands[k].restarts || reg_peek(&r.a.regs, 1) != commands[k].config0 ||
            r.a.rdatac != commands[k].rdatac)
            fail_msg("%s: refused %u, bad %u, restarts %u, CONFIG0 %02X, rdatac %d", commands[k].name, c->refused,
                     c->bad_opcodes, c->restarts, reg_peek(&r.a.regs, 1), r.a.rdatac);
    }
}

static void every_other_byte_is_a_bad_opcode(void **state)
{
    (void)state;
    unsigned bad = 0;
    for (unsigned code = 0; code < 256; code++) {
        struct rig r;
        powered(&r, &quiet);
        byte(&r, (uint8_t)code);
        bad += r.a.count.bad_opcodes;
    }
    assert_int_equal(bad, 256 - (4 * 2 + 3 + 32 + 32 + 2));
}

static void reset_opcode_restores_all_registers(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    SEND(&r, 0x41, 0x09, 0x56, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0x06);
    for (unsigned k = 0; k < COUNT(registers); k++) hex_is(reg_peek(&r.a.regs, registers[k].addr), registers[k].reset);
    assert_int_equal(r.a.filter.phase, ADS1282_LINEAR);
}

static void bytes_closer_than_24_tclk_are_counted_and_obeyed(void **state)
{
    (void)state;
    static const struct {
        int gap_tclk;
        uint32_t want;
    } rows[] = {{24, 0}, {20, 2}, {4, 2}};
    for (unsigned k = 0; k < COUNT(rows); k++) {
        struct rig r;
        powered(&r, &quiet);
        r.gap_tclk = rows[k].gap_tclk;
        wreg(&r, 0x01, 0x56);
        assert_int_equal(r.a.count.gap_violations, rows[k].want);
        hex_is(reg_peek(&r.a.regs, 1), 0x56);
        to_fall(&r);
        read_bytes(&r, 4); /* data need no gaps */
        assert_int_equal(r.a.count.gap_violations, rows[k].want);
    }
}

/* ---- Pins ---- */

static void without_power_or_in_reset_the_chip_is_dead(void **state)
{
    (void)state;
    for (int in_reset = 0; in_reset < 2; in_reset++) {
        struct rig r;
        unpowered(&r, &quiet, 1);
        ads1282_reset_pin(&r.a, !in_reset, 0);
        if (in_reset) ads1282_power_up(&r.a, 0);
        wreg(&r, 1, 0x56);
        ads1282_sync_pin(&r.a, true, r.s.now_ns);
        assert_int_equal(to_fall(&r), 0);
        assert_int_equal(r.samples, 0);
        hex_is(reg_peek(&r.a.regs, 1), 0x52);
        assert_int_equal(r.a.count.restarts, 0);
        assert_false(ads1282_running(&r.a));
        const int64_t t_ns = r.s.now_ns;
        if (in_reset) ads1282_reset_pin(&r.a, true, t_ns);
        else ads1282_power_up(&r.a, t_ns);
        assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, clk_count_at(&r.clk, t_ns) + T_DR_1000));
    }
}

static void only_a_rising_sync_edge_restarts(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    ads1282_sync_pin(&r.a, true, 0);
    ads1282_sync_pin(&r.a, true, 0);
    ads1282_sync_pin(&r.a, false, 0);
    assert_int_equal(r.a.count.restarts, 1);
}

static void three_chips_on_one_clock_stay_in_step(void **state)
{
    (void)state;
    static struct rig r[3];
    for (int i = 0; i < 3; i++) {
        unpowered(&r[i], &quiet, 1);
        r[i].ramp_v_per_s = 0.1;
        sched_run_until(&r[i].s, 1000 * i);
        ads1282_power_up(&r[i].a, 1000 * i);
        sched_run_until(&r[i].s, 80000000);
    }
    assert_int_not_equal(r[0].fall_ns, r[1].fall_ns);
    for (int i = 0; i < 3; i++) {
        ads1282_sync_pin(&r[i].a, true, 80000010 + 60 * i); /* skew of the wires, inside one tCLK */
        sched_run_until(&r[i].s, 80001000);
    }
    for (int m = 0; m < 300; m++) {
        uint32_t word[3];
        for (int i = 0; i < 3; i++) to_fall(&r[i]), word[i] = read_bytes(&r[i], 4);
        assert_int_equal(r[0].fall_ns, r[1].fall_ns);
        assert_int_equal(r[0].fall_ns, r[2].fall_ns);
        hex_is(word[1], word[0]);
        hex_is(word[2], word[0]);
    }
}

/* ---- Modes that are not modelled ---- */

static void absent_modes_stop_the_converter_and_are_counted(void **state)
{
    (void)state;
    static const struct {
        uint8_t config0;
        const char *why;
    } rows[] = {
        {0xD2, "continuous synchronisation"},
        {0x50, "modulator output"},
        {0x51, "sinc only"},
        {0x53, "high-pass"},
        {0x6A, "rate code 101"},
        {0x72, "rate code 110"},
        {0x7A, "rate code 111"},
    };
    for (unsigned k = 0; k < COUNT(rows); k++) {
        struct rig r;
        powered(&r, &quiet);
        to_fall(&r);
        wreg(&r, 1, rows[k].config0);
        if (to_fall(&r) || r.a.count.refused != 1 || ads1282_running(&r.a) || ads1282_period_ns(&r.a) ||
            ads1282_settle_ns(&r.a))
            fail_msg("%s was not refused", rows[k].why);
        assert_true(ads1282_drdy(&r.a));
        SEND(&r, 0x11);
        hex_is(rreg(&r, 1), rows[k].config0);
        ads1282_sync_pin(&r.a, true, r.s.now_ns);
        assert_int_equal(to_fall(&r), 0);
        wreg(&r, 1, 0x52);
        const int64_t edge = r.tclk;
        assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, edge + T_DR_1000));
    }
}

static void reserved_codes_of_config1_are_counted(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    wreg(&r, 2, 0x0F); /* gain code 111 */
    wreg(&r, 2, 0x58); /* multiplexer code 101 */
    wreg(&r, 2, 0x48);
    assert_int_equal(r.a.count.refused, 2);
    assert_int_equal(r.a.count.restarts, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(registers_have_their_reset_values_and_rights),
        cmocka_unit_test(all_registers_are_read_and_written_in_one_command),
        cmocka_unit_test(beyond_the_map_reads_zero_ignores_writes_and_is_counted),
        cmocka_unit_test(commands_do_what_their_row_says),
        cmocka_unit_test(every_other_byte_is_a_bad_opcode),
        cmocka_unit_test(reset_opcode_restores_all_registers),
        cmocka_unit_test(bytes_closer_than_24_tclk_are_counted_and_obeyed),
        cmocka_unit_test(without_power_or_in_reset_the_chip_is_dead),
        cmocka_unit_test(only_a_rising_sync_edge_restarts),
        cmocka_unit_test(three_chips_on_one_clock_stay_in_step),
        cmocka_unit_test(absent_modes_stop_the_converter_and_are_counted),
        cmocka_unit_test(reserved_codes_of_config1_are_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
