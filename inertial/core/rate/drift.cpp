#include "rate/drift.hpp"

namespace gyrofree::rate {
namespace {

constexpr double FEWEST_FOR_SLOPE = 100.0;  // samples that a slope needs
constexpr double LOOK_EVERY = 8.0;     // samples between two looks
constexpr double SLOPE_SURE = 1.5;     // of the variance that noise explains: what is beyond it is believed
constexpr double NOT_DENIED = 0.1;     // of it: a drift as small may hide in it,
constexpr double HIDDEN = 1e-6;        // (m/s^2)^2 per s^2, at most: 0.1 mg/s, a sensor that warms up

}  // namespace

void Drift::begin() {
  count_ = times_ = squares_ = 0.0;
  sum_.setZero();
  moment_.setZero();
}

// Mean square of omega' and c by the axes' share in each: the variance of one axis that explains it.
double Drift::of_one_axis(const Sensor& s, const Measurement& y) {
  double total = 0.0;
  for (int k = 0; k < PRODUCTS_M + s.m; ++k) total += square(y(k)) / s.drift(k, k);
  return total / (PRODUCTS_M + s.m);
}

void Drift::learn(const Sensor& s, const Measurement& y, double t_s) {
  if (count_ == 0.0) begin_s_ = t_s;
  const double t = t_s - begin_s_;
  count_ += 1.0;
  times_ += t;
  squares_ += t * t;
  sum_ += y;
  moment_ += t * y;
  if (count_ < FEWEST_FOR_SLOPE || std::fmod(count_, LOOK_EVERY) != 0.0) return;
  const double spread = squares_ - times_ * times_ / count_;
  const Measurement slope = (moment_ - times_ / count_ * sum_) / spread;
  const double noise = s.R_alpha(0, 0) / s.drift(0, 0) / spread, found = of_one_axis(s, slope);
  if (known_ == 0.0 || noise < known_) {  // no standstill told it better
    told(found, noise);
  }
}

void Drift::told(double found, double noise) {
  variance_ = std::max(0.0, found - SLOPE_SURE * noise);
  possible_ = std::max(std::min(NOT_DENIED * noise, HIDDEN), found - noise);
  known_ = noise;
}

void Drift::moved(const Sensor& s, const Measurement& d, double noise, double seconds) {
  const double found = of_one_axis(s, d);
  const double by_noise = noise / (seconds * seconds);
  if (known_ == 0.0 || by_noise <= known_) told(found / (seconds * seconds), by_noise);
}

}  // namespace gyrofree::rate
