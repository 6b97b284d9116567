/* An ADS1282 read as it wants to be: RDATAC, an interrupt at each fall of DRDY, four bytes. The input is a ramp.
 *
 *     cc examples/ads1282_read.c $(pkg-config --cflags --libs psabench) -o ads1282_read && ./ads1282_read */
#include <psabench.h>

#include <stdint.h>
#include <stdio.h>

enum { SDATAC = 0x11, RDATAC = 0x10, WREG = 0x40, CONFIG0 = 1 };
enum { GAP_NS = 6000 /* 24 clocks of 4.096 MHz between the bytes of commands */ };

/* Asked at the instants at which the converter samples; 1 V a second. */
static double ramp(void *ctx, psabench_part *p, int input, int64_t t_ns)
{
    (void)ctx;
    (void)p;
    return input == 0 ? 1e-9 * (double)t_ns : 0.0;
}

/* The interrupt: it must not read here (time stands still in a callback), but it says that there is something to read. */
static void on_drdy(void *ctx, psabench_part *p, int pin, int level, int64_t t_ns)
{
    (void)p;
    (void)pin;
    if (!level) *(int64_t *)ctx = t_ns;
}

int main(void)
{
    psabench *bench = psabench_new(1);
    psabench_part *adc = psabench_part_new(bench, "ads1282", "adc", "vref_v=5 noise_scale=0 power_up_tclk=0");
    if (!adc) return fprintf(stderr, "%s\n", psabench_error_text(bench)), 1;
    const uint8_t setup[] = {SDATAC, WREG | CONFIG0, 0, 0x56, RDATAC}; /* 1000 words a second, minimum phase */
    int64_t drdy_ns = 0;

    psabench_set_input(adc, ramp, NULL);
    psabench_run_for(bench, 1000000);
    psabench_spi_clock(adc, 1024000, GAP_NS);
    psabench_spi(adc, setup, NULL, sizeof setup);
    psabench_spi_clock(adc, 1024000, 0);
    psabench_watch(adc, psabench_pin(adc, "DRDY"), on_drdy, &drdy_ns);

    for (int words = 0; words < 4;) {
        psabench_run_until(bench, psabench_next_ns(bench)); /* the program would sleep until the interrupt */
        if (!drdy_ns) continue;
        uint8_t b[4];
        psabench_spi(adc, NULL, b, sizeof b);
        const uint32_t word = (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
        const double volts = 2.5 * (double)(int32_t)word / 2147483648.0;
        printf("DRDY at %.6f s: %08X, %.6f V, the input %.3f ms ago\n", 1e-9 * (double)drdy_ns, (unsigned)word, volts,
               1e-6 * (double)drdy_ns - 1e3 * volts);
        drdy_ns = 0;
        words++;
    }
    psabench_free(bench);
    return 0;
}
