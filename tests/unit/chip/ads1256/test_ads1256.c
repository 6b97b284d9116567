/* Registers, commands and pins of the ADS1256: tables of sources 2.2 .. 2.6, and the article's set-up. */
#include "ads1256_rig.h"

/* Reset value, what FFh and 00h leave behind. DRDY is high in STATUS: FFh there set ACAL and changed BUFEN. DIO of IO
 * shows inputs that no one drives. */
static const struct {
    const char *name;
    uint8_t reset, ones, zeros;
} registers[ADS1256_REGS] = {
    {"STATUS", 0x31, 0x3E, 0x31}, {"MUX", 0x01, 0xFF, 0x00},  {"ADCON", 0x20, 0x7F, 0x00}, {"DRATE", 0xF0, 0xFF, 0x00},
    {"IO", 0xE0, 0xF0, 0x00},     {"OFC0", 0x00, 0xFF, 0x00}, {"OFC1", 0x00, 0xFF, 0x00},  {"OFC2", 0x00, 0xFF, 0x00},
    {"FSC0", 0x08, 0xFF, 0x00},   {"FSC1", 0xAC, 0xFF, 0x00}, {"FSC2", 0x44, 0xFF, 0x00},
};

static void every_register_row(void **state)
{
    (void)state;
    struct rig r;
    for (uint8_t addr = 0; addr < ADS1256_REGS; addr++) {
        power_up(&r, &quiet, 1);
        assert_string_equal(r.a.regs.map[addr].name, registers[addr].name);
        assert_non_null(r.a.regs.map[addr].src);
        assert_int_equal(reg_peek(&r.a.regs, addr), registers[addr].reset);
        await_fall(&r);
        set_rate(&r, 0x82); /* DRDY stays low for 10 ms, OFC and FSC are others */
        wreg(&r, addr, 0xFF);
        assert_int_equal(reg_peek(&r.a.regs, addr) & ~1u, registers[addr].ones & ~1u);
        wreg(&r, addr, 0x00);
        assert_int_equal(rreg(&r, addr), registers[addr].zeros);
        command(&r, 0xFE);
        assert_int_equal(reg_peek(&r.a.regs, addr), addr == ADS1256_ADCON ? 0x00 : registers[addr].reset);
    }
}

static void addresses_wrap_after_0Ah(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    set_rate(&r, 0x82);
    static const uint8_t write[] = {0x59, 0x03, 0x11, 0x22, 0x02, 0x23}; /* FSC1, FSC2, STATUS, MUX */
    for (unsigned i = 0; i < COUNT(write); i++) xfer(&r, write[i]);
    static const uint8_t want[] = {0x11, 0x22, 0x32, 0x23, 0x20, 0x82};
    wait_ns(&r, T11_NS);
    xfer(&r, 0x19);
    xfer(&r, COUNT(want) - 1);
    wait_ns(&r, T6_NS);
    for (unsigned i = 0; i < COUNT(want); i++) assert_int_equal(xfer(&r, 0), want[i]);
    assert_int_equal(r.a.regs.bad_access, 0);
    wait_ns(&r, T11_NS);
    assert_int_equal(rreg(&r, 0x0B), 0); /* nothing there */
    assert_int_equal(r.a.regs.bad_access, 1);
    assert_int_equal(r.a.n.gap_violations, 0);
}

enum effect { NOTHING, BAD, DATA, MORE, STOPS, CALIBRATES };

static enum effect effect_of(struct rig *r, uint8_t opcode)
{
    rig_up(r, &quiet);
    set_rate(r, 0x82);
    const struct ads1256_counters n = r->a.n;
    xfer(r, opcode);
    if (r->a.n.bad_opcodes != n.bad_opcodes) return BAD;
    if (r->a.n.refused != n.refused) return BAD;
    if (r->a.port == ADS1256_WORD) return DATA;
    if (r->a.port == ADS1256_COUNT) return MORE;
    if (!ads1256_drdy(&r->a) && sched_next_ns(&r->s) != SCHED_NEVER) return NOTHING;
    return sched_next_ns(&r->s) == SCHED_NEVER ? STOPS : CALIBRATES;
}

static const struct {
    uint8_t first, last;
    enum effect effect;
} commands[] = {
    {0x00, 0x00, NOTHING},                              /* WAKEUP */
    {0x01, 0x01, DATA},                                 /* RDATA */
    {0x02, 0x02, BAD},        {0x03, 0x03, DATA},       /* RDATAC */
    {0x04, 0x0E, BAD},        {0x0F, 0x0F, NOTHING},    /* SDATAC */
    {0x10, 0x1F, MORE},                                 /* RREG */
    {0x20, 0x4F, BAD},        {0x50, 0x5F, MORE},       /* WREG */
    {0x60, 0xEF, BAD},        {0xF0, 0xF4, CALIBRATES}, /* SELFCAL, SELFOCAL, SELFGCAL, SYSOCAL, SYSGCAL */
    {0xF5, 0xFB, BAD},        {0xFC, 0xFC, NOTHING},    /* SYNC: WAKEUP does */
    {0xFD, 0xFD, STOPS},                                /* STANDBY */
    {0xFE, 0xFE, CALIBRATES},                           /* RESET */
    {0xFF, 0xFF, NOTHING},                              /* WAKEUP */
};

static void every_command_row(void **state)
{
    (void)state;
    struct rig r;
    unsigned next = 0;
    for (unsigned i = 0; i < COUNT(commands); i++) {
        assert_int_equal(commands[i].first, next);
        for (; next <= commands[i].last; next++) {
            const enum effect got = effect_of(&r, (uint8_t)next);
            if (got != commands[i].effect) fail_msg("opcode %02X: effect %d, want %d", next, got, commands[i].effect);
        }
    }
    assert_int_equal(next, 256);
}

/* Gap to the first edge of the next command in tau, t11 of sources 2.4: the shortest that is not counted. */
static void gaps_after_commands_are_counted(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        uint8_t bytes[3], count;
        int64_t t11_tau;
    } rows[] = {
        {"WREG", {0x51, 0x00, 0x01}, 3, 4},
        {"SDATAC", {0x0F}, 1, 24},
        {"SYNC", {0xFC}, 1, 24},
        {"WAKEUP", {0x00}, 1, 0},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        for (unsigned early = 0; early < (rows[i].t11_tau ? 2u : 1u); early++) {
            struct rig r;
            rig_up(&r, &quiet);
            set_rate(&r, 0x82);
            for (unsigned k = 0; k < rows[i].count; k++) xfer(&r, rows[i].bytes[k]);
            const int64_t gap_ns = tau_ns(rows[i].t11_tau) - (early ? 1 : 0);
            spi_first(&r.a.spi, r.s.now_ns + gap_ns);
            wait_ns(&r, gap_ns + BYTE_NS);
            spi_byte(&r.a.spi, 0x00, r.s.now_ns);
            if (r.a.n.gap_violations != early) fail_msg("%s, gap %lld ns", rows[i].name, (long long)gap_ns);
        }
    }
}

static void chip_select_high_drops_a_partial_command(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    set_rate(&r, 0x82);
    xfer(&r, 0x51);
    xfer(&r, 0x00);
    wait_ns(&r, tau_ns(8) + 1);
    ads1256_cs_pin(&r.a, true, r.s.now_ns);
    assert_int_equal(xfer(&r, 0x77), 0x00); /* to somebody else on the bus */
    ads1256_cs_pin(&r.a, false, r.s.now_ns);
    assert_int_equal(rreg(&r, ADS1256_MUX), 0x01);
    assert_int_equal(r.a.n.dropped, 1);
    assert_int_equal(r.a.n.gap_violations, 0);
    wreg(&r, ADS1256_MUX, 0x23);
    xfer(&r, 0x00);
    ads1256_cs_pin(&r.a, true, r.s.now_ns + tau_ns(8) - 1);
    assert_int_equal(r.a.n.gap_violations, 1); /* t10 */
    assert_int_equal(r.a.n.dropped, 1);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_MUX), 0x23);
}

static void chip_select_aligns_the_bits(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    set_rate(&r, 0x82);
    for (int i = 0; i < 3; i++) spi_sample(&r.a.spi, true, r.s.now_ns);
    ads1256_cs_pin(&r.a, true, r.s.now_ns);
    ads1256_cs_pin(&r.a, false, r.s.now_ns);
    assert_int_equal(rreg(&r, ADS1256_DRATE), 0x82);
    assert_int_equal(r.a.n.bad_opcodes, 0);
}

static void auto_calibration_follows_changes_of_pga_rate_and_buffer(void **state)
{
    (void)state;
    static const struct {
        uint8_t acal, addr, value;
        bool calibrates;
    } rows[] = {
        {0x04, ADS1256_ADCON, 0x21, true},   {0x04, ADS1256_ADCON, 0x20, false}, /* same gain */
        {0x04, ADS1256_ADCON, 0x00, false},  {0x04, ADS1256_DRATE, 0x82, true},   {0x04, ADS1256_DRATE, 0xF0, false},
        {0x04, ADS1256_STATUS, 0x06, true},  {0x04, ADS1256_STATUS, 0x0C, false}, {0x04, ADS1256_MUX, 0x23, false},
        {0x04, ADS1256_STATUS, 0x02, false}, /* the bit after the write counts: off */
        {0x00, ADS1256_STATUS, 0x06, true},  /* and on */
        {0x00, ADS1256_ADCON, 0x21, false},  {0x00, ADS1256_DRATE, 0x82, false},
    };
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        rig_up(&r, &quiet);
        wreg(&r, ADS1256_STATUS, rows[i].acal);
        await_fall(&r);
        wreg(&r, rows[i].addr, rows[i].value);
        assert_int_equal(r.a.mode, rows[i].calibrates ? ADS1256_CALIBRATING : ADS1256_RUNNING);
    }
}

static void auto_calibration_waits_for_the_end_of_the_write(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    static const uint8_t bytes[] = {0x50, 0x03, 0x04, 0x01, 0x21, 0x82}; /* STATUS, MUX, ADCON, DRATE in one WREG */
    for (unsigned i = 0; i < COUNT(bytes); i++) {
        assert_int_equal(r.a.mode, ADS1256_RUNNING);
        xfer(&r, bytes[i]);
    }
    assert_int_equal(r.a.mode, ADS1256_CALIBRATING);
    const int64_t from_ns = r.s.now_ns;
    near((double)(await_fall(&r) - from_ns) * 1e-6, 31.2, 0.0002);
    assert_int_equal(r.a.n.calibrations, 2);
}

/* Article section 5, one transfer at each fall of DRD-T: 50 00 02, 50 00 04, 53 00 82 (sources 4.2). */
static void set_up_of_the_article(void **state)
{
    (void)state;
    struct rig r;
    power_up(&r, &quiet, 1);
    near((double)await_fall(&r) * 1e-3, 596.0, 0.2);
    wreg(&r, ADS1256_STATUS, 0x02);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_STATUS) & 0x0E, 0x02);
    assert_int_equal(r.a.n.calibrations, 1);
    await_fall(&r);
    wreg(&r, ADS1256_STATUS, 0x04);
    near((double)(await_fall(&r) - r.edge[r.edges - 2].t_ns) * 1e-3, 596.0, 0.2); /* BUFEN fell, ACAL is on */
    xfer(&r, 0x53);
    xfer(&r, 0x00);
    xfer(&r, 0x82);
    assert_true(ads1256_drdy(&r.a));
    const int64_t from_ns = r.s.now_ns;
    near((double)(await_fall(&r) - from_ns) * 1e-6, 31.2, 0.0002);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_STATUS) & 0x0F, 0x04); /* ACAL on, buffer off, data ready */
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_FSC2), 0x3A);
    assert_int_equal(r.a.n.calibrations, 3);
    assert_int_equal(r.a.n.bad_opcodes + r.a.n.refused + r.a.n.gap_violations, 0);
}

/* The bytes in the order in which the article draws them: STATUS ends with BUFEN, DRATE waits for a byte (sources 4.2). */
static void drawn_byte_order_sent_literally(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    static const uint8_t bytes[] = {0x02, 0x50, 0x00, 0x04, 0x50, 0x00, 0x82, 0x53, 0x00};
    for (unsigned i = 0; i < COUNT(bytes); i++) xfer(&r, bytes[i]);
    assert_int_equal(r.a.n.bad_opcodes, 1);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_STATUS) & 0x0E, 0x02);
    assert_int_equal(r.a.port, ADS1256_WRITE);
    assert_int_equal(r.a.addr, ADS1256_DRATE);
}

static void clkout_bits_survive_the_reset_command_but_not_the_pin(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    wreg(&r, ADS1256_ADCON, 0x43);
    command(&r, 0xFE);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_ADCON), 0x40);
    await_fall(&r);
    ads1256_reset_pin(&r.a, false, r.s.now_ns);
    assert_true(ads1256_drdy(&r.a));
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_ADCON), 0x20);
    wait_ns(&r, 1000000);
    assert_int_equal(xfer(&r, 0x01), ADS1256_DOUT_IDLE); /* deaf while low */
    ads1256_reset_pin(&r.a, true, r.s.now_ns);
    const int64_t from_ns = r.s.now_ns;
    near((double)(await_fall(&r) - from_ns) * 1e-3, 596.0, 0.2);
    assert_int_equal(r.a.port, ADS1256_OPCODE);
    assert_int_equal(r.a.n.gap_violations, 0);
    ads1256_reset_pin(&r.a, false, r.s.now_ns);
    ads1256_reset_pin(&r.a, true, r.s.now_ns + tau_ns(4) - 1);
    assert_int_equal(r.a.n.gap_violations, 1); /* t16 */
}

static void reset_low_stops_everything(void **state)
{
    (void)state;
    struct rig r;
    rig_up(&r, &quiet);
    r.v[0] = 1.0;
    set_rate(&r, 0x92);
    xfer(&r, 0xFE);
    assert_int_equal(rdata(&r), 0);             /* the word before the reset is gone */
    ads1256_reset_pin(&r.a, false, r.s.now_ns); /* in the middle of the calibration */
    wait_ns(&r, 10000000);
    assert_true(ads1256_drdy(&r.a));
    assert_int_equal(sched_next_ns(&r.s), SCHED_NEVER);
    ads1256_power_up(&r.a, r.s.now_ns); /* the supply returns, RESET is still low */
    wait_ns(&r, 10000000);
    assert_true(ads1256_drdy(&r.a));
    assert_int_equal(r.a.n.calibrations, 2);
}

static void long_sync_low_powers_down(void **state)
{
    (void)state;
    for (unsigned over = 0; over < 2; over++) {
        struct rig r;
        rig_up(&r, &quiet);
        ads1256_sync_pin(&r.a, false, r.s.now_ns);
        wait_ns(&r, tau_ns(20 * 256) + (over ? 1 : 0));
        assert_int_equal(r.a.mode, over ? ADS1256_OFF : ADS1256_SYNC_LOW);
        ads1256_sync_pin(&r.a, true, r.s.now_ns);
        assert_int_equal(r.a.n.power_downs, over);
        await_fall(&r);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_register_row),
        cmocka_unit_test(addresses_wrap_after_0Ah),
        cmocka_unit_test(every_command_row),
        cmocka_unit_test(gaps_after_commands_are_counted),
        cmocka_unit_test(chip_select_high_drops_a_partial_command),
        cmocka_unit_test(chip_select_aligns_the_bits),
        cmocka_unit_test(auto_calibration_follows_changes_of_pga_rate_and_buffer),
        cmocka_unit_test(auto_calibration_waits_for_the_end_of_the_write),
        cmocka_unit_test(set_up_of_the_article),
        cmocka_unit_test(drawn_byte_order_sent_literally),
        cmocka_unit_test(clkout_bits_survive_the_reset_command_but_not_the_pin),
        cmocka_unit_test(reset_low_stops_everything),
        cmocka_unit_test(long_sync_low_powers_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
