// What axis biases are in the state, and how they grow (E-37).
#include "rate/filter.hpp"

namespace gyrofree::rate {
namespace {

// Specific force that the axes feel: u, and the centre's own way about the pivot while it turns.
Vector3 felt(const StateVector& x, bool turning) {
  const Vector3 omega = x.segment<3>(OMEGA), r = x.segment<3>(PIVOT);
  Vector3 f = x.segment<3>(LIFT);
  if (turning) f += dot(omega, r) * omega - square_of(omega) * r;
  return f;
}

// Variance by scale errors of each axis, of what it reads beyond its reading at rest, and by rounding, there
// and now.
Vector<MOST_AXES> away_from_rest(Filter& f, const Sensor& s, const Tuning& t, bool turning, double rounded) {
  const Vector3 force = felt(f.x, turning);
  Vector<MOST_AXES> reading = product(s.theta_b, force);
  Vector<MOST_AXES> away = Vector<MOST_AXES>::Zero();
  if (turning) {
    reading += product(s.Q, squares(f.omega()));
    for (int i = 0; i < s.n; ++i) away(i) = square(reading(i) - f.rest_reading(i)) * t.scale + square(rounded) / 6.0;
  } else {
    f.rest_reading = reading;
  }
  return away;
}

constexpr double FOLLOWED = 3.0;  // rad/s; what swings faster is averaged out by the filter

// Gravity that turns in the body swings the readings, and with them what scale errors do: within a
// radian a bias may be anything of that size again. Grows the biases to it where they are known better.
void swing_biases(Filter& f, const Sensor& s, const Tuning& t, double seconds) {
  const Vector3 omega = f.omega(), lift = f.x.segment<3>(LIFT);
  const double rate = norm_of(omega);
  if (rate == 0.0) return;
  const Vector3 axis = omega / rate;
  // of gravity, what turns, less what the axis' own uncertainty makes of it
  const double lost = 4.0 * square_of(lift) * largest_variance(f.omega_covariance()) / (rate * rate);
  const double turns = square_of(lift) - square(dot(lift, axis)) - lost;
  if (!(turns > 0.0)) return;
  const double across = turns / (1.0 + square(rate / FOLLOWED));
  Vector<MOST_AXES> size = Vector<MOST_AXES>::Zero();
  for (int i = 0; i < s.n; ++i) {
    const double along = dot(Vector3(s.theta_b.row(i).transpose()), axis);
    size(i) = 0.15 * t.scale * across * (1.0 - along * along);
  }
  Matrix<MEASURED, MOST_AXES> W = s.W;
  for (int i = 0; i < s.n; ++i) W.col(i) *= std::sqrt(size(i));
  for (int k = 0; k < MEASURED; ++k) {
    double most = 0.0;
    for (int i = 0; i < s.n; ++i) most += W(k, i) * W(k, i);
    const double known = std::max(f.P(bias_state(k), bias_state(k)), f.rest_variance(k));
    W.row(k) *= known < most ? std::sqrt(1.0 - known / most) : 0.0;
  }
  add_to_biases(f.P, product_transposed(W, W), std::min(1.0, 2.0 * rate * seconds));
}

}  // namespace

Measurement biases_of(const StateVector& x) {
  Measurement b;
  b << x.segment<BIASES>(BIAS_ALPHA), x.segment<3>(BIAS_FORCE);
  return b;
}

Measurement bias_variances(const Covariance& P) {
  Measurement variances;
  for (int k = 0; k < MEASURED; ++k) variances(k) = P(bias_state(k), bias_state(k));
  return variances;
}

void add_to_biases(Covariance& P, const Matrix<MEASURED>& D, double factor) {
  P.block<BIASES, BIASES>(BIAS_ALPHA, BIAS_ALPHA) += factor * D.topLeftCorner<BIASES, BIASES>();
  P.block<BIASES, 3>(BIAS_ALPHA, BIAS_FORCE) += factor * D.topRightCorner<BIASES, 3>();
  P.block<3, BIASES>(BIAS_FORCE, BIAS_ALPHA) += factor * D.bottomLeftCorner<3, BIASES>();
  P.block<3, 3>(BIAS_FORCE, BIAS_FORCE) += factor * D.bottomRightCorner<3, 3>();
}

// A scale error e of an axis is a bias e (f - f at the last standstill): it comes and goes with the
// readings. So what is known of a bias beyond that at rest, and its deviation, follow the readings up
// and down again. Beside it every bias walks.
void grow_biases(Filter& f, const Sensor& s, const Tuning& t, const Moment& moment) {
  const double seconds = moment.grow;
  const bool turning = moment.turning;
  const Vector<MOST_AXES> away = away_from_rest(f, s, t, turning, moment.rounded);
  if (!turning) {
    for (int k = 0; k < MEASURED; ++k) {
      if (s.drift(k, k) == 0.0) continue;
      f.rest_bias(k) = f.x(bias_state(k));
      f.rest_variance(k) = f.level(k) = f.P(bias_state(k), bias_state(k));
    }
  }
  StateVector follow = StateVector::Ones();
  for (int k = 0; k < MEASURED; ++k) {
    if (s.drift(k, k) == 0.0) continue;
    double now = f.rest_variance(k);
    for (int i = 0; i < s.n; ++i) now += s.W(k, i) * s.W(k, i) * away(i);
    const int b = bias_state(k);
    follow(b) = std::sqrt(now / f.level(k));
    f.level(k) = now;
    f.x(b) = f.rest_bias(k) + follow(b) * (f.x(b) - f.rest_bias(k));
  }
  for (int j = 0; j < STATES; ++j) f.P.col(j) = f.P.col(j).cwiseProduct(follow * follow(j));
  // what a bias wanders does not go when the readings come back
  const double walked = (t.drift + moment.wander) * seconds;
  add_to_biases(f.P, s.drift, walked);
  if (turning)
    for (int k = 0; k < MEASURED; ++k) {
      f.rest_variance(k) += s.drift(k, k) * walked;
      f.level(k) += s.drift(k, k) * walked;
    }
  if (turning) swing_biases(f, s, t, seconds);
}

}  // namespace gyrofree::rate
