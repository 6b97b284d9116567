/* An AD7712 on three frame lines, as a microcontroller without SPI drives it: +-10 V at AIN2, 60 Hz, 24 bits,
 * self-calibrated. cc examples/ad7712_read.c $(pkg-config --cflags --libs psabench) -o build/ad7712_read
 * An argument is a VCD file for the pins. */
#include <psabench.h>
#include <stdio.h>
#include <stdlib.h>

static psabench *bench;
static psabench_part *adc;

static void check(int result)
{
    if (result >= 0) return;
    fprintf(stderr, "%s\n", psabench_error_text(bench));
    exit(1);
}

static void set(const char *pin, int level)
{
    check(psabench_set(adc, psabench_pin(adc, pin), level));
}

static void wait_ns(int64_t ns)
{
    check(psabench_run_for(bench, ns));
}

static void await_drdy(int level)
{
    check(psabench_run_until_level(adc, psabench_pin(adc, "DRDY"), level, INT64_C(1000000000)));
}

/* 24 pulses of SCLK in a frame of RFS or TFS; A0 low: the control register. Returns what SDATA said at the rises. */
static unsigned long frame(const char *select, int a0, unsigned long out)
{
    unsigned long in = 0;
    const int sdata = psabench_pin(adc, "SDATA");
    set("A0", a0);
    wait_ns(400);
    set(select, 0);
    for (int i = 23; i >= 0; i--) {
        if (*select == 'T') set("SDATA", (int)(out >> i & 1));
        wait_ns(400);
        set("SCLK", 1);
        in = in << 1 | (unsigned long)psabench_get(adc, sdata);
        wait_ns(400);
        set("SCLK", 0);
    }
    wait_ns(400);
    set(select, 1);
    return in;
}

int main(int argc, char **argv)
{
    static const double volts[] = {-7.5, 0.125, 9.0};
    bench = psabench_new(1);
    if (!bench) return 1;
    adc = psabench_part_new(bench, "ad7712", "adc", "offset_v=0.02 gain_error=-0.01");
    if (!adc) check(-1);
    if (argc > 1) check(psabench_vcd(bench, argv[1]));
    frame("TFS", 0, 0x228146); /* MD 001, CH 1, WL 1, code 326 */
    await_drdy(1);
    await_drdy(0); /* nine output periods later */
    printf("calibrated after %.3f ms\n", (double)psabench_now_ns(bench) / 1e6);
    for (int k = 0; k < 3; k++) {
        check(psabench_set_volts(adc, 2, volts[k]));
        for (int i = 0; i < 4; i++) { /* the filter settles */
            frame("RFS", 1, 0);
            await_drdy(0);
        }
        const unsigned long code = frame("RFS", 1, 0);
        printf("%06lXh: %.4f V\n", code, 10.0 * ((double)code / 8388608.0 - 1.0));
    }
    psabench_free(bench);
    return 0;
}
