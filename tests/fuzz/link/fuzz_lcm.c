/* Frames of any programs on a bus with a unit of each type, published as LCM messages: each message is of its channel's type by
 * the code of lcm-gen, frames come out as they went in, and the URL of any text is read or rejected in one line. */
#include "fuzz.h"

#include "gen/lcm/psabench_lcm_can_frame_t.h"
#include "gen/lcm/psabench_lcm_gyro_reading_t.h"
#include "gen/lcm/psabench_lcm_instruments_t.h"
#include "gen/lcm/psabench_lcm_pik_reading_t.h"
#include "gen/lcm/psabench_lcm_pmka_reading_t.h"
#include "gen/lcm/psabench_lcm_psa2_reading_t.h"
#include "gen/lcm/psabench_lcm_psd1_reading_t.h"
#include "gen/lcm/psabench_lcm_register_t.h"
#include "gen/lcm/psabench_lcm_truth_t.h"
#include "telemetry/lcm_feed.h"

#include <string.h>

enum { UNITS = 5, NODE = 5, FRAMES_MAX = 200 };

static struct {
    struct sched s;
    struct can_bus bus;
    struct can_node host;
    struct lab lab;
    struct unit unit[UNITS];
    struct control_bench view;
    struct lcm_feed feed;
    struct can_msg sent;
    unsigned frames, messages;
} w;

/* Decodes a message of the type and encodes it again. */
#define CHECK(type)                                                                                                    \
    static void check_##type(const void *data, int len)                                                                \
    {                                                                                                                  \
        uint8_t again[LCM_MESSAGE_MAX];                                                                                \
        psabench_lcm_##type m;                                                                                         \
        assert(psabench_lcm_##type##_decode(data, 0, len, &m) == len);                                                 \
        assert(psabench_lcm_##type##_encode(again, 0, sizeof again, &m) == len &&                                      \
               memcmp(again, data, (size_t)len) == 0);                                                                 \
        psabench_lcm_##type##_decode_cleanup(&m);                                                                      \
    }
CHECK(psa2_reading_t)
CHECK(psd1_reading_t)
CHECK(pmka_reading_t)
CHECK(pik_reading_t)
CHECK(gyro_reading_t)
CHECK(register_t)
CHECK(instruments_t)
CHECK(truth_t)

/* Not decoded: the decoder of lcm-gen gives memcpy() a null pointer for a frame without data. */
static void check_frame(const void *data, int len)
{
    uint8_t want[LCM_MESSAGE_MAX];
    struct can_msg *m = &w.sent;
    const bool remote = m->flags & CAN_RTR;
    char bus[] = "can0";
    const psabench_lcm_can_frame_t f = {.t_ns = w.s.now_ns,
                                        .epoch_ns = 1,
                                        .bus = bus,
                                        .id = (int32_t)m->id,
                                        .extended = (m->flags & CAN_EXT) != 0,
                                        .remote = remote,
                                        .fd = (m->flags & CAN_FD) != 0,
                                        .brs = (m->flags & CAN_BRS) != 0,
                                        .length = m->len,
                                        .size = remote ? 0 : m->len,
                                        .data = m->data};
    assert(psabench_lcm_can_frame_t_encode(want, 0, sizeof want, &f) == len && memcmp(want, data, (size_t)len) == 0);
    w.frames++;
}

static int on_publish(void *lcm, const char *channel, const void *data, unsigned len)
{
    static const struct {
        const char *begins;
        void (*check)(const void *data, int len);
    } rows[] = {{"CAN_", check_frame},           {"PSA2_", check_psa2_reading_t},      {"PSD1_", check_psd1_reading_t},
                {"PMKA_", check_pmka_reading_t}, {"PIK_", check_pik_reading_t},        {"GYRO_", check_gyro_reading_t},
                {"REGISTER_", check_register_t}, {"INSTRUMENTS", check_instruments_t}, {"TRUTH_", check_truth_t}};
    (void)lcm;
    assert(strlen(channel) <= LCM_CHANNEL_MAX && strncmp(channel, "PSABENCH_", 9) == 0 && len <= LCM_MESSAGE_MAX);
    size_t k = 0;
    while (strncmp(channel + 9, rows[k].begins, strlen(rows[k].begins)) != 0) assert(++k < sizeof rows / sizeof *rows);
    rows[k].check(data, (int)len);
    w.messages++;
    return 0;
}

static void start(void)
{
    static const char *const names[UNITS] = {"a", "b", "c", "d", "thirty_one_characters_of_a_unit"};
    const struct can_bus_cfg bus = {.data_bitrate_hz = 5000000}; /* ideal */
    const struct lab_cfg lab = lab_default();
    memset(&w, 0, sizeof w);
    sched_init(&w.s);
    can_bus_init(&w.bus, &bus, &w.s);
    lab_init(&w.lab, &lab, 1);
    w.view = (struct control_bench){.lab = &w.lab, .bus = {&w.bus}, .buses = 1, .units = UNITS, .sched = &w.s};
    for (unsigned i = 0; i < UNITS; i++) {
        struct unit_cfg cfg = unit_default(names[i]);
        unit_cfg_type(&cfg, board_types[i]);
        cfg.node = (uint8_t)(NODE + i);
        unit_init(&w.unit[i], &cfg, &w.lab, &w.s);
        w.view.unit[i] = &w.unit[i];
        w.view.unit_name[i] = names[i];
    }
    /* Units without power on no bus: what is on it is the script's alone. */
    static struct can_node place;
    place = (struct can_node){.name = "unit", .fd = true};
    can_attach(&w.bus, &place);
    for (unsigned i = 0; i < UNITS; i++) w.view.node[i] = &place;
    w.host = (struct can_node){.name = "host", .fd = true, .order = CAN_ORDER_FIFO};
    can_attach(&w.bus, &w.host);
    w.feed.port.url.kind = LCM_UDPM;
    w.feed.port.udpm.publish = on_publish;
    lcm_feed_start(&w.feed, &w.view, 1, 1000000);
}

/* Mostly frames of the units' nodes with bases that mean something. */
static struct can_msg next_frame(struct script *s)
{
    static const uint16_t bases[] = {0x180, 0x200, 0x280, 0x380, 0x480, 0x580, 0x600, 0x000};
    static const uint8_t lens[] = {8, 8, 8, 8, 16, 64, 0, 7};
    const uint8_t what = script_byte(s), how = script_byte(s);
    struct can_msg m = {.id = (uint32_t)bases[what & 7] + NODE + (what >> 3 & 7u), .len = lens[how & 7]};
    if (m.len > 8) m.flags = CAN_FD | CAN_BRS;
    if ((how & 0xF0) == 0xF0) m.flags |= CAN_EXT;
    if ((how & 0xF0) == 0xE0 && m.len <= 8) m.flags |= CAN_RTR;
    for (unsigned i = 0; i < m.len; i++) m.data[i] = script_byte(s);
    return m;
}

static void check_url(const uint8_t *data, size_t size)
{
    char text[128], why[300] = "";
    struct lcm_url u;
    const size_t n = size < sizeof text ? size : sizeof text - 1;
    if (n) memcpy(text, data, n);
    text[n] = '\0';
    if (lcm_url_parse(text, "--lcm", &u, why, sizeof why)) {
        assert(u.kind == LCM_FILE ? *u.path && !strchr(u.path, '?')
                                  : u.port > 0 && u.group[0] >= 224 && u.group[0] < 240);
    } else assert(why[0] && memchr(why, '\0', sizeof why));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct script s = script_of(data, size);
    check_url(data, size);
    start();
    for (unsigned i = 0; i < FRAMES_MAX && script_more(&s); i++) {
        w.sent = next_frame(&s);
        const unsigned before = w.frames;
        if (can_send(&w.bus, &w.host, &w.sent, w.s.now_ns) != CAN_OK) continue;
        sched_run_until(&w.s, w.s.now_ns + 1000);
        assert(w.frames == before + 1);
    }
    sched_run_until(&w.s, w.s.now_ns + 1000000);
    assert(w.messages > w.frames);
    lcm_feed_stop(&w.feed);
    return 0;
}
