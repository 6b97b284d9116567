/* A step of a Kalman filter, prediction and three measurements, of 45 states of which six move: the library in both forms beside
 * dense Joseph formulas in Eigen, vectorised. Each prints CASE steps=N ns=T; all end with the same covariance, or the exit is 3. */
#include "nav/kf.h"

#include <Eigen/Dense>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

static const int N = 45, MOVING = 6, M = 3, TURNS = 16;
using square = Eigen::Matrix<double, N, N, Eigen::RowMajor>;
using rows = Eigen::Matrix<double, M, N, Eigen::RowMajor>;

/* Numbers of -0.5 to 0.5, the same each time. */
static double draw(unsigned *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return *seed / 4294967296.0 - 0.5;
}

struct problem {
    square phi, q, p;
    rows h[TURNS];
};

/* Zeros where the calibration's model has them (nav/sins/sins_step.cpp): angles 0-2 turn by themselves, by drifts 3-8 and
 * Theta 9-17; parts of drifts 3-5 decay; an accelerometer has an angle at most, its errors 18-20, six of Gamma, nine arms,
 * three quadratic terms and the delay, up to 39; the stand's 40-44 are not in these measurements. */
static void keep_pattern(struct problem *w)
{
    w->phi.block(0, 18, MOVING, N - 18).setZero();
    w->phi.block(3, 0, 3, N).setZero();
    for (int i = 3; i < MOVING; i++) w->phi(i, i) = 0.999;
    for (rows &h : w->h) {
        for (int i = 0; i < M; i++)
            for (int k = 0; k < 18; k++) h(i, k) *= i < 2 && k == 1 - i;
        h.rightCols(5).setZero();
    }
}

static void make(struct problem *w, bool full)
{
    unsigned seed = 1;
    w->phi.setIdentity();
    w->q.setZero();
    w->p.setIdentity();
    for (int i = 0; i < MOVING; i++) {
        w->q(i, i) = 1e-6;
        w->phi(i, i) = 0.999;
        for (int j = 0; j < N; j++) w->phi(i, j) += 0.01 * draw(&seed);
    }
    for (rows &h : w->h) h = rows::NullaryExpr([&seed]() { return draw(&seed); });
    if (!full) keep_pattern(w);
}

static const double R[M] = {0.01, 0.01, 0.01}, Z[M] = {0.1, -0.2, 0.3};

static void library_steps(const struct problem *w, int form, long steps, double *p)
{
    static double h[TURNS][M * N], phi[MOVING * N], q[MOVING * MOVING];
    void *memory = malloc(nav_kf_bytes());
    nav_kf *kf = nullptr;
    if (nav_kf_start(memory, nav_kf_bytes(), N, MOVING, form, &kf) != NAV_OK) exit(3);
    for (int k = 0; k < TURNS; k++) memcpy(h[k], w->h[k].data(), sizeof h[k]);
    memcpy(phi, w->phi.data(), sizeof phi);
    for (int i = 0; i < MOVING * MOVING; i++) q[i] = w->q(i / MOVING, i % MOVING);
    int status = nav_kf_set(kf, nullptr, w->p.data());
    for (long k = 0; k < steps && status == NAV_OK; k++) {
        status = nav_kf_predict(kf, phi, q);
        if (status == NAV_OK) status = nav_kf_update(kf, h[k % TURNS], Z, R, M, nullptr);
    }
    if (status != NAV_OK || nav_kf_get(kf, nullptr, p) != NAV_OK) exit(3);
    free(memory);
}

static void joseph(const struct problem *w, long steps, double *p)
{
    library_steps(w, NAV_KF_JOSEPH, steps, p);
}

static void ud(const struct problem *w, long steps, double *p)
{
    library_steps(w, NAV_KF_UD, steps, p);
}

static void dense(const struct problem *w, long steps, double *out)
{
    square p = w->p, left, tmp;
    Eigen::Matrix<double, N, 1> x = Eigen::Matrix<double, N, 1>::Zero();
    const Eigen::Matrix3d r = Eigen::Vector3d(R[0], R[1], R[2]).asDiagonal();
    for (long k = 0; k < steps; k++) {
        const rows &h = w->h[k % TURNS];
        x = w->phi * x;
        tmp.noalias() = w->phi * p;
        p.noalias() = tmp * w->phi.transpose();
        p += w->q;
        const Eigen::Matrix<double, N, M> ph = p * h.transpose();
        const Eigen::Matrix3d s = h * ph + r;
        const Eigen::Matrix<double, N, M> gain = ph * s.inverse();
        x += gain * (Eigen::Vector3d(Z[0], Z[1], Z[2]) - h * x);
        left.setIdentity();
        left.noalias() -= gain * h;
        tmp.noalias() = left * p;
        p.noalias() = tmp * left.transpose();
        p += gain * r * gain.transpose();
    }
    memcpy(out, p.data(), sizeof p);
}

static const struct kf_case {
    const char *name;
    void (*run)(const struct problem *w, long steps, double *p);
    bool full; /* no zeros */
} cases[] = {{"kf-joseph", joseph, false},
             {"kf-joseph-full", joseph, true},
             {"kf-ud", ud, false},
             {"kf-ud-full", ud, true},
             {"kf-dense", dense, false}};

static long long clock_ns()
{
    struct timespec t;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static struct problem w;
static square found, want;

static int run_case(const struct kf_case *c, long steps)
{
    make(&w, c->full);
    dense(&w, 50, want.data());
    c->run(&w, 50, found.data());
    if ((found - want).cwiseAbs().maxCoeff() > 1e-9 * want.cwiseAbs().maxCoeff()) return 3;
    const long long t0_ns = clock_ns();
    c->run(&w, steps, found.data());
    printf("%s steps=%ld ns=%lld\n", c->name, steps, clock_ns() - t0_ns);
    return std::isfinite(found.sum()) ? 0 : 3;
}

int main(int argc, char **argv)
{
    const long steps = argc > 2 ? atol(argv[2]) : 1000;
    for (const struct kf_case &c : cases)
        if (argc > 1 && strcmp(argv[1], c.name) == 0) return run_case(&c, steps);
    (void)fprintf(stderr, "usage: bench_kf CASE [STEPS]; cases:");
    for (const struct kf_case &c : cases) (void)fprintf(stderr, " %s", c.name);
    (void)fprintf(stderr, "\n");
    return 2;
}
