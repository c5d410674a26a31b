// A tachometer's report as a correction of a products filter: axis . omega = rate, at the report's own
// time (E-50).
#include "rate/frame.hpp"

namespace gyrofree::rate {
namespace {

constexpr double GATE = 36.0;  // chi-square, 1 degree: 6 sigma; beyond it a report is refused

struct Innovation {
  double y;         // rad/s
  double variance;  // (rad/s)^2
};

// What a report says of a filter: gained is the measured omega' since its time, times 1 / dt, n samples.
Innovation innovation(const Filter& f, const Report& report, const Vector3& gained, long n, double dt, double noise) {
  const Vector3 then = f.omega() - dt * (gained - n * f.x.segment<3>(BIAS_ALPHA));
  const double about = dot(report.axis_b, then);
  const double want = report.is_signed ? report.rate : std::copysign(report.rate, about);
  return {want - about, dot(report.axis_b, f.omega_covariance() * report.axis_b) + noise};
}

double log_likelihood(const Innovation& i) { return -0.5 * (i.y * i.y / i.variance + elementary::log(i.variance)); }

bool absorb_report(Filter& f, const Report& report, const Innovation& i, double noise) {
  if (i.y * i.y > GATE * i.variance) return false;
  const StateVector gain = product(f.P.middleCols<3>(OMEGA), report.axis_b);
  f.x += gain * (i.y / i.variance);
  for (int j = 0; j < STATES; ++j) f.P.col(j) -= gain * gain(j) / i.variance;
  f.sign_variance = std::min(f.sign_variance, noise);
  return true;
}

}  // namespace

bool Frame::correct(const Constants& c, const Report& report) {
  const double samples = std::nearbyint((last_s_ - report.t_s) / dt_);
  if (!started_ || !(samples >= 0.0 && samples < std::min(DEPTH, watch_.filled_samples()))) return false;
  const long n = static_cast<long>(samples), now = watch_.newest();
  const Vector3 gained = (watch_.total(now) - watch_.total(now - n)).segment<3>(ALPHA_M);
  const double noise =
      report.sigma * report.sigma + n * dt_ * dt_ * dot(report.axis_b, sensor(c).R_alpha * report.axis_b);
  const auto said_of = [&](const Start& begun) {
    return innovation(begun.filter, report, gained, n, dt_, noise);
  };
  if (branches_ == 2 && report.is_signed) {  // the likelier sign becomes the first
    balance_ += log_likelihood(said_of(first_)) - log_likelihood(said_of(second_));
    if (balance_ < 0.0) swap_signs();
    if (balance_ > DECIDED) branches_ = 1;
  }
  bool used = absorb_report(first_.filter, report, said_of(first_), noise);
  if (branches_ == 2) used = absorb_report(second_.filter, report, said_of(second_), noise) || used;
  if (used) fitted_ = 0;  // a later fit would not know of it
  return used;
}

}  // namespace gyrofree::rate
