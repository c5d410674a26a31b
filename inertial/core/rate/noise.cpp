#include "rate/noise.hpp"

namespace gyrofree::rate {
namespace {

constexpr double THIRD_DIFFERENCE = 20.0;  // variance of one of white noise over the noise's own
constexpr double NOISE_CLIP = 6.0;    // of one ratio over the mean so far: a jolt is no noise

}  // namespace

void Noise::Mean::add(double ratio) {
  count = std::min<long>(count + 1, MEMORY);
  const double most = NOISE_CLIP * std::max(value, 1.0);
  value += (std::min(ratio, most) - value) / count;
}

double Noise::Mean::believed(double slack) const {
  if (count == 0) return 1.0;
  const double limit = 1.0 + slack * std::sqrt(static_cast<double>(MEMORY) / count);
  return value < limit ? 1.0 : value;
}

double quiet_ratio(const Sensor& s, const Measurement& third_difference) {
  double quiet = 0.0;
  for (int k = 0; k < 3; ++k) quiet += square(third_difference(ALPHA_M + k)) / s.R_alpha(k, k);
  for (int k = 0; k < s.m; ++k) quiet += square(third_difference(PRODUCTS_M + k)) / s.R_c(k, k);
  return quiet / (THIRD_DIFFERENCE * (3 + s.m));
}

void Noise::observe(const Sensor& s, const Measurement& third_difference) {
  double force = 0.0;
  for (int k = 0; k < 3; ++k) force += square(third_difference(FORCE_M + k)) / s.R_p(k, k);
  quiet_.add(quiet_ratio(s, third_difference));
  force_.add(force / (THIRD_DIFFERENCE * 3));
}

void apply(const Noise& noise, const Sensor& configured, Sensor& out) {
  const double quiet = noise.quiet(), force = noise.force();
  out.R_alpha = quiet * configured.R_alpha;
  out.R_c = quiet * configured.R_c;
  out.known = configured.known / quiet;
  out.spread = quiet * configured.spread;
  out.R_p = force * configured.R_p;
}

}  // namespace gyrofree::rate
