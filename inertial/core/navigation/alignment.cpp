#include "navigation/alignment.hpp"

#include <algorithm>

namespace gyrofree::navigation {
namespace {

constexpr double SAME = 1e-9;  // s, times that differ by less are one

// Lets a sample act for dt: the mean of the attitudes before and after turns its force.
void act(Carried& now, const Vector3& f_b, const Vector3& omega_b, const Biases& bias, double dt) {
  const Matrix3 after = product(now.C_0k, turn_matrix((omega_b - bias.gyro_b) * dt));
  const Matrix3 mean = 0.5 * (now.C_0k + after);
  now.u_0 += apply(mean, f_b - bias.accel_b) * dt;
  now.C_0k = after;
}

}  // namespace

std::vector<Carried> carried(const WindowSamples& samples, const Eigen::Map<const Eigen::VectorXd>& times,
                             const Biases& bias) {
  std::vector<Carried> out;
  out.reserve(static_cast<std::size_t>(times.size()));
  Carried now;
  double t = times(0);
  for (Eigen::Index i = 0; i < samples.t.size(); ++i) {
    auto next = static_cast<Eigen::Index>(out.size()) + 1;
    while (next < times.size() && t < samples.t(i)) {
      const double dt = std::min(samples.t(i), times(next)) - t;
      act(now, samples.f_b.row(i), samples.omega_b.row(i), bias, dt);
      t += dt;
      if (t < times(next) - SAME) break;
      out.push_back(now);
      t = times(next++);
    }
  }
  while (static_cast<Eigen::Index>(out.size()) + 1 < times.size()) out.push_back(now);
  return out;
}

}  // namespace gyrofree::navigation
