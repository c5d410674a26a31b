// Products filter: its state by named segments, and the functions of one sample (E-30 to E-39).
// numpy twin: inertial/rate/products_model.py, tests/support/rate_twin.py.
#pragma once

#include <limits>
#include <utility>

#include "common/rotation.hpp"
#include "rate/sensor.hpp"

namespace gyrofree::rate {

// Segments of the state x: first component of each.
enum State {
  OMEGA = 0,          // rad/s
  BIAS_ALPHA = 3,     // rad/s^2
  BIAS_PRODUCTS = 6,  // (rad/s)^2, six
  LIFT = 12,          // m/s^2, u: specific force of the body at rest, gravity's reaction in b
  BIAS_FORCE = 15,    // m/s^2
  PIVOT = 18,         // m, r: from a pivot at rest to the centre
  ANGLE = 21,         // rad, integral of omega_z
  STATES = 22
};
// The biases that follow one another: of omega' and of the products.
constexpr int BIASES = 9;

using StateVector = Vector<STATES>;
using Covariance = Matrix<STATES>;

enum class Method : int { EKF = 0, UKF = 1, FORGET = 2, HORIZON = 3 };

// products_ekf.Config in squares, for the kernels.
struct Tuning {
  int method = 0;            // of Method
  double scale = 0.0;        // of 1, squared
  double drift = 0.0;        // (m/s^2)^2 per s
  double centre = 0.0;       // (m/s^2)^2
  double pivot_drift = 0.0;  // m^2 per s
  double still_rate = 0.0;   // (rad/s)^2 of one sample
  double first_still_rate = 0.0;  // (rad/s)^2 of the first standstill
  double products_gate = 0.0;
  double force_gate = 0.0;
  double unseen_alpha = 0.0;   // (rad/s^2)^2
  double unseen_rate = 0.0;    // (rad/s)^2, of a turn that has begun and is not noticed yet
  double forget = 0.0;         // 1/s; of FORGET only
  double bias = 0.0;           // (m/s^2)^2, of one axis before the first standstill
  double tilt = 0.0;           // (m/s^2)^2
  double gravity = 0.0;        // (m/s^2)^2
  double pivot = 0.0;          // m^2
  bool gravity_aid = true;     // gravity corrects
  double start_turning = 0.0;  // of the largest product over its variance
  double axis = 0.0;           // (rad/s)^2 per s, what omega across a fixed axis may wander; 0: none is fixed
  double axis_from = 0.0;      // (rad/s)^2, of |omega|^2: above it a body may be on a fixed axis
  double axis_limit = 0.0;     // chi-square
  double axis_lost = 0.0;      // (rad/s)^2
  double earth_north = 0.0;    // rad/s
  double earth_down = 0.0;
};

// Everything that one sample hands to the next.
struct Filter {
  StateVector x = StateVector::Zero();
  Covariance P = Covariance::Zero();  // symmetric to the bit
  Quaternion q_nb;
  Vector3 v_n = Vector3::Zero();
  Vector3 p_n = Vector3::Zero();
  Vector3 alpha_m = Vector3::Zero();     // measured omega' of the last sample
  Vector3 alpha_late = Vector3::Zero();  // of late, its running mean: the pivot is told by it
  Vector3 force_n = Vector3::Zero();     // acceleration of the last sample
  double sign_variance = 0.0;            // of omega along itself for the question of its sign (E-43)
  Measurement rest_bias = Measurement::Zero();      // biases at rest,
  Measurement rest_variance = Measurement::Zero();  // their variances,
  Measurement level = Measurement::Zero();          // and those now, by scale errors (E-37)
  Vector<MOST_AXES> rest_reading = Vector<MOST_AXES>::Zero();

  auto omega() const { return x.segment<3>(OMEGA); }
  Matrix3 omega_covariance() const { return P.block<3, 3>(OMEGA, OMEGA); }
  double speed_squared() const { return square_of(omega()); }
};

// What one sample's corrections said.
struct Said {
  Products innovation = Products::Zero();
  Products sigma = Products::Zero();
  double nis = 0.0;
  bool used = false;  // the products
  bool force_used = false;
  double misfit = 0.0;   // both NIS, up to their gates
  double density = 1.0;  // 1 / sqrt(det C) of both
};

struct Likelihood {
  double nis = 0.0;
  double density = 1.0;
};

// A B^T for few columns, the inner sum from term 0 on: product_transposed() in one pass over the rows.
template <typename A, typename B>
auto columns_by(const A& a, const B& b) {
  constexpr int K = B::ColsAtCompileTime;
  static_assert(A::ColsAtCompileTime == K);
  Matrix<A::RowsAtCompileTime, B::RowsAtCompileTime> c;
  for (Eigen::Index j = 0; j < c.cols(); ++j)
    [&]<int... k>(std::integer_sequence<int, k...>) {
      c.col(j) = (... + (a.col(k) * b(j, k)));
    }(std::make_integer_sequence<int, K>());
  return c;
}

// P -= G G^T, symmetric to the bit.
template <int M>
void take_out(Covariance& P, const Matrix<STATES, M>& G) {
  for (int j = 0; j < STATES; ++j)
    [&]<int... k>(std::integer_sequence<int, k...>) {
      P.col(j) -= (... + (G.col(k) * G(j, k)));
    }(std::make_integer_sequence<int, M>());
}

// A measurement with M components: P H^T, the innovation and its covariance C = H P H^T + R.
template <int M>
struct Seen {
  Matrix<STATES, M> PHt;
  Matrix<M> C;  // its lower half is read
  Vector<M> y;
};

// Kalman correction in place (E-39). An innovation beyond the gate changes nothing.
template <int M>
Likelihood absorb(StateVector& x, Covariance& P, const Seen<M>& seen, double gate) {
  const Cholesky<Matrix<M>> factor(seen.C);
  const Vector<M> y = factor.whitened(seen.y);
  Likelihood told{square_of(y), 1.0 / factor.root_of_determinant()};
  if (!factor.positive) return {std::numeric_limits<double>::quiet_NaN(), told.density};
  if (!(told.nis <= gate)) return told;
  Matrix<STATES, M> G = seen.PHt;  // becomes P H^T L^-T
  for (int j = 0; j < M; ++j) {
    for (int k = 0; k < j; ++k) G.col(j) -= factor.L(j, k) * G.col(k);
    G.col(j) *= 1.0 / factor.L(j, j);
  }
  for (int k = 0; k < M; ++k) x += y(k) * G.col(k);
  take_out<M>(P, G);
  return told;
}

// Projection of omega' that is integrated (E-45): all of it, none at rest, only that along omega on a
// fixed axis.
struct Along {
  Matrix3 N = Matrix3::Zero();
  bool fixed = false;
};
Along along_axis(const Vector3& omega, bool fixed, bool turning);

// What one prediction goes by: the mean measured omega' since the sample before, and dt in s.
struct Drive {
  Vector3 alpha_m;
  Along along;
  double dt;
  bool turning;
  Vector3 earth_b;
};

// Rows of F = d x / d x before (E-32) that differ from the identity: of omega, u and the angle.
struct Transition {
  Matrix3 A = Matrix3::Identity();  // omega by omega
  Matrix3 D = Matrix3::Zero();      // omega by bias_alpha, with the sign turned
  Matrix3 C = Matrix3::Identity();  // u by u
  Matrix3 T = Matrix3::Zero();      // u by omega: dt [u x]
  double dt = 0.0;                  // angle by omega_z
  double back = 0.0;                // half of dt while omega' is integrated

  Covariance dense() const;
};

// predict.cpp: the state moves (E-31); with its covariance, without process noise; what noise adds.
Transition move(StateVector& x, const Drive& drive, const Sensor& s);
void predict(StateVector& x, Covariance& P, const Drive& drive, const Sensor& s);
void add_noise(Covariance& P, const Drive& drive, const Sensor& s, const Tuning& t);
void forget(Covariance& P, const Sensor& s, const Tuning& t, double amount);
// omega' less what the products add to it (E-30).
Vector3 free_alpha(const Vector3& alpha_m, const StateVector& x, const Sensor& s);

// d p / d omega and d p / d pivot of the specific force (E-35).
struct ForceModel {
  Matrix3 by_omega;
  Matrix3 by_pivot;
};
ForceModel force_model(const StateVector& x, const Vector3& alpha, const Sensor& s);
// p predicted by x.
Vector3 measured_force(const StateVector& x, const ForceModel& h, const Sensor& s);
// d c / d omega (E-33).
Matrix<PRODUCTS, 3> products_model(const Vector3& omega, const Sensor& s);

// Covariance of what the spread of omega adds to its products: P_ik P_jl + P_il P_jk (E-34).
Matrix<PRODUCTS> spread_covariance(const Matrix3& P);

// correct.cpp: measurements by their model (E-33 to E-38), shares of the noise for the bound.
Seen<6> see_products(const Covariance& P, const Vector3& at, const Sensor& s, double share);
Seen<3> see_force(const StateVector& x, const Covariance& P, const Vector3& p, const Vector3& alpha,
                  const Sensor& s, double share);
Seen<6> see_standstill(const Covariance& P, const Sensor& s, double rate, double share);
Likelihood by_products(Filter& f, const Products& c_m, const Vector3& at, const Sensor& s, const Tuning& t,
                       Said& said);
Likelihood by_force(Filter& f, const Vector3& p, Vector3 alpha, Vector3 late, bool turning, const Sensor& s,
                    const Tuning& t);
void by_standstill(Filter& f, const Vector3& alpha_m, const Vector3& earth_b, const Sensor& s, const Tuning& t);

// unscented.cpp: the same through sigma points (E-44).
void predict_unscented(StateVector& x, Covariance& P, const Drive& drive, const Sensor& s);
Likelihood by_products_unscented(Filter& f, const Products& c_m, const Sensor& s, const Tuning& t, Said& said);

// What a step is told beside the sample.
struct Moment {
  double dt;           // s after the last sample
  bool turning;        // what the detector denies
  bool fixed;          // about an axis that keeps its direction
  double grow;         // s of bias growth that are due now; 0 for most samples
  const Vector3* at;   // omega that the products are linear about; null: that of the state
  double forget = 0.0;  // 1/s, by what innovations say (E-59)
  double wander = 0.0;  // (m/s^2)^2 per s, of biases beyond what is configured (E-54)
  double rounded = 0.0;  // m/s^2, what readings are rounded to where that hides their noise (H-14)
};

// step.cpp: one sample y = [alpha_m, c_m, p_m].
void step(Filter& f, const Sensor& s, const Tuning& t, const Measurement& y, const Moment& moment, Said& said);

// q_nb of a body at rest whose up is up_b, of unit length; x_b points north, or z_b where x_b is vertical
// (E-11).
Quaternion level(const Vector3& up_b);

// biases.cpp: what axis biases are in x.
Measurement biases_of(const StateVector& x);
Measurement bias_variances(const Covariance& P);
constexpr int bias_state(int k) { return k < BIASES ? BIAS_ALPHA + k : BIAS_FORCE + k - BIASES; }
void add_to_biases(Covariance& P, const Matrix<MEASURED>& D, double factor);
void grow_biases(Filter& f, const Sensor& s, const Tuning& t, const Moment& moment);

}  // namespace gyrofree::rate
