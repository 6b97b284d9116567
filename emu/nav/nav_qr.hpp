/* Least squares by Householder QR with pivoting. The last step is by hand: Eigen's triangular solver may allocate, and then asks for
 * C++'s runtime. */
#ifndef PSABENCH_NAV_QR_HPP
#define PSABENCH_NAV_QR_HPP

#include <Eigen/Dense>

/* x of the least squares of rows x = b; qr has full rank. */
template <typename Rows, typename Unknowns, typename Right>
Unknowns nav_qr_solve(const Eigen::ColPivHouseholderQR<Rows> &qr, const Right &b)
{
    const Eigen::Index n = qr.cols();
    Right c = b;
    c.applyOnTheLeft(qr.householderQ().setLength(n).adjoint());
    Unknowns x(n);
    for (Eigen::Index i = n - 1; i >= 0; i--) {
        double left = c(i);
        for (Eigen::Index j = i + 1; j < n; j++) left -= qr.matrixQR()(i, j) * x(qr.colsPermutation().indices()(j));
        x(qr.colsPermutation().indices()(i)) = left / qr.matrixQR()(i, i);
    }
    return x;
}

#endif
