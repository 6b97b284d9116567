/* Operations of the controller between cycles: control words UC1 and UC2 by TFS, coefficients and control words back.
 *
 * The article names the words, their way through РК, and that the converters calibrate themselves and keep the coefficients;
 * order and instants are ours (E0): frames as those of the cycle, of 24 SCLK, A0 low for control words. */
#include "board/psd1/internal.h"

#define IGNORE_TAU   600     /* DRDY may take 512 tau to rise after a control word: sources 3.2 */
#define JOB_WAIT_NS  1000000 /* E0: timeout of a command with a cycle that is not read */
#define JOB_RETRY_NS 20000

enum op { SEND, AWAIT, COEF, CONTROL, END };
struct psd1_job_step {
    enum op op;
    bool uc1;          /* SEND: that one, else UC2 */
    enum ad7712_md md; /* SEND: in place of UC2's; COEF: which */
};

static const struct psd1_job_step calibrate[] = {
    {.op = SEND, .uc1 = true},
    {.op = AWAIT},
    {.op = SEND, .md = AD7712_ZERO_COEF},
    {.op = COEF, .md = AD7712_ZERO_COEF},
    {.op = SEND, .md = AD7712_FULL_COEF},
    {.op = COEF, .md = AD7712_FULL_COEF},
    {.op = SEND},
    {.op = AWAIT},
    {.op = END},
};
static const struct psd1_job_step work[] = {{.op = SEND}, {.op = AWAIT}, {.op = END}};
static const struct psd1_job_step look[] = {{.op = CONTROL}, {.op = END}};

/* ---- rows ---- */

static int64_t finish_job(struct psd1 *b, int64_t t_ns)
{
    struct psd1_job *j = &b->job;
    struct psd1_request *r = j->request;
    j->at = NULL;
    j->request = NULL;
    b->phase = PSD1_IDLE;
    b->due_ns = SCHED_NEVER;
    if (r) r->done(r->ctx, r, BOARD_CYCLE_OK, t_ns);
    return b->due_ns;
}

/* A converter with an unread word gives that for its control word (sources 3.4), and no line says so: its DRDY rises before an
 * update, DR may be another's. So the word goes first, always. */
static int64_t word_first(struct psd1 *b, int64_t t_ns)
{
    b->job.data_first = true;
    b->phase = PSD1_COEF_A0;
    return psd1_next_rise(b, t_ns);
}

int64_t psd1_job_next(struct psd1 *b, int64_t t_ns)
{
    struct psd1_job *j = &b->job;
    switch (j->at->op) {
    case SEND:
        b->phase = PSD1_TFS_FALL;
        return psd1_next_fall(b, t_ns);
    case AWAIT:
        psd1_arm_timeout(b, t_ns);
        b->phase = PSD1_AWAIT_DR;
        return t_ns + clk_span_ns(b->profile.adc_clkin_hz, IGNORE_TAU);
    case COEF:
        j->axis = 0;
        b->phase = PSD1_COEF_A0;
        return psd1_next_rise(b, t_ns);
    case CONTROL:
        j->axis = j->request->command & PSD1_CMD_AXIS;
        return word_first(b, t_ns);
    default:
        return finish_job(b, t_ns);
    }
}

static int64_t next_operation(struct psd1 *b, int64_t t_ns)
{
    b->job.at++;
    return psd1_job_next(b, t_ns);
}

/* ---- control words out ---- */

static uint32_t word_of(const struct psd1 *b, const struct psd1_job_step *s)
{
    if (s->uc1) return b->uc1;
    return s->md ? (b->uc2 & ~AD7712_CTL_MD) | (uint32_t)s->md << 21 : b->uc2;
}

int64_t psd1_tfs_fall(struct psd1 *b, int64_t t_ns)
{
    const uint32_t word = word_of(b, b->job.at);
    const struct ad7712_sclk sclk = psd1_sclk(t_ns);
    psd1_rk_load(&b->rk, (uint8_t)(word >> 16), (uint16_t)word);
    psd1_put(b, PSD1_BIT(TFS), 0, t_ns);
    for (unsigned i = 0; i < 3; i++) {
        ad7712_tfs_pin(&b->adc[i], false, t_ns);
        ad7712_write_word(&b->adc[i], psd1_rk_give_word(&b->rk), PSD1_RK_BITS, &sclk);
    }
    psd1_frame_begin(b, PSD1_FORM_WRITE24, word, t_ns);
    board_notify(&b->base, PSD1_EV_UC, t_ns);
    b->phase = PSD1_TFS_RISE;
    return t_ns + PSD1_FRAME24_NS;
}

static void tfs_up(struct psd1 *b, int64_t t_ns)
{
    psd1_put(b, PSD1_BIT(TFS), PSD1_BIT(TFS), t_ns);
    for (unsigned i = 0; i < 3; i++) ad7712_tfs_pin(&b->adc[i], true, t_ns);
}

int64_t psd1_tfs_rise(struct psd1 *b, int64_t t_ns)
{
    psd1_frame_end(b, t_ns);
    tfs_up(b, t_ns);
    return next_operation(b, t_ns);
}

int64_t psd1_await_dr(struct psd1 *b, int64_t t_ns)
{
    return b->dr ? SCHED_NEVER : next_operation(b, t_ns);
}

void psd1_job_dr(struct psd1 *b, int64_t t_ns)
{
    if (b->phase != PSD1_AWAIT_DR || b->due_ns != SCHED_NEVER) return;
    const int64_t due_ns = next_operation(b, t_ns);
    psd1_due(b, b->phase, due_ns);
}

/* ---- words back ---- */

int64_t psd1_coef_a0(struct psd1 *b, int64_t t_ns)
{
    psd1_a0(b, true, t_ns);
    b->phase = PSD1_COEF_FALL;
    return t_ns + PSD1_HALF_NS;
}

/* DR has fallen since the word was read: there is another one. */
static bool word_came(const struct psd1 *b)
{
    const struct psd1_job *j = &b->job;
    return j->at->op == CONTROL && !j->data_first && b->dr_ns >= j->word_ns;
}

int64_t psd1_coef_fall(struct psd1 *b, int64_t t_ns)
{
    struct psd1_job *j = &b->job;
    const struct ad7712_sclk sclk = psd1_sclk(t_ns);
    if (word_came(b)) return word_first(b, t_ns);
    psd1_rf(b, j->axis, false, t_ns);
    const uint32_t word = ad7712_read_word(&b->adc[j->axis], j->data_first ? 16 : 24, &sclk);
    psd1_frame_begin(b, j->data_first ? PSD1_FORM_READ16 : PSD1_FORM_READ24, word, t_ns);
    b->phase = PSD1_COEF_RISE;
    return t_ns + (j->data_first ? PSD1_READ16_NS : PSD1_FRAME24_NS);
}

/* The coefficient of an axis; true: there is another axis. */
static bool keep_coef(struct psd1 *b)
{
    struct psd1_job *j = &b->job;
    uint32_t *const coef = j->at->md == AD7712_ZERO_COEF ? b->zero : b->full;
    coef[j->axis] = b->rk.bits;
    b->coef_known = true;
    return ++j->axis < 3;
}

int64_t psd1_coef_rise(struct psd1 *b, int64_t t_ns)
{
    struct psd1_job *j = &b->job;
    psd1_frame_end(b, t_ns);
    psd1_rf(b, j->axis, true, t_ns);
    psd1_rk_take_word(&b->rk, b->frame.word, j->data_first ? 16 : 24);
    b->phase = PSD1_COEF_FALL;
    if (j->data_first) {
        j->data_first = false;
        j->word_ns = t_ns;
        psd1_a0(b, false, t_ns);
        return t_ns + PSD1_PERIOD_NS;
    }
    if (j->at->op == COEF && keep_coef(b)) return t_ns + PSD1_PERIOD_NS;
    if (j->at->op == CONTROL) j->request->word = b->rk.bits;
    psd1_a0(b, false, t_ns);
    return next_operation(b, t_ns);
}

/* ---- requests ---- */

/* What is wrong with a control word, or NULL. */
static const char *check_word(uint8_t command, uint32_t word)
{
    const unsigned md = word >> 21, fs = word & AD7712_CTL_FS;
    if (word & AD7712_CTL_WL) return "WL must be 0: RK takes words of 16 bits in a cycle";
    if (word & AD7712_CTL_PD) return "PD must be 0: the converters would fall silent";
    if (fs < AD7712_FS_MIN || fs > AD7712_FS_MAX) return "FS must be 19 to 2000";
    if (command == PSD1_CMD_UC1)
        return md >= AD7712_SELF_CAL && md <= AD7712_SYSTEM_OFFSET ? NULL : "MD of UC1 must be 1 to 4, a calibration";
    return md == AD7712_NORMAL || md == AD7712_BACKGROUND ? NULL : "MD of UC2 must be 0 or 5, conversions";
}

static const struct psd1_job_step *row_of(uint8_t command)
{
    if (command == PSD1_CMD_UC1) return calibrate;
    if (command == PSD1_CMD_UC2) return work;
    return command >= PSD1_CMD_CONTROL && command < PSD1_CMD_CONTROL + 3 ? look : NULL;
}

static void begin_job(struct psd1 *b, int64_t t_ns)
{
    struct psd1_job *j = &b->job;
    j->waits = false;
    sched_cancel(b->base.sched, &j->ev);
    if (j->request->command == PSD1_CMD_UC1) b->uc1 = j->request->word;
    if (j->request->command == PSD1_CMD_UC2) b->uc2 = j->request->word;
    b->counters.commands++;
    j->at = row_of(j->request->command);
    const int64_t due_ns = psd1_job_next(b, t_ns);
    psd1_due(b, b->phase, due_ns);
}

enum board_cycle_result psd1_request_check(const struct psd1 *b, uint8_t command, uint32_t word, const char **why)
{
    const struct psd1_job_step *row = row_of(command);
    *why = row ? NULL : "there is no such command";
    if (row && row != look) *why = check_word(command, word);
    if (*why) return BOARD_CYCLE_BAD_VALUE;
    if (b->phase == PSD1_OFF || b->phase == PSD1_IN_RESET) return BOARD_CYCLE_OFF;
    return b->job.at || b->job.request ? BOARD_CYCLE_BUSY : BOARD_CYCLE_OK;
}

enum board_cycle_result psd1_request(struct psd1 *b, struct psd1_request *r, const char **why, int64_t t_ns)
{
    struct psd1_job *j = &b->job;
    const enum board_cycle_result result = psd1_request_check(b, r->command, r->word, why);
    if (result != BOARD_CYCLE_OK) return result;
    j->request = r;
    j->waits = true;
    if (b->phase == PSD1_IDLE || b->phase == PSD1_START) begin_job(b, t_ns);
    else sched_at(b->base.sched, &j->ev, t_ns + JOB_WAIT_NS);
    return BOARD_CYCLE_OK;
}

/* The cycle has not ended: if it only waits for its host, it is cut. */
static void on_wait_timeout(void *ctx, int64_t t_ns)
{
    struct psd1 *b = ctx;
    if (b->phase != PSD1_READY || (b->bus.busy && b->bus.takes)) {
        sched_at(b->base.sched, &b->job.ev, t_ns + JOB_RETRY_NS);
        return;
    }
    psd1_cut(b, t_ns);
    begin_job(b, t_ns);
}

void psd1_job_init(struct psd1 *b)
{
    sched_ev_inner(&b->job.ev, on_wait_timeout, b);
}

void psd1_job_setup(struct psd1 *b)
{
    b->job.at = calibrate;
}

/* No DR: the set-up waits on, a request fails. */
void psd1_job_timeout(struct psd1 *b, int64_t t_ns)
{
    struct psd1_request *r = b->job.request;
    if (b->phase != PSD1_AWAIT_DR || !r) return;
    b->job.at = NULL;
    b->job.request = NULL;
    psd1_due(b, PSD1_IDLE, SCHED_NEVER);
    r->done(r->ctx, r, BOARD_CYCLE_NOT_READY, t_ns);
}

void psd1_job_stop(struct psd1 *b, enum board_cycle_result result, int64_t t_ns)
{
    struct psd1_job *j = &b->job;
    struct psd1_request *r = j->request;
    if (b->phase == PSD1_TFS_RISE || b->phase == PSD1_COEF_RISE) psd1_frame_end(b, t_ns);
    tfs_up(b, t_ns);
    for (unsigned i = 0; i < 3; i++) psd1_rf(b, i, true, t_ns);
    psd1_a0(b, false, t_ns);
    sched_cancel(b->base.sched, &j->ev);
    j->at = NULL;
    j->request = NULL;
    j->waits = j->data_first = false;
    if (r) r->done(r->ctx, r, result, t_ns);
}

/* ---- idle: what begins next ---- */

/* A request that has waited for the end of the cycle begins. */
static bool start_waiting(struct psd1 *b, int64_t t_ns)
{
    if (!b->job.waits) return false;
    begin_job(b, t_ns);
    return true;
}

static bool cycle_allowed(const struct psd1 *b)
{
    return b->ready && b->int0 && b->fl1 && !b->dr;
}

void psd1_try_start(struct psd1 *b, int64_t t_ns)
{
    if (b->phase != PSD1_IDLE || start_waiting(b, t_ns) || !cycle_allowed(b)) return;
    psd1_due(b, PSD1_START, psd1_next_rise(b, t_ns));
}

/* One of them has changed. What changes at the very instant of the rise is too late for it. */
void psd1_recheck_start(struct psd1 *b, int64_t t_ns)
{
    if (b->phase == PSD1_IDLE) psd1_try_start(b, t_ns);
    else if (b->phase == PSD1_START && !cycle_allowed(b) && b->due_ns > t_ns) psd1_due(b, PSD1_IDLE, SCHED_NEVER);
}

void psd1_flags(struct psd1 *b, bool int0, bool fl1, int64_t t_ns)
{
    if (b->phase == PSD1_OFF) return;
    b->int0 = int0;
    b->fl1 = fl1;
    psd1_put(b, PSD1_BIT(INT0) | PSD1_BIT(FL1), (int0 ? PSD1_BIT(INT0) : 0) | (fl1 ? 0 : PSD1_BIT(FL1)), t_ns);
    psd1_recheck_start(b, t_ns);
}
