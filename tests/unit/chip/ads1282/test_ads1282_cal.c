/* Arithmetic of OFSCAL and GANCAL (sources 1.7): sums of sixteen readings, in LSB of 2^-30 full scale, to OFC and FSC. */
#include "rig.h"

#include "chip/ads1282/filter.h"

static const int64_t FULL_SCALE = INT64_C(16) << 30; /* of sixteen readings */

static int32_t ofc(int64_t sum)
{
    return ads1282_cal_ofc(&(struct ads1282_cal){.sum = sum});
}

static uint32_t fsc(int64_t sum, int32_t offset)
{
    return ads1282_cal_fsc(&(struct ads1282_cal){.sum = sum}, offset);
}

static void the_sixteenth_reading_is_the_last(void **state)
{
    (void)state;
    struct ads1282_cal c = {.left = ADS1282_CAL_READINGS};
    for (int n = 1; n <= 16; n++) assert_int_equal(ads1282_cal_take(&c, -3 * n), n == 16);
    assert_int_equal(c.sum, -3 * 136);
}

static void ofc_is_the_mean_to_the_nearest_count(void **state)
{
    (void)state;
    const int64_t count = 16 * 128; /* of OFC */
    assert_int_equal(ofc(1000 * count), 1000);
    assert_int_equal(ofc(1000 * count + count / 2 - 1), 1000);
    assert_int_equal(ofc(1000 * count + count / 2 + 1), 1001);
    assert_int_equal(ofc(-1000 * count - count / 2 + 1), -1000);
    assert_int_equal(ofc(-1000 * count - count / 2 - 1), -1001);
    assert_int_equal(ofc((INT64_C(1) << 23) * count), 0x7FFFFF);
    assert_int_equal(ofc(-(INT64_C(1) << 24) * count), -0x800000);
}

static void fsc_is_full_scale_by_the_mean_to_the_nearest_count(void **state)
{
    (void)state;
    assert_int_equal(fsc(FULL_SCALE, 0), 0x400000);
    assert_int_equal(fsc(FULL_SCALE + 16 * 128 * 5000, 5000), 0x400000); /* OFC is taken away first */
    assert_int_equal(fsc(FULL_SCALE / 2 * 3, 0), 2796203);               /* 2^23 / 3 = 2796202.67 */
    assert_int_equal(fsc(FULL_SCALE * 3, 0), 1398101);                   /* 1398101.33 */
}

static void fsc_saturates(void **state)
{
    (void)state;
    assert_int_equal(fsc(FULL_SCALE / 4, 0), 0xFFFFFF); /* 4 would be 1000000h */
    assert_int_equal(fsc(1, 0), 0xFFFFFF);
    assert_int_equal(fsc(0, 0), 0xFFFFFF);
    assert_int_equal(fsc(-FULL_SCALE, 0), 0xFFFFFF);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_sixteenth_reading_is_the_last),
        cmocka_unit_test(ofc_is_the_mean_to_the_nearest_count),
        cmocka_unit_test(fsc_is_full_scale_by_the_mean_to_the_nearest_count),
        cmocka_unit_test(fsc_saturates),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
