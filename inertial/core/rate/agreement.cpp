#include "rate/agreement.hpp"

namespace gyrofree::rate {

void Agreement::observe(const Said& said, int m, double dt) {
  constexpr double NIS_CLIP = 10.0;  // of NIS per degree of freedom: one damaged sample is no disagreement
  if (m == 0) return;
  const double nis = said.nis / m;
  fast_ += std::min(1.0, dt / NIS_S) * (std::min(std::isfinite(nis) ? nis : NIS_CLIP, NIS_CLIP) - fast_);
  if (!said.used) return;
  const double weight = std::min(0.5, dt / MEAN_S);
  double square_sum = 0.0;
  for (int k = 0; k < m; ++k) {
    mean_(k) += weight * (said.innovation(k) / said.sigma(k) - mean_(k));
    square_sum += square(mean_(k));
  }
  const double ratio = square_sum * (2.0 - weight) / (weight * m);
  slow_ += std::min(1.0, dt / OVER_S) * (ratio - slow_);
}

}  // namespace gyrofree::rate
