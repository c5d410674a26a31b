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

double Surprise::of_newest(int steps) const {
  Heard all;
  for (long k = count_ - steps; k < count_; ++k) {
    const Heard& one = ring_[static_cast<std::size_t>(k % KEPT)];
    all.sum += one.sum;
    all.samples += one.samples;
    all.C += one.samples * one.C;
    all.by_errors += one.by_errors * one.samples;  // of one sample, lasting
  }
  if (all.samples == 0) return 0.0;
  const Cholesky<Matrix<PRODUCTS>> factor(Matrix<PRODUCTS>(all.C + PLAUSIBLE * all.samples * all.by_errors));
  return factor.positive ? square_of(factor.whitened(all.sum)) : 0.0;
}

void Surprise::observe(const Heard& heard) {
  ring_[static_cast<std::size_t>(count_ % KEPT)] = heard;
  ++count_;
  worst_ = 0.0;
  const long most = std::min<long>(KEPT, count_);
  for (int steps = 1; steps <= most; steps += steps) worst_ = std::max(worst_, of_newest(steps));
}

}  // namespace gyrofree::rate
