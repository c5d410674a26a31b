// One measurement: residual, NIS, gain, robust weights. E-110 to E-113, E-118, E-119.
#pragma once

#include <array>

#include "navigation/state.hpp"

namespace gyrofree::navigation {

constexpr int MOST_ROWS = 7;

// Rows of a fix: position north, east, height (m), v_n (m/s), heading (rad). What a fix does not have
// is left out, the rest closes up.
constexpr int POSITION_ROW = 0, VELOCITY_ROW = 3, HEADING_ROW = 6;
// Its groups, which are weighted apart.
constexpr int POSITION = 0, VELOCITY = 1, HEADING = 2, GROUPS = 3;

using RowVector = VectorUpTo<MOST_ROWS>;
using RowMatrix = UpTo<MOST_ROWS>;
using Weights = Eigen::Matrix<double, GROUPS, 1>;

// A fix as the filters take it; sigmas are floored already.
struct Fix {
  double t = 0.0;                      // s
  double latitude = 0.0;               // rad
  double longitude = 0.0;              // rad
  double height = 0.0;                 // m; no number: unknown
  Vector3 v_n = Vector3::Zero();       // m/s; no number for down: unknown
  double yaw = 0.0;                    // rad
  Vector3 sigma_p = Vector3::Ones();   // m, north east up
  Vector3 sigma_v = Vector3::Ones();   // m/s
  double sigma_yaw = 1.0;              // rad
  bool has_v = false;
  bool has_yaw = false;
  bool withheld = false;               // only to score the filter with
  double timing = 0.0;                 // s, of its time against the samples' clock

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("t", s.t), v("latitude", s.latitude), v("longitude", s.longitude), v("height", s.height);
    v("v_n", s.v_n), v("yaw", s.yaw), v("sigma_p", s.sigma_p), v("sigma_v", s.sigma_v);
    v("sigma_yaw", s.sigma_yaw), v("has_v", s.has_v), v("has_yaw", s.has_yaw);
    v("withheld", s.withheld), v("timing", s.timing);
  }
};

// y = H error + noise, noise ~ N(0, R); y is computed - measured.
struct Measurement {
  RowVector y;
  UpTo<MOST_ROWS, MOST_STATES> H;
  RowMatrix R;

  Measurement() = default;
  Measurement(int rows, int states)
      : y(RowVector::Zero(rows)),
        H(UpTo<MOST_ROWS, MOST_STATES>::Zero(rows, states)),
        R(RowMatrix::Zero(rows, rows)) {}
  int rows() const { return static_cast<int>(y.size()); }

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("y", s.y), v("H", s.H), v("R", s.R);
  }
};

// Where a group stands among the rows of a fix.
struct Block {
  int group;
  int first;
  int size;
};
struct Blocks {
  std::array<Block, GROUPS> block;
  int count;
  const Block* begin() const { return block.data(); }
  const Block* end() const { return block.data() + count; }
};
Blocks blocks_of(int rows);  // 3, 4, 6 or 7

// All seven rows of a fix at the leg's state; rate_b is the measured rate, lever_b the antenna from
// the IMU (E-110, E-118). R stays zero.
Measurement compared(const Leg& leg, const Model& model, const Vector3& rate_b, const Vector3& lever_b,
                     const Fix& fix);
// Of them those that the fix has, with R (E-111). Where a height or a vertical speed is unknown, its row
// stays and is silent.
Measurement chosen(const Measurement& all, const Fix& fix);
bool is_silent(const Measurement& z, int row);
int said_rows(const Measurement& z);  // those that are not

// P H^T and S = H P H^T + R (E-112).
struct Innovation {
  UpTo<MOST_STATES, MOST_ROWS> PHt;
  RowMatrix S;
};
Innovation innovate(const Covariance& P, const Measurement& z);

// S = L L^T, u = L^-1 y; NIS = u^T u, or no number where S is not positive.
struct Whitened {
  Cholesky<RowMatrix> factor;
  RowVector u;
  double nis;
};
Whitened whiten(const RowMatrix& S, const RowVector& y);

// P := (I - K H) P; returns K y (E-113).
StateVector absorb(Covariance& P, const Innovation& innovation, const Whitened& white);

// Huber weights: limit / d where a group's Mahalanobis distance d exceeds the limit (E-119).
Weights huber_weights(const RowMatrix& S, const RowVector& y, double limit);
// Raises R so that each group of S grows by 1 / weight: the gain is then Huber's (E-119).
void inflate(RowMatrix& S, RowMatrix& R, const Weights& weight);
// Multiplies P by the smallest power of 2 that brings NIS down to the rows that say anything; returns it.
double make_consistent(Covariance& P, const Measurement& z);

}  // namespace gyrofree::navigation
