#include "nav/north/nav_fit.hpp"

using qr_of_rows = Eigen::ColPivHouseholderQR<fit_design>;

/* The last step is by hand: Eigen's triangular solver may allocate, and then asks for C++'s runtime. */
static fit_unknowns solve_column(const qr_of_rows &qr, const fit_vector &b)
{
    const Eigen::Index n = qr.cols();
    fit_vector c = b;
    c.applyOnTheLeft(qr.householderQ().setLength(n).adjoint());
    fit_unknowns x(n);
    for (Eigen::Index i = n - 1; i >= 0; i--) {
        double left = c(i);
        for (Eigen::Index j = i + 1; j < n; j++) left -= qr.matrixQR()(i, j) * x(qr.colsPermutation().indices()(j));
        x(qr.colsPermutation().indices()(i)) = left / qr.matrixQR()(i, i);
    }
    return x;
}

bool fit_solve(const fit_design &rows, double threshold, const fit_square &b, fit_gain *x)
{
    qr_of_rows qr(rows);
    qr.setThreshold(threshold);
    if (qr.rank() < rows.cols()) return false;
    x->resize(rows.cols(), b.cols());
    for (Eigen::Index i = 0; i < b.cols(); i++) x->col(i) = solve_column(qr, b.col(i));
    return true;
}
