// What a layout measures directly (inertial/rate/observed.py): constants of every rate filter.
#pragma once

#include <algorithm>

#include "common/matrix.hpp"

namespace gyrofree::rate {

constexpr double BLIND_SIGMA = 0.05;  // rad/s; a component less certain than that is not known

constexpr int MOST_AXES = 32;
constexpr int PRODUCTS = 6;  // w_i w_j, in the order xx xy xz yy yz zz
constexpr double GRAVITY = 9.80665;  // m/s^2, standard

// Segments of one sample's measurement y = W a, and of the biases of it.
enum Measured { ALPHA_M = 0, PRODUCTS_M = 3, FORCE_M = 9, MEASURED = 12 };
using Measurement = Vector<MEASURED>;
using Products = Vector<PRODUCTS>;

// i and j of w_i w_j
constexpr int FIRST[PRODUCTS] = {0, 0, 0, 1, 1, 2};
constexpr int SECOND[PRODUCTS] = {0, 1, 2, 1, 2, 2};

struct Sensor {
  int n = 0;              // axes
  int m = 0;              // observed combinations of the products
  bool feedback = false;  // SQ is not zero
  bool plain = false;     // M is the identity
  Matrix<MEASURED, MOST_AXES> W;  // axes to [omega', c, p] (E-40, E-41)
  Matrix<PRODUCTS> M;             // c = M z + bias; rows that are not seen are zero
  Matrix<3, PRODUCTS> SQ_alpha;   // what z adds to the measured omega'
  Matrix<3, PRODUCTS> SQ_force;   // and to the measured p
  Matrix3 R_alpha;                // (rad/s^2)^2, one sample
  Matrix3 R_p;                    // (m/s^2)^2
  Matrix<PRODUCTS> R_c;           // (rad/s)^4; identity where not used
  Matrix<PRODUCTS> known;         // M^T R_c^-1 M, (rad/s)^-4
  Matrix<MEASURED> drift;         // W W^T
  Matrix<MOST_AXES, PRODUCTS> Q;  // z of every axis, m
  Matrix<MOST_AXES, 3> theta_b;
  Matrix<MOST_AXES, 3> r_b;  // m, where it is
  Vector<MOST_AXES> used;  // 0 for an excluded axis, else 1
  Vector<MOST_AXES> limit;  // m/s^2, the largest reading; 0 where it is not known
  Matrix<9> basis;         // rows turn [alpha_m, c_m] into uncorrelated numbers
  Vector<9> spread;        // their variances

  // of one axis' noise in one sample, (m/s^2)^2
  double axis_variance() const { return R_alpha(0, 0) / drift(ALPHA_M, ALPHA_M); }

  // y = W a of one sample
  Measurement measure(const double* a) const {
    Measurement y = W.col(0) * a[0];
    for (int i = 1; i < n; ++i) y += W.col(i) * a[i];
    return y;
  }
};

// The six products z(omega), (rad/s)^2 (E-2).
inline Products squares(const Vector3& omega) {
  Products z;
  for (int k = 0; k < PRODUCTS; ++k) z(k) = omega(FIRST[k]) * omega(SECOND[k]);
  return z;
}

// dz / domega.
inline Matrix<PRODUCTS, 3> squares_jacobian(const Vector3& omega) {
  Matrix<PRODUCTS, 3> D = Matrix<PRODUCTS, 3>::Zero();
  for (int k = 0; k < PRODUCTS; ++k) {
    D(k, FIRST[k]) += omega(SECOND[k]);
    D(k, SECOND[k]) += omega(FIRST[k]);
  }
  return D;
}

// omega omega^T of six products.
inline Matrix3 outer(const Products& z) {
  Matrix3 W;
  for (int k = 0; k < PRODUCTS; ++k) W(FIRST[k], SECOND[k]) = W(SECOND[k], FIRST[k]) = z(k);
  return W;
}

inline double largest_variance(const Matrix3& P) { return std::max({P(0, 0), P(1, 1), P(2, 2)}); }
inline double trace(const Matrix3& A) { return A(0, 0) + A(1, 1) + A(2, 2); }

}  // namespace gyrofree::rate
