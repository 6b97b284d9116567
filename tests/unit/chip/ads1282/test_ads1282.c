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

enum { CONT, STOP, STRICT };                  /* RDATAC; after SDATAC; RDATAC of a strict part */
enum then { NOTHING, STANDBY, OFFSET, GAIN }; /* what goes on afterwards */

static const struct {
    const char *name;
    int mode;
    uint8_t n, bytes[4];
    uint8_t refused, bad, restarts, config0; /* counters and CONFIG0 afterwards */
    bool rdatac;
    enum then then;
} commands[] = {
    {"WAKEUP", CONT, 1, {0x00}, 0, 0, 0, 0x52, true, NOTHING},
    {"WAKEUP, other code", STOP, 1, {0x01}, 0, 0, 0, 0x52, false, NOTHING},
    {"WAKEUP", STRICT, 1, {0x00}, 0, 0, 0, 0x52, true, NOTHING},
    {"WAKEUP, other code", STRICT, 1, {0x01}, 0, 0, 0, 0x52, true, NOTHING},
    {"STANDBY", CONT, 1, {0x02}, 0, 0, 0, 0x52, true, STANDBY},
    {"STANDBY, other code", STOP, 1, {0x03}, 0, 0, 0, 0x52, false, STANDBY},
    {"STANDBY", STRICT, 1, {0x02}, 1, 0, 0, 0x52, true, NOTHING},
    {"WAKEUP from STANDBY", STOP, 2, {0x02, 0x01}, 0, 0, 0, 0x52, false, NOTHING},
    {"SYNC in STANDBY has no effect", STOP, 2, {0x02, 0x04}, 0, 0, 0, 0x52, false, STANDBY},
    {"RESET ends STANDBY", STOP, 2, {0x02, 0x06}, 0, 0, 0, 0x52, true, NOTHING},
    {"WREG in STANDBY", STOP, 4, {0x02, 0x41, 0x00, 0x56}, 0, 0, 1, 0x56, false, STANDBY},
    {"SYNC", CONT, 1, {0x04}, 0, 0, 1, 0x52, true, NOTHING},
    {"SYNC, other code", STOP, 1, {0x05}, 0, 0, 1, 0x52, false, NOTHING},
    {"SYNC", STRICT, 1, {0x04}, 1, 0, 0, 0x52, true, NOTHING},
    {"RESET", STOP, 1, {0x06}, 0, 0, 0, 0x52, true, NOTHING},
    {"RESET after WREG", STOP, 4, {0x43, 0x00, 0x99, 0x07}, 0, 0, 0, 0x52, true, NOTHING},
    {"RESET", STRICT, 1, {0x06}, 0, 0, 0, 0x52, true, NOTHING},
    {"RDATAC", STOP, 1, {0x10}, 0, 0, 0, 0x52, true, NOTHING},
    {"RDATAC", STRICT, 1, {0x10}, 1, 0, 0, 0x52, true, NOTHING},
    {"SDATAC", CONT, 1, {0x11}, 0, 0, 0, 0x52, false, NOTHING},
    {"SDATAC", STRICT, 1, {0x11}, 0, 0, 0, 0x52, false, NOTHING},
    {"RDATA", STOP, 1, {0x12}, 0, 0, 0, 0x52, false, NOTHING},
    {"RDATA wants SDATAC", CONT, 1, {0x12}, 1, 0, 0, 0x52, true, NOTHING},
    {"RREG", STOP, 3, {0x21, 0x00, 0x00}, 0, 0, 0, 0x52, false, NOTHING},
    {"RREG wants SDATAC; its count byte is no STANDBY", CONT, 2, {0x21, 0x02}, 1, 0, 0, 0x52, true, NOTHING},
    {"WREG", STOP, 3, {0x41, 0x00, 0x56}, 0, 0, 1, 0x56, false, NOTHING},
    {"WREG in RDATAC: the article's 41 00 56", CONT, 3, {0x41, 0x00, 0x56}, 0, 0, 1, 0x56, true, NOTHING},
    {"WREG that changes nothing", CONT, 3, {0x41, 0x00, 0x52}, 0, 0, 0, 0x52, true, NOTHING},
    {"WREG; its data byte is no SDATAC", STRICT, 3, {0x41, 0x00, 0x11}, 1, 0, 0, 0x52, true, NOTHING},
    {"the drawing's 56 41 00: two bytes to 16h", CONT, 3, {0x56, 0x41, 0x00}, 0, 0, 0, 0x52, true, NOTHING},
    {"OFSCAL", STOP, 1, {0x60}, 0, 0, 0, 0x52, false, OFFSET},
    {"OFSCAL in RDATAC", CONT, 1, {0x60}, 0, 0, 0, 0x52, true, OFFSET},
    {"OFSCAL", STRICT, 1, {0x60}, 1, 0, 0, 0x52, true, NOTHING},
    {"GANCAL", STOP, 1, {0x61}, 0, 0, 0, 0x52, false, GAIN},
    {"GANCAL", STRICT, 1, {0x61}, 1, 0, 0, 0x52, true, NOTHING},
    {"the later calibration counts", STOP, 2, {0x60, 0x61}, 0, 0, 0, 0x52, false, GAIN},
    {"OFSCAL in STANDBY", STOP, 2, {0x02, 0x60}, 1, 0, 0, 0x52, false, STANDBY},
    {"SYNC gives a calibration up", STOP, 2, {0x60, 0x04}, 0, 0, 1, 0x52, false, NOTHING},
    {"unknown", STOP, 1, {0x13}, 0, 1, 0, 0x52, false, NOTHING},
    {"unknown", CONT, 1, {0xFF}, 0, 1, 0, 0x52, true, NOTHING},
};

static enum then going_on(const struct ads1282 *a)
{
    if (a->standby) return STANDBY;
    return a->cal.kind == ADS1282_CAL_NONE ? NOTHING : a->cal.kind == ADS1282_CAL_OFFSET ? OFFSET : GAIN;
}

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
            r.a.rdatac != commands[k].rdatac || going_on(&r.a) != commands[k].then)
            fail_msg("%s: refused %u, bad %u, restarts %u, CONFIG0 %02X, rdatac %d, then %d", commands[k].name,
                     c->refused, c->bad_opcodes, c->restarts, reg_peek(&r.a.regs, 1), r.a.rdatac, going_on(&r.a));
    }
}

/* SBAS378 p. 30, as ranges of the first byte; sent after SDATAC. */
static const struct {
    uint8_t first, last;
    const char *name;
    bool more; /* a count byte must follow */
    bool bad, rdatac, standby, restarts, rdata;
    enum then then;
} opcode_bytes[] = {
    {0x00, 0x01, "WAKEUP", .then = NOTHING}, {0x02, 0x03, "STANDBY", .then = STANDBY},
    {0x04, 0x05, "SYNC", .restarts = true},  {0x06, 0x07, "RESET", .rdatac = true},
    {0x08, 0x0F, "none", .bad = true},       {0x10, 0x10, "RDATAC", .rdatac = true},
    {0x11, 0x11, "SDATAC", .then = NOTHING}, {0x12, 0x12, "RDATA", .rdata = true},
    {0x13, 0x1F, "none", .bad = true},       {0x20, 0x3F, "RREG", .more = true},
    {0x40, 0x5F, "WREG", .more = true},      {0x60, 0x60, "OFSCAL", .then = OFFSET},
    {0x61, 0x61, "GANCAL", .then = GAIN},    {0x62, 0xFF, "none", .bad = true},
};

static void every_byte_is_the_opcode_of_its_row(void **state)
{
    (void)state;
    unsigned code = 0;
    for (unsigned k = 0; k < COUNT(opcode_bytes); k++) {
        assert_int_equal(opcode_bytes[k].first, code); /* no byte left out */
        for (; code <= opcode_bytes[k].last; code++) {
            struct rig r;
            powered(&r, &quiet);
            to_fall(&r);
            SEND(&r, 0x11, (uint8_t)code);
            const struct ads1282 *a = &r.a;
            if ((a->op != NULL) != opcode_bytes[k].more || a->count.bad_opcodes != opcode_bytes[k].bad ||
                a->rdatac != opcode_bytes[k].rdatac || a->count.restarts != opcode_bytes[k].restarts ||
                a->rdata_due != opcode_bytes[k].rdata || going_on(a) != opcode_bytes[k].then || a->count.refused)
                fail_msg("%02X is not %s", code, opcode_bytes[k].name);
        }
    }
    assert_int_equal(code, 256);
}

static void a_write_that_changes_nothing_restarts_a_strict_part_only(void **state)
{
    (void)state;
    for (int strict = 0; strict < 2; strict++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.strict_config0 = strict;
        powered(&r, &cfg);
        to_fall(&r);
        const int64_t fall_ns = r.fall_ns;
        wreg(&r, 1, 0x52);
        const int64_t edge = r.tclk;
        assert_int_equal(r.a.count.restarts, strict);
        assert_int_equal(to_fall(&r), strict ? clk_edge_ns(&r.clk, edge + T_DR_1000) : fall_ns + 1000000);
    }
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
        assert_false(r.a.running);
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

/* ---- Reserved codes ---- */

/* DR 101, 110, 111 with each filter that has a rate: no one knows what the part does. */
static void reserved_rates_stop_the_converter_and_are_counted(void **state)
{
    (void)state;
    static const uint8_t config0[] = {0x6A, 0x72, 0x7A, 0x69, 0x73, 0xFA};
    for (unsigned k = 0; k < COUNT(config0); k++) {
        struct rig r;
        powered(&r, &quiet);
        to_fall(&r);
        wreg(&r, 1, config0[k]);
        if (to_fall(&r) || r.a.count.refused != 1 || r.a.running || ads1282_period_ns(&r.a) || ads1282_settle_ns(&r.a))
            fail_msg("CONFIG0 %02X was not refused", config0[k]);
        assert_true(ads1282_drdy(&r.a));
        SEND(&r, 0x11);
        hex_is(rreg(&r, 1), config0[k]);
        ads1282_sync_pin(&r.a, true, r.s.now_ns);
        assert_int_equal(to_fall(&r), 0);
        wreg(&r, 1, 0x52);
        const int64_t edge = r.tclk;
        assert_int_equal(to_fall(&r), clk_edge_ns(&r.clk, edge + T_DR_1000));
    }
}

/* For a controller that knows one settled FIR word a data period. */
static void models_are_the_modes_of_plain_fir_words(void **state)
{
    (void)state;
    unsigned count = 0;
    for (unsigned c0 = 0; c0 < 256; c0++) {
        const bool plain = !(c0 & 0x80) && (c0 & 3) == 2 && (c0 >> 3 & 7) <= 4;
        assert_int_equal(ads1282_models((uint8_t)c0), plain);
        count += plain;
    }
    assert_int_equal(count, 5 * 2 * 2); /* rates, phases, b6 */
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
        cmocka_unit_test(every_byte_is_the_opcode_of_its_row),
        cmocka_unit_test(a_write_that_changes_nothing_restarts_a_strict_part_only),
        cmocka_unit_test(reset_opcode_restores_all_registers),
        cmocka_unit_test(bytes_closer_than_24_tclk_are_counted_and_obeyed),
        cmocka_unit_test(without_power_or_in_reset_the_chip_is_dead),
        cmocka_unit_test(only_a_rising_sync_edge_restarts),
        cmocka_unit_test(three_chips_on_one_clock_stay_in_step),
        cmocka_unit_test(reserved_rates_stop_the_converter_and_are_counted),
        cmocka_unit_test(models_are_the_modes_of_plain_fir_words),
        cmocka_unit_test(reserved_codes_of_config1_are_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
