#include "rig.h"

#include "scenario/profile.h"
#include "scenario/scenario.h"

#include <string.h>
#include <unistd.h>

static struct scenario s;
static char why[1024];

static bool parse(const char *text)
{
    why[0] = '\0';
    return scenario_parse("dir/s.yaml", text, strlen(text), &s, why, sizeof why);
}

static void a_scenario_without_more_than_a_unit_has_sound_defaults(void **state)
{
    (void)state;
    if (!parse("units: [{}]\n")) fail_msg("%s", why);
    assert_int_equal(s.seed, 1);
    assert_int_equal(s.bus[0].cfg.bitrate_hz, 1000000);
    assert_int_equal(s.unit_count, 1);
    assert_string_equal(s.units[0].name, "a");
    assert_int_equal(s.units[0].cfg.node, 5);
    assert_string_equal(s.units[0].profile.psa2.name, "article");
    assert_int_equal(s.units[0].cfg.axis[0].sensor, UNIT_NO_SENSOR);
    assert_false(s.start);
}

static void every_key_reaches_its_field(void **state)
{
    (void)state;
    const bool ok =
        parse("seed: 18446744073709551615\n"
              "start: true\n"
              "bus: {bitrate_hz: 500000, data_bitrate_hz: 2000000}\n"
              "site: {g_mps2: 9.7803}\n"
              "head: {resolution_arcsec: 1, setting_error_arcsec_rms: 2, periodic_arcsec: 3, periodic_order: 4,\n"
              "       mount_error_arcsec_rms: 5, turn_s: 6}\n"
              "units:\n"
              "  - name: left\n"
              "    node: 9\n"
              "    serial: 77\n"
              "    frame_form: 2\n"
              "    temp_degc: [1, 2, 3, 4]\n"
              "    adc_noise_scale: 0.5\n"
              "    adc_chain: direct\n"
              "    profile_set: {word_bits: 24, line_hz: 4096000, line_div: 3, word: [T, Z, Y, X]}\n"
              "    axes:\n"
              "      y: {sensor: mems, u0_v: -0.25, kxy_v_per_g2: 1e-3, alpha0_deg: 0.1121,\n"
              "          afe: {input: current, load_ohm: 999, load_tol_ppm: -12}}\n");
    if (!ok) fail_msg("%s", why);
    assert_true(s.seed == UINT64_MAX && s.start);
    assert_int_equal(s.bus[0].cfg.bitrate_hz, 500000);
    assert_int_equal(s.bus[0].cfg.data_bitrate_hz, 2000000);
    assert_true(s.site.g_mps2 == 9.7803);
    assert_true(s.lab.head.resolution_arcsec == 1 && s.lab.head.setting_error_arcsec_rms == 2 &&
                s.lab.head.periodic_arcsec == 3);
    assert_true(s.lab.head.periodic_order == 4 && s.lab.head.mount_error_arcsec_rms == 5 && s.lab.head.turn_s == 6);
    const struct scenario_unit *u = &s.units[0];
    assert_string_equal(u->name, "left");
    assert_int_equal(u->cfg.node, 9);
    assert_int_equal(u->cfg.board.serial, 77);
    assert_int_equal(u->frame_form, 2);
    assert_true(u->cfg.temp_degc[0] == 1 && u->cfg.temp_degc[3] == 4);
    assert_true(u->cfg.board.adc_noise_scale == 0.5 && u->cfg.board.temp_noise_scale == 1);
    assert_int_equal(u->cfg.board.adc_chain, ADS1282_CHAIN_DIRECT);
    assert_int_equal(u->profile.psa2.word_bits, 24);
    assert_int_equal(u->profile.psa2.word[0], PSA2_WORD_T);
    assert_int_equal(u->cfg.axis[1].sensor, UNIT_MEMS);
    assert_true(u->cfg.axis[1].mems.u0_v == -0.25 && u->cfg.axis[1].mems.kxy_v_per_g2 == 1e-3);
    assert_true(u->cfg.axis[1].mems.alpha0_deg == 0.1121);
    assert_int_equal(u->cfg.board.afe[1].input, AFE_CURRENT);
    assert_true(u->cfg.board.afe[1].load_ohm == 999 && u->cfg.board.afe[1].load_tol_ppm == -12);
    assert_true(u->cfg.board.afe[0].load_ohm == 1000); /* the other axes keep the nominal chain */
}

#define PLACE "units: [{}]\nsite: {latitude_deg: 55}\n"

static const struct {
    const char *text, *why; /* the whole line, or its beginning */
} bad[] = {
    {"", "dir/s.yaml:1:1: expected a mapping `key: value`, got an empty file"},
    {"- 1\n", "dir/s.yaml:1:1: expected a mapping `key: value`"},
    {"units: [{}]\nseed: -1\n", "dir/s.yaml:2:7: seed: expected an integer of 0 or more, got -1"},
    {"units: [{}]\nseed: [1]\n", "dir/s.yaml:2:7: seed: expected one value of up to 256 characters, got a list"},
    {"units: [{}]\nseed: \"1\\n2\"\n", "dir/s.yaml:2:7: seed: expected an integer of 0 or more, got \"1?2\""},
    {"units: [{}]\nsead: 1\n",
     "dir/s.yaml:2:1: sead: unknown key, nearest: seed; expected one of version, seed, start, bus, buses, "},
    {"seed: 1\nseed: 2\nunits: [{}]\n", "dir/s.yaml:2:1: seed: expected the key once, got it twice"},
    {"seed: 1\n", "dir/s.yaml:1:1: units: expected at least one unit, got none"},
    {"units: 5\n", "dir/s.yaml:1:8: units: expected a list of units"},
    {"units: [5]\n", "dir/s.yaml:1:9: units.a: expected a mapping `key: value`"},
    {"units: [{}]\nstart: yes\n", "dir/s.yaml:2:8: start: expected true or false, got \"yes\""},
    {"flight: {legs: [{park_s: 9}]}\nunits: [{}]\n",
     "dir/s.yaml:1:9: flight: expected site.latitude_deg, where it begins, got none"},
    {PLACE "flight: {}\n", "dir/s.yaml:3:9: flight.legs: expected a list of legs, got none"},
    {PLACE "flight: {legs: []}\n", "dir/s.yaml:3:9: flight.legs: expected a list of legs, got none"},
    {PLACE "flight: {legs: {park_s: 9}}\n", "dir/s.yaml:3:16: flight.legs: expected a list of legs, got "},
    {PLACE "flight:\n  legs:\n  - {park_s: 9}\n  - {turn: 9}\n",
     "dir/s.yaml:6:6: flight.legs[1].turn: unknown key, nearest: turn_deg (its unit is part of the name); expected one "
     "of"},
    {PLACE "flight:\n  legs:\n  - {bank_deg: 9}\n", "dir/s.yaml:5:5: flight.legs[0]: expected one of park_s, taxi_m, "
                                                    "stop_s, turn_deg, takeoff_mps, climb_m, descend_m, "
                                                    "fly_s, snake_s, land_mps, got none"},
    {PLACE "flight:\n  legs:\n  - {park_s: 9, stop_s: 1}\n",
     "dir/s.yaml:5:5: flight.legs[0]: expected one of park_s, taxi_m, stop_s, turn_deg, takeoff_mps, climb_m, "
     "descend_m, "
     "fly_s, snake_s, land_mps, got more"},
    {PLACE "flight:\n  legs:\n  - {park_s: 9, bank_deg: 5}\n",
     "dir/s.yaml:5:27: flight.legs[0]: expected no bank_deg beside park_s, got one"},
    {PLACE "flight:\n  legs:\n  - {park_s: 9}\n  - {turn_deg: 90, radius_m: 2}\n",
     "dir/s.yaml:6:30: flight.legs[1].radius_m: expected 5 to 5000, got 2"},
    {PLACE "flight:\n  legs:\n  - {park_s: 9}\n  - {turn_deg: 90}\n",
     "dir/s.yaml:6:16: flight.legs[1].turn_deg: expected a moving aircraft (a taxi_m before it), got one at rest"},
    {PLACE "flight:\n  legs:\n  - {taxi_m: 90}\n  - {turn_deg: 90}\n  - {stop_s: 9}\n  - {park_s: 5, roll_deg: 1}\n",
     "dir/s.yaml:8:5: flight.legs[3].roll_s: expected up to half of park_s (2.5), got 3"},
    {"units: [{on: flight}]\n", "dir/s.yaml:1:8: units: a: expected a section flight to mount it on, got none"},
    {"bus:\n  bitrate_hz: 2e6\n", "dir/s.yaml:2:15: bus.bitrate_hz: expected an integer of 0 or more, got 2e6"},
    {"bus:\n  bitrate_hz: 1000001\n", "dir/s.yaml:2:15: bus.bitrate_hz: expected 0 to 1000000, got 1000001"},
    {"bus: {bitrate_hz: 9999}\nunits: [{}]\n",
     "dir/s.yaml:1:19: bus.bitrate_hz: expected 10000 or more, or 0 (frames take no time), got 9999"},
    {"units:\n  - name: a\n    node: 0\n", "dir/s.yaml:3:11: units.a.node: expected 1 to 127, got 0"},
    {"units:\n  - {name: a}\n  - {name: a}\n",
     "dir/s.yaml:3:12: units.a.name: expected a name of its own, got \"a\", which another unit has"},
    {"units:\n  - {node: 5}\n  - {node: 5}\n",
     "dir/s.yaml:3:12: units.b.node: expected a node of its own, got 5, which unit a has"},
    {"units:\n  - {serial: 2}\n  - {}\n",
     "dir/s.yaml:3:5: units.b.serial: expected a number of its own, got 2, which unit a has"},
    {"units: [{name: \"a b\"}]\n", "dir/s.yaml:1:16: units.a b.name: expected letters, digits and _, got \"a b\""},
    {"units: [{board: psa3}]\n", "dir/s.yaml:1:17: units.a.board: expected psa2, "},
    {"units: [{board: []}]\n", "dir/s.yaml:1:17: units.a.board: expected psa2, "},
    {"units: [{adc_chain: exact, board: pmka}]\n",
     "dir/s.yaml:1:21: units.a.adc_chain: expected a key of a PMKA, got one of another board"},
    {"units: [{board: pmka, temp_adc_offset_v: 0}]\n",
     "dir/s.yaml:1:42: units.a.temp_adc_offset_v: expected a key of a PMKA"},
    {"units: [{board: pmka, frame_form: 0}]\n", "dir/s.yaml:1:35: units.a.frame_form: expected a key of a PMKA"},
    {"units: [{board: pmka, profile_set: {word_bits: 24}}]\n",
     "dir/s.yaml:1:37: units.a.profile_set.word_bits: unknown key; "},
    {"units: [{board: psd1, profile: pmka}]\n", "dir/s.yaml:1:32: units.a.profile: expected a profile of PSD-1 (board: "
                                                "psd1), got pmka, one of PMKA (board: pmka)"},
    {"units: [{profile: pmka}]\n", "dir/s.yaml:1:19: units.a.profile: expected a profile of PSA-2 (board: psa2), got "
                                   "pmka, one of PMKA (board: pmka)"},
    {"units:\n  - board: pik5\n    profile: pik6\n", "dir/s.yaml:3:14: units.a.profile: expected a profile of PIK-5 "
                                                     "(board: pik5), got pik6, one of PIK-6 (board: pik6)"},
    {"units: [{board: psa1, profile: w16}]\n", "dir/s.yaml:1:32: units.a.profile: expected a profile of PSA-1 (board: "
                                               "psa1), got w16, one of PSA-2 (board: psa2)"},
    {"units: [{profile: nope}]\n",
     "dir/s.yaml:1:19: units.a.profile: nope: expected a path or a name from proto/profiles"},
    {"units: [{profile: ./nope.yaml}]\n",
     "dir/s.yaml:1:19: units.a.profile: dir/./nope.yaml: expected a profile file, got no such file"},
    {"units:\n- profile_set:\n    word_bits: 20\n",
     "dir/s.yaml:3:5: units.a.profile_set: word_bits: expected 16, 24 or 32, got 20"},
    {"units:\n- profile_set: {lead_in_clk: 0}\n",
     "dir/s.yaml:2:16: units.a.profile_set: INT low"}, /* INT low would be 70 us */
    {"units:\n- profile_set: {word: [X, Y, Z]}\n",
     "dir/s.yaml:2:23: units.a.profile_set.word: expected 4 elements, got 3"},
    {"units:\n- profile_set:\n    wrod: [X, Y, Z, T]\n",
     "dir/s.yaml:3:5: units.a.profile_set.wrod: unknown key, "
     "nearest: word; expected one of name, fclk_hz, temp_clkin_hz, "},
    {"units: [{profile_set: 5}]\n", "dir/s.yaml:1:23: units.a.profile_set: expected a mapping `key: value`"},
    {"units: [{profile_set: {word_bits: 24, word_bits: 32}}]\n",
     "dir/s.yaml:1:39: units.a.profile_set.word_bits: expected the key once, got it twice"},
    {"units: [{profile_set: {word_bits: 32}, nod: 5}]\n", "dir/s.yaml:1:40: units.a.nod: unknown key, nearest: node; "},
    {"units: [{temp_degc: [1, 2]}]\n", "dir/s.yaml:1:21: units.a.temp_degc: expected one value or a list of 4 numbers"},
    {"units: [{temp_degc: 200}]\n", "dir/s.yaml:1:21: units.a.temp_degc: expected -60 to 125, got 200"},
    {"units:\n  - axes:\n      x:\n        sensor: gyro\n",
     "dir/s.yaml:4:17: units.a.axes.x.sensor: expected none, mems, quartz, recorded or mems_gyro"},
    {"units:\n  - axes: {x: {sensor: quartz}}\n",
     "dir/s.yaml:2:11: units.a.axes: x: expected afe: {input: current} for a quartz sensor"},
    {"units:\n  - axes:\n      x:\n        u0_v: 2,5\n",
     "dir/s.yaml:4:15: units.a.axes.x.u0_v: expected a number, got 2,5"},
    {"units:\n  - axes:\n      x:\n        u0_v: nan\n",
     "dir/s.yaml:4:15: units.a.axes.x.u0_v: expected a number, got \"nan\""},
    {"units: [{axes: {w: {}}}]\n", "dir/s.yaml:1:17: units.a.axes.w: unknown key; expected one of x, y, z"},
    {"units: [{adc_chain: sinc}]\n", "dir/s.yaml:1:21: units.a.adc_chain: expected exact, modulator or direct"},
    {"units: [{axes: {x: {afe: {input: tube}}}}]\n",
     "dir/s.yaml:1:34: units.a.axes.x.afe.input: expected current or voltage"},
    {"units: [{count: 1001}]\n", "dir/s.yaml:1:17: units.u%02u.count: expected 1 to 1000, got 1001"},
    {"units: [{count: 127, node: 2}]\n", "dir/s.yaml:1:28: units.u%02u.node: expected 1 to 127, got 128"},
    {"buses: [{name: a}, {name: b}, {name: c}, {name: d}, {name: e}, {name: f}, {name: g}, {name: h}, {name: i}]\n",
     "dir/s.yaml:1:97: buses: expected up to 8 buses, got more"},
    {"units: [{}\n", "dir/s.yaml:2:1: not YAML: "},
    {"a: b: c\n", "dir/s.yaml:1:5: not YAML: "},
    {"seed: \t\n\t- x", "dir/s.yaml:"},
    {"seed: \"1\\0\"\nunits: [{}]\n", "dir/s.yaml:1:7: seed: expected one value"}, /* a NUL would hide what follows */
    {"units: [{}]\nhead: {turn: 2}\n",
     "dir/s.yaml:2:8: head.turn: unknown key, nearest: turn_s (its unit is part of the name); expected one of "},
    {"units: [{adc_chain: modulater}]\n",
     "dir/s.yaml:1:21: units.a.adc_chain: expected exact, modulator or direct (nearest: modulator)"},
    {"units: [{count: 2, name: u}]\n",
     "dir/s.yaml:1:26: units.u.name: expected a place for the number, as in u%02u, got \"u\""},
    {"units: [{count: 2, name: u%d}]\n",
     "dir/s.yaml:1:26: units.u%d.name: expected a place for the number, as in u%02u, got \"u%d\""},
    {"units: [{count: 2, name: \"%u%u\"}]\n", "dir/s.yaml:1:26: units.%u%u.name: expected a place for the number"},
    {"units: [{count: 10, node: 120}]\n", "dir/s.yaml:1:27: units.u%02u.node: expected 1 to 127, got 128"},
    {"units: [{count: 2, serial: 4294967295}]\n",
     "dir/s.yaml:1:28: units.u%02u.serial: expected up to 4294967295, got more by count"},
    {"units: [{bus: can1}]\n", "dir/s.yaml:1:15: units.a.bus: expected one of can0 (nearest: can0), got \"can1\""},
    {"bus: {}\nbuses: [{}]\nunits: [{}]\n", "dir/s.yaml:2:8: buses: expected bus or buses, got both"},
    {"buses: [{}, {name: can0}]\nunits: [{}]\n",
     "dir/s.yaml:1:13: buses.can1.name: expected a name of its own, got \"can0\", which another bus has"},
    {"buses: []\nunits: [{}]\n", "dir/s.yaml:1:8: buses: expected a list of buses"},
    {"site: {longitude_deg: 30}\nunits: [{}]\n",
     "dir/s.yaml:1:23: site: expected latitude_deg beside longitude_deg, got none"},
    {"site: {g_mps2: 0}\nunits: [{}]\n",
     "dir/s.yaml:1:16: site.g_mps2: expected 0.001 to 20, got 0"}, /* per g of what? */
    {"site: {latitude_deg: 91}\nunits: [{}]\n", "dir/s.yaml:1:22: site.latitude_deg: expected -90 to 90, got 91"},
    {"table: {axes: 4}\nunits: [{}]\n", "dir/s.yaml:1:15: table.axes: expected 1 to 3, got 4"},
    {"table: {axes: [{along: w}]}\nunits: [{}]\n", "dir/s.yaml:1:24: table.axes[0].along: expected x, y or z"},
    {"table: {axes: [{angle_min_deg: 5}]}\nunits: [{}]\n",
     "dir/s.yaml:1:16: table.axes: expected angle_min_deg below angle_max_deg 0, got 5"},
    {"units: [{on: table}]\n", "dir/s.yaml:1:8: units: a: expected a section table to mount it on, got none"},
    {"units: [{lever_arm_m: 1}]\n", "dir/s.yaml:1:23: units.a.lever_arm_m: expected a list of 3 numbers"},
    {"chamber: {start_degc: 90}\nunits: [{}]\n",
     "dir/s.yaml:1:23: chamber.start_degc: expected -60 to 85 (min_degc to max_degc), got 90"},
    {"supply: {volt_v: 16}\nunits: [{}]\n", "dir/s.yaml:1:18: supply.volt_v: expected up to 15 (volt_max_v), got 16"},
    {"spread: {u0_v: -1}\nunits: [{}]\n", "dir/s.yaml:1:16: spread.u0_v: expected 0 to 20, got -1"},
    {"spread: {afe: {input: current}}\nunits: [{}]\n", "dir/s.yaml:1:16: spread.afe.input: unknown key"},
    {"spread: {quartz: [1]}\nunits: [{}]\n",
     "dir/s.yaml:1:18: spread.quartz: expected a name of proto/batches, a path, or a mapping"},
    {"spread: {quartz: nope}\nunits: [{}]\n",
     "dir/s.yaml:1:18: spread.quartz: nope: expected a path or a name from proto/batches: serial"},
    {"spread: {quartz: {share_a: 0.7}}\nunits: [{}]\n",
     "dir/s.yaml:1:18: spread.quartz.share_b: expected up to 1 with share_a, got 1.1"},
    {"spread: {quartz: {curve_max_ug: 100}}\nunits: [{}]\n",
     "dir/s.yaml:1:33: spread.quartz.curve_max_ug: expected curve_min_ug = 120 or more, got 100"},
    {"spread: {quartz: {curve_min_ug: 1, curve_max_ug: 2}}\nunits: [{}]\n",
     "dir/s.yaml:1:18: spread.quartz.ratio_max: expected curves and slopes that give ratios of 3 to 16, got none in "
     "group"},
    {"units: [{axes: {x: {quartz: {pendulum: {pickoff_v_per_rad: 1, amplifier_a_per_v: 1e-7, hinge_n_m_per_rad: "
     "0}}}}}]\n",
     "dir/s.yaml:1:40: units.a.axes.x.quartz.pendulum: expected parts that give pendulous_ug_per_g2 up to 10000, got "
     "1.281e+10"},
    {"spread: {quartz: {share_a: 0.98, share_b: 0, rest_slope_min_ug_per_k: 1000, rest_slope_max_ug_per_k: 2000}}\n",
     "dir/s.yaml:1:18: spread.quartz.ratio_max: expected curves and slopes that give ratios of 3 to 16, got none in "
     "group rest"},
    {"units: [{axes: {x: {quartz: {pendulum: {mass_kg: 0}}}}}]\n",
     "dir/s.yaml:1:50: units.a.axes.x.quartz.pendulum.mass_kg: expected 1e-06 to 1, got 0"},
    {"timeline: [{at_s: 1}]\nunits: [{}]\n", "dir/s.yaml:1:12: timeline[0]: expected cmd, a command, got none"},
    {"timeline: [{at_s: -1, cmd: x}]\nunits: [{}]\n",
     "dir/s.yaml:1:19: timeline[0].at_s: expected 0 to 1000000, got -1"},
    {"timeline: [{cmd: x, args: {a: 1, a: 2}}]\nunits: [{}]\n",
     "dir/s.yaml:1:34: timeline[0].a: expected the key once, got it twice"},
    {"timeline: [{cmd: x, args: {a: [[[[[1]]]]]}}]\nunits: [{}]\n",
     "dir/s.yaml:1:35: timeline[0].args: expected fewer or less deeply nested"},
    {"faults: [1]\nunits: [{}]\n", "dir/s.yaml:1:10: faults: expected a mapping with the arguments of fault.add"},
    {"seed: 1\n---\nseed: 2\n", "dir/s.yaml:3:1: expected one document"},
    {"%YAML 1.2\n---\nunits: [{}]\n", "dir/s.yaml:1:1: expected no directive"},
    {"? KD:\t? :",
     "dir/s.yaml:1:1: expected `key: value`, got an explicit key"}, /* libfyaml frees the same memory twice */
    {"\xEF\xBB\xBF? KD:\t? :", "dir/s.yaml:1:1: expected `key: value`"},
    {"\xEF\xBB\xBF%%%%\xD5%", "dir/s.yaml:1:1: expected no directive"}, /* keeps libfyaml busy forever */
    {"a:\n\xEF\xBB\xBF%%", "dir/s.yaml:2:1: expected no byte order mark"},
    {"units: [{}]\n&a ?\tb:\t? :", "dir/s.yaml:2:4: expected `key: value`"},
    {"units: [{\"a\"? b:\t? :", "dir/s.yaml:1:13: expected `key: value`"},
    {"seed: ?", "dir/s.yaml:1:7: expected `key: value`"},
    {"seed: *x\n", "dir/s.yaml:1:7: *x: expected an anchor before this"},
    {"a: &x [*x]\n", "dir/s.yaml:1:8: *x: expected an anchor before this"},
};

static void what_is_wrong_is_told_with_file_line_key_and_remedy(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT(bad); i++) {
        if (parse(bad[i].text)) fail_msg("accepted:\n%s", bad[i].text);
        if (strncmp(why, bad[i].why, strlen(bad[i].why)) != 0)
            fail_msg("%s\n  gave %s\n  want %s", bad[i].text, why, bad[i].why);
        assert_null(strchr(why, '\n'));
    }
}

static void a_question_in_words_is_no_key(void **state)
{
    (void)state;
    if (!parse("\xEF\xBB\xBF# Why? Because. \xD0\xB4\xD0\xB0? (yes)? 5? no?? so\nseed: 7 # what?\nunits: [{}]\n"))
        fail_msg("%s", why);
    assert_int_equal(s.seed, 7);
}

static void the_order_of_keys_means_nothing(void **state)
{
    static const char *const orders[] = {
        "units: [{board: psa2, profile: w24, profile_set: {lead_in_clk: 50}, node: 9}]\n",
        "units: [{profile_set: {lead_in_clk: 50}, node: 9, profile: w24, board: psa2}]\n",
    };
    (void)state;
    for (unsigned i = 0; i < COUNT(orders); i++) {
        if (!parse(orders[i])) fail_msg("%s", why);
        assert_int_equal(s.units[0].profile.psa2.word_bits, 24);
        assert_int_equal(s.units[0].profile.psa2.lead_in_clk, 50);
        assert_int_equal(s.units[0].cfg.node, 9);
    }
    if (!parse("units: [{profile_set: {lead_in_clk: 50}, board: psa1}]\n")) fail_msg("%s", why);
    assert_string_equal(s.units[0].profile.psa2.name, "psa1");
    assert_int_equal(s.units[0].profile.psa2.lead_in_clk, 50);
}

/* Nodes of the boards' own, the next that is free where one is taken; analog chains of the boards' own. */
static void each_board_brings_its_defaults(void **state)
{
    static const unsigned node[] = {5, 6, 7, 8, 9, 40};
    (void)state;
    if (!parse("units: [{}, {}, {board: pmka}, {board: psa1}, {board: pmka}, {board: pmka, node: 40}]\n"))
        fail_msg("%s", why);
    for (unsigned i = 0; i < COUNT(node); i++) assert_int_equal(s.units[i].cfg.node, node[i]);
    assert_string_equal(s.units[2].cfg.type->name, "pmka");
    assert_string_equal(s.units[3].cfg.type->name, "psa2");
    const struct afe_cfg pmka = s.units[2].cfg.board.afe[0];
    assert_true(pmka.divider_ratio == 1 && s.units[3].cfg.board.afe[0].divider_ratio == 8);
    if (!parse("units: [{axes: {x: {afe: {load_ohm: 999}}}, node: 9, board: pmka}]\n")) fail_msg("%s", why);
    assert_true(s.units[0].cfg.board.afe[0].load_ohm == 999);
    assert_true(s.units[0].cfg.board.afe[0].divider_ratio == 1);
    assert_int_equal(s.units[0].cfg.node, 9);
    if (!parse("buses: [{}, {}]\nunits: [{}, {bus: can1}, {bus: can1, board: psa1}]\n")) fail_msg("%s", why);
    assert_int_equal(s.units[1].cfg.node, 6); /* as ever: the second of its type */
    assert_int_equal(s.units[2].cfg.node, 7);
}

/* By name or by its keys: of a unit that draws, its quartz sensors alone; what the batch does not say is the scenario's. */
static void a_batch_gives_each_quartz_sensor_its_own_figures(void **state)
{
    (void)state;
    static const char *const texts[] = {"serial", "{share_a: 1, share_b: 0}"};
    for (size_t i = 0; i < COUNT(texts); i++) {
        char text[512];
        snprintf(
            text, sizeof text,
            "seed: 5\nspread: {quartz: %s}\nunits:\n"
            "- {spread: true, axes: {x: &q {sensor: quartz, afe: {input: current}, quartz: {play_k: 0.7}}, y: *q}}\n"
            "- {axes: {x: *q}}\n",
            texts[i]);
        if (!parse(text)) fail_msg("%s", why);
        scenario_bind(&s);
        const struct quartz_g *x = &s.units[0].cfg.axis[0].quartz, *y = &s.units[0].cfg.axis[1].quartz;
        assert_true(x->glue_ug != 0.0 && y->glue_ug != 0.0 && x->glue_ug != y->glue_ug);
        assert_true(x->play_k == 0.7 && x->start_ug == 12.6);
        assert_true(quartz_ratio(x) >= 3.0 && quartz_ratio(x) <= 16.0);
        assert_true(i == 0 || (x->curve_ug > 0.0 && y->curve_ug > 0.0));
        assert_true(s.units[0].cfg.axis[2].quartz.glue_ug == 0.0); /* no quartz there */
        assert_true(s.units[1].cfg.axis[0].quartz.glue_ug == 0.0); /* it does not draw */
    }
}

/* The hinge of a pendulum that is given makes the bias of the position that is drawn: at 30 degC the sum is the batch's. */
static void a_batch_reckons_with_the_pendulum(void **state)
{
    (void)state;
    if (!parse("spread: {quartz: {position_urad: 20}}\nunits: [{spread: true, axes: {x: {sensor: quartz, "
               "afe: {input: current}, quartz: {pendulum: {hinge_n_m_per_rad: 6e-3}}}}}]\n"))
        fail_msg("%s", why);
    scenario_bind(&s);
    const struct quartz_g *x = &s.units[0].cfg.axis[0].quartz;
    const double zero_ug = fabs(quartz_settled_ug(x, 30.0));
    assert_true(x->hinge_ug_per_urad > 95.0 && x->hinge_ug_per_urad < 96.0);
    assert_true(zero_ug > 39.999 && zero_ug < 150.001);
}

static void cut_off_anywhere_a_scenario_is_refused_or_sound(void **state)
{
    (void)state;
    static const char text[] =
        "seed: 3\nhead: {turn_s: 2}\nunits:\n  - {name: q, axes: {x: {sensor: mems, u0_v: 2.5}}}\n";
    for (size_t n = 0; n < sizeof text - 1; n++) {
        why[0] = '\0';
        const bool ok = scenario_parse("cut", text, n, &s, why, sizeof why);
        assert_true(ok ? s.unit_count == 1 : strlen(why) > 0);
    }
}

/* The files that are shipped; the tests run in the root of the repository. */
static void the_shipped_scenarios_and_profiles_load(void **state)
{
    (void)state;
    static const char *const scenarios[] = {"converters", "calibrate",      "quiet",        "stream",
                                            "fast",       "multi",          "brownout",     "chamber_sweep",
                                            "faults",     "fleet64",        "fleet1000",    "six_positions",
                                            "table_rate", "quartz_chamber", "quartz_run_in"};
    static const char *const profiles[] = {"article", "intent", "ungated", "w24", "w16",  "lab32",
                                           "psa1",    "psd1",   "pmka",    "pik", "pik5", "pik6"};
    if (access("proto/scenarios", R_OK) != 0) skip();
    for (size_t i = 0; i < COUNT(scenarios); i++) {
        if (!scenario_load(scenarios[i], &s, why, sizeof why)) fail_msg("%s", why);
    }
    for (size_t i = 0; i < COUNT(profiles); i++) {
        char path[FIND_PATH_MAX];
        const struct board_name *board;
        union board_profile_store p;
        assert_true(find_proto("profiles", profiles[i], NULL, path, why, sizeof why));
        if (!profile_yaml_load(path, &board, &p, why, sizeof why)) fail_msg("%s", why);
        assert_string_equal(board_profile_name(board->type, &p), profiles[i]);
    }
    assert_true(scenario_load("fast", &s, why, sizeof why));
    assert_int_equal(psa2_profile_period_ns(&s.units[0].profile.psa2), 250000);
}

/* Eight buses with as many as may be, and one more. */
static void more_than_1000_units_are_refused(void **state)
{
    (void)state;
    char text[2048];
    size_t len = (size_t)snprintf(text, sizeof text, "buses: [");
    for (int i = 0; i < 8; i++) len += (size_t)snprintf(text + len, sizeof text - len, "{name: b%d},", i);
    len += (size_t)snprintf(text + len, sizeof text - len, "]\nunits:\n");
    for (int i = 0; i < 8; i++)
        len +=
            (size_t)snprintf(text + len, sizeof text - len,
                             "- {name: %c%%u, count: 125, bus: b%d, node: 1, serial: %d}\n", 'a' + i, i, 1 + 125 * i);
    if (!scenario_parse("many.yaml", text, len, &s, why, sizeof why)) fail_msg("%s", why);
    assert_int_equal(s.unit_count, 1000);
    assert_string_equal(s.units[999].name, "h125");
    assert_int_equal(s.units[999].cfg.node, 125);
    assert_int_equal(s.units[999].cfg.board.serial, 1000);
    assert_int_equal(s.units[999].bus, 7);
    len += (size_t)snprintf(text + len, sizeof text - len, "- {name: i, bus: b0, node: 126, serial: 1001}\n");
    assert_false(scenario_parse("many.yaml", text, len, &s, why, sizeof why));
    assert_string_equal(why, "many.yaml:11:3: units.i.count: expected up to 1000 units in all, got more");
}

/* Those of another bus are in no one's way: who has no node there finds a free one, however many there are. */
static void a_node_is_found_beyond_a_full_bus(void **state)
{
    (void)state;
    static const char text[] = "buses: [{name: b0}, {name: b1}, {name: b2}]\n"
                               "units:\n"
                               "- {name: a%u, count: 127, bus: b0, node: 1}\n"
                               "- {name: b%u, count: 127, bus: b1, node: 1, serial: 128}\n"
                               "- {name: c, bus: b2, serial: 255}\n"
                               "- {name: d, bus: b2, serial: 256}\n";
    if (!scenario_parse("full.yaml", text, sizeof text - 1, &s, why, sizeof why)) fail_msg("%s", why);
    assert_int_equal(s.units[254].cfg.node, 5);
    assert_int_equal(s.units[255].cfg.node, 6);
}

static void a_missing_scenario_is_told_in_one_line(void **state)
{
    (void)state;
    assert_false(scenario_load("nope", &s, why, sizeof why));
    assert_string_equal(
        why, "nope: expected a path or a name from proto/scenarios: "
             "batch, brownout, calibrate, chamber_sweep, climate, converters, converters_chamber, fast, faults, "
             "fleet1000, fleet64, flight, gyrocompass, gyrocompass_ideal, heading_modes, koi_flight, mems_gyro, "
             "multi, quartz_chamber, quartz_run_in, quiet, realistic, receiver, sins_coarse, sins_secondary, "
             "sins_table, six_positions, stream, table_rate");
    assert_false(scenario_load("./nope.yaml", &s, why, sizeof why));
    assert_string_equal(why, "./nope.yaml: expected a scenario file, got no such file");
}

static void a_dump_has_every_bit_of_a_number_and_every_unit_of_a_count(void **state)
{
    (void)state;
    static struct scenario again;
    if (!parse("seed: 18446744073709551615\nsite: {g_mps2: 9.8066500000000012}\nbuses: [{}, {name: b}]\n"
               "units: [&u {count: 3, bus: b, lever_arm_m: [0.1, -0.30000000000000004, 1e-300]}]\n"))
        fail_msg("%s", why);
    cJSON *j = scenario_dump(&s);
    char *text = cJSON_Print(j);
    if (!scenario_parse("dump", text, strlen(text), &again, why, sizeof why)) fail_msg("%s", why);
    assert_true(again.seed == UINT64_MAX && again.site.g_mps2 == s.site.g_mps2);
    assert_int_equal(again.unit_count, 3);
    assert_string_equal(again.units[2].name, "u03");
    assert_int_equal(again.units[2].bus, 1);
    assert_int_equal(again.units[2].cfg.node, 7);
    for (unsigned k = 0; k < 3; k++)
        assert_true(again.units[1].cfg.mounting.lever_m[k] == s.units[0].cfg.mounting.lever_m[k]);
    cJSON_free(text);
    cJSON_Delete(j);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scenario_without_more_than_a_unit_has_sound_defaults),
        cmocka_unit_test(every_key_reaches_its_field),
        cmocka_unit_test(what_is_wrong_is_told_with_file_line_key_and_remedy),
        cmocka_unit_test(a_question_in_words_is_no_key),
        cmocka_unit_test(the_order_of_keys_means_nothing),
        cmocka_unit_test(each_board_brings_its_defaults),
        cmocka_unit_test(a_batch_gives_each_quartz_sensor_its_own_figures),
        cmocka_unit_test(a_batch_reckons_with_the_pendulum),
        cmocka_unit_test(cut_off_anywhere_a_scenario_is_refused_or_sound),
        cmocka_unit_test(the_shipped_scenarios_and_profiles_load),
        cmocka_unit_test(more_than_1000_units_are_refused),
        cmocka_unit_test(a_node_is_found_beyond_a_full_bus),
        cmocka_unit_test(a_missing_scenario_is_told_in_one_line),
        cmocka_unit_test(a_dump_has_every_bit_of_a_number_and_every_unit_of_a_count),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
