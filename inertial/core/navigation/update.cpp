#include "navigation/update.hpp"

#include <limits>

#include "common/elementary.hpp"
#include "navigation/local_earth.hpp"

namespace gyrofree::navigation {
namespace {

constexpr double TWO_PI = 6.28318530717958623200;
constexpr double MOST_LAG_S = 2.0;        // ticks older than this tell nothing of a receiver's lag
constexpr double MOST_DOUBLING = 0x1p60;  // then the fix itself must be wrong

double wrapped(double angle) { return angle - TWO_PI * std::floor(angle / TWO_PI + 0.5); }

// Heights count up: the third component changes its sign.
Vector3 upward(Vector3 v) {
  v[HEIGHT] = -v[HEIGHT];
  return v;
}

struct Motion {
  Vector3 v_n;
  Vector3 a_n;
};

// v_n `lag` s before the leg's time and its derivative, by straight lines between the ticks.
Motion motion_before(const Leg& leg, double lag) {
  double later_t = leg.time;
  Vector3 later = leg.x.v_n;
  Motion m{later, Vector3::Zero()};
  int k = TICKS - 1;
  while (k >= 0 && leg.ticks[k].t > 0.0 && leg.ticks[k].t >= later_t - SAME_TIME_S) --k;
  for (; k >= 0 && leg.ticks[k].t > 0.0 && leg.time - leg.ticks[k].t < MOST_LAG_S; --k) {
    const Tick& tick = leg.ticks[k];
    m.a_n = (later - tick.v_n) / (later_t - tick.t);
    m.v_n = later + m.a_n * (leg.time - lag - later_t);
    if (tick.t <= leg.time - lag) return m;
    later = tick.v_n;
    later_t = tick.t;
  }
  return m;
}

// Antenna against fix, measured with our own radii: the same metres as the error state (E-110).
void position_rows(Measurement& z, const Nominal& x, const Vector3& arm_n, const Fix& fix) {
  const Vector3 ned = earth::ned_between(place_of(x), {fix.latitude, fix.longitude, fix.height});
  z.y.segment<3>(POSITION_ROW) = upward(arm_n - ned);
  z.H.block<3, 3>(POSITION_ROW, DP).setIdentity();
  z.H.block<3, 3>(POSITION_ROW, PSI) = skew(arm_n);
  z.H.block<1, 3>(POSITION_ROW + HEIGHT, PSI) *= -1.0;
}

// The antenna swings about the IMU with w_eb (E-110).
void velocity_rows(Measurement& z, const Nominal& x, const Vector3& swing_n, const Vector3& lever_b,
                   const Fix& fix) {
  z.y.segment<3>(VELOCITY_ROW) = x.v_n + swing_n - fix.v_n;
  z.H.block<3, 3>(VELOCITY_ROW, DV).setIdentity();
  z.H.block<3, 3>(VELOCITY_ROW, PSI) = skew(swing_n);
  z.H.block<3, 3>(VELOCITY_ROW, BIAS_GYRO) = -(x.C_nb * skew(lever_b));
}

// The receiver speaks of a moment before its time (E-118).
void late_rows(Measurement& z, const Leg& leg, const Model& model) {
  const Vector3 way = upward(motion_before(leg, 0.5 * leg.x.lag_position).v_n);
  z.y.segment<3>(POSITION_ROW) -= way * leg.x.lag_position;
  z.H.block<3, 1>(POSITION_ROW, model.lag_position) = -way;
  const Motion then = motion_before(leg, leg.x.lag_velocity);
  z.y.segment<3>(VELOCITY_ROW) += then.v_n - leg.x.v_n;
  z.H.block<3, 1>(VELOCITY_ROW, model.lag_velocity) = -then.a_n;
}

void heading_row(Measurement& z, const Attitude& C, const Fix& fix) {
  const Vector3 forward = C.col(0);
  const double flat = forward[NORTH] * forward[NORTH] + forward[EAST] * forward[EAST];
  z.y(HEADING_ROW) = wrapped(elementary::atan2(forward[EAST], forward[NORTH]) - fix.yaw);
  z.H(HEADING_ROW, PSI + NORTH) = forward[NORTH] * forward[DOWN] / flat;
  z.H(HEADING_ROW, PSI + EAST) = forward[EAST] * forward[DOWN] / flat;
  z.H(HEADING_ROW, PSI + DOWN) = -1.0;
}

}  // namespace

Blocks blocks_of(int rows) {
  Blocks out{{{{POSITION, POSITION_ROW, 3}, {VELOCITY, VELOCITY_ROW, 3}, {HEADING, rows - 1, 1}}}, 1};
  if (rows >= HEADING_ROW) out.count = 2;
  if (rows % 3 == 1) out.block[out.count++] = {HEADING, rows - 1, 1};
  return out;
}

Measurement compared(const Leg& leg, const Model& model, const Vector3& rate_b, const Vector3& lever_b,
                     const Fix& fix) {
  const Nominal& x = leg.x;
  const Matrix3 C = x.C_nb;
  const Vector3 omega_eb_b = rate_b - x.bias_gyro - x.scale_gyro.cwiseProduct(rate_b) -
                             C.transpose() * earth::earth_rate(x.latitude);
  Measurement z(MOST_ROWS, model.states);
  position_rows(z, x, C * lever_b, fix);
  velocity_rows(z, x, C * cross(omega_eb_b, lever_b), lever_b, fix);
  if (model.has_lag()) late_rows(z, leg, model);
  heading_row(z, x.C_nb, fix);
  return z;
}

// A row that the fix does not have says nothing: no difference, no sensitivity, a noise of its own.
void silence(Measurement& z, int row) {
  z.y(row) = 0.0;
  z.H.row(row).setZero();
  z.R.row(row).setZero();
  z.R.col(row).setZero();
  z.R(row, row) = 1.0;
}

Measurement chosen(const Measurement& all, const Fix& fix) {
  const int kept = fix.has_v ? HEADING_ROW : VELOCITY_ROW;
  const int rows = kept + (fix.has_yaw ? 1 : 0);
  Measurement z(rows, static_cast<int>(all.H.cols()));
  z.y.head(kept) = all.y.head(kept);
  z.H.topRows(kept) = all.H.topRows(kept);
  z.R.diagonal().segment<3>(POSITION_ROW) = fix.sigma_p.cwiseProduct(fix.sigma_p);
  if (fix.has_v) {
    z.R.diagonal().segment<3>(VELOCITY_ROW) = fix.sigma_v.cwiseProduct(fix.sigma_v);
    Vector3 way = upward(fix.v_n) * fix.timing;  // what its own timing costs (E-111)
    if (!std::isfinite(way[HEIGHT])) way[HEIGHT] = 0.0;
    z.R.block<3, 3>(POSITION_ROW, POSITION_ROW) += way * way.transpose();
  }
  if (fix.has_yaw) {
    z.y(kept) = all.y(HEADING_ROW);
    z.H.row(kept) = all.H.row(HEADING_ROW);
    z.R(kept, kept) = fix.sigma_yaw * fix.sigma_yaw;
  }
  if (!std::isfinite(fix.height)) silence(z, POSITION_ROW + HEIGHT);
  if (fix.has_v && !std::isfinite(fix.v_n[DOWN])) silence(z, VELOCITY_ROW + DOWN);
  return z;
}

bool is_silent(const Measurement& z, int row) { return (z.H.row(row).array() == 0.0).all(); }

int said_rows(const Measurement& z) {
  int said = 0;
  for (int r = 0; r < z.rows(); ++r) said += is_silent(z, r) ? 0 : 1;
  return said;
}

// H is mostly zeros, which cost nothing here.
Innovation innovate(const Covariance& P, const Measurement& z) {
  const int n = static_cast<int>(P.rows()), rows = z.rows();
  Innovation out{UpTo<MOST_STATES, MOST_ROWS>::Zero(n, rows), z.R};
  for (int r = 0; r < rows; ++r)
    for (int k = 0; k < n; ++k)
      if (z.H(r, k) != 0.0) out.PHt.col(r) += z.H(r, k) * P.col(k);
  for (int r = 0; r < rows; ++r)
    for (int k = 0; k < n; ++k)
      if (z.H(r, k) != 0.0) out.S.row(r) += z.H(r, k) * out.PHt.row(k);
  return out;
}

Whitened whiten(const RowMatrix& S, const RowVector& y) {
  Whitened out{Cholesky<RowMatrix>(S), y, std::numeric_limits<double>::quiet_NaN()};
  if (!out.factor.positive) return out;
  out.u = out.factor.whitened(y);
  out.nis = square_of(out.u);
  return out;
}

// W = P H^T L^-T: K y = W u, P - W W^T, symmetric (E-113).
StateVector absorb(Covariance& P, const Innovation& innovation, const Whitened& white) {
  const auto& L = white.factor.L;
  const int rows = static_cast<int>(L.rows()), n = static_cast<int>(P.rows());
  auto W = innovation.PHt;
  StateVector error = StateVector::Zero(n);
  for (int i = 0; i < rows; ++i) {
    for (int k = 0; k < i; ++k) W.col(i) -= L(i, k) * W.col(k);
    W.col(i) /= L(i, i);
    error += white.u(i) * W.col(i);
  }
  P -= product_transposed(W, W);
  return error;
}

Weights huber_weights(const RowMatrix& S, const RowVector& y, double limit) {
  Weights weight = Weights::Ones();
  for (const auto& [group, first, size] : blocks_of(static_cast<int>(y.size()))) {
    const double d = std::sqrt(whiten(S.block(first, first, size, size), y.segment(first, size)).nis);
    if (d > limit) weight(group) = limit / d;
  }
  return weight;
}

void inflate(RowMatrix& S, RowMatrix& R, const Weights& weight) {
  for (const auto& [group, first, size] : blocks_of(static_cast<int>(S.rows()))) {
    if (!(weight(group) < 1.0)) continue;
    const RowMatrix more = S.block(first, first, size, size) * (1.0 / weight(group) - 1.0);
    S.block(first, first, size, size) += more;
    R.block(first, first, size, size) += more;
  }
}

// For a filter that many fixes in a row contradict: its covariance is wrong, and by how much the fixes
// say. The correlations stay, so tilt and biases are found again too.
double make_consistent(Covariance& P, const Measurement& z) {
  double total = 1.0;
  while (total < MOST_DOUBLING) {
    if (whiten(innovate(P, z).S, z.y).nis <= said_rows(z)) break;
    total *= 2.0;
    P *= 2.0;
  }
  return total;
}

}  // namespace gyrofree::navigation
