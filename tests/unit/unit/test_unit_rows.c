/* What a unit's sensors give a row of looks is what they give one look at a time. */
#include "unit/unit.h"

#include "rig.h"

#include <math.h>
#include <string.h>

#define EVERY_NS 312500 /* a look is at each step of temperature, to the nanosecond */

struct bench {
    struct sched s;
    struct lab lab;
    struct unit u;
    struct sensor_fault noise;
};

static struct bench rows, looks;

/* A chamber that warms up, a head that turns; X and Z of silicon, Y of quartz, all with every noise; a fault on X. */
static void up(struct bench *b)
{
    struct lab_cfg world = lab_default();
    struct unit_cfg cfg = unit_default("a");
    memset(b, 0, sizeof *b);
    world.chamber.present = true;
    world.chamber.ramp_k_per_min = world.chamber.heating_max_k_per_min = 60.0;
    world.head.turn_s = 0.5;
    cfg.tau_case_s = cfg.tau_element_s = 0.1;
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        cfg.axis[i].mems = (struct mems_g){.u0_v = 2.5, .kx_v_per_g = 1.0, .noise_v_rthz = 1e-4, .walk_v_rts = 1e-3};
        cfg.axis[i].mems.k_tc_ppm_per_k = i == 0 ? 500.0 : 0.0;
        cfg.axis[i].quartz = quartz_default();
        cfg.axis[i].quartz.noise_a_rthz = 1e-8;
        cfg.axis[i].sensor = i == 1 ? UNIT_QUARTZ : UNIT_MEMS;
    }
    sched_init(&b->s);
    lab_init(&b->lab, &world, 1);
    unit_init(&b->u, &cfg, &b->lab, &b->s);
    head_turn(&b->lab.head, 90.0, 100000000);
    assert_int_equal(chamber_set(&b->lab.chamber, 80.0, 0), CHAMBER_OK);
    b->noise = (struct sensor_fault){
        .kind = SENSOR_NOISE, .value = 1e-4, .from_ns = 300000000, .noise = draws_of(1, 1, "fault")};
    sensor_fault_add(&b->u.sensor_faults[0], &b->noise);
}

static void take(struct bench *b, unsigned axis, const int64_t *t_ns, unsigned n, double *out)
{
    const struct board_io *io = &b->u.board->io;
    io->accel(io->ctx, axis, &(struct looks){t_ns, n, EVERY_NS}, out);
}

static void a_row_is_its_looks(void **state)
{
    (void)state;
    double low_v = 9.0, high_v = 0.0;
    int64_t k = 0;
    up(&rows);
    up(&looks);
    for (unsigned n = 1; n <= LOOKS_MAX; n++) {
        int64_t t_ns[LOOKS_MAX];
        double row[LOOKS_MAX], one;
        for (unsigned i = 0; i < n; i++) t_ns[i] = k++ * EVERY_NS;
        for (unsigned axis = 0; axis < UNIT_AXES; axis++) {
            take(&rows, axis, t_ns, n, row);
            if (axis == 0) low_v = fmin(low_v, row[0]);
            if (axis == 0) high_v = fmax(high_v, row[0]);
            for (unsigned i = 0; i < n; i++) {
                take(&looks, axis, &t_ns[i], 1, &one);
                if (row[i] != one) fail_msg("axis %u at %lld ns: %.17g, %.17g", axis, (long long)t_ns[i], row[i], one);
            }
        }
    }
    assert_true(high_v - low_v > 0.5); /* the head has turned */
    assert_true(rows.u.mems[0].temp_degc > rows.lab.chamber.cfg.start_degc + 0.2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_row_is_its_looks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
