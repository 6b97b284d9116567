/* Readings out of a PSA-2's CAN frames: what the board packs is what LCM and MAVLink send, in every form. */
#include "rig.h"

#include "base/rng.h"
#include "board/psa2/board.h"
#include "telemetry/psa2_reading.h"

#include <string.h>

enum { NODE = 9, SAMPLES = 500, PERIOD_NS = 1000000, BUS_NS = 310000 };

static struct psa2_frame sample(struct rng *rng, unsigned i)
{
    struct psa2_frame f = {.seq = i, .t_sample_ns = INT64_C(3000000000) + (int64_t)i * PERIOD_NS};
    for (unsigned k = 0; k < 3; k++) f.code[k] = (int32_t)(rng_u64(rng) & 0xFFFFFF) - 0x800000;
    f.temp_code = (uint16_t)rng_u64(rng);
    f.temp_channel = i & 3;
    f.status = i & 15;
    return f;
}

/* Readings of one sample's frames; ids as the node would send them. */
static unsigned take_frames(struct psa2_reader *d, unsigned form, struct can_msg *m, unsigned n, int64_t t_ns,
                            struct psa2_reading *out)
{
    static const uint16_t cob[PSA2_FORMS][2] = {{0x180, 0x280}, {0x380}, {0x200}, {0x480}};
    unsigned count = 0;
    for (unsigned i = 0; i < n; i++) {
        m[i].id = cob[form][i] + (uint32_t)NODE;
        count += psa2_reading_take(d, &m[i], t_ns + i * 1000, out + count);
    }
    return count;
}

static void every_form_reads_as_it_was_packed(void **state)
{
    (void)state;
    for (unsigned form = 0; form < PSA2_FORMS; form++) {
        struct rng rng = rng_stream(rig_seed(1), form, "frames");
        struct psa2_block block = {0};
        struct psa2_reader d = {.node = NODE};
        static struct psa2_frame sent[SAMPLES];
        unsigned read = 0;
        for (unsigned i = 0; i < SAMPLES; i++) {
            struct can_msg m[PSA2_FORM_FRAMES_MAX] = {{0}};
            struct psa2_reading out[PSA2_READINGS_MAX];
            sent[i] = sample(&rng, i);
            const unsigned n = psa2_form_pack(form, &block, &sent[i], m);
            const unsigned came = take_frames(&d, form, m, n, sent[i].t_sample_ns + BUS_NS, out);
            for (unsigned k = 0; k < came; k++) {
                const struct psa2_frame *f = &sent[read++];
                const int32_t drop = form == PSA2_FORM_FAST ? 7 : 0;
                for (unsigned a = 0; a < 3; a++) {
                    assert_int_equal(out[k].code[a], f->code[a] & ~drop);
                    assert_true(out[k].volts[a] == out[k].code[a] * (10.0 / 8388608.0));
                }
                assert_int_equal(out[k].lost, 0);
                if (form == PSA2_FORM_FAST) continue;
                assert_int_equal(out[k].temp_code, (int16_t)f->temp_code);
                assert_int_equal(out[k].temp_channel, f->temp_channel);
                assert_int_equal(out[k].status, f->status);
                if (form != PSA2_FORM_BLOCK || i >= 2 * PSA2_READINGS_MAX)
                    assert_true(llabs(out[k].t_ns - f->t_sample_ns) < 4000);
            }
        }
        assert_int_equal(read, SAMPLES);
    }
}

static void gaps_of_the_numbers_are_counted_and_a_reset_is_none(void **state)
{
    (void)state;
    static const struct {
        uint16_t seq;
        uint32_t lost;
    } rows[] = {{7, 0}, {8, 0}, {11, 2}, {0, 0}, {1, 0}, {65535, 65533}, {0, 0}, {2, 1}};
    struct psa2_reader d = {.node = NODE};
    for (unsigned i = 0; i < COUNT(rows); i++) {
        struct psa2_frame f = {.seq = rows[i].seq, .t_sample_ns = INT64_C(1000000) * (i + 1)};
        struct can_msg m[PSA2_FORM_FRAMES_MAX] = {{0}};
        struct psa2_reading out[PSA2_READINGS_MAX];
        const unsigned n = psa2_form_pack(PSA2_FORM_PAIR, NULL, &f, m);
        assert_int_equal(take_frames(&d, PSA2_FORM_PAIR, m, n, f.t_sample_ns + BUS_NS, out), 1);
        assert_int_equal(out[0].lost, rows[i].lost);
    }
}

static void a_half_alone_and_frames_of_others_give_no_reading(void **state)
{
    (void)state;
    static const struct can_msg rows[] = {
        {.id = 0x280 + NODE, .len = 8},     /* the second half first */
        {.id = 0x180 + NODE, .len = 7},     /* too short */
        {.id = 0x180 + NODE + 1, .len = 8}, /* another node's */
        {.id = 0x180 + NODE, .flags = CAN_EXT, .len = 8},
        {.id = 0x380 + NODE, .flags = CAN_RTR, .len = 8},
        {.id = 0x200 + NODE, .len = 16}, /* no FD frame */
        {.id = 0x480 + NODE, .flags = CAN_FD, .len = 48},
    };
    struct psa2_reader d = {.node = NODE};
    struct psa2_reading out[PSA2_READINGS_MAX];
    for (unsigned i = 0; i < COUNT(rows); i++) assert_int_equal(psa2_reading_take(&d, &rows[i], 1000, out), 0);
    const struct can_msg xy = {.id = 0x180 + NODE, .len = 8}, zt = {.id = 0x280 + NODE, .len = 8};
    assert_int_equal(psa2_reading_take(&d, &zt, 1000, out), 0);
    assert_int_equal(psa2_reading_take(&d, &xy, 2000, out), 0);
    assert_int_equal(psa2_reading_take(&d, &zt, 2200, out), 1);
    assert_int_equal(psa2_reading_take(&d, &zt, 3200, out), 0); /* its first half was lost */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_form_reads_as_it_was_packed),
        cmocka_unit_test(gaps_of_the_numbers_are_counted_and_a_reset_is_none),
        cmocka_unit_test(a_half_alone_and_frames_of_others_give_no_reading),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
