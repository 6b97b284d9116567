/* A sensor that is driven by samples: every sample at its instant, between and behind them as chosen. */
#include "rig.h"

#include "phys/sensor/series.h"
#include "unit/unit.h"

#include <math.h>

static const struct series_sample three[] = {{1000, 1.0}, {2000, 3.0}, {4000, -5.0}};

static struct series of_three(enum series_between between, enum series_end end)
{
    return (struct series){.sample = three, .count = 3, .start_ns = 100, .between = between, .end = end};
}

static double value_at(struct series *s, int64_t t_ns)
{
    double v = 99.0;
    assert_true(series_value(s, t_ns, &v));
    return v;
}

static void a_line_or_the_earlier_value(void **state)
{
    (void)state;
    struct series line = of_three(SERIES_LINEAR, SERIES_END_HOLD), hold = of_three(SERIES_HOLD, SERIES_END_HOLD);
    static const struct {
        int64_t t_ns;
        double line, hold;
    } at[] = {{0, 1, 1},     {1100, 1, 1},      {1600, 2, 1},   {2099, 2.998, 1}, {2100, 3, 3},
              {3100, -1, 3}, {4099, -4.996, 3}, {4100, -5, -5}, {9100, -5, -5}};
    for (unsigned i = 0; i < sizeof at / sizeof *at; i++) {
        assert_true(value_at(&line, at[i].t_ns) == at[i].line);
        assert_true(value_at(&hold, at[i].t_ns) == at[i].hold);
    }
}

/* The last sample lasts as long as the interval before it, 2000 ns: a pass is 5000 ns. */
static void a_series_is_repeated_without_a_gap(void **state)
{
    (void)state;
    struct series line = of_three(SERIES_LINEAR, SERIES_END_REPEAT), hold = of_three(SERIES_HOLD, SERIES_END_REPEAT);
    assert_true(value_at(&line, 4100) == -5.0);
    assert_true(value_at(&line, 5100) == -2.0);
    assert_true(value_at(&hold, 6099) == -5.0);
    for (int64_t pass = 0; pass < 1000; pass++) {
        assert_true(value_at(&line, 1100 + pass * 5000) == 1.0);
        assert_true(value_at(&line, 2100 + pass * 5000) == 3.0);
        assert_true(value_at(&hold, 4100 + pass * 5000) == -5.0);
    }
}

static void a_series_that_stops_has_no_value_behind_its_last_sample(void **state)
{
    (void)state;
    double v;
    struct series s = of_three(SERIES_LINEAR, SERIES_END_STOP);
    assert_true(value_at(&s, 4100) == -5.0);
    assert_false(series_value(&s, 4101, &v));
    assert_true(value_at(&s, 2100) == 3.0); /* a look back is as good as any */
}

/* Of many uneven samples, by leaps in any order: as a search from the first one finds them. */
static void any_order_of_looks_finds_the_same(void **state)
{
    (void)state;
    enum { N = 500, LOOKS = 20000 };
    static struct series_sample sample[N];
    int64_t t_ns = -700;
    for (unsigned i = 0; i < N; i++) {
        sample[i] = (struct series_sample){t_ns, (double)i};
        t_ns += 1 + (i * 7919) % 100;
    }
    struct series s = {.sample = sample, .count = N, .between = SERIES_HOLD};
    uint32_t x = 1;
    for (unsigned k = 0; k < LOOKS; k++) {
        x = x * 1664525u + 1013904223u;
        const int64_t at_ns = k % 3 ? (int64_t)(x >> 8) % 27000 - 1000 : (int64_t)k;
        unsigned i = 0;
        while (i + 1 < N && sample[i + 1].t_ns <= at_ns) i++;
        assert_true(value_at(&s, at_ns) == (double)i);
    }
}

/* ---- on a unit */

enum { MANY = 1000, STEP_NS = 1000000 };
static struct series_sample ramp[MANY];

static void start_unit(struct unit *u, struct lab *lab, struct sched *s, enum unit_sensor sensor, enum series_end end)
{
    sched_init(s);
    const struct lab_cfg cfg = lab_default();
    lab_init(lab, &cfg, 1);
    for (unsigned i = 0; i < MANY; i++) ramp[i] = (struct series_sample){(int64_t)i * STEP_NS, 0.5 + i * 1e-3};
    struct unit_cfg c = unit_default("u");
    c.axis[1].sensor = sensor;
    c.axis[1].mems = (struct mems_g){.u0_v = 2.5, .kx_v_per_g = 1.0};
    c.axis[1].series = (struct series){.sample = ramp, .count = MANY, .between = SERIES_HOLD, .end = end};
    unit_init(u, &c, lab, s);
}

static double look(const struct board_io *io, unsigned axis, int64_t t_ns)
{
    double out;
    io->accel(io->ctx, axis, &(struct looks){&t_ns, 1, STEP_NS}, &out);
    return out;
}

/* The board's own look at its input, at each sample's instant, just before the next one, and behind the last. */
static void a_board_gets_every_sample(void **state)
{
    (void)state;
    static struct unit u;
    static struct lab lab;
    struct sched s;
    start_unit(&u, &lab, &s, UNIT_RECORDED, SERIES_END_STOP);
    const struct board_io *io = &u.board->io;
    for (unsigned i = 0; i < MANY; i++) {
        assert_true(look(io, 1, ramp[i].t_ns) == ramp[i].value);
        if (i + 1 < MANY) assert_true(look(io, 1, ramp[i + 1].t_ns - 1) == ramp[i].value);
        assert_true(unit_sensor_out(&u, 1, ramp[i].t_ns) == ramp[i].value);
    }
    assert_true(look(io, 1, (int64_t)MANY * STEP_NS) == 0.0);
    assert_true(look(io, 0, (int64_t)MANY * STEP_NS) == 0.0); /* channel X has no sensor */
}

/* A sensor of gravity's projection a feels a = -f. */
static void a_sensor_feels_the_specific_force(void **state)
{
    (void)state;
    static struct unit u;
    static struct lab lab;
    struct sched s;
    start_unit(&u, &lab, &s, UNIT_MEMS, SERIES_END_HOLD);
    const struct board_io *io = &u.board->io;
    for (unsigned i = 0; i < MANY; i++)
        assert_true(fabs(look(io, 1, ramp[i].t_ns) - (2.5 - ramp[i].value / lab.site.g_mps2)) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_line_or_the_earlier_value),
        cmocka_unit_test(a_series_is_repeated_without_a_gap),
        cmocka_unit_test(a_series_that_stops_has_no_value_behind_its_last_sample),
        cmocka_unit_test(any_order_of_looks_finds_the_same),
        cmocka_unit_test(a_board_gets_every_sample),
        cmocka_unit_test(a_sensor_feels_the_specific_force),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
