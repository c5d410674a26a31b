// The products filter's model through sigma points (E-44).
//
// Symmetric set of 2 n + 1 points with weight 1 - n / spread in the middle; spread = 3 keeps the fourth
// moment of a Gaussian. Only what the functions are not linear in needs points; the other components
// are carried linearly, which gives the same numbers as points of all 22 (marginalised transform).
// numpy twin: tests/support/rate_twin.py.
#include "rate/filter.hpp"

namespace gyrofree::rate {
namespace {

constexpr double SPREAD = 3.0;
const double REACH = std::sqrt(SPREAD);
constexpr double WEIGHT = 0.5 / SPREAD;

// Segments of a point: what the transition takes.
enum Point { P_OMEGA = 0, P_LIFT = 3, P_BIAS = 6, P_ANGLE = 9, POINT = 10 };
constexpr int INSIDE[POINT] = {OMEGA,         OMEGA + 1,      OMEGA + 2,      LIFT, LIFT + 1, LIFT + 2,
                               BIAS_ALPHA, BIAS_ALPHA + 1, BIAS_ALPHA + 2, ANGLE};
using PointVector = Vector<POINT>;

// Lower triangular L with L L^T = A for a positive semidefinite A; columns of no variance are zero.
template <int N>
Matrix<N> root(const Matrix<N>& A) {
  Matrix<N> L = Matrix<N>::Zero();
  for (int j = 0; j < N; ++j) {
    double pivot = A(j, j);
    for (int k = 0; k < j; ++k) pivot -= L(j, k) * L(j, k);
    if (pivot <= 1e-14 * A(j, j)) continue;
    L(j, j) = std::sqrt(pivot);
    for (int i = j + 1; i < N; ++i) {
      double value = A(i, j);
      for (int k = 0; k < j; ++k) value -= L(i, k) * L(j, k);
      L(i, j) = value / L(j, j);
    }
  }
  return L;
}

// Points in columns: the mean, then mean + and - each column of L.
template <int N>
Matrix<N, 2 * N + 1> points_about(const Vector<N>& mean, const Matrix<N>& L) {
  Matrix<N, 2 * N + 1> points;
  points.col(0) = mean;
  for (int k = 0; k < N; ++k) {
    points.col(1 + k) = mean + REACH * L.col(k);
    points.col(1 + N + k) = mean - REACH * L.col(k);
  }
  return points;
}

template <int Rows, int N>
Vector<Rows> mean_of(const Matrix<Rows, 2 * N + 1>& points) {
  Vector<Rows> mean = (1.0 - N / SPREAD) * points.col(0);
  for (int k = 1; k <= 2 * N; ++k) mean += WEIGHT * points.col(k);
  return mean;
}

template <int Rows, int N>
Matrix<Rows> covariance_of(const Matrix<Rows, 2 * N + 1>& points, const Vector<Rows>& mean) {
  Matrix<Rows> square = Matrix<Rows>::Zero();
  for (int k = 0; k <= 2 * N; ++k) {
    const Vector<Rows> d = points.col(k) - mean;
    const double weight = k == 0 ? 1.0 - N / SPREAD : WEIGHT;
    for (int j = 0; j < Rows; ++j) square.col(j) += (weight * d(j)) * d;
  }
  return square;
}

// F with F L = cross, the statistical linearisation; a direction without variance has slope `unseen`.
template <int Rows, int N>
Matrix<Rows, N> slope(const Matrix<Rows, 2 * N + 1>& points, const Matrix<N>& L, double unseen) {
  Matrix<Rows, N> F = Matrix<Rows, N>::Zero();
  for (int j = N - 1; j >= 0; --j) {
    if (L(j, j) == 0.0) {
      if (j < Rows) F(j, j) = unseen;
      continue;
    }
    F.col(j) = (points.col(1 + j) - points.col(1 + N + j)) * (0.5 / REACH);
    for (int k = j + 1; k < N; ++k) F.col(j) -= F.col(k) * L(k, j);
    F.col(j) /= L(j, j);
  }
  return F;
}

// One point through the transition (E-31).
PointVector moved(const PointVector& before, const Drive& drive, const Sensor& s) {
  PointVector p = before;
  const Vector3 omega = p.segment<3>(P_OMEGA);
  if (drive.turning) {
    Vector3 alpha = drive.alpha_m - p.segment<3>(P_BIAS);
    if (s.feedback) alpha -= product(s.SQ_alpha, squares(omega));
    p.segment<3>(P_OMEGA) += drive.dt * (drive.along.N * alpha);
  }
  const Vector3 middle = 0.5 * (omega + p.segment<3>(P_OMEGA));
  p(P_ANGLE) += drive.dt * middle.z();
  p.segment<3>(P_LIFT) = turn_matrix(drive.dt * (drive.earth_b - middle)) * Vector3(before.segment<3>(P_LIFT));
  return p;
}

}  // namespace

void predict_unscented(StateVector& x, Covariance& P, const Drive& drive, const Sensor& s) {
  PointVector mean;
  Matrix<POINT> A;
  Matrix<STATES, POINT> columns;  // of P, of what is inside
  for (int j = 0; j < POINT; ++j) {
    mean(j) = x(INSIDE[j]);
    columns.col(j) = P.col(INSIDE[j]);
    for (int i = 0; i < POINT; ++i) A(i, j) = P(INSIDE[i], INSIDE[j]);
  }
  const Matrix<POINT> L = root<POINT>(A);
  Matrix<POINT, 2 * POINT + 1> points = points_about<POINT>(mean, L);
  for (int k = 0; k <= 2 * POINT; ++k) points.col(k) = moved(points.col(k), drive, s);
  const PointVector now = mean_of<POINT, POINT>(points);
  const Matrix<POINT> square = covariance_of<POINT, POINT>(points, now);
  const Matrix<STATES, POINT> cross = product_transposed(columns, slope<POINT, POINT>(points, L, 1.0));
  for (int j = 0; j < POINT; ++j) {  // cross covariance of what moves with what does not,
    x(INSIDE[j]) = now(j);
    P.col(INSIDE[j]) = cross.col(j);
    P.row(INSIDE[j]) = cross.col(j).transpose();
  }
  for (int j = 0; j < POINT; ++j)  // then of what moves with itself
    for (int i = 0; i < POINT; ++i) P(INSIDE[i], INSIDE[j]) = 0.5 * (square(i, j) + square(j, i));
}

Likelihood by_products_unscented(Filter& f, const Products& c_m, const Sensor& s, const Tuning& t, Said& said) {
  if (s.m == 0) return {};
  const Matrix3 L = root<3>(f.omega_covariance());
  const Matrix<3, 7> points = points_about<3>(Vector3(f.omega()), L);
  Matrix<PRODUCTS, 7> z;
  for (int k = 0; k < 7; ++k) z.col(k) = squares(points.col(k));
  z = product(s.M, z);
  const Products mean = mean_of<PRODUCTS, 3>(z);
  const Matrix<PRODUCTS, 3> H = slope<PRODUCTS, 3>(z, L, 0.0);
  Seen<6> seen;
  seen.PHt = f.P.middleCols<6>(BIAS_PRODUCTS) + product_transposed(f.P.middleCols<3>(OMEGA), H);
  const Matrix<PRODUCTS> crossed = product(H, Matrix<3, 6>(f.P.block<3, 6>(OMEGA, BIAS_PRODUCTS)));
  seen.C = f.P.block<6, 6>(BIAS_PRODUCTS, BIAS_PRODUCTS) + crossed + crossed.transpose() +
           covariance_of<PRODUCTS, 3>(z, mean) + s.R_c;
  seen.y = c_m - mean - f.x.segment<6>(BIAS_PRODUCTS);
  for (int r = 0; r < s.m; ++r) {
    said.innovation(r) = seen.y(r);
    said.sigma(r) = std::sqrt(seen.C(r, r));
  }
  return absorb(f.x, f.P, seen, t.products_gate);
}

}  // namespace gyrofree::rate
