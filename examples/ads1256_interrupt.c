/* A driver whose interrupt handler reads the converter: DRDY falls, the handler exchanges bytes, the program does something
 * else. The shim is this file: attach_interrupt(), transfer(), delay_us() are what a board's support package has. */
#include <psabench.h>
#include <setjmp.h>
#include <stdio.h>

static psabench *bench;
static psabench_part *adc;
static jmp_buf out;

/* ---- the shim ---- */

static void transfer(const uint8_t *tx, uint8_t *rx, size_t n)
{
    psabench_spi(adc, tx, rx, n);
}

static void delay_us(int us)
{
    psabench_run_for(bench, us * 1000);
}

static void too_late(void *ctx, psabench *b)
{
    (void)ctx;
    printf("%s\n", psabench_error_text(b));
    longjmp(out, 1);
}

/* ---- the driver ---- */

static volatile int words;
static volatile double volts;

static void on_drdy(void *ctx, psabench_part *p, int pin)
{
    const uint8_t rdata = 0x01;
    uint8_t b[3];
    (void)ctx, (void)p, (void)pin;
    transfer(&rdata, NULL, 1);
    delay_us(7); /* t6 */
    transfer(NULL, b, 3);
    volts = ((b[0] << 24 | b[1] << 16 | b[2] << 8) >> 8) * 5.0 / 8388608.0;
    words++;
}

static void set_rate(uint8_t drate)
{
    const uint8_t wreg[] = {0x53, 0, drate};
    const uint8_t selfcal = 0xF0;
    const int was = psabench_mask(bench, 1); /* noInterrupts() */
    transfer(wreg, NULL, sizeof wreg);
    delay_us(1); /* t11 */
    transfer(&selfcal, NULL, 1);
    psabench_run_until_edge(adc, psabench_pin(adc, "DRDY"), PSABENCH_FALLING, 1000000000);
    psabench_mask(bench, was); /* interrupts() */
}

int main(void)
{
    bench = psabench_new(1);
    adc = psabench_part_new(bench, "ads1256", "adc", "vref_v=2.5 sclk_hz=1900000");
    psabench_set_volts(adc, 0, 1.25);
    const int drdy = psabench_pin(adc, "DRDY");
    psabench_run_until_level(adc, drdy, 0, 1000000000);
    psabench_set(adc, psabench_pin(adc, "CS"), 0);
    set_rate(0xA1); /* 1000 SPS */
    psabench_on_interrupt(adc, drdy, PSABENCH_FALLING, on_drdy, NULL);
    delay_us(10500);
    printf("%d words in 10.5 ms, the latest %.4f V\n", words, volts);
    printf("%s\n", psabench_check(adc) ? psabench_error_text(bench) : "no violations");

    psabench_deadline(bench, psabench_now_ns(bench) + 50000000, too_late, NULL);
    psabench_set(adc, psabench_pin(adc, "SYNC"), 0); /* a mistake: the converter stops */
    if (!setjmp(out))
        while (words < 100) delay_us(10);
    printf("%lld conversions\n", (long long)psabench_count(adc, "conversions"));
    psabench_free(bench);
}
