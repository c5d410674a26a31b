// Phi over an interval: the integrals of a flat Earth exactly, the terms of the round, turning Earth
// to first order (E-107, E-108).
#include "navigation/local_earth.hpp"
#include "navigation/leg.hpp"

namespace gyrofree::navigation {
namespace {

using Upper = decltype(Transition::upper);
using MovingMatrix = Matrix<MOVING>;

// Rows and columns of F.
constexpr int PSI_N = PSI + NORTH, PSI_E = PSI + EAST, PSI_D = PSI + DOWN;
constexpr int V_N = DV + NORTH, V_E = DV + EAST, V_D = DV + DOWN;
constexpr int P_N = DP + NORTH, P_E = DP + EAST, P_H = DP + HEIGHT;

// What the terms of F are made of, at the vehicle.
struct Terms {
  double inverse_n, inverse_e, tangent, cosine2;
  double ie_n, ie_d;          // W cos L, W sin L, rad/s
  double en_n, en_e, en_d;    // w_en
  double v_N, v_E, v_D;
  double gravity;

  Terms(const Nominal& x, const LocalEarth& e)
      : inverse_n(e.inverse_n),
        inverse_e(e.inverse_e),
        tangent(e.tangent),
        cosine2(e.cosine * e.cosine),
        ie_n(earth::RATE * e.cosine),
        ie_d(earth::RATE * e.sine),
        en_n(x.v_n[EAST] * e.inverse_e),
        en_e(-x.v_n[NORTH] * e.inverse_n),
        en_d(-x.v_n[EAST] * e.tangent * e.inverse_e),
        v_N(x.v_n[NORTH]),
        v_E(x.v_n[EAST]),
        v_D(x.v_n[DOWN]),
        gravity(e.gravity) {}
};

void attitude_rows(MovingMatrix& F, const Terms& t) {
  const Vector3 omega_in(t.ie_n + t.en_n, t.en_e, t.en_d - t.ie_d);
  F.block<3, 3>(PSI, PSI) = -skew(omega_in);
  F(PSI_N, V_E) = t.inverse_e;
  F(PSI_E, V_N) = -t.inverse_n;
  F(PSI_D, V_E) = -t.tangent * t.inverse_e;
  F(PSI_N, P_N) = -t.ie_d * t.inverse_n;
  F(PSI_N, P_H) = -t.en_n * t.inverse_e;
  F(PSI_E, P_H) = -t.en_e * t.inverse_n;
  F(PSI_D, P_N) = (-t.ie_n - t.en_n / t.cosine2) * t.inverse_n;
  F(PSI_D, P_H) = -t.en_d * t.inverse_e;
}

void velocity_rows(MovingMatrix& F, const Terms& t) {
  F(V_N, V_N) = t.v_D * t.inverse_n;
  F(V_N, V_E) = -2.0 * t.ie_d - 2.0 * t.en_n * t.tangent;
  F(V_N, V_D) = t.v_N * t.inverse_n;
  F(V_E, V_N) = 2.0 * t.ie_d + t.en_n * t.tangent;
  F(V_E, V_E) = (t.v_D + t.v_N * t.tangent) * t.inverse_e;
  F(V_E, V_D) = 2.0 * t.ie_n + t.en_n;
  F(V_D, V_N) = 2.0 * t.en_e;
  F(V_D, V_E) = -2.0 * t.ie_n - 2.0 * t.en_n;
  F(V_N, P_N) = (-2.0 * t.ie_n * t.v_E - t.v_E * t.en_n / t.cosine2) * t.inverse_n;
  F(V_N, P_H) = t.en_e * t.v_D * t.inverse_n + t.en_n * t.v_E * t.inverse_e * t.tangent;
  F(V_E, P_N) = (2.0 * (t.ie_n * t.v_N - t.ie_d * t.v_D) + t.v_N * t.en_n / t.cosine2) * t.inverse_n;
  F(V_E, P_H) = -t.en_n * (t.v_D + t.v_N * t.tangent) * t.inverse_e;
  F(V_D, P_N) = 2.0 * t.ie_d * t.v_E * t.inverse_n;
  F(V_D, P_H) = t.en_n * t.v_E * t.inverse_e - t.en_e * t.v_N * t.inverse_n -
                2.0 * t.gravity * std::sqrt(t.inverse_n * t.inverse_e);
}

void position_rows(MovingMatrix& F, const Terms& t) {
  F(P_N, P_N) = -t.v_D * t.inverse_n;
  F(P_N, P_H) = -t.v_N * t.inverse_n;
  F(P_E, P_N) = t.v_E * t.tangent * t.inverse_n;
  F(P_E, P_E) = -t.v_D * t.inverse_e - t.v_N * t.tangent * t.inverse_e;
  F(P_E, P_H) = -t.en_n;
}

// The terms of F that are there because the Earth is round and turns (E-107).
MovingMatrix earth_terms(const Nominal& x, const LocalEarth& e) {
  const Terms t(x, e);
  MovingMatrix F = MovingMatrix::Zero();
  attitude_rows(F, t);
  velocity_rows(F, t);
  position_rows(F, t);
  return F;
}

// J = diag(1, 1, -1): heights count up.
Matrix3 height_up(Matrix3 m) {
  m.row(HEIGHT) = -m.row(HEIGHT);
  return m;
}

// Columns of a gyro's and an accelerometer's error, `at` and three on, that acts times `share`.
void gyro_columns(Upper& Phi, const Interval& i, int at, const Vector3& share) {
  Phi.block<3, 3>(PSI, at) = -(i.U1 * share.asDiagonal());
  Phi.block<3, 3>(DV, at) = -(i.M1 * share.asDiagonal());
  Phi.block<3, 3>(DP, at) = -height_up(i.M2 * share.asDiagonal());
}

void accel_columns(Upper& Phi, const Interval& i, int at, const Vector3& share) {
  Phi.block<3, 3>(DV, at) = i.U1 * share.asDiagonal();
  Phi.block<3, 3>(DP, at) = height_up(i.U2 * share.asDiagonal());
}

// Phi over a flat Earth that does not turn: exact (E-108).
Upper flat(const Interval& i, const Model& model, const StateVector& decay) {
  Upper Phi = Upper::Zero(MOVING, model.states);
  Phi.leftCols<MOVING>().setIdentity();
  Phi.block<3, 3>(DV, PSI) = skew(i.s1);
  Phi.block<3, 3>(DP, PSI) = height_up(skew(i.s2));
  Phi.block<3, 3>(DP, DV) = height_up(i.length * Matrix3::Identity());
  // a bias decays a little over the interval: its mean
  const Vector3 ones = Vector3::Ones();
  accel_columns(Phi, i, BIAS_ACCEL, 0.5 * (ones + decay.segment<3>(BIAS_ACCEL)));
  gyro_columns(Phi, i, BIAS_GYRO, 0.5 * (ones + decay.segment<3>(BIAS_GYRO)));
  if (model.has_scale()) {  // the reading hardly changes against C: its mean over the interval
    accel_columns(Phi, i, model.scale_accel, i.f_b / i.length);
    gyro_columns(Phi, i, model.scale_gyro, i.omega_b / i.length);
  }
  return Phi;
}

// exp(-T / tau) by its series
StateVector decay_over(const Model& model, double T) {
  StateVector out(model.states);
  for (int j = 0; j < model.states; ++j) {
    const double z = -model.decay(j) * T;
    out(j) = 1.0 + z * (1.0 + z * (0.5 + z / 6.0));
  }
  return out;
}

}  // namespace

Transition transition(const Leg& leg, const Model& model) {
  const double T = leg.interval.length;
  Transition Phi(model.states);
  Phi.decay = decay_over(model, T);
  const Upper main = flat(leg.interval, model, Phi.decay);
  const MovingMatrix E = earth_terms(leg.x, leg.earth) * (0.5 * T);
  // Phi = main + (E main + main E) T / 2
  Phi.upper = main + product(E, main);
  Phi.upper.leftCols<MOVING>() += product(main.leftCols<MOVING>(), E);
  return Phi;
}

}  // namespace gyrofree::navigation
