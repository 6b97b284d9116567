/* РК: its four modes, bit by bit and at once with the same result. */
#include "rig.h"

#include "base/rng.h"
#include "board/psd1/shift.h"

static void words_in_and_out_bit_by_bit_and_at_once(void **state)
{
    (void)state;
    struct rng rng = rng_stream(rig_seed(7), 1, "test");
    for (unsigned k = 0; k < 1000; k++) {
        const uint32_t word = (uint32_t)(rng_u64(&rng) & 0xFFFFFF);
        struct psd1_rk one = {.bits = word ^ 0x123456}, all = one;
        for (unsigned i = 0; i < 16; i++) psd1_rk_take(&one, word >> (15 - i) & 1);
        psd1_rk_take_word(&all, word & 0xFFFF, 16);
        assert_int_equal(one.bits, all.bits);
        assert_int_equal(one.mode, PSD1_RK_IN);
        assert_int_equal(all.mode, PSD1_RK_IN);
        assert_int_equal(psd1_rk_bus(&all), word & 0xFFFF);
        assert_int_equal(all.mode, PSD1_RK_TO_BUS);
        for (unsigned i = 0; i < 24; i++) psd1_rk_take(&one, word >> (23 - i) & 1);
        psd1_rk_take_word(&all, word, 24);
        assert_int_equal(one.bits, word);
        assert_int_equal(all.bits, word);
    }
}

static void control_words_come_from_the_bus_and_leave_by_sdat(void **state)
{
    (void)state;
    struct psd1_rk rk = {.bits = 0};
    psd1_rk_load(&rk, 0x22, 0x8013);
    assert_int_equal(rk.mode, PSD1_RK_FROM_BUS);
    assert_int_equal(psd1_rk_give_word(&rk), 0x228013);
    assert_int_equal(rk.mode, PSD1_RK_OUT);
    uint32_t seen = 0;
    for (unsigned i = 0; i < PSD1_RK_BITS; i++) seen = seen << 1 | psd1_rk_give(&rk);
    assert_int_equal(seen, 0x228013);
    assert_int_equal(rk.bits, 0x228013); /* kept */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(words_in_and_out_bit_by_bit_and_at_once),
        cmocka_unit_test(control_words_come_from_the_bus_and_leave_by_sdat),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
