#include "navigation/leg.hpp"

#include "common/elementary.hpp"
#include "common/rotation.hpp"
#include "navigation/local_earth.hpp"

namespace gyrofree::navigation {
namespace {

constexpr int SHAKEN = DV + 3;  // attitude and velocity

// C := (3 C - C C^T C) / 2 takes out the rounding gathered in many products.
void orthonormalise(Attitude& C_nb) {
  const Matrix3 C = C_nb;
  const Matrix3 square = C * C.transpose();
  C_nb = 0.5 * (3.0 * C - square * C);
}

// A diag(d) A^T
Matrix3 spread(const Matrix3& A, const Vector3& d) { return A * d.asDiagonal() * A.transpose(); }

// Half an interval's noise: T/2 G (E-108, E-109) and what the readings' shaking adds, in n (E-131).
void add_half_noise(Covariance& Q, const Leg& leg, const Model& model) {
  const double half = 0.5 * leg.interval.length;
  for (int i = 0; i < model.states; ++i) Q(i, i) += half * model.density(i);
  const Matrix3 mean = leg.interval.U1 / leg.interval.length;
  Q.block<3, 3>(PSI, PSI) += spread(mean, half * model.shake * leg.shake.gyro);
  Q.block<3, 3>(DV, DV) += spread(mean, half * model.shake * leg.shake.accel);
  // a turn that is told wrongly by its scale and cross-axis errors; scale errors that are states are none
  const Vector3 omega_b = leg.interval.omega_b / leg.interval.length - leg.x.bias_gyro;
  const double turn = half * model.turn * square_of(omega_b);
  for (int i = PSI; i < PSI + 3; ++i) Q(i, i) += turn;
  if (model.has_scale())
    Q.block<3, 3>(PSI, PSI) -= spread(mean, half * model.turn * omega_b.cwiseProduct(omega_b));
  static_assert(SHAKEN <= MOVING);
}

void remember(std::array<Tick, TICKS>& ticks, const Tick& tick) {
  for (int k = 0; k + 1 < TICKS; ++k) ticks[k] = ticks[k + 1];
  ticks.back() = tick;
}

}  // namespace

void fold(Leg& leg) {
  const OpenTick& tick = leg.tick;
  const double T = tick.length;
  if (T <= 0.0) return;
  Interval& i = leg.interval;
  const Matrix3 half_way = i.U1 + 0.5 * tick.C_nb;
  const Matrix3 rise = skew(tick.f_n) * half_way;
  i.M2 += T * (i.M1 + 0.5 * rise);
  i.M1 += rise;
  i.U2 += T * half_way;
  i.U1 += tick.C_nb;
  i.s2 += T * (i.s1 + 0.5 * tick.f_n);
  i.s1 += tick.f_n;
  i.f_b += tick.f_b;
  i.omega_b += tick.omega_b;
  i.length += T;
  leg.since_constraint += T;
  remember(leg.ticks, {leg.time, T, leg.x.v_n, tick.f_b, tick.omega_b});
  leg.tick = OpenTick();
}

void close(Leg& leg, const Model& model) {
  fold(leg);
  if (leg.interval.length <= 0.0) return;
  const Transition Phi = transition(leg, model);
  // Phi (Q + T/2 G) Phi^T + T/2 G is the trapezoid with one product less
  add_half_noise(leg.Q, leg, model);
  leg.Q = carried(Phi, leg.Q);
  add_half_noise(leg.Q, leg, model);
  leg.Phi = after(Phi, leg.Phi);
  orthonormalise(leg.x.C_nb);
  leg.interval = Interval();
}

std::size_t run_leg(Leg& leg, const Model& model, Samples samples, std::size_t start, std::size_t stop,
                    double until, double every) {
  std::size_t k = start;
  while (k < stop) {
    k = mechanise(leg, samples, k, stop, until);
    if (leg.tick.length >= TICK_S - SLACK_S) {
      fold(leg);
      if (leg.interval.length >= INTERVAL_S - SLACK_S) close(leg, model);
      if (leg.since_constraint >= every - SLACK_S) return k;
    }
    if (k < stop && samples[k].t > until && leg.time >= until) return k;
  }
  return k;
}

Covariance carried(const Transition& Phi, const Covariance& P) {
  const int n = Phi.states(), rest = n - MOVING;
  const auto moved = product(Phi.upper, P);
  const Matrix<MOVING> corner = product_transposed(moved, Phi.upper);
  Covariance out(n, n);
  for (int j = 0; j < MOVING; ++j)
    for (int i = j; i < MOVING; ++i) out(i, j) = out(j, i) = corner(i, j);
  for (int j = MOVING; j < n; ++j) {
    out.col(j).head<MOVING>() = moved.col(j) * Phi.decay(j);
    out.col(j).tail(rest) = P.col(j).tail(rest).cwiseProduct(Phi.decay.tail(rest)) * Phi.decay(j);
    out.row(j).head<MOVING>() = out.col(j).head<MOVING>();
  }
  return out;
}

Covariance predicted(const Covariance& P, const Transition& Phi, const Covariance& Q, double factor) {
  Covariance out = carried(Phi, P);
  out = factor * out + Q;
  return out;
}

StateVector moved(const Transition& Phi, const StateVector& m) {
  StateVector out = Phi.decay.cwiseProduct(m);
  out.head<MOVING>() = product(Phi.upper, m);
  return out;
}

StateVector moved_back(const Transition& Phi, const StateVector& m) {
  StateVector out = Phi.decay.cwiseProduct(m);
  out.head<MOVING>().setZero();
  for (int i = 0; i < MOVING; ++i) out += Phi.upper.row(i).transpose() * m(i);
  return out;
}

Transition after(const Transition& later, const Transition& Phi) {
  Transition out(Phi.states());
  out.upper = product(later.upper.leftCols<MOVING>(), Phi.upper);
  for (int j = MOVING; j < Phi.states(); ++j) out.upper.col(j) += later.upper.col(j) * Phi.decay(j);
  out.decay = later.decay.cwiseProduct(Phi.decay);
  return out;
}

Covariance covariance_now(Leg leg, const Model& model) {
  close(leg, model);
  return predicted(leg.P, leg.Phi, leg.Q);
}

void reset(Nominal& x, const StateVector& error, const Model& model) {
  const auto [meridian, normal] = earth::radii(x.latitude);
  x.longitude -= error(DP + EAST) / ((normal + x.height) * elementary::cos(x.latitude));
  x.latitude -= error(DP + NORTH) / (meridian + x.height);
  x.height -= error(DP + HEIGHT);
  x.v_n -= error.segment<3>(DV);
  x.bias_accel += error.segment<3>(BIAS_ACCEL);
  x.bias_gyro += error.segment<3>(BIAS_GYRO);
  if (model.has_scale()) {
    x.scale_accel += error.segment<3>(model.scale_accel);
    x.scale_gyro += error.segment<3>(model.scale_gyro);
  }
  if (model.has_lag()) {
    x.lag_position -= error(model.lag_position);
    x.lag_velocity -= error(model.lag_velocity);
  }
  if (model.has_car()) {
    x.mount_pitch -= error(model.mount_pitch);
    x.mount_yaw -= error(model.mount_yaw);
    x.axle -= error(model.axle);
  }
  const Matrix3 C = x.C_nb;
  x.C_nb = turn_matrix(error.segment<3>(PSI)) * C;
}

void correct(Leg& leg, const Model& model, const StateVector& error) {
  reset(leg.x, error, model);
  leg.Phi.set_identity();
  leg.Q.setZero();
  for (Tick& tick : leg.ticks) tick.v_n -= error.segment<3>(DV);
}

}  // namespace gyrofree::navigation
