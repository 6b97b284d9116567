/* A whole PSA-2 board: three sensors, registers through its controller, the frames it sends.
 *
 *     cc examples/psa2_frames.c $(pkg-config --cflags --libs psabench) -o psa2_frames && ./psa2_frames */
#include <psabench.h>

#include <stdint.h>
#include <stdio.h>

static void on_frame(void *ctx, psabench_part *p, const struct psabench_frame *f)
{
    (void)p;
    unsigned *frames = ctx;
    if ((*frames)++ % 100 != 99) return;
    printf("frame %u, sampled at %.3f ms:", (unsigned)f->seq, 1e-6 * (double)f->t_sample_ns);
    for (int i = 0; i < 3; i++) printf(" %c %.5f V", "XYZ"[i], f -> code[i] * 10.0 / 8388608.0);
    printf("\n");
}

int main(void)
{
    psabench *bench = psabench_new(1);
    psabench_part *board = psabench_part_new(bench, "psa2", "board", "profile=article");
    if (!board) return fprintf(stderr, "%s\n", psabench_error_text(bench)), 1;
    unsigned frames = 0;
    const int64_t second_ns = 1000000000;

    psabench_on_frame(board, on_frame, &frames);
    psabench_set_volts(board, 0, 2.5);
    psabench_set_volts(board, 1, -1.0);
    printf("CONFIG0 of X is %02Xh\n", (unsigned)psabench_board_read(board, 0, 1, second_ns)); /* after the set-up */
    printf("set up after %.3f ms\n", 1e-6 * (double)psabench_now_ns(bench));
    psabench_run_until(bench, second_ns / 2);
    printf("%u frames\n", frames);
    psabench_free(bench);
    return 0;
}
