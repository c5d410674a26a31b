#include "rate/least_squares.hpp"

namespace gyrofree::rate {
namespace {

constexpr double UNSEEN_RATE = 0.05;  // rad/s, sigma at rest: a turn begins before the detector sees it
constexpr double FASTEST_MEASURED = 300.0;     // rad/s; no accelerometer of this kind measures a faster turn

Quaternion quaternion_of(const IntegralVector& y) { return {y(I_Q_NB), y(I_Q_NB + 1), y(I_Q_NB + 2), y(I_Q_NB + 3)}; }

void set_quaternion(IntegralVector& y, const Quaternion& q) { y.segment<4>(I_Q_NB) << q.w, q.x, q.y, q.z; }

// u without the rate's part (E-3).
DriveVector without_rate(const DriveVector& u, const Vector3& omega, const Sensor& s) {
  DriveVector x = u;
  if (!s.feedback) return x;
  const Products z = squares(omega);
  x.segment<3>(D_ALPHA) -= product(s.SQ_alpha, z);
  x.segment<3>(D_FORCE) -= product(s.SQ_force, z);
  return x;
}

DriveVector driven(const Measurement& y) {
  DriveVector u;
  u << y.segment<3>(ALPHA_M), y.segment<3>(FORCE_M);
  return u;
}

}  // namespace

IntegralVector derivative(const IntegralVector& y, const DriveVector& u, const Sensor& s) {
  const Vector3 omega = y.segment<3>(I_OMEGA);
  const DriveVector x = without_rate(u, omega, s);
  const Quaternion q = quaternion_of(y), turned = q * Quaternion{0.0, omega.x(), omega.y(), omega.z()};
  IntegralVector d;
  d.segment<3>(I_OMEGA) = x.segment<3>(D_ALPHA);
  set_quaternion(d, {0.5 * turned.w, 0.5 * turned.x, 0.5 * turned.y, 0.5 * turned.z});
  d(I_ANGLE) = omega.z();
  d.segment<3>(I_V_N) = to_matrix(normalised(q)) * Vector3(x.segment<3>(D_FORCE)) + Vector3(0.0, 0.0, GRAVITY);
  d.segment<3>(I_P_N) = y.segment<3>(I_V_N);
  return d;
}

IntegralVector runge_kutta(const IntegralVector& y, const DriveVector& before, const DriveVector& after,
                           const Sensor& s, double dt) {
  const DriveVector middle = 0.5 * (before + after);
  const IntegralVector k1 = derivative(y, before, s);
  const IntegralVector k2 = derivative(y + 0.5 * dt * k1, middle, s);
  const IntegralVector k3 = derivative(y + 0.5 * dt * k2, middle, s);
  const IntegralVector k4 = derivative(y + dt * k3, after, s);
  IntegralVector next = y + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  set_quaternion(next, normalised(quaternion_of(next)));
  return next;
}

LeastSquares::LeastSquares() { restart(); }

// The rate is unknown: wait for a standstill.
void LeastSquares::restart() {
  watch_.forget();
  y_.setZero();
  set_quaternion(y_, {});
  bias_.setZero();
  samples_ = 0;
  still_ = false;
  moving_s_ = 0.0;
}

// Its integral, and what it stood on, were made with other axes.
void LeastSquares::exchange_axes() {
  watch_.unlearn();
  restart();
}

// Biases and tilt from the mean of the standstill (E-7). All of omega' is bias; of p, what exceeds
// gravity along the measured vertical. A bias across the vertical reads like a tilt and stays in it.
void LeastSquares::align() {
  const DriveVector mean = driven(watch_.learnt_mean());
  const Vector3 force = mean.segment<3>(D_FORCE);
  const double size = norm_of(force);
  y_.setZero();
  set_quaternion(y_, level(force / size));
  bias_ = mean;
  bias_.segment<3>(D_FORCE) *= 1.0 - GRAVITY / size;
  u_ = mean - bias_;
  u_.segment<3>(D_ALPHA).setZero();
  samples_ = watch_.learning_samples();
  noise_ = watch_.noise().quiet();
}

// Covariance of omega (E-8): white noise summed, bias error times time.
Matrix3 LeastSquares::covariance(const Sensor& s) const {
  if (samples_ == 0) return UNKNOWN_RATE * UNKNOWN_RATE * Matrix3::Identity();
  if (moving_s_ == 0.0) return watch_.noise().unnoticed() * UNSEEN_RATE * UNSEEN_RATE * Matrix3::Identity();
  return noise_ * s.R_alpha * (dt_ * moving_s_ + moving_s_ * moving_s_ / samples_);
}

// The sensor with the noise that was measured (E-58).
const Sensor& LeastSquares::believed(const Sensor& s) {
  if (watch_.noise().as_configured()) return s;
  measured_ = s;
  apply(watch_.noise(), s, measured_);
  return measured_;
}

void LeastSquares::advance(const Sensor& s, const LeastSquaresLimits& c, double t_s, const double* a) {
  if (intake_.refuses(s, a, dt_, watch_.noise().any())) {
    if (intake_.missing() > BRIDGED_SAMPLES) {
      restart();
      P_ = covariance(s);
    }
    return;
  }
  const double dt = t_s - last_s_;
  last_s_ = t_s;
  if (dt > c.longest_step_s) {
    restart();
  } else if (dt > 0.0) {
    dt_ = dt;
  }
  watch_.noise().rounded(intake_.resolution(s), s);
  watch_.take(s, a, dt_);
  noise_ = std::max(noise_, watch_.noise().quiet());
  const Verdict verdict = watch_.detect(believed(s), c.still, y_.segment<3>(I_OMEGA), P_, dt_);
  still_ = verdict.still;
  const long now = watch_.newest();
  long first = now;
  if (moving_s_ == 0.0) {
    if (still_ && watch_.learning_samples() >= c.shortest_standstill) align();
    // the turn began before the detector saw it: integrate what was held back
    first = still_ || samples_ == 0 ? now + 1 : now - verdict.depth;
  }
  for (long sample = first; sample <= now; ++sample) {
    const DriveVector u = driven(watch_.y(sample)) - bias_;
    y_ = runge_kutta(y_, u_, u, s, watch_.dt(sample));
    u_ = u;
    moving_s_ += watch_.dt(sample);
  }
  // feedback of a drifting rate diverges
  if (!(square_of(y_.segment<3>(I_OMEGA)) < FASTEST_MEASURED * FASTEST_MEASURED)) restart();
  P_ = covariance(s);
}

void LeastSquares::write(const Sensor& s, Row& row) const {
  const Vector3 omega = y_.segment<3>(I_OMEGA);
  const DriveVector x = without_rate(driven(newest()) - bias_, omega, s);
  row = Row{};
  put(row.omega_b, omega);
  put(row.P[0], P_);
  put(row.alpha_b, x.segment<3>(D_ALPHA));
  put(row.f_b, x.segment<3>(D_FORCE));
  put(row.q_nb, y_.segment<4>(I_Q_NB));
  row.angle_z = y_(I_ANGLE);
  put(row.p_n, y_.segment<3>(I_P_N));
  put(row.v_n, y_.segment<3>(I_V_N));
  put(row.bias, bias_);
  row.still = still_;
  const bool waiting = samples_ == 0, moving = moving_s_ > 0.0;
  row.phase = waiting ? WAITING : moving ? INTEGRATING : STILL_AT_START;
  const bool unseen = intake_.missing() > 0;
  const Doubt doubt = unseen ? Doubt::NO_DATA : intake_.doubted() ? Doubt::CONTRADICTED : Doubt::NONE;
  row.doubt = static_cast<std::uint8_t>(doubt);
  const bool blind = waiting || doubt != Doubt::NONE || (moving && largest_variance(P_) > BLIND_SIGMA * BLIND_SIGMA);
  std::fill_n(row.sight, 3, blind ? BLIND : VALID);
}

}  // namespace gyrofree::rate
