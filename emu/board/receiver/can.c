#include "board/receiver/board.h"
#include "gen/psabench_can.h"
#include "gen/receiver_od.h"

enum { FRAMES = 4 };

static const struct receiver *receiver_of(const struct board_node *n)
{
    return n->board;
}

/* ---- readings ---- */

static struct psabench_receiver_time_t time_of(const struct receiver_reading *r)
{
    uint32_t week, tow_ms;
    report_gps_time(&r->report, &week, &tow_ms);
    return (struct psabench_receiver_time_t){
        .tow = tow_ms, .week = (uint16_t)week, .fix = (uint8_t)r->report.fix, .seq = (uint8_t)r->seq};
}

static void send_reading(void *can, const struct receiver_reading *r, int64_t t_ns)
{
    struct can_msg m[FRAMES] = {{0}, {0}, {0}, {0}};
    const struct report *p = &r->report;
    const struct psabench_receiver_position_t position = {p->lat_e7, p->lon_e7};
    const struct psabench_receiver_velocity_t velocity = {p->v_n_mmps[0], p->v_n_mmps[1]};
    const struct psabench_receiver_height_t height = {p->h_mm, p->v_n_mmps[2]};
    const struct psabench_receiver_time_t time = time_of(r);
    m[0].len = (uint8_t)psabench_receiver_position_pack(m[0].data, &position, sizeof m[0].data);
    m[1].len = (uint8_t)psabench_receiver_velocity_pack(m[1].data, &velocity, sizeof m[1].data);
    m[2].len = (uint8_t)psabench_receiver_height_pack(m[2].data, &height, sizeof m[2].data);
    m[3].len = (uint8_t)psabench_receiver_time_pack(m[3].data, &time, sizeof m[3].data);
    board_node_stream(can, RECEIVER_POSITION_TPDO, m, FRAMES, t_ns);
}

/* ---- objects ---- */

static double read_solution(const struct board_node *n, const struct co_entry *e)
{
    const struct report *r = &receiver_of(n)->latest.report;
    const int32_t value[] = {0, r->lat_e7, r->lon_e7, r->v_n_mmps[0], r->v_n_mmps[1], r->h_mm, r->v_n_mmps[2]};
    return value[e->sub];
}

static double read_head(const struct board_node *n, const struct co_entry *e)
{
    const struct receiver_reading *r = &receiver_of(n)->latest;
    uint32_t week, tow_ms;
    report_gps_time(&r->report, &week, &tow_ms);
    const uint32_t value[] = {0, tow_ms, (uint16_t)week, (uint32_t)r->report.fix, (uint8_t)r->seq};
    return value[e->sub];
}

static double read_accuracy(const struct board_node *n, const struct co_entry *e)
{
    const struct report *r = &receiver_of(n)->latest.report;
    const uint32_t value[] = {0, r->h_acc_mm, r->v_acc_mm, r->s_acc_mmps, r->sats};
    return value[e->sub];
}

static double read_port(const struct board_node *n, const struct co_entry *e)
{
    const struct receiver *b = receiver_of(n);
    const uint32_t value[] = {0, b->profile.baud, b->profile.rate_hz, b->profile.leap_s};
    return value[e->sub];
}

static const struct board_object objects[] = {
    {RECEIVER_OD_SOLUTION, .value = read_solution},
    {RECEIVER_OD_READING, .value = read_head},
    {RECEIVER_OD_ACCURACY, .value = read_accuracy},
    {RECEIVER_OD_PORT, .value = read_port},
};

static int64_t period_ns(const void *board)
{
    return ((const struct receiver *)board)->errors.cfg.period_ns;
}

static const struct board_node_type type = {
    .device = &receiver_device, BOARD_NODE_OBJECTS(objects), .period_ns = period_ns};

static void init_can(void *can, const struct board_can_cfg *cfg, struct board *board, struct can_bus *bus,
                     struct sched *s)
{
    struct receiver *b = (struct receiver *)board;
    board_node_init(can, &type, cfg, board, bus, s);
    b->on_reading = send_reading;
    b->can = can;
}

const struct board_can receiver_can = {.size = sizeof(struct receiver_can), .init = init_can, BOARD_NODE_LIFE};
