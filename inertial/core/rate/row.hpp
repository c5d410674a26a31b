// What an estimator says after one sample: a row of a numpy structured array, whose type is made of the
// table below (inertial/rate/rows.py).
#pragma once

#include <cstddef>
#include <cstdint>

#include "rate/frame.hpp"

namespace gyrofree::rate {

enum Phase : std::uint8_t { WAITING, TWO_SIGNS, STILL, TURNING, STILL_AT_START, INTEGRATING };
enum Sight : std::uint8_t { VALID, AMBIGUOUS, BLIND };

struct Row {  // units: inertial/rate/batch.py
  double omega_b[3];
  double P[3][3];
  double alpha_b[3];
  double f_b[3];
  double q_nb[4];
  double angle_z;
  double innovation[PRODUCTS];
  double innovation_sigma[PRODUCTS];
  double nis;
  double p_n[3];
  double v_n[3];
  double bias[MEASURED];  // of omega', of p, of the products
  double sign_variance;
  double bound_sigma[3];
  std::uint8_t nis_dof;
  std::uint8_t still;
  std::uint8_t phase;
  std::uint8_t sight[3];
  std::uint8_t doubt;  // of Doubt: why nothing is valid
};

struct Field {
  const char* name;
  const char* type;  // of numpy
  std::size_t rows;
  std::size_t columns;  // 0: one number, or a row of them
  std::size_t offset;
};

#define GYROFREE_FIELD(name, type, rows, columns) {#name, type, rows, columns, offsetof(Row, name)}
constexpr Field ROW_FIELDS[] = {
    GYROFREE_FIELD(omega_b, "f8", 3, 0),
    GYROFREE_FIELD(P, "f8", 3, 3),
    GYROFREE_FIELD(alpha_b, "f8", 3, 0),
    GYROFREE_FIELD(f_b, "f8", 3, 0),
    GYROFREE_FIELD(q_nb, "f8", 4, 0),
    GYROFREE_FIELD(angle_z, "f8", 0, 0),
    GYROFREE_FIELD(innovation, "f8", PRODUCTS, 0),
    GYROFREE_FIELD(innovation_sigma, "f8", PRODUCTS, 0),
    GYROFREE_FIELD(nis, "f8", 0, 0),
    GYROFREE_FIELD(p_n, "f8", 3, 0),
    GYROFREE_FIELD(v_n, "f8", 3, 0),
    GYROFREE_FIELD(bias, "f8", MEASURED, 0),
    GYROFREE_FIELD(sign_variance, "f8", 0, 0),
    GYROFREE_FIELD(bound_sigma, "f8", 3, 0),
    GYROFREE_FIELD(nis_dof, "u1", 0, 0),
    GYROFREE_FIELD(still, "?", 0, 0),
    GYROFREE_FIELD(phase, "u1", 0, 0),
    GYROFREE_FIELD(sight, "u1", 3, 0),
    GYROFREE_FIELD(doubt, "u1", 0, 0),
};
#undef GYROFREE_FIELD

template <typename Numbers>
void put(double* to, const Numbers& from) {
  for (Eigen::Index i = 0; i < from.size(); ++i) to[i] = from(i);
}

inline void put(double* to, const Quaternion& q) {
  to[0] = q.w;
  to[1] = q.x;
  to[2] = q.y;
  to[3] = q.z;
}

// Fisher information of one sample's products on each component of omega, (rad/s)^-2 (E-43).
Vector3 information(const Vector3& omega, const Sensor& s);

// sight of a turning body: by component of omega, what is known of it (E-43).
struct Known {
  Vector3 omega_b;
  Vector3 variances;
  double sign_variance;
  bool two_signs;
};
void judge(const Known& known, const Sensor& s, double dt, std::uint8_t (&sight)[3]);

// The filter's state as a row; the bound is left as it is.
void write(const Frame& frame, const Constants& c, Row& row);

}  // namespace gyrofree::rate
