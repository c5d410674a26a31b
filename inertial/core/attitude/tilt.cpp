#include "attitude/tilt.hpp"

#include <algorithm>

namespace gyrofree::attitude {
namespace {

constexpr double NO_LENGTH = 1e-9;  // of a blend of opposite directions, which has none of its own

// Shortest turn from a direction b in n onto up (0, 0, -1): quaternion (1 + b . up, b x up).
Quaternion onto_up(const Vector3& b_n) {
  const double c = 1.0 - b_n.z();
  if (c < 1e-12) return {0.0, -1.0, 0.0, 0.0};  // exactly upside down: any horizontal axis will do
  return normalised({c, -b_n.y(), b_n.x(), 0.0});
}

}  // namespace

Quaternion pulled_up(const Quaternion& q_nb, const Vector3& f_b, double part) {
  const double size = norm_of(f_b);
  if (size == 0.0) return q_nb;
  Vector3 blend = rotate(q_nb, f_b) / size * part;
  blend.z() -= 1.0 - part;  // what is felt, and up
  const double length = norm_of(blend);
  if (length < NO_LENGTH) return q_nb;
  return onto_up(blend / length) * q_nb;
}

Quaternion upright_from(const Vector3& up_b) { return pulled_up(Quaternion{}, up_b, 1.0); }

Vector3 from_projection_angles(double xz, double yz, double sign_z) {
  const double across_x = elementary::cos(xz) * elementary::tan(yz);
  const double across_y = elementary::cos(yz) * elementary::tan(xz);
  const double x = elementary::sin(xz) / std::sqrt(1.0 + across_x * across_x);
  const double y = elementary::sin(yz) / std::sqrt(1.0 + across_y * across_y);
  return {x, y, sign_z * std::sqrt(std::max(0.0, 1.0 - x * x - y * y))};
}

// R by the gyros alone (E-72 to E-74).
Vector3 PublishedTilt::turned(double next_xz, double next_yz) const {
  if (std::fabs(R_a.z()) < ILL_CONDITIONED) return R_a;
  const double xz = elementary::atan2(R_a.x(), R_a.z()) + period * 0.5 * (next_xz + rate_xz);
  const double yz = elementary::atan2(R_a.y(), R_a.z()) + period * 0.5 * (next_yz + rate_yz);
  return from_projection_angles(xz, yz, R_a.z() > 0.0 ? 1.0 : -1.0);
}

Quaternion PublishedTilt::step(const Vector3& f_b, const Vector3& omega_b) {
  const Vector3 f_a(f_b.x(), -f_b.y(), -f_b.z());
  const double size = norm_of(f_a);
  // the article ignores the rest: tipping so that x's reading rises is a turn about -y of a
  const double next_xz = omega_b.y(), next_yz = omega_b.x();
  if (started) {
    Vector3 R = turned(next_xz, next_yz);
    if (size > 0.0) R = f_a / size + w_gyro * R;  // (E-75)
    const double length = norm_of(R);
    if (length > NO_LENGTH) R_a = R / length;  // the accelerometer may say the exact opposite
  } else if (size > 0.0) {
    R_a = f_a / size;
    started = true;
  }
  rate_xz = next_xz;
  rate_yz = next_yz;
  return upright_from({R_a.x(), -R_a.y(), -R_a.z()});
}

Quaternion VectorTilt::step(const Vector3& f_b, const Vector3& next_omega_b) {
  if (started) {
    const Vector3 turn = 0.5 * period * (next_omega_b + omega_b);
    q_nb = normalised(pulled_up(q_nb * from_rotation_vector(turn), f_b, 1.0 / (1.0 + w_gyro)));
  } else if (square_of(f_b) > 0.0) {
    q_nb = upright_from(f_b);
    started = true;
  }
  omega_b = next_omega_b;
  return q_nb;
}

}  // namespace gyrofree::attitude
