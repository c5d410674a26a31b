#include "navigation/constraints.hpp"

#include <algorithm>

#include "navigation/leg.hpp"

namespace gyrofree::navigation {
namespace {

constexpr int FORWARD = 0, SIDE = 1, BELOW = 2;  // of the body
constexpr int SIDEWAYS = 0, VERTICAL = 1, WHEEL_ROWS = 2;
constexpr int ZERO_V = 0, ZERO_W = 3, STILL_ROWS = 6;

constexpr double STRAIN_SHARE = 0.05;  // of the newest look in the mean: 10 s at two looks a second
constexpr double MOST_STRAIN = 25.0;   // of one look
constexpr int LEAST_TICKS = 8;         // of them, to judge a standstill
constexpr double LEAST_TICK_S = 0.05;  // shorter ones are too noisy
constexpr double STILL_BIAS = 3.0;     // times still_w_change: more is a turn

// Mean and largest standard deviation of an axis, of values that come one by one.
struct Spread {
  Vector3 sum = Vector3::Zero(), squares = Vector3::Zero();

  void add(const Vector3& v) {
    sum += v;
    squares += v.cwiseProduct(v);
  }
  double largest(int count) const {
    double most = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double mean = sum(i) / count, variance = squares(i) / count - mean * mean;
      if (variance > most) most = variance;
    }
    return std::sqrt(most);
  }
};

bool turns(const Vector3& mean_omega, const Vector3& bias, double limit) {
  for (int i = 0; i < 3; ++i)
    if (std::fabs(mean_omega(i) - bias(i)) > limit) return true;
  return false;
}

// Zero velocity, and what is left of the gyro's bias (E-121).
Measurement standstill(const Leg& leg, const Model& model, const Rules& rules) {
  const Tick& last = leg.ticks.back();
  Measurement z(STILL_ROWS, model.states);
  z.y.segment<3>(ZERO_V) = leg.x.v_n;
  z.H.block<3, 3>(ZERO_V, DV).setIdentity();
  z.R.diagonal().segment<3>(ZERO_V).setConstant(rules.still_v * rules.still_v);
  z.y.segment<3>(ZERO_W) = last.omega_b / last.length - leg.x.bias_gyro;
  z.H.block<3, 3>(ZERO_W, BIAS_GYRO).setIdentity();
  z.R.diagonal().segment<3>(ZERO_W).setConstant(rules.still_w * rules.still_w);
  return z;
}

// The rear axle does not slide sideways and does not leave the ground (E-120). No rows: too slow for
// the wheels to tell, or too fast a turn for the tyres.
Measurement wheels(const Leg& leg, const Model& model, const Rules& rules) {
  const Nominal& x = leg.x;
  const Tick& last = leg.ticks.back();
  const Matrix3 C = x.C_nb;
  const Vector3 v_b = C.transpose() * x.v_n;
  const Vector3 omega = last.omega_b / last.length - x.bias_gyro;
  if (v_b[FORWARD] < rules.least_speed || std::fabs(omega[BELOW]) > rules.most_turn) return {};
  Measurement z(WHEEL_ROWS, model.states);
  z.y(SIDEWAYS) = v_b[SIDE] - x.mount_yaw * v_b[FORWARD] - omega[BELOW] * x.axle;
  z.y(VERTICAL) = v_b[BELOW] + x.mount_pitch * v_b[FORWARD] + omega[SIDE] * x.axle;
  // the vehicle's axes in n: the body's, turned by the mounting angles
  const Vector3 side_n = C.col(SIDE) - x.mount_yaw * C.col(FORWARD);
  const Vector3 below_n = C.col(BELOW) + x.mount_pitch * C.col(FORWARD);
  const Matrix3 turn = skew(x.v_n);
  z.H.block<1, 3>(SIDEWAYS, DV) = side_n.transpose();
  z.H.block<1, 3>(VERTICAL, DV) = below_n.transpose();
  z.H.block<1, 3>(SIDEWAYS, PSI) = -(side_n.transpose() * turn);
  z.H.block<1, 3>(VERTICAL, PSI) = -(below_n.transpose() * turn);
  // the rate that is left over turns the axle about the IMU
  z.H(SIDEWAYS, BIAS_GYRO + BELOW) = -x.axle;
  z.H(VERTICAL, BIAS_GYRO + SIDE) = x.axle;
  z.H(SIDEWAYS, model.mount_yaw) = -v_b[FORWARD];
  z.H(SIDEWAYS, model.axle) = -omega[BELOW];
  z.H(VERTICAL, model.mount_pitch) = v_b[FORWARD];
  z.H(VERTICAL, model.axle) = omega[SIDE];
  z.R(SIDEWAYS, SIDEWAYS) = rules.sigma_side * rules.sigma_side;
  z.R(VERTICAL, VERTICAL) = rules.sigma_up * rules.sigma_up;
  return z;
}

}  // namespace

bool standing(const Leg& leg, const Rules& rules) {
  const Vector3& v = leg.x.v_n;
  if (norm_of(v) > rules.still_speed) return false;  // a steady climb is quiet too
  Spread f, omega;
  int count = 0;
  for (int k = TICKS - TICKS_A_SECOND; k < TICKS; ++k) {
    const Tick& tick = leg.ticks[k];
    if (tick.length < LEAST_TICK_S) continue;
    ++count;
    f.add(tick.f_b / tick.length);
    omega.add(tick.omega_b / tick.length);
  }
  return count >= LEAST_TICKS && !(f.largest(count) > rules.still_f_change) &&
         !(omega.largest(count) > rules.still_w_change) &&
         !turns(omega.sum / count, leg.x.bias_gyro, STILL_BIAS * rules.still_w_change);
}

Measurement constraint(const Leg& leg, const Model& model, const Rules& rules) {
  if (leg.ticks.back().length <= 0.0) return {};
  if (standing(leg, rules)) return leg.moved > MOST_MOVED ? Measurement() : standstill(leg, model, rules);
  return model.has_car() && leg.wheels ? wheels(leg, model, rules) : Measurement();
}

bool constrain(Leg& leg, const Model& model, const Rules& rules, StateVector& error) {
  leg.since_constraint = 0.0;
  Measurement z = constraint(leg, model, rules);
  leg.quiet = leg.quiet || standing(leg, rules);
  if (z.rows() == 0) return false;
  close(leg, model);
  leg.since_constraint = 0.0;
  Covariance P = predicted(leg.P, leg.Phi, leg.Q);
  Innovation innovation = innovate(P, z);
  Whitened white = whiten(innovation.S, z.y);
  if (!(white.nis >= 0.0)) return false;
  const double square = white.nis / z.rows(), d = std::sqrt(square);
  if (z.rows() == WHEEL_ROWS) leg.strain += STRAIN_SHARE * (std::min(square, MOST_STRAIN) - leg.strain);
  if (d > rules.huber) {  // wheels slip and ground shakes: less weight, never none
    innovation.S *= d / rules.huber;
    white = whiten(innovation.S, z.y);
  }
  error = absorb(P, innovation, white);
  leg.P = P;
  correct(leg, model, error);
  return true;
}

}  // namespace gyrofree::navigation
