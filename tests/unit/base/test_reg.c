#include "rig.h"

#include "base/reg.h"
#include "base/spi.h"

static int hooks;
static uint8_t hook_was, hook_now;

static void written(void *chip, uint8_t was, uint8_t now, int64_t t_ns)
{
    (void)chip;
    (void)t_ns;
    hooks++;
    hook_was = was;
    hook_now = now;
}

static const struct reg_spec map[] = {
    {.name = "ID", .src = "test", .reset = 0x31},
    {.name = "CONFIG", .src = "test", .reset = 0x52, .rw = 0xBF, .unimp = 0x80, .on_write = written},
    {0},
    {.name = "DATA", .src = "test", .reset = 0x00, .rw = 0xFF},
};

static void rights_holes_and_hooks(void **state)
{
    (void)state;
    uint8_t value[COUNT(map)];
    struct reg_file f = {.map = map, .count = COUNT(map), .value = value};
    hooks = 0;
    reg_reset(&f);
    assert_int_equal(hooks, 0); /* reset stores, it does not act */
    reg_write(&f, 0, 0xFF, 0);
    assert_int_equal(reg_read(&f, 0), 0x31);
    assert_int_equal(f.ro_write, 1);
    reg_write(&f, 1, 0x16, 0); /* bit 6 is not writable: stays 1 */
    assert_int_equal(reg_read(&f, 1), 0x56);
    assert_int_equal(hooks, 1);
    assert_int_equal(hook_was, 0x52);
    assert_int_equal(hook_now, 0x56);
    reg_write(&f, 1, 0xD6, 0);
    assert_int_equal(f.unimp_access, 1);
    reg_write(&f, 2, 0x55, 0);
    assert_int_equal(reg_read(&f, 2), 0);
    assert_int_equal(reg_read(&f, 99), 0);
    assert_int_equal(f.bad_access, 3);
    reg_poke(&f, 0, 0x32);
    assert_int_equal(reg_peek(&f, 0), 0x32);
    assert_int_equal(reg_peek(&f, 2), 0);
    assert_int_equal(f.bad_access, 3); /* peeking leaves no trace */
}

struct echo {
    struct spi spi;
    uint8_t got[8];
    int count, firsts;
};

static uint8_t plus_one(void *chip, uint8_t mosi, int64_t t_ns)
{
    struct echo *e = chip;
    (void)t_ns;
    e->got[e->count++ % 8] = mosi;
    return (uint8_t)(mosi + 1);
}

static void first_edge(void *chip, int64_t t_ns)
{
    (void)t_ns;
    ((struct echo *)chip)->firsts++;
}

static void bytes_and_bits_drive_the_same_shifter(void **state)
{
    (void)state;
    const uint8_t mosi[] = {0x41, 0x00, 0x56, 0xA5, 0xFF};
    struct echo by_byte = {0}, by_bit = {0};
    spi_init(&by_byte.spi, plus_one, first_edge, &by_byte);
    spi_init(&by_bit.spi, plus_one, first_edge, &by_bit);
    for (size_t i = 0; i < COUNT(mosi); i++) {
        spi_first(&by_byte.spi, 0);
        const uint8_t want = spi_byte(&by_byte.spi, mosi[i], 0);
        uint8_t miso = 0;
        for (int b = 7; b >= 0; b--) {
            miso = (uint8_t)((miso << 1) | spi_miso(&by_bit.spi));
            spi_sample(&by_bit.spi, (mosi[i] >> b) & 1, 0);
        }
        assert_int_equal(miso, want);
        assert_int_equal(miso, i ? (uint8_t)(mosi[i - 1] + 1) : 0);
    }
    assert_memory_equal(by_byte.got, mosi, sizeof mosi);
    assert_memory_equal(by_bit.got, mosi, sizeof mosi);
    assert_int_equal(by_byte.firsts, 5);
}

static void a_latch_that_updates_mid_byte_tears_at_that_bit(void **state)
{
    (void)state;
    struct echo e = {0};
    spi_init(&e.spi, plus_one, NULL, &e);
    spi_load(&e.spi, 0xFF);
    uint8_t miso = 0;
    for (int b = 0; b < 8; b++) {
        if (b == 3) spi_load(&e.spi, 0x00);
        miso = (uint8_t)((miso << 1) | spi_miso(&e.spi));
        spi_sample(&e.spi, 0, 0);
    }
    assert_int_equal(miso, 0xE0);
}

static void realigning_drops_a_partial_byte(void **state)
{
    (void)state;
    struct echo e = {0};
    spi_init(&e.spi, plus_one, NULL, &e);
    for (int b = 0; b < 5; b++) spi_sample(&e.spi, 1, 0);
    assert_int_equal(spi_byte(&e.spi, 0x00, 0), 0x1F); /* straddles: 000 of the old byte, then 11111 of its answer F9 */
    assert_int_equal(e.got[0], 0xF8);
    spi_realign(&e.spi);
    spi_byte(&e.spi, 0x41, 0);
    assert_int_equal(e.got[1], 0x41);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rights_holes_and_hooks),
        cmocka_unit_test(bytes_and_bits_drive_the_same_shifter),
        cmocka_unit_test(a_latch_that_updates_mid_byte_tears_at_that_bit),
        cmocka_unit_test(realigning_drops_a_partial_byte),
    };
    return cmocka_run_group_tests_name("reg", tests, NULL, NULL);
}
