/* ADS1281/ADS1282: the calibration commands at the chip (sources 1.3, 1.7). */
#include "ads1282_rig.h"

#include "base/bits.h"

/* ---- Calibration ---- */

static void offset_is(struct rig *r, int32_t want)
{
    const uint32_t ofc =
        (uint32_t)r->a.reg_value[5] | (uint32_t)r->a.reg_value[6] << 8 | (uint32_t)r->a.reg_value[7] << 16;
    hex_is(ofc, (uint32_t)want & 0xFFFFFF);
}

static uint32_t gain_of(const struct rig *r)
{
    return (uint32_t)r->a.reg_value[8] | (uint32_t)r->a.reg_value[9] << 8 | (uint32_t)r->a.reg_value[10] << 16;
}

/* The sequence of TI's support: SDATAC, SYNC, RDATAC, DRDY, SDATAC, OFSCAL or GANCAL, RDATAC, DRDY. */
static void calibrate(struct rig *r, uint8_t opcode)
{
    SEND(r, 0x11, 0x04, 0x10);
    to_fall(r);
    const int64_t settled_ns = r->fall_ns;
    const unsigned falls = r->falls;
    at_tclk(r, r->tclk + 100);
    SEND(r, 0x11, opcode, 0x10);
    assert_true(ads1282_drdy(&r->a));
    to_fall(r);
    assert_int_equal(r->falls, falls + 1); /* no pulses meanwhile */
    assert_int_equal(r->fall_ns, settled_ns + 16 * 1000000);
}

static void calibration_makes_offset_zero_and_full_scale_full(void **state)
{
    (void)state;
    static const struct {
        double offset_v, span_v;
    } rows[] = {{0.0, 2.4}, {0.01, 2.3}, {-0.25, 1.25}, {1.0, 1.4}, {0.001, 0.7}};
    for (unsigned k = 0; k < COUNT(rows); k++) {
        struct rig r;
        powered(&r, &quiet);
        r.v = rows[k].offset_v;
        calibrate(&r, 0x60);
        near(fraction(read_bytes(&r, 4)), 0.0, 0x1p-24); /* half a count of OFC */
        const double dc = 1.0000287402267158;
        offset_is(&r, (int32_t)lround(0x1p23 * dc * rows[k].offset_v / 2.5));
        ads1282_sample_until(&r.a, r.s.now_ns);
        r.v = rows[k].offset_v + rows[k].span_v;
        calibrate(&r, 0x61);
        const double want = 0x1p22 * 2.5 / (dc * rows[k].span_v);
        near(gain_of(&r), want, 1.0 + want * 0x1p-24 * 2.5 / rows[k].span_v); /* half a count of OFC is in it */
        near(fraction(read_bytes(&r, 4)), 1.0, 2.5e-7);                       /* a count of FSC */
        assert_int_equal(r.a.count.calibrations, 2);
    }
}

/* In SDATAC SCLK does not raise DRDY: the opcode does, and the fall says that it is done. */
static void a_calibration_raises_drdy_until_it_is_done(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    SEND(&r, 0x11);
    const int64_t fall_ns = to_fall(&r);
    byte(&r, 0x00);
    assert_false(ads1282_drdy(&r.a));
    byte(&r, 0x60);
    assert_true(ads1282_drdy(&r.a));
    assert_int_equal(to_fall(&r), fall_ns + 16 * 1000000);
    assert_int_equal(r.a.count.conversions, 1 + 1); /* the readings between are no words */
}

/* A word that no one has read when a calibration begins is gone. */
static void a_calibration_forgets_the_word(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 1.0;
    to_fall(&r);
    byte(&r, 0x60); /* shifts out its first byte */
    hex_is(read_bytes(&r, 4), 0);
    assert_int_equal(r.a.count.overruns, 0);
}

/* In SDATAC SCLK raises DRDY for the word of an RDATA, read whole or in part, and for no other. */
static void sclk_raises_drdy_for_the_word_asked_for_only(void **state)
{
    (void)state;
    for (unsigned bytes = 3; bytes <= 4; bytes++) {
        struct rig r;
        powered(&r, &quiet);
        SEND(&r, 0x11, 0x12);
        to_fall(&r);
        to_fall(&r); /* still there */
        (void)byte(&r, 0);
        assert_true(ads1282_drdy(&r.a));
        read_bytes(&r, bytes - 1);
        to_fall(&r);
        (void)byte(&r, 0);
        assert_false(ads1282_drdy(&r.a));
    }
}

/* Whether OFC and FSC act while calibrating is not known: both readings, after a first calibration of the same input. */
static void a_second_calibration_shows_whether_registers_act(void **state)
{
    (void)state;
    for (int corrected = 0; corrected < 2; corrected++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.cal_corrected = corrected;
        powered(&r, &cfg);
        r.v = 0.5;
        calibrate(&r, 0x60);
        const int32_t ofc = (int32_t)lround(0x1p23 * 0.2 * 1.0000287402267158);
        offset_is(&r, ofc);
        calibrate(&r, 0x60);
        offset_is(&r, corrected ? 0 : ofc);
    }
}

static void calibration_limits(void **state)
{
    (void)state;
    struct rig r;
    powered(&r, &quiet);
    r.v = 2.7; /* saturates at 106 %: beyond what OFC holds */
    calibrate(&r, 0x60);
    offset_is(&r, 0x7FFFFF);
    ads1282_sample_until(&r.a, r.s.now_ns);
    r.v = 0.1; /* below the offset */
    calibrate(&r, 0x61);
    hex_is(gain_of(&r), 0xFFFFFF);
    SEND(&r, 0x11, 0x41, 0x00, 0x51, 0x60); /* no calibration of the sinc's words */
    assert_int_equal(r.a.count.refused, 1);
    assert_int_equal(r.a.cal.kind, ADS1282_CAL_NONE);
}

/* Sixteen readings: their mean is four times quieter than one (less a little, neighbours are not independent). */
static void calibration_averages_sixteen_readings(void **state)
{
    (void)state;
    const uint64_t first = rig_seed(300);
    double power = 0.0;
    enum { SEEDS = 60 };
    for (unsigned seed = 0; seed < SEEDS; seed++) {
        struct rig r;
        struct ads1282_cfg cfg = quiet;
        cfg.noise_scale = 100.0; /* so that a count of OFC is fine */
        unpowered(&r, &cfg, first + seed);
        ads1282_power_up(&r.a, 0);
        calibrate(&r, 0x60);
        const double ofc = (double)bits_sign_extend(
            (uint32_t)r.a.reg_value[5] | (uint32_t)r.a.reg_value[6] << 8 | (uint32_t)r.a.reg_value[7] << 16, 24);
        power += pow(ofc * 0x1p-23, 2) / SEEDS;
    }
    const double one = 100.0 * sqrt(0.5) * pow(10.0, -124.0 / 20.0);
    near(power * 16.0 / (one * one), 1.0, 5.0 * sqrt(2.0 / SEEDS) + 0.2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(calibration_makes_offset_zero_and_full_scale_full),
        cmocka_unit_test(a_calibration_raises_drdy_until_it_is_done),
        cmocka_unit_test(a_calibration_forgets_the_word),
        cmocka_unit_test(sclk_raises_drdy_for_the_word_asked_for_only),
        cmocka_unit_test(a_second_calibration_shows_whether_registers_act),
        cmocka_unit_test(calibration_limits),
        cmocka_unit_test(calibration_averages_sixteen_readings),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
