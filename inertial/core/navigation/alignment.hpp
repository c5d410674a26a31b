// Alignment under way: what the samples of a window say between the times of its fixes (E-80 of
// docs/equations-in-motion.md). numpy twin: tests/support/twins/alignment.py.
#pragma once

#include <vector>

#include "common/rotation.hpp"

namespace gyrofree::navigation {

// Attitude and integral of the specific force in the body at the window's start.
struct Carried {
  Matrix3 C_0k = Matrix3::Identity();
  Vector3 u_0 = Vector3::Zero();  // m/s
};

struct Biases {
  Vector3 accel_b;  // m/s^2
  Vector3 gyro_b;   // rad/s
};

// Samples t (n,), f_b and omega_b (n, 3); sample i acts from t[i - 1] to t[i].
struct WindowSamples {
  Eigen::Map<const Eigen::VectorXd> t;
  Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>> f_b;
  Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>> omega_b;
};

// At every later one of the times (m + 1), which lie inside the samples (E-80). Times beyond the last
// sample stay at what was reached.
std::vector<Carried> carried(const WindowSamples& samples, const Eigen::Map<const Eigen::VectorXd>& times,
                             const Biases& bias);

}  // namespace gyrofree::navigation
