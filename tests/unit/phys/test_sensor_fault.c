/* Faults of a sensor's output: each by hand arithmetic, then several at once, and the noise against its density. */
#include "rig.h"

#include "phys/sensor/fault.h"

#include <math.h>

#define S INT64_C(1000000000)

static void near(double got, double want, double tol)
{
    if (!(fabs(got - want) <= tol)) fail_msg("got %.15g, want %.15g within %g", got, want, tol);
}

/* A look over a block of the converter at 1000 SPS. */
static double out_at(const struct sensor_fault *list, double out, int64_t t_ns)
{
    sensor_fault_row(list, &(struct looks){&t_ns, 1, 31250}, &out);
    return out;
}

/* A sensor of 2.5 V without acceleration, 1 V/g; the fault is there from 2 s on. */
static void each_fault_changes_the_output_as_it_says(void **state)
{
    (void)state;
    const struct {
        enum sensor_fault_kind kind;
        double value, value_high, out;
        int64_t t_ns;
        double want;
    } rows[] = {
        {SENSOR_STUCK, 1.25, 0, 3.5, 2 * S, 1.25},        {SENSOR_STUCK, 1.25, 0, 3.5, 2 * S - 1, 3.5}, /* not yet */
        {SENSOR_BIAS, 0.125, 0, 2.5, 5 * S, 2.625},       {SENSOR_BIAS, -0.125, 0, 2.5, 5 * S, 2.375},
        {SENSOR_DRIFT, 0.25, 0, 2.5, 2 * S, 2.5},         {SENSOR_DRIFT, 0.25, 0, 2.5, 6 * S, 3.5},
        {SENSOR_SCALE, 0.5, 0, 3.5, 5 * S, 4.0}, /* 1 V above zero becomes 1.5 V */
        {SENSOR_SCALE, 0.5, 0, 1.5, 5 * S, 1.0},          {SENSOR_SCALE, -1.0, 0, 1.5, 5 * S, 2.5}, /* deaf */
        {SENSOR_SATURATION, 2.0, 3.0, 3.5, 5 * S, 3.0},   {SENSOR_SATURATION, 2.0, 3.0, 1.5, 5 * S, 2.0},
        {SENSOR_SATURATION, 2.0, 3.0, 2.75, 5 * S, 2.75},
    };
    for (size_t k = 0; k < COUNT(rows); k++) {
        struct sensor_fault f = {.kind = rows[k].kind,
                                 .value = rows[k].value,
                                 .value_high = rows[k].value_high,
                                 .zero = 2.5,
                                 .from_ns = 2 * S};
        struct sensor_fault *list = NULL;
        sensor_fault_add(&list, &f);
        near(out_at(list, rows[k].out, rows[k].t_ns), rows[k].want, 0.0);
    }
}

/* Output 3 V: a bias of 1 V, then a limit of 3.5 V, is 3.5 V; the other way round 4 V. */
static void faults_work_in_the_order_of_their_coming(void **state)
{
    (void)state;
    struct sensor_fault bias = {.kind = SENSOR_BIAS, .value = 1.0};
    struct sensor_fault limit = {.kind = SENSOR_SATURATION, .value = 0.0, .value_high = 3.5};
    struct sensor_fault *list = NULL;
    sensor_fault_add(&list, &bias);
    sensor_fault_add(&list, &limit);
    near(out_at(list, 3.0, 0), 3.5, 0.0);
    sensor_fault_remove(&list, &bias);
    near(out_at(list, 3.0, 0), 3.0, 0.0);
    sensor_fault_add(&list, &bias);
    near(out_at(list, 3.0, 0), 4.0, 0.0);
    sensor_fault_remove(&list, &limit);
    sensor_fault_remove(&list, &limit);
    sensor_fault_remove(&list, &bias);
    assert_null(list);
}

/* 1 mV/rtHz looked at every 31.25 us: rms = 1e-3 sqrt(16000) = 126.5 mV; of 20000 values within 4 sigma of that, which is
 * 2 %. The same instant again shows the same. */
static void noise_has_its_density(void **state)
{
    (void)state;
    enum { N = 20000 };
    struct sensor_fault f = {.kind = SENSOR_NOISE, .value = 1e-3, .noise = draws_of(1, 1, "fault")};
    struct sensor_fault *list = NULL;
    double sum = 0.0, squares = 0.0;
    sensor_fault_add(&list, &f);
    for (int64_t k = 0; k < N; k++) {
        const double v = out_at(list, 0.0, k * 31250);
        near(out_at(list, 1.0, k * 31250), 1.0 + v, 1e-15);
        sum += v;
        squares += v * v;
    }
    near(sqrt(squares / N), 1e-3 * sqrt(16000.0), 0.02 * 1e-3 * sqrt(16000.0));
    near(sum / N, 0.0, 4.0 * 1e-3 * sqrt(16000.0) / sqrt((double)N));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_fault_changes_the_output_as_it_says),
        cmocka_unit_test(faults_work_in_the_order_of_their_coming),
        cmocka_unit_test(noise_has_its_density),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
