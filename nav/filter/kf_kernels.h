/* The two loops that a step of the filter spends its time in, for vectors of 2, 4 or 8 doubles. Each element of a
 * result is summed in the order of the plain loop, without fused operations: the same bytes from all. */
#ifndef PSABENCH_NAV_KF_KERNELS_H
#define PSABENCH_NAV_KF_KERNELS_H

#ifdef __cplusplus
extern "C" {
#endif

/* A row begins at a multiple of KF_LANES doubles, which is one of 64 bytes, and is zero beyond its columns. */
#define KF_LANES       8
#define KF_PADDED(n)   (((n) + KF_LANES - 1) / KF_LANES * KF_LANES)
#define KF_WIDTHS      3
#define KF_ALIGN_BYTES 64

/* Row i of y += sum over k in `at` of a[i a_stride + k] times row k of p. */
struct kf_sum {
    int rows, columns; /* of y; columns: a multiple of KF_LANES */
    int count;
    const int *at;
    const double *a, *p;
    double *y;
    int a_stride, p_stride, y_stride;
};

/* p -= v v', n rows; then y = p h, where there is an h: the next measurement's, while the rows are at hand. */
struct kf_square {
    int n, stride;
    const double *v, *h;
    double *p, *y;
};

struct kf_kernels {
    void (*add_rows)(const struct kf_sum *s);
    void (*subtract_square)(const struct kf_square *s);
};

/* This processor runs kf_kernels[0] to kf_kernels[kf_width()]; the last is the quickest. */
extern const struct kf_kernels kf_kernels[KF_WIDTHS];
int kf_width(void);

#ifdef __cplusplus
}
#endif

#endif
