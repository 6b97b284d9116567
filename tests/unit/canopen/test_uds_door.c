/* Two accesses that take time at once, one over each door: their owner may finish them in any order. */
#include "host_wire.h"

#include "canopen/uds_door.h"
#include "gen/psa2_od.h"
#include "gen/uds_dids.h"

enum { NODE = 5, REQUEST = 0x7E0, RESPONSE = 0x7E8, SDO_ANSWER = 0x580 + NODE };

struct rig {
    struct sched s;
    struct can_bus bus;
    struct co_node node;
    struct uds_door door;
    struct can_node host;
    struct can_msg last[2]; /* UDS, SDO */
    unsigned count[2];      /* frames of each */
    uint32_t read_ticket, write_ticket;
};
static struct rig rig;

static void on_rx(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)t_ns;
    if (m->id != RESPONSE && m->id != SDO_ANSWER) return;
    r->last[m->id == SDO_ANSWER] = *m;
    r->count[m->id == SDO_ANSWER]++;
}

static uint32_t on_read(void *ctx, const struct co_entry *e, struct co_value *v, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)e;
    (void)v;
    (void)t_ns;
    r->read_ticket = r->node.sdo.ticket;
    return CO_PENDING;
}

static uint32_t on_write(void *ctx, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct rig *r = ctx;
    (void)e;
    (void)v;
    (void)t_ns;
    r->write_ticket = r->node.sdo.ticket;
    return CO_PENDING;
}

static void on_event(void *ctx, enum co_event ev, int64_t t_ns)
{
    (void)ctx;
    (void)ev;
    (void)t_ns;
}

static void on_sync(void *ctx, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
}

static void host_sends(struct rig *r, uint32_t id, uint8_t len, const uint8_t *data)
{
    host_put(&r->bus, &r->host, id, len, data);
    host_settle(&r->bus);
}

static struct rig *rig_up(void)
{
    struct rig *r = &rig;
    memset(r, 0, sizeof *r);
    sched_init(&r->s);
    can_bus_init(&r->bus, &(struct can_bus_cfg){1000000, 0}, &r->s);
    r->host = (struct can_node){.name = "host", .rx = on_rx, .ctx = r};
    can_attach(&r->bus, &r->host);
    const struct co_node_cfg cfg = {.name = "unit", .id = NODE, .od = &psa2_od, .tpdos = PSA2_TPDOS};
    const struct co_node_io io = {r, on_read, on_write, on_event, on_sync, NULL};
    co_node_init(&r->node, &cfg, &io, &r->bus, &r->s);
    uds_door_init(&r->door, 1, &uds_dids, &r->node);
    co_node_power_up(&r->node, 0);
    host_settle(&r->bus);
    return r;
}

static void end_read(struct rig *r)
{
    const struct co_value v = {.number = 0x5A};
    co_node_answer(&r->node, r->read_ticket, CO_OK, &v, r->s.now_ns);
    host_settle(&r->bus);
    assert_int_equal(r->count[0], 1);
    assert_memory_equal(r->last[0].data, "\x04\x62\x20\x02\x5A", 5);
}

static void end_write(struct rig *r)
{
    co_node_answer(&r->node, r->write_ticket, CO_OK, NULL, r->s.now_ns);
    host_settle(&r->bus);
    assert_int_equal(r->count[1], 2);
    assert_int_equal(r->last[1].data[0], 0x20);
}

/* The remark comes down in segments; before the last one UDS reads a register. */
static void each_answer_goes_to_the_door_that_asked(void **state)
{
    (void)state;
    for (unsigned write_first = 0; write_first < 2; write_first++) {
        struct rig *r = rig_up();
        host_asks(&r->bus, &r->host, NODE, 0x21, PSA2_OD_REMARK, 0, 2);
        host_settle(&r->bus);
        host_sends(r, REQUEST, 4, (const uint8_t[]){3, 0x22, 0x20, 0x02});
        host_sends(r, 0x600 + NODE, 8, (const uint8_t[8]){0x0B, 'h', 'i'});
        assert_int_equal(r->count[0], 0);
        assert_int_equal(r->count[1], 1);
        assert_int_not_equal(r->read_ticket, r->write_ticket);
        if (write_first) end_write(r);
        assert_int_equal(r->count[0], 0);
        end_read(r);
        if (!write_first) end_write(r);
        assert_int_equal(r->count[0] + r->count[1], 3);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(each_answer_goes_to_the_door_that_asked)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
