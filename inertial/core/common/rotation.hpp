// Rotations: quaternions w x y z of unit length, direction cosine matrices C_nb, rotation vectors,
// Euler angles (E-10 to E-12 of docs/equations.md, E-103 and E-115 of docs/equations-ins.md).
// numpy twin, with the same bits: inertial/rotation.py.
#pragma once

#include <optional>

#include "common/elementary.hpp"
#include "common/matrix.hpp"

namespace gyrofree {

// Columns and rows of a matrix, components of a vector.
enum Axis : int { X, Y, Z };

struct Quaternion {
  double w = 1.0;
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("w", s.w), v("x", s.x), v("y", s.y), v("z", s.z);
  }
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

// q_ba of q_ab.
inline Quaternion conjugate(const Quaternion& q) { return {q.w, -q.x, -q.y, -q.z}; }

// C v, each sum from term 0 on.
inline Vector3 apply(const Matrix3& C, const Vector3& v) {
  return {dot(C.row(X), v), dot(C.row(Y), v), dot(C.row(Z), v)};
}

// v_n of v_b.
inline Vector3 rotate(const Quaternion& q_nb, const Vector3& v_b) { return apply(to_matrix(q_nb), v_b); }

// Quaternion, w >= 0, of a matrix: by its largest component, which loses nothing near half turns (Shepperd).
inline Quaternion from_matrix(const Matrix3& C) {
  const double trace = C(X, X) + C(Y, Y) + C(Z, Z);
  const double ww = 1.0 + trace;  // 4 w^2, and so on
  const double xx = 1.0 - trace + 2.0 * C(X, X);
  const double yy = 1.0 - trace + 2.0 * C(Y, Y);
  const double zz = 1.0 - trace + 2.0 * C(Z, Z);
  const double wx = C(Z, Y) - C(Y, Z), wy = C(X, Z) - C(Z, X), wz = C(Y, X) - C(X, Y);
  const double xy = C(X, Y) + C(Y, X), xz = C(X, Z) + C(Z, X), yz = C(Y, Z) + C(Z, Y);
  Quaternion q{ww, wx, wy, wz};
  double largest = ww;
  if (xx > largest) {
    q = {wx, xx, xy, xz};
    largest = xx;
  }
  if (yy > largest) {
    q = {wy, xy, yy, yz};
    largest = yy;
  }
  if (zz > largest) q = {wz, xz, yz, zz};
  q = normalised(q);
  return q.w < 0.0 ? Quaternion{-q.w, -q.x, -q.y, -q.z} : q;
}

// Log: rotation vector of a matrix, for angles below pi.
inline Vector3 rotation_vector(const Matrix3& C) {
  const Vector3 v(C(Z, Y) - C(Y, Z), C(X, Z) - C(Z, X), C(Y, X) - C(X, Y));
  const double sine = 0.5 * norm_of(v);
  if (sine < 1e-12) return 0.5 * v;
  const double angle = elementary::atan2(sine, 0.5 * (C(X, X) + C(Y, Y) + C(Z, Z) - 1.0));
  return (0.5 * angle / sine) * v;
}

struct EulerAngles {
  double roll = 0.0;  // rad
  double pitch = 0.0;
  double yaw = 0.0;
};

// C_nb = Rz(yaw) Ry(pitch) Rx(roll) (E-103).
inline Matrix3 euler_matrix(const EulerAngles& a) {
  const double cr = elementary::cos(a.roll), sr = elementary::sin(a.roll);
  const double cp = elementary::cos(a.pitch), sp = elementary::sin(a.pitch);
  const double cy = elementary::cos(a.yaw), sy = elementary::sin(a.yaw);
  Matrix3 C;
  C << cp * cy, sr * sp * cy - cr * sy, sr * sy + cr * sp * cy,  //
      cp * sy, cr * cy + sr * sp * sy, cr * sp * sy - sr * cy,   //
      -sp, sr * cp, cr * cp;
  return C;
}

// Of C_nb; at pitch +-90 degrees roll and yaw are not separate.
inline EulerAngles euler_angles(const Matrix3& C) {
  return {elementary::atan2(C(Z, Y), C(Z, Z)), elementary::asin(-C(Z, X)), elementary::atan2(C(Y, X), C(X, X))};
}

// q_nb of a body at rest that feels f_b; heading such that x_b points north (E-11). None when f_b is
// zero, not finite, or along x_b, where x_b has no heading.
inline std::optional<Quaternion> level(const Vector3& f_b) {
  const double size = norm_of(f_b);
  if (!std::isfinite(size) || size == 0.0) return std::nullopt;
  const Vector3 down = f_b / -size;
  const Vector3 part(1.0 - down.x() * down.x(), -down.x() * down.y(), -down.x() * down.z());
  const double length = norm_of(part);
  if (length < 1e-6) return std::nullopt;
  const Vector3 north = part / length;
  const Vector3 east(down.y() * north.z() - down.z() * north.y(), down.z() * north.x() - down.x() * north.z(),
                     down.x() * north.y() - down.y() * north.x());
  Matrix3 C;
  C.row(X) = north;
  C.row(Y) = east;
  C.row(Z) = down;
  return from_matrix(C);
}

// Roll and pitch of a body at rest that feels f_b; yaw 0 (E-115).
inline EulerAngles roll_pitch(const Vector3& f_b) {
  return {elementary::atan2(-f_b.y(), -f_b.z()),
          elementary::atan2(f_b.x(), std::sqrt(f_b.y() * f_b.y() + f_b.z() * f_b.z())), 0.0};
}

// q_nb turned by the fraction gain of the way that brings up_b onto n's up; heading is kept; not
// turned where up_b is zero (E-12).
inline Quaternion upright(const Quaternion& q_nb, const Vector3& up_b, double gain = 1.0) {
  const double size = norm_of(up_b);
  if (!(size > 0.0)) return q_nb;
  const Vector3 up_n = rotate(q_nb, up_b / size);
  // up_n x (0, 0, -1): horizontal, as long as the sine of the tilt error
  return normalised(from_rotation_vector({-gain * up_n.y(), gain * up_n.x(), 0.0}) * q_nb);
}

}  // namespace gyrofree
