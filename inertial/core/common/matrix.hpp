// Matrices of the filters, and products whose bits do not depend on the processor.
//
// Eigen keeps the matrices and writes the formulas. Three rules make every build give the same bits:
// no contraction to fused multiply-add (-ffp-contract=off), no vector code of Eigen's own
// (EIGEN_DONT_VECTORIZE: the compiler vectorises what it may, and it may not reorder a sum), and no
// product or factorisation of Eigen's that splits its inner sum by cache size. Where an inner sum is
// long, the functions below keep its order: term 0 first.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace gyrofree {

template <int Rows, int Columns = Rows>
using Matrix = Eigen::Matrix<double, Rows, Columns>;
template <int Rows>
using Vector = Eigen::Matrix<double, Rows, 1>;
using Matrix3 = Matrix<3>;
using Vector3 = Vector<3>;

// Sizes that are known at run time only, up to a most: no heap.
template <int MostRows, int MostColumns = MostRows>
using UpTo = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, MostRows, MostColumns>;
template <int Most>
using VectorUpTo = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, Most, 1>;

// C = A B, the inner sum from term 0 on.
template <typename A, typename B>
auto product(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  using Result = Eigen::Matrix<double, A::RowsAtCompileTime, B::ColsAtCompileTime, Eigen::ColMajor,
                               A::MaxRowsAtCompileTime, B::MaxColsAtCompileTime>;
  Result c(a.rows(), b.cols());
  for (Eigen::Index j = 0; j < b.cols(); ++j) {
    c.col(j) = a.col(0) * b(0, j);
    for (Eigen::Index k = 1; k < a.cols(); ++k) c.col(j) += a.col(k) * b(k, j);
  }
  return c;
}

// C = A B^T, the inner sum from term 0 on.
template <typename A, typename B>
auto product_transposed(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  using Result = Eigen::Matrix<double, A::RowsAtCompileTime, B::RowsAtCompileTime, Eigen::ColMajor,
                               A::MaxRowsAtCompileTime, B::MaxRowsAtCompileTime>;
  Result c(a.rows(), b.rows());
  for (Eigen::Index j = 0; j < b.rows(); ++j) {
    c.col(j) = a.col(0) * b(j, 0);
    for (Eigen::Index k = 1; k < a.cols(); ++k) c.col(j) += a.col(k) * b(j, k);
  }
  return c;
}

// Sum of a_i b_i, from i = 0 on.
template <typename A, typename B>
double dot(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < a.size(); ++i) sum += a(i) * b(i);
  return sum;
}

template <typename A>
double square_of(const Eigen::MatrixBase<A>& a) {
  return dot(a, a);
}

template <typename A>
double norm_of(const Eigen::MatrixBase<A>& a) {
  return std::sqrt(dot(a, a));
}

// S with S u = v x u.
inline Matrix3 skew(const Vector3& v) {
  Matrix3 s;
  s << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return s;
}

inline Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(), a.x() * b.y() - a.y() * b.x()};
}

inline double square(double x) { return x * x; }

// Makes a square matrix symmetric by the mean of its halves.
template <typename A>
void symmetrise(Eigen::MatrixBase<A>& a) {
  for (Eigen::Index j = 0; j < a.cols(); ++j)
    for (Eigen::Index i = 0; i < j; ++i) a(i, j) = a(j, i) = 0.5 * (a(i, j) + a(j, i));
}

// Lower Cholesky factor L of a symmetric matrix, C = L L^T, column by column; reads the lower half.
template <typename M>
struct Cholesky {
  M L;
  bool positive;  // false: C has no factor, L is of no meaning

  explicit Cholesky(const M& c) : L(M::Zero(c.rows(), c.cols())), positive(true) {
    const Eigen::Index n = c.rows();
    for (Eigen::Index j = 0; j < n; ++j) {
      double pivot = c(j, j);
      for (Eigen::Index k = 0; k < j; ++k) pivot -= L(j, k) * L(j, k);
      if (!(pivot > 0.0)) {  // also for no number
        positive = false;
        return;
      }
      L(j, j) = std::sqrt(pivot);
      for (Eigen::Index i = j + 1; i < n; ++i) {
        double sum = c(i, j);
        for (Eigen::Index k = 0; k < j; ++k) sum -= L(i, k) * L(j, k);
        L(i, j) = sum / L(j, j);
      }
    }
  }

  // L^-1 B, forward substitution; B has as many rows as C.
  template <typename B>
  B whitened(B b) const {
    for (Eigen::Index i = 0; i < L.rows(); ++i) {
      for (Eigen::Index k = 0; k < i; ++k) b.row(i) -= L(i, k) * b.row(k);
      b.row(i) /= L(i, i);
    }
    return b;
  }

  // C^-1 B.
  template <typename B>
  B solved(const B& right) const {
    B b = whitened(right);
    for (Eigen::Index i = L.rows() - 1; i >= 0; --i) {
      for (Eigen::Index k = i + 1; k < L.rows(); ++k) b.row(i) -= L(k, i) * b.row(k);
      b.row(i) /= L(i, i);
    }
    return b;
  }

  double root_of_determinant() const {
    double root = 1.0;
    for (Eigen::Index i = 0; i < L.rows(); ++i) root *= L(i, i);
    return root;
  }
};

}  // namespace gyrofree
