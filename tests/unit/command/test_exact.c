#include "rig.h"

#include "base/rng.h"
#include "command/exact.h"

#include <math.h>
#include <string.h>

static void numbers_print_short_where_that_is_exact(void **state)
{
    static const struct {
        double x;
        const char *text;
    } rows[] = {
        {0.0, "0"},
        {-0.0, "-0"},
        {0.1, "0.1"},
        {0.1 + 0.2, "0.30000000000000004"}, /* cJSON prints 0.3 */
        {9007199254740991.0, "9007199254740991"},
        {1e300, "1e+300"},
        {INFINITY, "null"},
        {NAN, "null"},
    };
    char text[EXACT_MAX];
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        exact_number(rows[i].x, text);
        assert_string_equal(text, rows[i].text);
    }
}

static void any_double_reads_back_as_itself(void **state)
{
    struct rng r = rng_stream(rig_seed(1), 0, "exact");
    (void)state;
    for (int i = 0; i < 20000; i++) {
        const uint64_t bits = rng_u64(&r);
        double x, back;
        memcpy(&x, &bits, sizeof x);
        if (!isfinite(x)) continue;
        cJSON *list = cJSON_CreateArray();
        cJSON_AddItemToArray(list, cJSON_CreateNumber(x));
        char *line = exact_line(list);
        cJSON *again = cJSON_Parse(line);
        back = cJSON_GetArrayItem(again, 0)->valuedouble;
        assert_memory_equal(&back, &x, sizeof x);
        cJSON_Delete(again);
        cJSON_Delete(list);
        free(line);
    }
}

static void a_tree_keeps_its_shape(void **state)
{
    static const char text[] = "{\"a\":[1,2.5,{\"b\":\"3\"}],\"c\":true,\"d\":null,\"e\":{}}";
    (void)state;
    cJSON *tree = cJSON_Parse(text);
    char *line = exact_line(tree);
    assert_string_equal(line, text);
    free(line);
    cJSON_Delete(tree);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_print_short_where_that_is_exact),
        cmocka_unit_test(any_double_reads_back_as_itself),
        cmocka_unit_test(a_tree_keeps_its_shape),
    };
    return cmocka_run_group_tests_name("exact", tests, NULL, NULL);
}
