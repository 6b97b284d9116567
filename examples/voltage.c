#include <psabench.h>
#include <stdio.h>

int main(void)
{
    psabench *bench = psabench_new(1);
    psabench_part *adc = psabench_part_new(bench, "ads1256", "adc", "vref_v=2.5");
    const uint8_t rdata = 0x01;
    uint8_t b[3];

    psabench_set_volts(adc, 0, 1.25);                                        /* AIN0 */
    psabench_run_until_level(adc, psabench_pin(adc, "DRDY"), 0, 1000000000); /* calibrated after power-up */
    psabench_set(adc, psabench_pin(adc, "CS"), 0);
    psabench_spi(adc, &rdata, NULL, 1);
    psabench_run_for(bench, 7000); /* t6 */
    psabench_spi(adc, NULL, b, 3);
    printf("%.6f V\n", ((b[0] << 24 | b[1] << 16 | b[2] << 8) >> 8) * 5.0 / 8388608.0);
    psabench_free(bench);
}
