/* Arithmetic of calibration and correction (sources 1.7): sums of sixteen readings, in LSB of 2^-30 full scale, to OFC and
 * FSC; readings, OFC and FSC to the output word. */
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

static void hex_is(uint32_t got, uint32_t want)
{
    if (got != want) fail_msg("got %08X, want %08X", (unsigned)got, (unsigned)want);
}

/* ---- Correction and output word ---- */

/* Sources 1.7, table of the output word; y in LSB of full scale / 2^30. */
static const struct {
    int64_t y;
    uint32_t word;
    bool clipped;
} words[] = {
    {INT64_C(1) << 32, 0x7FFFFFFF, true}, // far above +FS
    {ADS1282_FS_LSB, 0x7FFFFFFF, true},   // one LSB above the highest code
    {ADS1282_FS_LSB - 1, 0x7FFFFFFE, false},
    {1, 0x00000002, false},
    {0, 0x00000000, false},
    {-1, 0xFFFFFFFF, false},
    {-ADS1282_FS_LSB, 0x80000001, false},
    {-ADS1282_FS_LSB - 1, 0x80000000, true},
    {-(INT64_C(1) << 32), 0x80000000, true},
};

static void words_follow_the_data_format_table(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(words); k++) {
        bool clipped;
        hex_is(ads1282_word(words[k].y, &clipped), words[k].word);
        assert_int_equal(clipped, words[k].clipped);
    }
}

/* Sources 1.7: zero input with OFC, and FSC. The printed table shows bit 0 clear; in a word it repeats the sign. */
static const struct {
    int64_t y;
    int32_t ofc;
    uint32_t fsc, word;
} corrections[] = {
    {0, 0x000000, 0x400000, 0x00000000},
    {0, 0x000001, 0x400000, 0xFFFFFF01},  // printed FFFFFF00
    {0, -0x000001, 0x400000, 0x00000100}, // OFC FFFFFFh, printed 00000100
    {0, 0x7FFFFF, 0x400000, 0x80000101},  // printed 80000000: nominal
    {0, -0x800000, 0x400000, 0x7FFFFFFF}, // printed 7FFFFF00: nominal; exact arithmetic clips
    {0x10000000, 0, 0x400000, 0x20000000},
    {0x10000000, 0, 0x800000, 0x40000000},  // gain 2
    {0x10000000, 0, 0x200000, 0x10000000},  // gain 1/2
    {0x10000000, 0, 0x000000, 0x00000000},  // gain 0
    {0x10000000, 0, 0xFFFFFF, 0x7FFFFF80},  // gain 3.99999976
    {-0x10000000, 0, 0xFFFFFF, 0x80000081}, // a quarter of full scale, times it
    {0x20000000, 0, 0xFFFFFF, 0x7FFFFFFF},
    {0x10000000, 0x100000, 0x800000, 0x20000000}, // offset first, then gain: (1/4 - 1/8) 2
    {1, 0, 0x200000, 0x00000002},                 // a half rounds up
};

static void offset_and_gain_follow_equation_7(void **state)
{
    (void)state;
    for (unsigned k = 0; k < COUNT(corrections); k++) {
        bool clipped;
        const int64_t y = ads1282_correct(corrections[k].y, corrections[k].ofc, corrections[k].fsc);
        hex_is(ads1282_word(y, &clipped), corrections[k].word);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_sixteenth_reading_is_the_last),
        cmocka_unit_test(ofc_is_the_mean_to_the_nearest_count),
        cmocka_unit_test(fsc_is_full_scale_by_the_mean_to_the_nearest_count),
        cmocka_unit_test(fsc_saturates),
        cmocka_unit_test(words_follow_the_data_format_table),
        cmocka_unit_test(offset_and_gain_follow_equation_7),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
