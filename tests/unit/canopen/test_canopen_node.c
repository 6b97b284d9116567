#include "host_wire.h"

#include "canopen/co_node.h"
#include "gen/psa2_od.h"

enum { NODE = 5, SEEN_MAX = 256 };

struct rig {
    struct sched s;
    struct can_bus bus;
    struct co_node node;
    struct can_node host;
    struct can_msg seen[SEEN_MAX];
    int64_t seen_ns[SEEN_MAX];
    unsigned count, at; /* at: first one not looked at */
    unsigned syncs, resets;
};
static struct rig rig;

static void on_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct rig *r = ctx;
    assert_true(r->count < SEEN_MAX);
    r->seen_ns[r->count] = t_ns;
    r->seen[r->count++] = *m;
}

static uint32_t on_read(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    (void)ctx;
    (void)e;
    (void)v;
    (void)t_ns;
    return CO_OK;
}

static uint32_t on_write(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    (void)ctx;
    (void)e;
    (void)v;
    (void)t_ns;
    return CO_OK;
}

static void on_event(void *ctx, enum co_event ev, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (ev == CO_EV_RESET_NODE) r->resets++;
}

static void on_sync(void *ctx, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    r->syncs++;
}

/* Runs 10 ms, a heartbeat period is a second. */
static void settle(struct rig *r)
{
    sched_run_until(&r->s, r->s.now_ns + NS_PER_S / 100);
}

static struct rig *rig_up(void)
{
    struct rig *r = &rig;
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    const struct can_bus_cfg bus = {1000000, 0};
    can_bus_init(&r->bus, &bus, &r->s);
    r->host = (struct can_node){.name = "host", .fd = true, .rx = on_rx, .ctx = r};
    can_attach(&r->bus, &r->host);
    const struct co_node_cfg cfg = {.name = "unit", .id = NODE, .od = &psa2_od, .tpdos = PSA2_TPDOS};
    const struct co_node_io io = {r, on_read, on_write, on_event, on_sync, NULL};
    co_node_init(&r->node, &cfg, &io, &r->bus, &r->s);
    co_node_power_up(&r->node, 0);
    co_pdo_select(&r->node, 3);
    settle(r);
    return r;
}

static void host_sends(struct rig *r, uint32_t id, uint8_t len, const uint8_t *data)
{
    host_put(&r->bus, &r->host, id, len, data);
    settle(r);
}

static void nmt(struct rig *r, uint8_t command, uint8_t node)
{
    host_sends(r, 0, 2, (const uint8_t[]){command, node});
}

static uint32_t sdo(struct rig *r, uint8_t command, uint16_t index, uint8_t sub, uint32_t data)
{
    host_asks(&r->bus, &r->host, NODE, command, index, sub, data);
    settle(r);
    const struct can_msg *m = &r->seen[r->count - 1];
    assert_int_equal(m->id, 0x580 + NODE);
    r->at = r->count;
    return (uint32_t)bits_get_le(&m->data[4], 4);
}

static uint32_t upload(struct rig *r, uint16_t index, uint8_t sub)
{
    return sdo(r, 0x40, index, sub, 0);
}

static const struct can_msg *next(struct rig *r)
{
    return r->at < r->count ? &r->seen[r->at++] : NULL;
}

static void boots_up_and_waits_in_pre_operational(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    assert_int_equal(r->count, 1);
    assert_int_equal(r->seen[0].id, 0x705);
    assert_int_equal(r->seen[0].len, 1);
    assert_int_equal(r->seen[0].data[0], 0);
    assert_int_equal(r->node.state, CO_PRE_OPERATIONAL);
}

static void nmt_commands_move_between_the_states(void **state)
{
    (void)state;
    static const struct {
        uint8_t command, node;
        enum co_state state;
        bool boots;
    } row[] = {
        {1, 5, CO_OPERATIONAL, false},       {2, 5, CO_STOPPED, false},          {1, 0, CO_OPERATIONAL, false},
        {128, 5, CO_PRE_OPERATIONAL, false}, {1, 6, CO_PRE_OPERATIONAL, false}, /* another node's */
        {2, 5, CO_STOPPED, false},           {130, 5, CO_PRE_OPERATIONAL, true}, {1, 5, CO_OPERATIONAL, false},
        {129, 0, CO_PRE_OPERATIONAL, true},  {77, 5, CO_PRE_OPERATIONAL, false}, /* no such command */
    };
    struct rig *r = rig_up();
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        r->at = r->count;
        nmt(r, row[i].command, row[i].node);
        assert_int_equal(r->node.state, row[i].state);
        const struct can_msg *m = next(r);
        assert_int_equal(m != NULL, row[i].boots);
        if (m) assert_int_equal(m->id, 0x705);
    }
    assert_int_equal(r->resets, 1);
    assert_int_equal(r->node.malformed, 1);
}

static void heartbeat_keeps_its_period_and_says_the_state(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    sdo(r, 0x2B, 0x1017, 0, 100);
    nmt(r, 1, 5);
    r->at = r->count;
    sched_run_until(&r->s, r->s.now_ns + NS_PER_S);
    assert_int_equal(r->count - r->at, 10);
    for (unsigned i = r->at; i < r->count; i++) {
        assert_int_equal(r->seen[i].id, 0x705);
        assert_int_equal(r->seen[i].data[0], 5);
        if (i > r->at) assert_int_equal(r->seen_ns[i] - r->seen_ns[i - 1], NS_PER_S / 10);
    }
    sdo(r, 0x2B, 0x1017, 0, 0);
    sched_run_until(&r->s, r->s.now_ns + NS_PER_S);
    assert_int_equal(r->count, r->at);
}

static void stopped_is_deaf_to_all_but_nmt(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    nmt(r, 2, 5);
    r->at = r->count;
    host_sends(r, 0x605, 8, (const uint8_t[]){0x40, 0x00, 0x10, 0, 0, 0, 0, 0});
    host_sends(r, 0x080, 0, NULL);
    co_node_error(&r->node, 0xFF01, 0x81, 1, r->s.now_ns);
    settle(r);
    assert_null(next(r));
    assert_int_equal(r->syncs, 0);
    nmt(r, 128, 5);
    assert_int_equal(upload(r, 0x1001, 0), 0x81);
}

/* An upload of the device's name is between two segments when the node is stopped: no one may take it up later. */
static void stopping_ends_a_transfer(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    host_sends(r, 0x605, 8, (const uint8_t[]){0x40, 0x08, 0x10, 0, 0, 0, 0, 0});
    nmt(r, 2, 5);
    nmt(r, 128, 5);
    r->at = r->count;
    host_sends(r, 0x605, 8, (const uint8_t[]){0x60, 0, 0, 0, 0, 0, 0, 0});
    const struct can_msg *m = next(r);
    assert_non_null(m);
    assert_int_equal(m->data[0], 0x80);
    assert_int_equal(bits_get_le(&m->data[4], 4), CO_AB_COMMAND);
}

static void emcy_tells_a_condition_once_and_its_end(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->at = r->count;
    const int64_t t_ns = r->s.now_ns;
    co_node_error(&r->node, 0xFF01, 0x81, 1, t_ns);
    co_node_error(&r->node, 0xFF01, 0x81, 1, t_ns);
    co_node_error(&r->node, 0x8110, 0x11, 3, t_ns);
    settle(r);
    const struct can_msg *m = next(r);
    assert_int_equal(m->id, 0x085);
    assert_int_equal(bits_get_le(m->data, 2), 0xFF01);
    assert_int_equal(m->data[2], 0x81);
    assert_int_equal(m->data[3], 1);
    assert_int_equal(bits_get_le(&m->data[4], 4), t_ns / 1000);
    m = next(r);
    assert_int_equal(bits_get_le(m->data, 2), 0x8110);
    assert_int_equal(m->data[2], 0x91);
    co_node_error_end(&r->node, 0xFF01, r->s.now_ns);
    settle(r);
    assert_null(next(r)); /* one is yet */
    assert_int_equal(upload(r, 0x1001, 0), 0x11);
    co_node_error_end(&r->node, 0x8110, r->s.now_ns);
    settle(r);
    m = next(r);
    assert_int_equal(bits_get_le(m->data, 2), 0);
    assert_int_equal(m->data[2], 0);
}

/* CiA 301 has no emergency for error warning; error-passive ends there. */
static void error_warning_sends_no_emcy_and_ends_error_passive(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    struct can_node *n = &r->node.services;
    n->state(n->ctx, CAN_STATE_ERROR_WARNING, r->s.now_ns);
    settle(r);
    r->at = 1; /* after boot-up */
    assert_null(next(r));
    n->state(n->ctx, CAN_STATE_ERROR_PASSIVE, r->s.now_ns);
    settle(r);
    assert_int_equal(bits_get_le(next(r)->data, 2), 0x8120);
    n->state(n->ctx, CAN_STATE_ERROR_WARNING, r->s.now_ns);
    settle(r);
    assert_int_equal(bits_get_le(next(r)->data, 2), 0);
    n->state(n->ctx, CAN_STATE_ERROR_ACTIVE, r->s.now_ns);
    settle(r);
    assert_null(next(r));
}

static void error_history_has_the_latest_first_and_can_be_cleared(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    for (uint16_t k = 1; k <= 10; k++) {
        co_node_error(&r->node, (uint16_t)(0xFF00 + k), 0x81, 2, r->s.now_ns);
        co_node_error_end(&r->node, (uint16_t)(0xFF00 + k), r->s.now_ns);
    }
    settle(r);
    assert_int_equal(upload(r, 0x1003, 0) & 0xFF, 8);
    assert_int_equal(upload(r, 0x1003, 1), 0x0002FF0A);
    assert_int_equal(upload(r, 0x1003, 8), 0x0002FF03);
    assert_int_equal(sdo(r, 0x2F, 0x1003, 0, 1), CO_AB_VALUE);
    assert_int_equal(sdo(r, 0x2F, 0x1003, 0, 0), 0);
    assert_int_equal(upload(r, 0x1003, 0) & 0xFF, 0);
}

static void every_object_can_be_read_and_read_only_ones_not_written(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    for (unsigned i = 0; i < psa2_od.count; i++) {
        const struct co_entry *e = &psa2_od.entry[i];
        const uint32_t data = upload(r, e->index, e->sub);
        const uint8_t command = r->seen[r->count - 1].data[0];
        if (e->access == CO_WO) assert_int_equal(data, CO_AB_WRITE_ONLY);
        else assert_int_equal(command & 0xE0, 0x40);
        if (e->access == CO_RO || e->access == CO_CONST) {
            assert_int_equal(sdo(r, 0x23, e->index, e->sub, 0), CO_AB_READ_ONLY);
        }
        r->count = 0; /* room in the log */
    }
}

static void constants_that_name_the_node_carry_its_id(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    static const struct {
        uint16_t index;
        uint8_t sub;
        uint32_t want;
    } row[] = {{0x1014, 0, 0x85},       {0x1200, 1, 0x605},      {0x1200, 2, 0x585},      {0x1800, 1, 0x40000185},
               {0x1801, 1, 0x40000285}, {0x1802, 1, 0xC0000385}, {0x1804, 1, 0xC0000205}, {0x1A00, 1, 0x22000118}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        assert_int_equal(upload(r, row[i].index, row[i].sub), row[i].want);
    }
}

static enum co_pdo_result offer(struct rig *r, unsigned k, uint8_t first_byte)
{
    struct can_msg m = {.len = 8, .data = {first_byte}};
    return co_pdo_offer(&r->node, k, &m, r->s.now_ns);
}

static void event_pdos_go_out_in_operational_only(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    r->at = r->count;
    assert_int_equal(offer(r, 0, 1), CO_PDO_OFF);
    nmt(r, 1, 5);
    assert_int_equal(offer(r, 0, 2), CO_PDO_SENT);
    assert_int_equal(offer(r, 1, 3), CO_PDO_SENT);
    assert_int_equal(offer(r, 2, 4), CO_PDO_OFF); /* not selected */
    settle(r);
    assert_int_equal(r->seen[r->at].id, 0x185);
    assert_int_equal(r->seen[r->at + 1].id, 0x285);
    assert_int_equal(r->count - r->at, 2);
}

static void pdos_keep_their_order_where_the_bus_is_slow(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    nmt(r, 1, 5);
    r->at = r->count;
    for (uint8_t i = 0; i < 8; i++) {
        offer(r, 0, i);
        offer(r, 1, i);
    }
    assert_int_equal(offer(r, 0, 99), CO_PDO_FULL); /* 16 wait */
    settle(r);
    for (uint8_t i = 0; i < 8; i++) {
        assert_int_equal(r->seen[r->at + 2u * i].id, 0x185);
        assert_int_equal(r->seen[r->at + 2u * i].data[0], i);
        assert_int_equal(r->seen[r->at + 2u * i + 1].id, 0x285);
    }
}

static void communication_parameters_obey_cia_301(void **state)
{
    (void)state;
    static const struct {
        uint8_t command, sub;
        uint32_t value, want;
    } row[] = {
        {0x23, 1, 0x40000190, CO_AB_VALUE}, /* another id while it is valid */
        {0x23, 1, 0xC0000190, 0},           /* off, and the new id */
        {0x23, 1, 0x40000190, 0},
        {0x23, 1, 0xC0000000, CO_AB_VALUE}, /* NMT's */
        {0x23, 1, 0xC0000085, CO_AB_VALUE}, /* an emergency's */
        {0x23, 1, 0xC0000585, CO_AB_VALUE}, /* SDO's */
        {0x23, 1, 0xC0000705, CO_AB_VALUE}, /* a heartbeat's */
        {0x23, 1, 0xE0000190, CO_AB_VALUE}, /* 29 bits */
        {0x23, 1, 0x80000190, CO_AB_VALUE}, /* with RTR */
        {0x2F, 2, 253, CO_AB_VALUE},        /* on RTR */
        {0x2F, 2, 241, CO_AB_VALUE},        /* reserved */
        {0x2F, 2, 240, 0},
        {0x2F, 2, 255, 0},
        {0x2B, 3, 100, 0},
    };
    struct rig *r = rig_up();
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        assert_int_equal(sdo(r, row[i].command, 0x1800, row[i].sub, row[i].value), row[i].want);
    }
    assert_int_equal(sdo(r, 0x23, 0x1802, 1, 0x40000385), CO_AB_STATE); /* nothing feeds it */
    assert_int_equal(upload(r, 0x1800, 1), 0x40000190);
    nmt(r, 130, 5); /* reset communication */
    assert_int_equal(upload(r, 0x1800, 1), 0x40000185);
    assert_int_equal(upload(r, 0x1800, 3) & 0xFFFF, 0);
}

static void inhibit_time_keeps_pdos_apart_and_counts(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    sdo(r, 0x2B, 0x1800, 3, 10); /* 1 ms */
    nmt(r, 1, 5);
    const int64_t t_ns = r->s.now_ns;
    assert_int_equal(offer(r, 0, 1), CO_PDO_SENT);
    sched_run_until(&r->s, t_ns + 999999);
    assert_int_equal(offer(r, 0, 2), CO_PDO_INHIBITED);
    sched_run_until(&r->s, t_ns + 1000000);
    assert_int_equal(offer(r, 0, 3), CO_PDO_SENT);
    assert_int_equal(r->node.pdo_inhibited, 1);
}

static unsigned sync_and_count(struct rig *r)
{
    const unsigned before = r->count;
    host_sends(r, 0x080, 0, NULL);
    return r->count - before;
}

static void synchronous_types_send_at_sync(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    sdo(r, 0x2F, 0x1800, 2, 0); /* acyclic: what is new */
    sdo(r, 0x2F, 0x1801, 2, 3); /* every third, new or not */
    nmt(r, 1, 5);
    for (int i = 0; i < 3; i++) assert_int_equal(sync_and_count(r), 0); /* nothing yet */
    sdo(r, 0x2F, 0x1801, 2, 3);                                         /* counts again */
    assert_int_equal(sync_and_count(r), 0);
    assert_int_equal(offer(r, 0, 1), CO_PDO_HELD);
    assert_int_equal(offer(r, 1, 1), CO_PDO_HELD);
    assert_int_equal(sync_and_count(r), 1); /* 185h is new */
    assert_int_equal(sync_and_count(r), 1); /* 285h is due */
    assert_int_equal(sync_and_count(r), 0);
    assert_int_equal(sync_and_count(r), 0);
    assert_int_equal(sync_and_count(r), 1);
    assert_int_equal(r->syncs, 9);
}

static void a_synchronous_pdo_without_room_is_counted_as_lost(void **state)
{
    (void)state;
    struct rig *r = rig_up();
    sdo(r, 0x2F, 0x1801, 2, 1);
    nmt(r, 1, 5);
    assert_int_equal(offer(r, 1, 1), CO_PDO_HELD);
    while (co_pdo_room(&r->node, 1)) /* asynchronous ones fill the backlog before any gets onto the wire */
        assert_int_equal(offer(r, 0, 1), CO_PDO_SENT);
    co_pdo_sync(&r->node, r->s.now_ns);
    assert_int_equal(r->node.pdo_lost, 1);
}

static void frames_that_are_no_service_are_ignored_and_bad_ones_counted(void **state)
{
    (void)state;
    static const struct {
        struct can_msg m;
        unsigned malformed;
    } row[] = {
        {{.id = 0x606, .len = 8}, 0},                   /* another node's SDO */
        {{.id = 0x605, .len = 8, .flags = CAN_EXT}, 0}, /* 29-bit namesake */
        {{.id = 0x100, .len = 6}, 0},                   /* TIME: not consumed */
        {{.id = 0x205, .len = 8}, 0},                   /* an RPDO: we have none */
        {{.id = 0x000, .len = 1}, 1},                   /* NMT without a node */
        {{.id = 0x080, .len = 2}, 1},                   /* SYNC of two bytes */
        {{.id = 0x605, .len = 8, .flags = CAN_RTR}, 1},
        {{.id = 0x705, .len = 1, .flags = CAN_RTR}, 0}, /* node guarding: absent */
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct rig *r = rig_up();
        r->at = r->count;
        assert_int_equal(can_send(&r->bus, &r->host, &row[i].m, r->s.now_ns), CAN_OK);
        settle(r);
        assert_null(next(r));
        assert_int_equal(r->node.malformed, row[i].malformed);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(boots_up_and_waits_in_pre_operational),
        cmocka_unit_test(nmt_commands_move_between_the_states),
        cmocka_unit_test(heartbeat_keeps_its_period_and_says_the_state),
        cmocka_unit_test(stopped_is_deaf_to_all_but_nmt),
        cmocka_unit_test(stopping_ends_a_transfer),
        cmocka_unit_test(emcy_tells_a_condition_once_and_its_end),
        cmocka_unit_test(error_warning_sends_no_emcy_and_ends_error_passive),
        cmocka_unit_test(error_history_has_the_latest_first_and_can_be_cleared),
        cmocka_unit_test(every_object_can_be_read_and_read_only_ones_not_written),
        cmocka_unit_test(constants_that_name_the_node_carry_its_id),
        cmocka_unit_test(event_pdos_go_out_in_operational_only),
        cmocka_unit_test(pdos_keep_their_order_where_the_bus_is_slow),
        cmocka_unit_test(communication_parameters_obey_cia_301),
        cmocka_unit_test(inhibit_time_keeps_pdos_apart_and_counts),
        cmocka_unit_test(synchronous_types_send_at_sync),
        cmocka_unit_test(a_synchronous_pdo_without_room_is_counted_as_lost),
        cmocka_unit_test(frames_that_are_no_service_are_ignored_and_bad_ones_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
