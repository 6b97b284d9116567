/* Least squares by Householder QR with pivoting, compiled once for all: its templates take the compiler ten seconds. */
#ifndef PSABENCH_NAV_QR_HPP
#define PSABENCH_NAV_QR_HPP

#include "nav/nav_fit.hpp"

/* x of the least squares of rows x = b, a column of x for each of b. False: rows has not full rank, pivots below `threshold` of the
 * largest taken for zero. */
bool nav_qr_solve(const fit_design &rows, double threshold, const fit_square &b, fit_gain *x);

#endif
