/* From the pins to the PGA, and D0..D3: what SBAS288 p. 15 .. 17 and 23 say (sources 2.1, 2.2, 2.8), and the ADS1255. */
#include "ads1256_pins_rig.h"

#define FS 8388608.0

static void up(struct rig *r, const struct ads1256_cfg *cfg)
{
    power_up_all(r, cfg);
    await_fall(r);
}

/* Volts at the PGA after one settled conversion at 100 SPS. */
static double measured_v(struct rig *r, uint8_t adcon)
{
    wreg(r, ADS1256_ADCON, adcon);
    set_rate(r, 0x82);
    return r->a.word / FS * 5.0 / (1u << ads1256_gain_log2(adcon & 7));
}

/* Table 10, effective impedances in kohm: of a pin to AVDD/2, between the pins. */
static const double table10[7][2] = {{260, 220}, {130, 110}, {65, 55}, {33, 28}, {16, 14}, {8, 7}, {8, 7}};

/* Both together, as the differential input sees them, are the 150 kohm/PGA of the electrical characteristics (PGA to 16) and
 * 4.7 kohm (32, 64), as far as two digits go. */
static void input_impedance_agrees_with_the_characteristics(void **state)
{
    (void)state;
    for (unsigned g = 0; g < 7; g++) {
        const double kohm = 1.0 / (1.0 / table10[g][1] + 1.0 / (2.0 * table10[g][0]));
        const double printed = g < 5 ? 150.0 / (1 << g) : 4.7;
        near(kohm / printed, 1.0, 0.07);
    }
}

/* Equal resistances on both sides of a differential voltage about AVDD/2: a divider into those impedances. */
static void source_resistance_loads_the_unbuffered_input(void **state)
{
    (void)state;
    static const uint32_t clocks_hz[] = {7680000, 3840000};
    for (unsigned c = 0; c < COUNT(clocks_hz); c++) {
        for (unsigned g = 0; g < 7; g++) {
            struct ads1256_cfg cfg = quiet;
            cfg.clkin_hz = clocks_hz[c];
            struct rig r;
            up(&r, &cfg);
            r.v[0] = 2.5 + 0.03;
            r.v[1] = 2.5 - 0.03;
            r.ohm[0] = r.ohm[1] = 1000.0;
            const double scale = 7680000.0 / clocks_hz[c] * 1e3;
            const double load_ohm = scale / (1.0 / table10[g][1] + 0.5 / table10[g][0]);
            near(measured_v(&r, (uint8_t)g), 0.06 * load_ohm / (load_ohm + 2000.0), 1.5e-6);
        }
    }
}

/* One side only, against nodal analysis done by hand: 10 kohm behind 1 V on AIN0, AIN1 at 0 V. */
static void one_sided_source_is_pulled_to_the_middle(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    r.v[0] = 1.0;
    r.ohm[0] = 10e3;
    const double sum_s = 1 / 10e3 + 1 / 260e3 + 1 / 220e3;
    near(measured_v(&r, 0), (1.0 / 10e3 + 2.5 / 260e3) / sum_s, 1e-6);
    r.ohm[0] = INFINITY; /* nothing connected: between AVDD/2 and AIN1 */
    near(measured_v(&r, 0), 2.5 / 260e3 / (1 / 260e3 + 1 / 220e3), 2e-6);
    r.ohm[0] = 0.0;
    near(measured_v(&r, 0), 1.0, 1e-6);
    wreg(&r, ADS1256_STATUS, 0x02); /* the buffer does not load it */
    r.ohm[0] = 10e3;
    near(measured_v(&r, 0), 1.0, 1e-6);
}

/* I (2 Rmux + Rsens), Rmux 25 ohm; a short gives a small signal, an open sensor the ends of the range. */
static void sensor_detect_currents_give_the_drop(void **state)
{
    (void)state;
    static const double ua[] = {0.0, 0.5, 2.0, 10.0};
    static const double sensor_ohm[] = {0.0, 350.0, 10e3, 100e3};
    for (unsigned code = 0; code < 4; code++) {
        for (unsigned i = 0; i < COUNT(sensor_ohm); i++) {
            struct rig r;
            up(&r, &quiet);
            r.v[0] = r.v[1] = 1.5; /* a sensor between the pins, its middle at 1.5 V */
            r.ohm[0] = r.ohm[1] = 0.5 * sensor_ohm[i];
            near(measured_v(&r, (uint8_t)(code << 3)), code ? ua[code] * 1e-6 * (50.0 + sensor_ohm[i]) : 0.0, 2e-6);
            assert_int_equal(r.a.n.buffer_clipped, 0);
        }
        struct rig r;
        up(&r, &quiet);
        r.ohm[0] = r.ohm[1] = INFINITY;
        near(measured_v(&r, (uint8_t)(code << 3)), code ? 3.0 : 0.0, 2e-6);
        assert_int_equal(r.a.n.buffer_clipped > 0, code > 0);
    }
}

/* The currents switch the buffer on whatever BUFEN says: the load goes, and the range is the buffer's. */
static void sensor_detect_switches_the_buffer_on(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    r.v[0] = 4.0;
    r.ohm[0] = 1000.0;
    assert_true(measured_v(&r, 0x00) > 3.5);
    near(measured_v(&r, 0x08), 3.0, 2e-6); /* the 3 V clamp */
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_STATUS) & ADS1256_STATUS_BUFEN, 0);
}

static void buffer_limits_follow_the_supply(void **state)
{
    (void)state;
    static const struct {
        double avdd_v, v, seen_v;
        bool clipped;
    } rows[] = {{5.0, 3.0, 3.0, false},   {5.0, 3.001, 3.0, true},   {5.25, 3.25, 3.25, false},
                {5.25, 3.26, 3.25, true}, {4.75, 2.75, 2.75, false}, {4.75, 2.76, 2.75, true},
                {5.0, 0.0, 0.0, false},   {5.0, -0.001, 0.0, true}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct ads1256_cfg cfg = quiet;
        cfg.avdd_v = rows[i].avdd_v;
        struct rig r;
        up(&r, &cfg);
        r.v[0] = rows[i].v;
        wreg(&r, ADS1256_STATUS, 0x02);
        near(measured_v(&r, 0), rows[i].seen_v, 2e-6);
        assert_int_equal(r.a.n.buffer_clipped > 0, rows[i].clipped);
    }
}

static void pins_beyond_the_supplies_are_counted(void **state)
{
    (void)state;
    static const struct {
        double v;
        bool counted;
    } rows[] = {{-0.1, false}, {-0.11, true}, {5.1, false}, {5.11, true}};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct rig r;
        up(&r, &quiet);
        for (unsigned ain = 0; ain < 2; ain++) {
            const uint32_t before = r.a.n.range_exceeded;
            r.v[ain] = rows[i].v;
            await_fall(&r);
            await_fall(&r);
            assert_int_equal(r.a.n.range_exceeded > before, rows[i].counted);
            r.v[ain] = 0.0;
        }
    }
}

static void ads1255_has_two_inputs_and_aincom(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.part = ADS1256_PART_1255;
    struct rig r;
    up(&r, &cfg);
    for (unsigned i = 0; i < 9; i++) r.v[i] = 0.25 * (i + 1);
    for (unsigned i = 2; i < 8; i++) r.ohm[i] = 1e5; /* no one's */
    for (unsigned p = 0; p < 16; p++) {
        for (unsigned n = 0; n < 16; n++) {
            const uint32_t before = r.a.n.bad_mux;
            wreg(&r, ADS1256_MUX, (uint8_t)(p << 4 | n));
            command(&r, 0xFC);
            xfer(&r, 0x00);
            await_fall(&r);
            const double vp = p > 7 ? 2.25 : p < 2 ? 0.25 * (p + 1) : 0.0;
            const double vn = n > 7 ? 2.25 : n < 2 ? 0.25 * (n + 1) : 0.0;
            near(r.a.word / FS * 5.0, vp - vn, 3e-6);
            assert_int_equal(r.a.n.bad_mux > before, (p > 1 && p < 8) || (n > 1 && n < 8));
        }
    }
    assert_int_equal(rreg(&r, ADS1256_STATUS) >> 4, 3);
}

/* ---- D0..D3 ---- */

/* IO written, pins driven from outside, IO read, levels on the wires. CLKOUT off. */
static const struct {
    uint8_t io, in, read, wires;
} gpio[] = {
    {0x00, 0x0, 0x00, 0x0}, {0x0F, 0x0, 0x0F, 0xF}, {0x0A, 0xF, 0x0A, 0xA}, {0xF0, 0x0, 0xF0, 0x0},
    {0xF0, 0xF, 0xFF, 0xF}, {0xFF, 0x5, 0xF5, 0x5}, {0xE0, 0xA, 0xEA, 0xA}, {0x5A, 0x5, 0x5F, 0xF},
    {0xA5, 0x0, 0xA5, 0x5}, {0xC3, 0x4, 0xC7, 0x7},
};

static void gpio_pins_follow_dir_and_dio(void **state)
{
    (void)state;
    for (unsigned i = 0; i < COUNT(gpio); i++) {
        struct rig r;
        up(&r, &quiet);
        wreg(&r, ADS1256_ADCON, 0x00);
        for (unsigned d = 0; d < 4; d++) ads1256_gpio_pin(&r.a, d, gpio[i].in >> d & 1, r.s.now_ns);
        wreg(&r, ADS1256_IO, gpio[i].io);
        assert_int_equal(rreg(&r, ADS1256_IO), gpio[i].read);
        for (unsigned d = 0; d < 4; d++) {
            const bool output = !(gpio[i].io >> (4 + d) & 1);
            assert_int_equal(ads1256_gpio(&r.a, d), gpio[i].wires >> d & 1);
            assert_int_equal(ads1256_gpio_is_output(&r.a, d), output);
            if (output) assert_int_equal(r.gpio[d], gpio[i].wires >> d & 1);
        }
    }
}

static void gpio_outputs_are_told_on_changes_only(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    wreg(&r, ADS1256_ADCON, 0x00);
    assert_int_equal(r.gpio_calls, 0);
    wreg(&r, ADS1256_IO, 0x0F);
    assert_int_equal(r.gpio_calls, 4);
    wreg(&r, ADS1256_IO, 0x0F);
    wreg(&r, ADS1256_IO, 0xF0); /* inputs */
    for (unsigned d = 0; d < 4; d++) ads1256_gpio_pin(&r.a, d, d & 1, r.s.now_ns);
    assert_int_equal(r.gpio_calls, 4);
    assert_int_equal(rreg(&r, ADS1256_IO), 0xFA); /* a later edge is read, too */
    ads1256_gpio_pin(&r.a, 2, true, r.s.now_ns);
    assert_int_equal(rreg(&r, ADS1256_IO), 0xFE);
    wreg(&r, ADS1256_IO, 0x0F);
    xfer(&r, 0xFE); /* reset: D0 low, the others let go */
    assert_int_equal(r.gpio_calls, 5);
    assert_false(r.gpio[0]);
    assert_int_equal(reg_peek(&r.a.regs, ADS1256_IO), 0xEE);
    ads1256_gpio_pin(&r.a, 4, true, r.s.now_ns); /* there is no D4 */
    assert_false(ads1256_gpio(&r.a, 4) || ads1256_gpio_is_output(&r.a, 4));
}

static void clkout_on_d0_and_its_division(void **state)
{
    (void)state;
    static const struct {
        uint8_t adcon;
        uint32_t hz;
    } rows[] = {{0x20, 7680000}, {0x00, 0}, {0x40, 3840000}, {0x60, 1920000}};
    struct rig r;
    power_up_all(&r, &quiet);
    assert_int_equal(ads1256_clkout_hz(&r.a), 7680000); /* the default */
    assert_true(ads1256_gpio_is_output(&r.a, 0));
    await_fall(&r);
    for (unsigned i = 0; i < COUNT(rows); i++) {
        wreg(&r, ADS1256_ADCON, rows[i].adcon);
        assert_int_equal(ads1256_clkout_hz(&r.a), rows[i].hz);
        unsigned rises = 0;
        bool was = ads1256_gpio(&r.a, 0);
        for (unsigned k = 0; k < 10000; k++) {
            wait_ns(&r, 20);
            const bool is = ads1256_gpio(&r.a, 0);
            rises += is && !was;
            was = is;
        }
        near(rises, rows[i].hz * 200e-6, 1.0); /* counted over 200 us */
        wreg(&r, ADS1256_IO, 0xEF);
        assert_int_equal(r.gpio[0], rows[i].hz == 0); /* D0 is a pin of IO while CLKOUT is off */
        wreg(&r, ADS1256_IO, 0xEE);
        wait_ns(&r, 1000000);
    }
    assert_int_equal(r.gpio_calls, 2);
}

/* D0 shows its output as soon as CLKOUT is off. */
static void d0_is_told_when_clkout_goes_off(void **state)
{
    (void)state;
    struct rig r;
    up(&r, &quiet);
    wreg(&r, ADS1256_IO, 0xE1);
    assert_int_equal(r.gpio_calls, 0);
    wreg(&r, ADS1256_ADCON, 0x00);
    assert_int_equal(r.gpio_calls, 1);
    assert_true(r.gpio[0] && ads1256_gpio(&r.a, 0));
}

/* D2 and D3 do not exist: their bits are stored and do nothing (SBAS288 p. 23). */
static void ads1255_has_d0_and_d1(void **state)
{
    (void)state;
    struct ads1256_cfg cfg = quiet;
    cfg.part = ADS1256_PART_1255;
    struct rig r;
    up(&r, &cfg);
    wreg(&r, ADS1256_ADCON, 0x00);
    for (unsigned d = 0; d < 4; d++) ads1256_gpio_pin(&r.a, d, true, r.s.now_ns);
    assert_int_equal(rreg(&r, ADS1256_IO), 0xE2);
    wreg(&r, ADS1256_IO, 0x0F);
    assert_int_equal(r.gpio_calls, 2);
    assert_true(ads1256_gpio(&r.a, 0) && ads1256_gpio(&r.a, 1));
    assert_false(ads1256_gpio(&r.a, 2) || ads1256_gpio(&r.a, 3) || ads1256_gpio_is_output(&r.a, 2));
    assert_int_equal(rreg(&r, ADS1256_IO), 0x0F);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(input_impedance_agrees_with_the_characteristics),
        cmocka_unit_test(source_resistance_loads_the_unbuffered_input),
        cmocka_unit_test(one_sided_source_is_pulled_to_the_middle),
        cmocka_unit_test(sensor_detect_currents_give_the_drop),
        cmocka_unit_test(sensor_detect_switches_the_buffer_on),
        cmocka_unit_test(buffer_limits_follow_the_supply),
        cmocka_unit_test(pins_beyond_the_supplies_are_counted),
        cmocka_unit_test(ads1255_has_two_inputs_and_aincom),
        cmocka_unit_test(gpio_pins_follow_dir_and_dio),
        cmocka_unit_test(gpio_outputs_are_told_on_changes_only),
        cmocka_unit_test(clkout_on_d0_and_its_division),
        cmocka_unit_test(d0_is_told_when_clkout_goes_off),
        cmocka_unit_test(ads1255_has_d0_and_d1),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
