// Small factorisations by plane rotations (Jacobi): only + - * / and square roots, always in the same
// order, so the same bits on every processor. For constants of layouts, not for inner loops.
#pragma once

#include "common/matrix.hpp"

namespace gyrofree {

// Cosine and sine of the turn that makes two directions of unlike sizes p and q independent, where
// `coupling` is what they share.
struct PlaneRotation {
  double c = 1.0;
  double s = 0.0;

  PlaneRotation(double p, double q, double coupling) {
    const double zeta = (q - p) / (2.0 * coupling);
    const double t = (zeta >= 0.0 ? 1.0 : -1.0) / (std::fabs(zeta) + std::sqrt(1.0 + zeta * zeta));
    c = 1.0 / std::sqrt(1.0 + t * t);
    s = c * t;
  }

  template <typename Columns>
  void turn_columns(Columns& A, Eigen::Index p, Eigen::Index q) const {
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
      const double a = A(i, p), b = A(i, q);
      A(i, p) = c * a - s * b;
      A(i, q) = s * a + c * b;
    }
  }

  template <typename Rows>
  void turn_rows(Rows& A, Eigen::Index p, Eigen::Index q) const {
    for (Eigen::Index j = 0; j < A.cols(); ++j) {
      const double a = A(p, j), b = A(q, j);
      A(p, j) = c * a - s * b;
      A(q, j) = s * a + c * b;
    }
  }
};

constexpr int MOST_SWEEPS = 60;
constexpr double NEGLIGIBLE = 1e-16;  // of the sizes that two columns have

// A = V diag(values) V^T of a symmetric matrix; values ascend.
template <typename M>
struct SymmetricEigen {
  M vectors;
  Eigen::Matrix<double, M::RowsAtCompileTime, 1> values;

  explicit SymmetricEigen(M A) : vectors(M::Identity(A.rows(), A.cols())), values(A.rows()) {
    const Eigen::Index n = A.rows();
    bool turned = true;
    for (int sweep = 0; turned && sweep < MOST_SWEEPS; ++sweep) {
      turned = false;
      for (Eigen::Index p = 0; p < n; ++p) {
        for (Eigen::Index q = p + 1; q < n; ++q) {
          if (std::fabs(A(p, q)) <= NEGLIGIBLE * std::sqrt(std::fabs(A(p, p) * A(q, q))) || A(p, q) == 0.0) continue;
          const PlaneRotation rotation(A(p, p), A(q, q), A(p, q));
          rotation.turn_columns(A, p, q);
          rotation.turn_rows(A, p, q);
          rotation.turn_columns(vectors, p, q);
          A(p, q) = A(q, p) = 0.0;
          turned = true;
        }
      }
    }
    for (Eigen::Index i = 0; i < n; ++i) values(i) = A(i, i);
    sort();
  }

 private:
  void sort() {
    for (Eigen::Index i = 0; i + 1 < values.size(); ++i) {
      Eigen::Index least = i;
      for (Eigen::Index j = i + 1; j < values.size(); ++j)
        if (values(j) < values(least)) least = j;
      if (least == i) continue;
      std::swap(values(i), values(least));
      for (Eigen::Index k = 0; k < vectors.rows(); ++k) std::swap(vectors(k, i), vectors(k, least));
    }
  }
};

// A = U diag(sigma) V^T, sigma descending; columns of U without a size are zero.
struct SingularValues {
  Eigen::MatrixXd U;
  Eigen::VectorXd sigma;
  Eigen::MatrixXd V;

  explicit SingularValues(const Eigen::MatrixXd& A)
      : U(A), sigma(A.cols()), V(Eigen::MatrixXd::Identity(A.cols(), A.cols())) {
    double size = 0.0;
    for (Eigen::Index j = 0; j < U.cols(); ++j) size = std::fmax(size, norm_of(U.col(j)));
    const double nothing = 1e-30 * size * size;  // a square of rounding errors
    bool turned = true;
    for (int sweep = 0; turned && sweep < MOST_SWEEPS; ++sweep) {
      turned = false;
      for (Eigen::Index p = 0; p < U.cols(); ++p)
        for (Eigen::Index q = p + 1; q < U.cols(); ++q) turned = separate(p, q, nothing) || turned;
    }
    for (Eigen::Index j = 0; j < U.cols(); ++j) {
      sigma(j) = norm_of(U.col(j));
      if (sigma(j) > 0.0) U.col(j) /= sigma(j);
    }
    sort();
  }

 private:
  bool separate(Eigen::Index p, Eigen::Index q, double nothing) {
    const double a = square_of(U.col(p)), b = square_of(U.col(q)), shared = dot(U.col(p), U.col(q));
    if (shared == 0.0 || std::fabs(shared) <= 1e-15 * std::sqrt(a * b) || std::fabs(shared) <= nothing) return false;
    const PlaneRotation rotation(a, b, shared);
    rotation.turn_columns(U, p, q);
    rotation.turn_columns(V, p, q);
    return true;
  }

  void sort() {
    for (Eigen::Index i = 0; i + 1 < sigma.size(); ++i) {
      Eigen::Index most = i;
      for (Eigen::Index j = i + 1; j < sigma.size(); ++j)
        if (sigma(j) > sigma(most)) most = j;
      if (most == i) continue;
      std::swap(sigma(i), sigma(most));
      U.col(i).swap(U.col(most));
      V.col(i).swap(V.col(most));
    }
  }
};

}  // namespace gyrofree
