/* Every type of board is complete, and lives on a unit through nothing but its table. */
#include "lone_unit.h"
#include "rig.h"

#include "canopen/co_node.h"
#include "scenario/profile.h"
#include "trace/sampler.h"
#include "unit/unit.h"

#include <stdlib.h>
#include <string.h>

/* ---- the tables */

static void every_pointer_is_there(const struct board_type *t)
{
    assert_true(t->name && *t->name && t->title && *t->title);
    assert_true(t->size > 0 && t->size <= sizeof(union board_store));
    assert_true(t->fields && t->fields->size > 0 && t->fields->size <= sizeof(union board_profile_store));
    assert_true(t->fields->count && t->profile_name && t->profile_check && t->about);
    assert_true(t->period_ns && t->lines && t->line_count && t->port_lines && t->frame_line < t->line_count);
    assert_true(t->events && t->event_count && t->parts && t->part_count && t->node);
    assert_true(t->init && t->power_up && t->power_down && t->reset && t->ready && t->sample_until);
    assert_true(t->controller_faults && t->digest);
    const struct board_can *c = t->can;
    assert_true(c && c->init && c->power_up && c->power_down && c->node);
    assert_true(c->size > 0 && c->size <= sizeof(union board_can_store));
    if (t->bus) assert_true(t->bus->submit && t->bus->registers && t->bus->addresses > 0 && t->bus->addresses <= 256);
}

static void every_part_says_what_it_can(const struct board_type *t)
{
    assert_string_equal(t->parts[0].label, "board");
    for (unsigned i = 0; i < t->part_count; i++) {
        const struct board_part *p = &t->parts[i];
        assert_true(p->label && (p->counters || !p->counter_count));
        for (unsigned k = 0; k < p->counter_count; k++)
            assert_true(p->counters[k].name && p->offset + p->counters[k].offset + sizeof(uint32_t) <= t->size);
        assert_true(!p->faults == !p->fault);
        assert_true(!p->registers == !p->flip);
        const bool all = p->faults == (BOARD_FAULT_DRDY | BOARD_FAULT_DOUT | BOARD_FAULT_SYNC | BOARD_FAULT_CLOCK);
        if (p->faults && !all) assert_non_null(p->unless);
        for (unsigned k = 0; k < i; k++) assert_string_not_equal(p->label, t->parts[k].label);
    }
}

static void every_key_is_told(const struct board_type *t)
{
    assert_string_equal(t->fields->row[0].key, "name");
    for (unsigned i = 0; i < t->fields->count; i++) {
        const struct field *f = &t->fields->row[i];
        assert_true(f->what && *f->what && f->offset < t->fields->size);
        assert_string_not_equal(f->key, "board"); /* a profile's file says its type by it */
        if (f->type == FIELD_CHOICE) assert_non_null(f->choices);
        if (f->type == FIELD_LIST) assert_true(f->parse && f->text && f->like && f->standard_of);
        for (unsigned k = 0; k < i; k++) assert_string_not_equal(f->key, t->fields->row[k].key);
    }
}

static void each_type_is_complete(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        every_pointer_is_there(*t);
        every_part_says_what_it_can(*t);
        every_key_is_told(*t);
        assert_ptr_equal(board_name_find((*t)->name)->type, *t);
        for (unsigned i = 0; i < (*t)->event_count; i++) assert_non_null((*t)->events[i]);
        for (const struct board_type *const *other = board_types; other < t; other++)
            assert_int_not_equal((*t)->node, (*other)->node);
    }
    assert_non_null(board_name_find("psa1")->profile); /* a name, not a type */
}

static void names_lead_to_types_and_their_profiles(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        const struct board_name *own = board_name_find((*t)->name);
        assert_non_null(own);
        assert_ptr_equal(own->type, *t);
        assert_null(own->profile);
        assert_string_equal(board_name_title(own), (*t)->title);
    }
    for (const struct board_name *n = board_names; n->name; n++) assert_ptr_equal(board_name_find(n->name), n);
    assert_string_equal(board_name_find("psa1")->profile, "psa1");
    assert_string_equal(board_name_title(board_name_find("psa1")), "PSA-1");
    assert_null(board_name_find("psa3"));
}

/* ---- profiles */

static char *dump_of(const struct board_type *t, const void *profile)
{
    cJSON *j = cJSON_CreateObject();
    yaml_dump(t->fields, profile, j);
    char *text = cJSON_Print(j);
    cJSON_Delete(j);
    assert_non_null(text);
    return text;
}

static void the_default_profile_is_sound_and_the_file_that_it_names(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        union board_profile_store def, file;
        char why[512], path[256], about[256] = "";
        const struct board_type *type = *t;
        const struct board_name *board;
        memset(&def, 0, sizeof def);
        fields_default(type->fields, &def);
        if (!type->profile_check(&def, why, sizeof why)) fail_msg("%s: %s", type->name, why);
        assert_true(type->period_ns(&def) > 0);
        type->about(&def, about, sizeof about);
        assert_true(*about && !strchr(about, '\n'));
        assert_string_equal(board_profile_name(type, &def), type->profile_name);
        snprintf(path, sizeof path, "proto/profiles/%s.yaml", type->profile_name);
        if (!profile_yaml_load(path, &board, &file, why, sizeof why)) fail_msg("%s", why);
        assert_ptr_equal(board->type, type);
        char *one = dump_of(type, &def), *two = dump_of(type, &file);
        assert_string_equal(one, two);
        free(one);
        free(two);
    }
}

static void a_dump_of_a_profile_is_a_profile_with_the_same_dump(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        union board_profile_store def, again;
        struct yaml_file f;
        char why[512];
        memset(&def, 0, sizeof def);
        memset(&again, 0, sizeof again);
        fields_default((*t)->fields, &def);
        fields_default((*t)->fields, &again);
        char *one = dump_of(*t, &def);
        if (!yaml_file_parse(&f, "dump", one, strlen(one), why, sizeof why)) fail_msg("%s", why);
        if (!yaml_load_by(&f, f.root, "", (*t)->fields, &again, profile_yaml_value, NULL)) fail_msg("%s", why);
        yaml_file_close(&f);
        char *two = dump_of(*t, &again);
        assert_string_equal(one, two);
        free(one);
        free(two);
    }
}

/* A type's own name takes the profiles of all its names, another name its own alone. */
static void a_name_takes_its_own_profiles(void **state)
{
    (void)state;
    for (const struct board_name *of = board_names; of->name; of++) {
        const struct board_name *board;
        union board_profile_store p;
        char why[512], path[256];
        snprintf(path, sizeof path, "proto/profiles/%s.yaml", of->profile ? of->profile : of->type->profile_name);
        if (!profile_yaml_load(path, &board, &p, why, sizeof why)) fail_msg("%s", why);
        assert_ptr_equal(board, of);
        for (const struct board_name *n = board_names; n->name; n++)
            assert_int_equal(board_name_takes(n, of),
                             n == of || (n->type == of->type && n == board_name_find(n->type->name)));
    }
}

/* ---- life */

static struct world {
    struct sched s;
    struct lab lab;
    struct can_bus bus;
    struct can_node host; /* acknowledges */
    struct unit u;
    struct unit_observer ear;
    unsigned events;
    struct sampler sampler;
} w;

static void on_event(void *ctx, unsigned event, int64_t t_ns)
{
    (void)ctx;
    assert_true(event < w.u.type->event_count);
    assert_true(t_ns <= w.s.now_ns);
    w.events++;
}

static void live(const struct board_type *t, int64_t until_ns)
{
    const struct lab_cfg lab = lab_default();
    const struct can_bus_cfg bus = {.bitrate_hz = 1000000};
    const struct board_can_cfg can = {.name = "a", .node_id = t->node};
    struct unit_cfg cfg = unit_default("a");
    memset(&w, 0, sizeof w);
    sched_init(&w.s);
    lab_init(&w.lab, &lab, 1);
    can_bus_init(&w.bus, &bus, &w.s);
    w.host.name = "host";
    can_attach(&w.bus, &w.host);
    unit_cfg_type(&cfg, t);
    assert_int_equal(cfg.node, t->node);
    unit_init(&w.u, &cfg, &w.lab, &w.s);
    assert_string_equal(w.u.profile, t->profile_name);
    assert_null(unit_node(&w.u));
    unit_connect(&w.u, &can, &w.bus, &w.s);
    assert_non_null(unit_node(&w.u));
    w.ear.fn = on_event;
    unit_subscribe(&w.u, &w.ear);
    unit_power_up(&w.u, 0);
    sched_run_until(&w.s, until_ns);
    trace_advance(unit_trace(&w.u), w.s.now_ns - TRACE_LAG_NS);
}

static void digest(char hex[SHA256_HEX])
{
    struct sha256 s;
    sha256_init(&s);
    w.u.type->digest(w.u.board, &s);
    sha256_hex(&s, hex);
}

#define KEYS 18u /* chains, white and slow noise of MEMS, noise and scatter of quartz, and a source of the board's */

static void noise_keys(const struct board_type *t, uint32_t serial, uint64_t key[KEYS])
{
    memset(&w, 0, sizeof w);
    lone_unit(&w.u, &w.lab, &w.s, t, serial);
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        static const char *const source[] = {"adc.x", "adc.y", "adc.z"};
        key[i] = w.u.board->afe[i].noise.key;
        key[3 + i] = w.u.mems[i].noise.key;
        key[6 + i] = w.u.mems[i].slow.draws.key;
        key[9 + i] = w.u.quartz[i].noise.key;
        key[12 + i] = board_draws(w.u.board, source[i]).key;
        key[15 + i] = w.u.quartz[i].scatter.key;
    }
}

/* Units that differ in nothing but their serial number, and their axes. */
static void no_two_sources_share_their_noise(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        uint64_t key[3 * KEYS];
        for (unsigned i = 0; i < 3; i++) noise_keys(*t, i + 1, key + i * KEYS);
        for (unsigned i = 0; i < 3 * KEYS; i++)
            for (unsigned k = 0; k < i; k++)
                if (key[i] == key[k]) fail_msg("%s: sources %u and %u", (*t)->name, k, i);
    }
}

static void the_lines_are_those_of_the_table(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        live(*t, 0);
        const struct trace *trace = unit_trace(&w.u);
        const unsigned lines = (*t)->line_count;
        assert_int_equal(trace->count, lines + 2 * (*t)->pair_count);
        for (unsigned i = 0; i < lines; i++) assert_string_equal(trace->name[i], (*t)->lines[i].name);
        for (unsigned i = 0; i < (*t)->pair_count; i++) {
            assert_string_equal(trace->name[lines + 2 * i], (*t)->pairs[i].a);
            assert_string_equal(trace->name[lines + 2 * i + 1], (*t)->pairs[i].b);
            assert_true(line_has_pair(&w.u.board->line, (*t)->pairs[i].line));
        }
        const struct clk clock = {.hz = SAMPLER_HZ, .div = 1};
        static uint8_t ring[SAMPLER_RING];
        const struct sampler_cfg cfg = sampler_line_port(&clock, (*t)->port_lines, ring);
        assert_true(sampler_start(&w.sampler, unit_trace(&w.u), &cfg));
        sampler_stop(&w.sampler);
        assert_int_equal((*t)->pairs != NULL, (*t)->pair_port_lines != NULL);
        if ((*t)->pairs) {
            const struct sampler_cfg wires = sampler_line_port(&clock, (*t)->pair_port_lines, ring);
            assert_true(sampler_start(&w.sampler, unit_trace(&w.u), &wires));
            sampler_stop(&w.sampler);
        }
        assert_ptr_equal(w.u.board->line.trace, trace);
    }
}

static void each_comes_up_tells_of_it_and_goes_down(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        live(*t, NS_PER_S);
        assert_true((*t)->ready(w.u.board));
        assert_true(w.events > 0);
        assert_true(w.bus.frames > 0); /* at least its boot-up message */
        (*t)->reset(w.u.board, w.s.now_ns);
        assert_false((*t)->ready(w.u.board));
        sched_run_until(&w.s, 2 * NS_PER_S);
        assert_true((*t)->ready(w.u.board));
        unit_power_down(&w.u, w.s.now_ns);
        assert_false((*t)->ready(w.u.board));
        unit_unsubscribe(&w.u, &w.ear);
        w.events = 0;
        unit_power_up(&w.u, w.s.now_ns);
        sched_run_until(&w.s, 3 * NS_PER_S);
        assert_true((*t)->ready(w.u.board));
        assert_int_equal(w.events, 0);
    }
}

static void the_digest_tells_states_apart_and_nothing_else(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        char one[SHA256_HEX], same[SHA256_HEX], later[SHA256_HEX];
        live(*t, NS_PER_S);
        digest(one);
        digest(same);
        assert_string_equal(one, same); /* looking changes nothing */
        sched_run_until(&w.s, NS_PER_S + 20000000);
        digest(later);
        assert_string_not_equal(one, later);
        live(*t, NS_PER_S);
        digest(same);
        assert_string_equal(one, same);
    }
}

static void count_truth(void *ctx, const char *name, double value)
{
    assert_true(name && *name && value == value);
    ++*(unsigned *)ctx;
}

static void truth_and_faults_may_be_asked_at_any_time(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        live(*t, NS_PER_S);
        unsigned told = 0;
        if ((*t)->truth) (*t)->truth(w.u.board, count_truth, &told);
        assert_true(!(*t)->truth || told > 0);
        for (const struct board_controller_fault *f = (*t)->controller_faults; f->kind; f++) {
            board_set_faults(w.u.board, board_fault_bit(*t, f->kind));
            assert_int_equal(w.u.board->faults, f->bit);
            sched_run_until(&w.s, w.s.now_ns + 50000000);
        }
        board_set_faults(w.u.board, board_fault_bit(*t, "controller.none"));
        assert_int_equal(w.u.board->faults, 0);
        sched_run_until(&w.s, w.s.now_ns + 50000000);
        for (unsigned axis = 0; (*t)->analog && axis < BOARD_AXES; axis++)
            assert_true(w.u.board->afe[axis].cfg.load_ohm > 0.0);
        unit_sample_until(&w.u, w.s.now_ns);
    }
}

/* ---- the parallel bus */

static enum board_cycle_result result;
static bool done;

static void on_done(void *ctx, struct board_cycle *c, enum board_cycle_result r, int64_t t_ns)
{
    (void)c;
    assert_ptr_equal(ctx, &w);
    assert_true(t_ns <= w.s.now_ns);
    result = r;
    done = true;
}

/* Answered in the end, whatever it is: at once or by done(), not both. */
static enum board_cycle_result cycle(struct board_cycle *c)
{
    const struct board_type *t = w.u.type;
    done = false;
    c->done = on_done;
    c->ctx = &w;
    const enum board_cycle_result r = t->bus->submit(w.u.board, c, w.s.now_ns);
    assert_false(done); /* never from inside */
    sched_run_until(&w.s, w.s.now_ns + NS_PER_S / 10);
    assert_int_equal(done, r == BOARD_CYCLE_OK);
    return done ? result : r;
}

static void each_address_of_a_bus_answers_or_refuses(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        if (!(*t)->bus) continue;
        live(*t, NS_PER_S);
        unsigned read = 0;
        for (unsigned a = 0; a < (*t)->bus->addresses + 2u && a < 256; a++) {
            struct board_cycle c = {.address = (uint8_t)a};
            const bool here = board_bus_name((*t)->bus, a);
            const enum board_cycle_result r = cycle(&c);
            assert_int_equal(r == BOARD_CYCLE_NO_ADDRESS, !here);
            assert_string_not_equal(board_cycle_word(r), "");
            read += r == BOARD_CYCLE_OK;
        }
        assert_true(read > 0);
        unit_power_down(&w.u, w.s.now_ns);
        struct board_cycle off = {.address = 0};
        assert_int_equal(cycle(&off), BOARD_CYCLE_OFF);
    }
}

/* The sentence of a refusal; those of a value name the limits, which the register takes, one more it does not. */
static void a_refusal_says_what_would_be_right(void **state)
{
    static const struct {
        const char *board;
        struct board_cycle c;
        const char *why;
        uint16_t takes[2];
    } rows[] = {
        {"psd1",
         {.address = 10, .strobe_ns = 199},
         "read of address 0Ah (TEMP), strobe 199 ns: the strobe is shorter than the board needs, at least 200 ns",
         {0}},
        {"psd1",
         {.address = 16},
         "read of address 10h (nothing), strobe 800 ns: nothing answers at this address; 00h to 0Fh do",
         {0}},
        {"psd1",
         {.write = true, .address = 15, .data = 4},
         "write of 4 to address 0Fh (FLAGS), strobe 800 ns: the register does not take this value: it takes 0 to 3",
         {0, 3}},
        {"psd1", {.write = true, .address = 12, .data = 256}, "value: it takes 0 to 255", {0, 255}},
        {"psd1", {.write = true, .address = 14, .data = 256}, "value: it takes 0 to 255", {0}},
        {"psd1", {.write = true, .address = 14, .data = 255}, "value: there is no such command", {0}},
        {"pmka", {.address = 6, .strobe_ns = 199}, "at least 200 ns", {0}},
        {"pmka",
         {.address = 15},
         "address 0Fh (nothing), strobe 800 ns: nothing answers at this address; 00h to 0Eh do",
         {0}},
        {"pmka", {.write = true, .address = 9, .data = 2}, "value: it takes 0 or 1", {0, 1}},
        {"pmka",
         {.write = true, .address = 10, .data = 1},
         "it takes in MODE 0 alone: beat 0 to 5 in bits 0 to 2, calibration 0 to 2 in bits 4, 5",
         {0}},
        {"pmka", {.write = true, .address = 11, .data = 125}, "value: it takes 126 to 60000", {126, 60000}},
        {"pmka", {.write = true, .address = 12, .data = 0}, "value: it takes 1 to 194", {1, 194}},
        {"pmka", {.write = true, .address = 13, .data = 8}, "value: it takes 0 to 7 and 256 to ", {0, 7}},
        {"pik", {.address = 10, .strobe_ns = 1}, "at least 200 ns", {0}},
        {"pik", {.write = true, .address = 14}, "strobe 1000 ns: nothing answers at this address; 00h to 0Dh do", {0}},
        {"pik", {.write = true, .address = 12, .data = 1}, "value: it takes 0 and 2 to 65535", {2, 65535}},
        {"pik", {.write = true, .address = 13, .data = 8}, "value: it takes 0 to 7", {0, 7}},
    };
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++) {
        char why[BOARD_CYCLE_WHY_MAX];
        struct board_cycle c = rows[i].c;
        live(board_name_find(rows[i].board)->type, NS_PER_S);
        const enum board_cycle_result r = cycle(&c);
        board_cycle_why(w.u.type->bus, w.u.board, &c, r, why);
        if (!strstr(why, rows[i].why)) fail_msg("\"%s\" does not say \"%s\"", why, rows[i].why);
        for (size_t k = 0; k < 2 && rows[i].takes[1]; k++) {
            live(w.u.type, NS_PER_S);
            c = rows[i].c;
            c.data = rows[i].takes[k];
            assert_int_equal(cycle(&c), BOARD_CYCLE_OK);
        }
        if (!rows[i].takes[1] || rows[i].takes[1] == UINT16_MAX) continue;
        c.data = (uint16_t)(rows[i].takes[1] + 1);
        assert_int_equal(cycle(&c), BOARD_CYCLE_BAD_VALUE);
    }
}

static void who_is_too_early_learns_when(void **state)
{
    (void)state;
    for (const struct board_type *const *t = board_types; *t; t++) {
        char why[BOARD_CYCLE_WHY_MAX];
        const struct board_cycle c = {.address = 0};
        if (!(*t)->bus) continue;
        live(*t, 0);
        board_cycle_why((*t)->bus, w.u.board, &c, BOARD_CYCLE_NOT_READY, why);
        const char *const early = strstr(why, "too early: no word waits there; ");
        assert_true(early && strstr(early, "h) ")); /* the register to look at or to write */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_type_is_complete),
        cmocka_unit_test(names_lead_to_types_and_their_profiles),
        cmocka_unit_test(the_default_profile_is_sound_and_the_file_that_it_names),
        cmocka_unit_test(a_dump_of_a_profile_is_a_profile_with_the_same_dump),
        cmocka_unit_test(a_name_takes_its_own_profiles),
        cmocka_unit_test(no_two_sources_share_their_noise),
        cmocka_unit_test(the_lines_are_those_of_the_table),
        cmocka_unit_test(each_comes_up_tells_of_it_and_goes_down),
        cmocka_unit_test(the_digest_tells_states_apart_and_nothing_else),
        cmocka_unit_test(truth_and_faults_may_be_asked_at_any_time),
        cmocka_unit_test(each_address_of_a_bus_answers_or_refuses),
        cmocka_unit_test(a_refusal_says_what_would_be_right),
        cmocka_unit_test(who_is_too_early_learns_when),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
