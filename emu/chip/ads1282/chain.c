#include "chip/ads1282/internal.h"

#include "base/bits.h"
#include "chip/ads1282/input.h"

#include <math.h>
#include <string.h>

/* Input samples to results. Each chain is one function that takes samples up to an instant, called through a->sample: the
 * mode is chosen when it is configured, not looked at for each sample. */

/* Latency of the arithmetic behind the last sample of a word: what is left of t_DR (sources 1.6). E0. */
#define FIR_LATENCY_TCLK  468
#define SINC_LATENCY_TCLK 264
#define SINC_LAG          4 /* a word of the sinc needs five blocks */
#define MCLK_TCLK         4 /* a clock of the modulator */

#define DRAW_SD 37837.227475000000 /* of the sum of four uniform 16-bit numbers: sqrt((2^32 - 1) / 3) */

unsigned ads1282_sinc_ratio(const struct ads1282 *a)
{
    return 128u >> (ads1282_rate(a) <= 4 ? ads1282_rate(a) : 2);
}

bool ads1282_sinc_only(const struct ads1282 *a)
{
    return (a->config0 & ADS1282_CONFIG0_FILTR) == 1;
}

bool ads1282_bits_only(const struct ads1282 *a)
{
    return (a->config0 & ADS1282_CONFIG0_FILTR) == 0;
}

static enum ads1282_chain chain_in_force(const struct ads1282 *a)
{
    return a->recording.bits ? ADS1282_CHAIN_MODULATOR : a->cfg.chain;
}

static bool bit_true(const struct ads1282 *a)
{
    return chain_in_force(a) == ADS1282_CHAIN_MODULATOR || ads1282_bits_only(a);
}

/* Samples are those of the modulator's clock, not of sinc blocks or data periods. */
static bool at_modulator_rate(const struct ads1282 *a)
{
    return bit_true(a) || (ads1282_sinc_only(a) && chain_in_force(a) == ADS1282_CHAIN_EXACT);
}

/* ---- Input ---- */

static int64_t saturate_input(struct ads1282 *a, double x)
{
    return a->last_lsb = ads1282_saturate_lsb(x);
}

/* From the supplies to the limits of an input: those of the gain stage (M85), and of the ADS1281 without it (M80). */
static const struct ads1282_range input_range[] = {
    [ADS1282_PART_1281] = {-0.1, 0.1}, [ADS1282_PART_1282] = {0.7, -1.25}};

struct ads1282_range ads1282_input_range(const struct ads1282 *a)
{
    const struct ads1282_range *r = &input_range[a->cfg.part];
    return (struct ads1282_range){a->cfg.avss_v + r->min_v, a->cfg.avdd_v + r->max_v};
}

static void pins_row_v(const struct ads1282 *a, const int64_t *t_ns, unsigned n, double *vin_v)
{
    if (a->io.vin_row_v) {
        a->io.vin_row_v(a->io.ctx, a->mux, &(struct looks){t_ns, n, a->step.ns}, vin_v);
        return;
    }
    for (unsigned i = 0; i < n; i++) vin_v[i] = a->io.vin_v(a->io.ctx, a->mux, t_ns[i]);
}

static void input_row_v(struct ads1282 *a, const int64_t *t_ns, unsigned n, double *vin_v)
{
    if (a->mux == 2 || a->mux > 4) { /* shorted inside */
        for (unsigned i = 0; i < n; i++) vin_v[i] = 0.0;
        return;
    }
    pins_row_v(a, t_ns, n, vin_v);
    if (a->cfg.common_mode_v != 0.0)
        a->count.range_exceeded += ads1282_limit_row(ads1282_input_range(a), a->cfg.common_mode_v, vin_v, n);
}

static double input_v(struct ads1282 *a)
{
    double v;
    input_row_v(a, &a->next.t_ns, 1, &v);
    return v;
}

/* The samples of one step's grid count from CLK edge 0: the noise of a sample is that of its instant, whatever went before.
 * Each step has draws of its own, else a slower rate would use numbers again. */
static int64_t draw_number(const struct ads1282 *a, int64_t edge)
{
    return edge / a->step.k;
}

static struct draws step_draws(const struct ads1282 *a)
{
    return (struct draws){a->noise.key, a->noise.high + (uint64_t)a->step.k};
}

static int64_t noisy_input(struct ads1282 *a)
{
    double x = input_v(a) * a->lsb_per_v;
    const struct draws noise = step_draws(a);
    if (a->noise_lsb > 0.0) x += a->noise_lsb * ads1282_sum_draw(draws_u64(&noise, draw_number(a, a->next.k)));
    return saturate_input(a, x);
}

/* To the next sample. */
static void next_sample(struct ads1282 *a)
{
    a->index++;
    a->next = clk_on(a->next, &a->step);
}

/* ---- Ideal modulator, sinc by held blocks ---- */

/* As noisy_input(), for n samples from CLK edge `edge` on whose volts are known. */
static void modulate_block(struct ads1282 *a, int64_t edge, const double *vin_v, unsigned n, int64_t *lsb)
{
    uint64_t u[ADS1282_BLOCKS];
    const bool noisy = a->noise_lsb > 0.0;
    const struct draws noise = step_draws(a);
    if (noisy) draws_row(&noise, draw_number(a, edge), n, u);
    ads1282_input_row((struct ads1282_scale){a->lsb_per_v, a->noise_lsb}, vin_v, noisy ? u : NULL, n, lsb);
    a->last_lsb = lsb[n - 1];
}

/* n instants from next on; the one after them. */
static inline struct clk_pos even_times(struct clk_pos next, const struct clk_step *step, unsigned n, int64_t *t_ns)
{
    const int64_t step_ns = step->ns;
    int64_t at_ns = next.t_ns;
#pragma GCC unroll 8
    for (unsigned i = 0; i < n; i++, at_ns += step_ns) t_ns[i] = at_ns;
    return (struct clk_pos){next.k + n * step->k, at_ns, next.rest};
}

static inline struct clk_pos uneven_times(struct clk_pos next, const struct clk_step *by, unsigned n, int64_t *t_ns)
{
    const struct clk_step step = *by;
    int64_t at_ns = next.t_ns, left = next.rest - step.hz; /* below 0 */
#pragma GCC unroll 4
    for (unsigned i = 0; i < n; i++) {
        t_ns[i] = at_ns;
        at_ns += step.ns;
        left += step.rest;
        if (left < 0) continue;
        left -= step.hz;
        at_ns++;
    }
    return (struct clk_pos){next.k + n * step.k, at_ns, left + step.hz};
}

/* The instants of the next samples up to until_ns, at most n; returns how many, which need not yet be all. The next one is
 * due. How many surely are follows from the longest that a step may take: none needs to be looked at. */
static unsigned sample_times(struct ads1282 *a, int64_t until_ns, unsigned n, int64_t *t_ns)
{
    const bool uneven = a->step.rest > 0;
    const int64_t due = (until_ns - a->next.t_ns) / (a->step.ns + uneven) + 1;
    if (due < n) n = (unsigned)due;
    a->next = uneven ? uneven_times(a->next, &a->step, n, t_ns) : even_times(a->next, &a->step, n, t_ns);
    a->index += n;
    return n;
}

/* Blocks up to the end of their data period at a time. */
static void sample_fir(struct ads1282 *a, int64_t until_ns)
{
    while (a->next.t_ns <= until_ns) {
        const unsigned slot = (unsigned)(a->index % ADS1282_BLOCKS);
        const unsigned period = (unsigned)(a->index / ADS1282_BLOCKS);
        int64_t t_ns[ADS1282_BLOCKS];
        double vin_v[ADS1282_BLOCKS];
        const int64_t edge = a->next.k;
        const unsigned n = sample_times(a, until_ns, ADS1282_BLOCKS - slot, t_ns);
        input_row_v(a, t_ns, n, vin_v);
        modulate_block(a, edge, vin_v, n, a->sinc + slot);
        if (slot + n == ADS1282_BLOCKS)
            a->result[period % ADS1282_RESULTS] = ads1282_filter_period(&a->filter, a->sinc);
    }
}

/* The sinc alone passes what a held block would lose: each clock of the modulator is sampled. N^5 times full scale needs
 * up to 70 bits: the sample is taken in two parts. */
static void sample_sinc(struct ads1282 *a, int64_t until_ns)
{
    enum { LOW = 14 };
    const unsigned shift = 5 * bits_log2(a->cic.ratio) + 4 - LOW; /* word of full scale 2^30 */
    while (a->next.t_ns <= until_ns) {
        int64_t high, low;
        const int64_t x = noisy_input(a);
        const int64_t x_high = bits_round_shift(x, LOW);
        next_sample(a);
        (void)ads1282_cic_take(&a->cic_low, x - x_high * (1 << LOW), &low);
        if (!ads1282_cic_take(&a->cic, x_high, &high)) continue;
        const unsigned k = (unsigned)a->block++;
        a->result[k % ADS1282_RESULTS] = bits_round_shift(high + bits_round_shift(low, LOW), shift);
    }
}

/* ---- Bit-true modulator ---- */

/* Sinc output of gain N^5, in bits of which 4/5 are full scale, to full scale 2^34. */
static int64_t sinc_lsb(int64_t y, unsigned ratio)
{
    const unsigned gain_log2 = 5 * bits_log2(ratio);
    return gain_log2 > 32 ? bits_round_shift(5 * y, gain_log2 - 32) : 5 * y * (INT64_C(1) << (32 - gain_log2));
}

static void take_sinc(struct ads1282 *a, int64_t lsb)
{
    const unsigned k = (unsigned)a->block++;
    if (ads1282_sinc_only(a)) {
        a->result[k % ADS1282_RESULTS] = bits_round_shift(lsb, 4);
        return;
    }
    a->sinc[k % ADS1282_BLOCKS] = lsb;
    if (k % ADS1282_BLOCKS == ADS1282_BLOCKS - 1)
        a->result[k / ADS1282_BLOCKS % ADS1282_RESULTS] = ads1282_filter_fir(&a->filter, a->sinc);
}

/* Of n clocks from CLK edge `edge` on. Past the recording's end M0 and M1 alternate: zero. */
static void read_recording(struct ads1282 *a, int64_t edge, unsigned n, uint8_t *bits)
{
    struct ads1282_recording *r = &a->recording;
    if (r->edge < 0) r->edge = edge;
    int64_t clock = (edge - r->edge) / MCLK_TCLK;
    for (unsigned i = 0; i < n; i++, clock++) {
        const bool known = clock < r->count;
        bits[i] = known ? r->bits[clock] : clock & 1 ? 3 : 0;
        a->count.bits_missing += !known;
    }
}

static void clock_modulator(struct ads1282 *a)
{
    uint8_t bits;
    if (a->recording.bits) {
        read_recording(a, a->next.k, 1, &bits);
        ads1282_mod_take(&a->mod, bits);
    } else {
        ads1282_mod_step(&a->mod, noisy_input(a));
    }
    next_sample(a);
}

/* Before the first decoded clock, and it is not yet one. */
static bool fill_delay(struct ads1282 *a)
{
    if (a->index >= ADS1282_MOD_DELAY) return false;
    clock_modulator(a);
    if (a->index == ADS1282_MOD_DELAY && !a->recording.one_bit) ads1282_mod_start(&a->mod, &a->cic);
    return true;
}

/* n clocks from CLK edge `edge` on, at t_ns. */
static void run_modulator(struct ads1282 *a, int64_t edge, const int64_t *t_ns, unsigned n)
{
    int64_t lsb[ADS1282_MOD_RUN];
    double vin_v[ADS1282_MOD_RUN];
    input_row_v(a, t_ns, n, vin_v);
    modulate_block(a, edge, vin_v, n, lsb);
    ads1282_mod_run(&a->mod, &a->cic, lsb, n);
}

static void play_recording(struct ads1282 *a, int64_t edge, unsigned n)
{
    uint8_t bits[ADS1282_MOD_RUN];
    read_recording(a, edge, n, bits);
    ads1282_mod_play(&a->mod, &a->cic, bits, n, a->recording.one_bit);
}

/* Samples up to the end of their sinc block, or as many as a run takes. */
static void sample_bit_true(struct ads1282 *a, int64_t until_ns)
{
    while (a->next.t_ns <= until_ns) {
        int64_t t_ns[ADS1282_MOD_RUN], y;
        if (fill_delay(a)) continue;
        const int64_t edge = a->next.k;
        const unsigned left = a->cic.ratio - a->cic.n;
        const unsigned n = sample_times(a, until_ns, left < ADS1282_MOD_RUN ? left : ADS1282_MOD_RUN, t_ns);
        if (a->recording.bits) play_recording(a, edge, n);
        else run_modulator(a, edge, t_ns, n);
        if (ads1282_cic_output(&a->cic, &y)) take_sinc(a, sinc_lsb(y, a->cic.ratio));
    }
}

static void sample_bits(struct ads1282 *a, int64_t until_ns)
{
    while (a->next.t_ns <= until_ns) {
        const int64_t t_ns = a->next.t_ns;
        clock_modulator(a);
        if (a->io.modulator) a->io.modulator(a->io.ctx, a->mod.m0 & 1, a->mod.m1 & 1, t_ns);
    }
}

/* No one looks at the bits. */
static void sample_nothing(struct ads1282 *a, int64_t until_ns)
{
    (void)a;
    (void)until_ns;
}

/* ---- No chain ---- */

struct fir_dc {
    double gain, delay; /* delay in blocks */
};

static struct fir_dc fir_dc(enum ads1282_phase phase)
{
    struct fir_dc dc = {1.0, 0.0};
    double step = 1.0;
    for (int s = 0; s < ADS1282_FIR_STAGES; s++) {
        const struct ads1282_fir *fir = &ads1282_fir[phase][s];
        double sum = 0.0;
        double moment = 0.0;
        for (unsigned i = 0; i < fir->taps; i++) {
            sum += fir->tap[i];
            moment += (double)i * fir->tap[i];
        }
        dc.gain *= ldexp(sum, -(int)fir->scale_log2);
        dc.delay += step * moment / sum;
        step *= fir->decim;
    }
    return dc;
}

/* Group delay at DC from the input to DRDY: the sinc's 5(N - 1)/2 + 1/2 clocks of the modulator, the FIR's, and latency. */
static int64_t direct_delay_tclk(const struct ads1282 *a)
{
    const int64_t n = ads1282_sinc_ratio(a);
    const int64_t sinc = 10 * n - 8;
    if (ads1282_sinc_only(a)) return sinc + SINC_LATENCY_TCLK;
    return sinc + FIR_LATENCY_TCLK + (int64_t)(4.0 * (double)n * fir_dc(a->filter.phase).delay + 0.5);
}

int64_t ads1282_delay_ns(const struct ads1282 *a)
{
    return clk_span_ns(a->clk.hz, direct_delay_tclk(a));
}

double ads1282_dc_gain(const struct ads1282 *a)
{
    return ads1282_sinc_only(a) ? 1.0 : fir_dc(a->filter.phase).gain;
}

static void sample_direct(struct ads1282 *a, int64_t until_ns)
{
    const struct draws noise = step_draws(a);
    while (a->next.t_ns <= until_ns) {
        const unsigned k = (unsigned)a->index;
        double y = (double)saturate_input(a, input_v(a) * a->lsb_per_v) * a->direct_gain;
        if (a->noise_lsb > 0.0) y += a->noise_lsb * draws_gauss(&noise, draw_number(a, a->next.k));
        a->result[k % ADS1282_RESULTS] = (int64_t)(y + 0x1p36 + 0.5) - (INT64_C(1) << 36);
        next_sample(a);
    }
}

/* ---- Choice ---- */

/* Middle of block 0. FIR: block 1 begins 1.5 N tCLK after the restart; block 0, which the restart cuts short, counts as
 * taken with value 0. Sinc: five blocks and the latency end with the first word. Both E0. */
static int64_t block_origin_tclk(const struct ads1282 *a)
{
    const int64_t n = ads1282_sinc_ratio(a);
    return ads1282_sinc_only(a) ? a->timing.first_tclk - SINC_LATENCY_TCLK - 18 * n : -n / 2;
}

static void time_samples(struct ads1282 *a)
{
    struct ads1282_timing *t = &a->timing;
    const int64_t n = ads1282_sinc_ratio(a);
    t->step_tclk = 4 * n;
    t->origin_tclk = block_origin_tclk(a);
    if (at_modulator_rate(a)) {
        t->step_tclk = MCLK_TCLK;
        t->origin_tclk += ads1282_sinc_only(a) ? 2 - 2 * n : 2 + 2 * n; /* the first clock of block 0, or of block 1 */
        if (ads1282_bits_only(a)) t->origin_tclk = 4;
    } else if (chain_in_force(a) == ADS1282_CHAIN_DIRECT) {
        t->step_tclk = t->period_tclk;
        t->origin_tclk = t->first_tclk - direct_delay_tclk(a);
    }
}

typedef void sample_fn(struct ads1282 *a, int64_t t_ns);

static sample_fn *chain_of(const struct ads1282 *a)
{
    if (!a->running) return sample_nothing;
    if (ads1282_bits_only(a)) return a->io.modulator || a->io.mflag ? sample_bits : sample_nothing;
    if (bit_true(a)) return sample_bit_true;
    if (chain_in_force(a) == ADS1282_CHAIN_DIRECT) return sample_direct;
    return ads1282_sinc_only(a) ? sample_sinc : sample_fir;
}

/* What its results depend on: 1971 blocks at most (filter.h), and the volts before them. */
bool ads1282_chain_forgets(const struct ads1282 *a)
{
    return a->running && chain_of(a) == sample_fir;
}

void ads1282_put_off(struct ads1282 *a)
{
    a->sample = sample_nothing;
    memset(a->result, 0, sizeof a->result);
}

void ads1282_chain_resume(struct ads1282 *a, int64_t index)
{
    a->sample = chain_of(a);
    ads1282_filter_clear(&a->filter);
    memset(a->sinc, 0, sizeof a->sinc);
    a->index = index;
    a->next = clk_pos(&a->clk, a->sync_count + a->timing.origin_tclk + index * a->timing.step_tclk);
}

void ads1282_chain_configure(struct ads1282 *a)
{
    a->sample = chain_of(a);
    if (!a->running) return;
    const bool minimum = a->config0 & ADS1282_CONFIG0_PHASE;
    ads1282_filter_init(&a->filter, ads1282_sinc_ratio(a), minimum ? ADS1282_MINIMUM : ADS1282_LINEAR);
    time_samples(a);
    a->lag = ads1282_sinc_only(a) && chain_in_force(a) != ADS1282_CHAIN_DIRECT ? SINC_LAG : 0;
    a->direct_gain = (ads1282_sinc_only(a) ? 1.0 : fir_dc(a->filter.phase).gain) / 16.0;
}

/* n over 9. */
static double binomial9(double n)
{
    double c = 1.0;
    for (int i = 0; i < 9; i++) c *= (n - i) / (9 - i);
    return c;
}

/* Root of the sum of squares of the sinc's impulse response of DC gain 1, times sqrt(N). The sum is the middle coefficient
 * of the tenth power of 1 + z + .. + z^(N-1). */
static double sinc_noise_gain(double n)
{
    static const double choose10[5] = {1, -10, 45, -120, 210};
    double sum = 0.0;
    for (int j = 0; j < 5; j++)
        if (5 * (n - 1) - j * n >= 0) sum += choose10[j] * binomial9(5 * (n - 1) - j * n + 9);
    return sqrt(sum / (n * n * n * n * n * n * n * n * n));
}

/* From the rms that the published figure means behind the FIR, in LSB of 2^-34 full scale, to that of one draw: the noise
 * is white, so a modulator clock has sqrt(N) times that of a block. */
double ads1282_chain_noise_lsb(const struct ads1282 *a, double output_lsb)
{
    const double block_lsb = output_lsb / ads1282_filter_noise_gain(&a->filter);
    const double n = a->filter.sinc_ratio;
    if (at_modulator_rate(a)) return block_lsb / DRAW_SD * sqrt(n);
    if (chain_in_force(a) != ADS1282_CHAIN_DIRECT) return block_lsb / DRAW_SD;
    return (ads1282_sinc_only(a) ? block_lsb * sinc_noise_gain(n) : output_lsb) / 16.0;
}

/* ---- Restart ---- */

/* The first input sample: none before the restart. */
static int64_t first_index(const struct ads1282 *a)
{
    if (a->sample == sample_fir) return 1;
    const struct ads1282_timing *t = &a->timing;
    return t->origin_tclk < 0 ? (-t->origin_tclk + t->step_tclk - 1) / t->step_tclk : 0;
}

void ads1282_chain_restart(struct ads1282 *a)
{
    ads1282_filter_clear(&a->filter);
    ads1282_mod_clear(&a->mod);
    ads1282_cic_init(&a->cic, ads1282_sinc_ratio(a));
    a->cic_low = a->cic;
    memset(a->sinc, 0, sizeof a->sinc);
    memset(a->result, 0, sizeof a->result);
    const struct ads1282_timing *t = &a->timing;
    a->index = first_index(a);
    a->block = !ads1282_sinc_only(a);
    a->next = clk_pos(&a->clk, a->sync_count + t->origin_tclk + a->index * t->step_tclk);
    a->step = clk_step(&a->clk, t->step_tclk);
}
