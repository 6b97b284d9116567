/* What the tests of faults share: a bench of two units for the commands, and fault.add. */
#ifndef PSABENCH_TESTS_FAULT_CALL_H
#define PSABENCH_TESTS_FAULT_CALL_H

#include "rig.h"

#include "control/control.h"
#include "fault/fault.h"

static inline bool no_client(void *ctx, unsigned i, struct control_client *out)
{
    (void)ctx;
    (void)i;
    (void)out;
    return false;
}

/* Two units on a bus of their lab, without clients. */
static inline struct control_bench bench_of_two(struct unit unit[2], const char *first, const char *second,
                                                struct can_bus *bus, struct sched *s, struct fault_engine *engine)
{
    return (struct control_bench){.lab = unit[0].lab,
                                  .bus = {bus},
                                  .buses = 1,
                                  .unit = {&unit[0], &unit[1]},
                                  .unit_name = {first, second},
                                  .units = 2,
                                  .sched = s,
                                  .seed = 7,
                                  .faults = engine,
                                  .clients.nth = no_client};
}

/* The number that fault.add gives; 0: refused, the reason is in the control. Single quotes for double ones. */
static inline uint32_t add_fault(struct control *control, const char *args, int64_t now_ns)
{
    char json[512];
    snprintf(json, sizeof json, "%s", args);
    for (char *s = json; *s; s++) *s = *s == '\'' ? '"' : *s;
    cJSON *const given = cJSON_Parse(json), *const result = cJSON_CreateObject();
    assert_non_null(given);
    const bool done = control_call(control, "fault.add", given, result, now_ns) == CONTROL_DONE;
    const uint32_t id = done ? (uint32_t)cJSON_GetObjectItemCaseSensitive(result, "id")->valuedouble : 0;
    cJSON_Delete(result);
    cJSON_Delete(given);
    return id;
}

#endif
