#include "telemetry/lcm_reading.h"

#include "board/psa2/psa2.h"
#include "gen/lcm/psabench_lcm_gyro_reading_t.h"
#include "gen/lcm/psabench_lcm_pik_reading_t.h"
#include "gen/lcm/psabench_lcm_pmka_reading_t.h"
#include "gen/lcm/psabench_lcm_psa2_reading_t.h"
#include "gen/lcm/psabench_lcm_psd1_reading_t.h"
#include "gen/psa2_od.h"
#include "gen/psabench_can.h"
#include "gen/psabench_scale.h"
#include "telemetry/lcm_board.h"

#include <string.h>

#define PSD1_VOLTS      (10.0 / 32768.0) /* a code of AIN2, gain 1 */
#define RADPS_OF_DEGPH  (3.14159265358979323846 / 648000.0)
#define COUNT_OF(table) (sizeof(table) / sizeof *(table))

static void keep_first(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    (void)f;
    (void)t_ns;
    lcm_reading_keep(u, 0, m);
}

static void keep_second(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    (void)f;
    (void)t_ns;
    lcm_reading_keep(u, 1, m);
}

/* ---- PSD-1 */

static double psd1_volts(uint16_t code)
{
    return (code - 32768) * PSD1_VOLTS;
}

static void take_cycle(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    uint8_t out[LCM_MESSAGE_MAX];
    struct psabench_psd1_cycle_t c;
    psabench_psd1_cycle_unpack(&c, m->data, m->len);
    const psabench_lcm_psd1_reading_t r = {.t_ns = t_ns,
                                           .epoch_ns = f->epoch_ns,
                                           .unit = lcm_text(u->name),
                                           .x_code = c.x,
                                           .y_code = c.y,
                                           .z_code = c.z,
                                           .x_v = psd1_volts(c.x),
                                           .y_v = psd1_volts(c.y),
                                           .z_v = psd1_volts(c.z),
                                           .count = c.cnt,
                                           .read_x = (int8_t)c.read_x,
                                           .read_y = (int8_t)c.read_y,
                                           .read_z = (int8_t)c.read_z,
                                           .overrun = (int8_t)c.overrun,
                                           .late = (int8_t)c.late,
                                           .mixed = (int8_t)c.mixed,
                                           .clipped = (int8_t)c.clip};
    lcm_feed_send(f, u->readings, out, psabench_lcm_psd1_reading_t_encode(out, 0, sizeof out, &r), t_ns);
}

/* ---- PMKA */

static void take_state(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    uint8_t out[LCM_MESSAGE_MAX];
    struct psabench_pmka_codes_t c;
    struct psabench_pmka_state_t s;
    if (!lcm_reading_complete(u, 1)) return;
    psabench_pmka_codes_unpack(&c, u->part[0], sizeof u->part[0]);
    psabench_pmka_state_unpack(&s, m->data, m->len);
    const psabench_lcm_pmka_reading_t r = {.t_ns = t_ns,
                                           .epoch_ns = f->epoch_ns,
                                           .unit = lcm_text(u->name),
                                           .x_code = c.x,
                                           .y_code = c.y,
                                           .z_code = c.z,
                                           .k_code = c.k,
                                           .x_v = c.x * PSABENCH_PMKA_CODES_X_SCALE,
                                           .y_v = c.y * PSABENCH_PMKA_CODES_Y_SCALE,
                                           .z_v = c.z * PSABENCH_PMKA_CODES_Z_SCALE,
                                           .k_v = c.k * PSABENCH_PMKA_CODES_K_SCALE,
                                           .sequence = s.seq,
                                           .temp_code = s.t,
                                           .temp_degc = s.t * PSABENCH_PMKA_STATE_T_SCALE,
                                           .saturated = (int8_t)s.saturated,
                                           .clipped = (int8_t)s.clipped,
                                           .autonomous = (int8_t)s.autonomous};
    lcm_feed_send(f, u->readings, out, psabench_lcm_pmka_reading_t_encode(out, 0, sizeof out, &r), t_ns);
}

/* ---- PIK */

static void take_counts(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    uint8_t out[LCM_MESSAGE_MAX];
    struct psabench_pik_counts_t c;
    psabench_pik_counts_unpack(&c, m->data, m->len);
    const psabench_lcm_pik_reading_t r = {.t_ns = t_ns,
                                          .epoch_ns = f->epoch_ns,
                                          .unit = lcm_text(u->name),
                                          .x_pulses = c.x,
                                          .y_pulses = c.y,
                                          .z_pulses = c.z,
                                          .sequence = c.seq,
                                          .saturated_x = (int8_t)c.sat_x,
                                          .saturated_y = (int8_t)c.sat_y,
                                          .saturated_z = (int8_t)c.sat_z};
    lcm_feed_send(f, u->readings, out, psabench_lcm_pik_reading_t_encode(out, 0, sizeof out, &r), t_ns);
}

/* ---- gyro platform */

static void take_level(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    uint8_t out[LCM_MESSAGE_MAX];
    struct psabench_gyro_rates_t w;
    struct psabench_gyro_angles_t a;
    struct psabench_gyro_level_t l;
    if (!lcm_reading_complete(u, 2)) return;
    psabench_gyro_rates_unpack(&w, u->part[0], sizeof u->part[0]);
    psabench_gyro_angles_unpack(&a, u->part[1], sizeof u->part[1]);
    psabench_gyro_level_unpack(&l, m->data, m->len);
    const psabench_lcm_gyro_reading_t r = {.t_ns = t_ns,
                                           .epoch_ns = f->epoch_ns,
                                           .unit = lcm_text(u->name),
                                           .u1_code = w.u1,
                                           .u2_code = w.u2,
                                           .u1_radps = w.u1 * PSABENCH_GYRO_RATES_U1_SCALE * RADPS_OF_DEGPH,
                                           .u2_radps = w.u2 * PSABENCH_GYRO_RATES_U2_SCALE * RADPS_OF_DEGPH,
                                           .encoder_code = a.encoder,
                                           .encoder_deg = a.encoder * PSABENCH_GYRO_ANGLES_ENCODER_SCALE,
                                           .beta_code = l.beta,
                                           .gamma_code = l.gamma,
                                           .beta_deg = l.beta * PSABENCH_GYRO_LEVEL_BETA_SCALE,
                                           .gamma_deg = l.gamma * PSABENCH_GYRO_LEVEL_GAMMA_SCALE,
                                           .step = a.step,
                                           .mode = (int8_t)a.mode,
                                           .phase = (int8_t)a.phase,
                                           .position = (int8_t)a.position,
                                           .saturated = (int8_t)a.saturated,
                                           .level_lost = (int8_t)a.level_lost,
                                           .encoder_fault = (int8_t)a.encoder_fault,
                                           .not_settled = (int8_t)a.not_settled};
    lcm_feed_send(f, u->readings, out, psabench_lcm_gyro_reading_t_encode(out, 0, sizeof out, &r), t_ns);
}

/* ---- PSA-2 */

static void take_psa2(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    uint8_t out[LCM_MESSAGE_MAX];
    struct psa2_reading read[PSA2_READINGS_MAX];
    const unsigned n = psa2_reading_take(&u->psa2, m, t_ns, read);
    for (unsigned i = 0; i < n; i++) {
        const struct psa2_reading *p = &read[i];
        const psabench_lcm_psa2_reading_t r = {.t_ns = t_ns,
                                               .epoch_ns = f->epoch_ns,
                                               .unit = lcm_text(u->name),
                                               .form = (int8_t)p->form,
                                               .sample = (int8_t)p->sample,
                                               .x_code = p->code[0],
                                               .y_code = p->code[1],
                                               .z_code = p->code[2],
                                               .x_v = p->volts[0],
                                               .y_v = p->volts[1],
                                               .z_v = p->volts[2],
                                               .sequence = p->sequence,
                                               .t_sample_s = p->t_sample_s,
                                               .temp_code = p->temp_code,
                                               .temp_channel = p->temp_channel,
                                               .temp_new = (p->status & PSA2_ST_TEMP_NEW) != 0,
                                               .settled = p->form == PSA2_FORM_FAST || p->status & PSA2_ST_SETTLED,
                                               .clipped = (p->status & PSA2_ST_CLIP) != 0,
                                               .overrun = (p->status & PSA2_ST_OVERRUN) != 0};
        lcm_feed_send(f, u->readings, out, psabench_lcm_psa2_reading_t_encode(out, 0, sizeof out, &r), t_ns);
    }
}

/* ---- boards, by the identifiers of their messages at node 0 */

#define MESSAGE(name, bytes, function)                                                                                 \
    {                                                                                                                  \
        PSABENCH_##name##_FRAME_ID & ~UINT32_C(0x7F), (bytes), (function)                                              \
    }

// clang-format off
static const struct lcm_row psd1[] = {MESSAGE(PSD1_CYCLE, 8, take_cycle)};
static const struct lcm_row pmka[] = {MESSAGE(PMKA_CODES, 8, keep_first), MESSAGE(PMKA_STATE, 8, take_state)};
static const struct lcm_row pik[] = {MESSAGE(PIK_COUNTS, 8, take_counts)};
static const struct lcm_row gyro[] = {MESSAGE(GYRO_RATES, 8, keep_first), MESSAGE(GYRO_ANGLES, 8, keep_second),
                                      MESSAGE(GYRO_LEVEL, 8, take_level)};
static const struct lcm_row psa2[] = {MESSAGE(PSA2_XY, 8, take_psa2), MESSAGE(PSA2_ZT, 8, take_psa2),
                                      MESSAGE(PSA2_FAST, 8, take_psa2), MESSAGE(PSA2_FRAME, 16, take_psa2),
                                      MESSAGE(PSA2_BLOCK, 64, take_psa2)};
// clang-format on

struct lcm_board {
    const char *name, *channel;
    const struct lcm_row *row;
    size_t rows;
};

static const struct lcm_board boards[] = {
    {"psa2", "PSABENCH_PSA2_", psa2, COUNT_OF(psa2)}, {"psd1", "PSABENCH_PSD1_", psd1, COUNT_OF(psd1)},
    {"pmka", "PSABENCH_PMKA_", pmka, COUNT_OF(pmka)}, {"pik", "PSABENCH_PIK_", pik, COUNT_OF(pik)},
    {"gyro", "PSABENCH_GYRO_", gyro, COUNT_OF(gyro)},
};

const struct lcm_board *lcm_board_of(const char *name)
{
    for (size_t i = 0; i < COUNT_OF(boards); i++)
        if (strcmp(boards[i].name, name) == 0) return &boards[i];
    return NULL;
}

const char *lcm_board_channel(const struct lcm_board *b)
{
    return b->channel;
}

void lcm_reading_take(struct lcm_feed *f, struct lcm_unit *u, const struct can_msg *m, int64_t t_ns)
{
    const uint32_t base = m->id & ~UINT32_C(0x7F);
    for (size_t i = 0; u->board && i < u->board->rows; i++) {
        const struct lcm_row *row = &u->board->row[i];
        if (row->base == base && row->len == m->len) row->take(f, u, m, t_ns);
    }
}
