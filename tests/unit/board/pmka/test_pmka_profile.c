/* Profile of the PMKA: its files beside the default, and what a board cannot be. */
#include "pmka_rig.h"

static void the_default_passes(void **state)
{
    (void)state;
    const struct pmka_profile p = rig_profile();
    char why[300] = "", text[200];
    if (!pmka_board.profile_check(&p, why, sizeof why)) fail_msg("%s", why);
    assert_int_equal(pmka_board.period_ns(&p), 4800000);
    pmka_board.about(&p, text, sizeof text);
    assert_string_equal(text, "Ts 4.8 ms, Ur 5.106 V, 2.869 uV s a code, autonomous rotation, beats of 200 Ts");
    for (unsigned i = 0; i < pmka_fields.count; i++) {
        assert_non_null(pmka_fields.row[i].key);
        assert_non_null(pmka_fields.row[i].what);
    }
}

static void what_a_board_cannot_be(void **state)
{
    (void)state;
    const struct {
        const char *key, *text, *says;
    } rows[] = {
        {"ts_ns", "4800001", "ts_ns: expected an even number (a reset lasts half of it), got 4800001"},
        {"hold_ns", "50000", "hold_ns: expected less than convert_ns = 50000, got 50000"},
        {"convert_ns", "100001", NULL},
        {"mux_step_ns", "49999", "convert_ns: expected up to mux_step_ns = 49999"},
        {"key_gap_ns", "50000", "key_gap_ns: expected less than convert_ns = 50000"},
        {"ts_ns", "1000000", ""},
        {"ts_ns", "7000000", "uc_v: expected more than half of a reset, Ur = 7.447 V, got 3.500"},
        {"strobe_min_ns", "801", "strobe_ns: expected strobe_min_ns = 801 or more, got 800"},
        {"uc_v", "2.5", "uc_v: expected more than half of a reset, Ur = 5.106 V, got 2.500"},
        {"uc_v", "4.9", "uc_v: expected a value that with Ur = 5.106 V is within the converter's range, got 4.900"},
        {"r_in_ohm", "20100", "r_in_ohm: expected RIN / (2 Rr) of 0.997 to 1.003 (CT in the ROM), got 1.00500"},
        {"zero_periods", "195", "zero_periods: expected up to beat_periods - 6 = 194"},
        {"zero_periods", "194", ""},
        {"mux_step_ns", "500000", ""},
        {"rotation", "program", ""},
        {"rotation", "none", NULL},
        {"cap_tol_sd", "0.2", NULL},
    };
    for (size_t k = 0; k < COUNT(rows); k++) {
        struct pmka_profile p = rig_profile();
        char why[300] = "";
        const bool set = fields_set(&pmka_fields, &p, rows[k].key, 0, rows[k].text, why, sizeof why);
        const bool ok = set && pmka_profile_check(&p, why, sizeof why);
        const char *says = rows[k].says;
        if (ok != (says && !says[0])) fail_msg("row %zu: %s", k, why);
        if (says && strncmp(why, says, strlen(says)) != 0) fail_msg("row %zu: %s", k, why);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_default_passes),
        cmocka_unit_test(what_a_board_cannot_be),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
