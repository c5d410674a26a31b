// Rotations: quaternions w x y z of unit length, direction cosine matrices C_nb (E-10 to E-12).
// numpy twin: inertial/rotation.py.
#pragma once

#include "common/elementary.hpp"
#include "common/matrix.hpp"

namespace gyrofree {

struct Quaternion {
  double w = 1.0;
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
};

// Hamilton product p q: first q, then p.
inline Quaternion operator*(const Quaternion& p, const Quaternion& q) {
  return {p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z, p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y,
          p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x, p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w};
}

inline Quaternion normalised(const Quaternion& q) {
  const double f = 1.0 / std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  return {f * q.w, f * q.x, f * q.y, f * q.z};
}

// Quaternion of the turn by |v| rad about v; below half a radian by series (E-10).
inline Quaternion from_rotation_vector(const Vector3& v) {
  const double s = 0.25 * square_of(v);  // square of half the angle
  double w = 0.0;
  double k = 0.0;
  if (s < 0.0625) {
    w = 1.0 - s * (1.0 / 2.0 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * (1.0 / 40320.0 - s / 3628800.0))));
    k = 0.5 - s * (1.0 / 12.0 - s * (1.0 / 240.0 - s * (1.0 / 10080.0 - s * (1.0 / 725760.0 - s / 79833600.0))));
  } else {
    const double half = std::sqrt(s);
    w = elementary::cos(half);
    k = 0.5 * elementary::sin(half) / half;
  }
  return {w, k * v.x(), k * v.y(), k * v.z()};
}

// Direction cosine matrix of a quaternion of unit length.
inline Matrix3 to_matrix(const Quaternion& q) {
  const double xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z;
  const double xy = q.x * q.y, xz = q.x * q.z, yz = q.y * q.z;
  const double wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z;
  Matrix3 C;
  C << 1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy), 2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz),
      2.0 * (yz - wx), 2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy);
  return C;
}

inline Matrix3 turn_matrix(const Vector3& v) { return to_matrix(from_rotation_vector(v)); }

}  // namespace gyrofree
