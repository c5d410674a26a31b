// How the products filter's state moves (E-30 to E-32, E-45, E-47).
#include "rate/filter.hpp"

namespace gyrofree::rate {
namespace {

constexpr int MOVED = 7;  // rows: omega, u, angle
constexpr int MOVED_LIFT = 3, MOVED_ANGLE = 6;
constexpr int moved_state(int k) { return k < MOVED_LIFT ? OMEGA + k : k < MOVED_ANGLE ? LIFT + k - 3 : ANGLE; }

// F M for those rows, of which M has the columns: (22 x k) becomes k columns of P F^T or of F P F^T.
Matrix<STATES, MOVED> moved_columns(const Covariance& P, const Transition& F) {
  Matrix<STATES, MOVED> G;
  const auto omega = P.middleCols<3>(OMEGA);
  const auto bias = P.middleCols<3>(BIAS_ALPHA);
  G.leftCols<3>() = columns_by(omega, F.A) - columns_by(bias, F.D);
  const Matrix<STATES, 3> middle = omega - F.back * bias;
  G.middleCols<3>(MOVED_LIFT) = columns_by(P.middleCols<3>(LIFT), F.C) + columns_by(middle, F.T);
  G.col(MOVED_ANGLE) = P.col(ANGLE) + F.dt * P.col(OMEGA + 2) - F.dt * F.back * P.col(BIAS_ALPHA + 2);
  return G;
}

// The other side: G becomes F G in the same rows.
void move_rows(Matrix<STATES, MOVED>& G, const Transition& F) {
  for (int j = 0; j < MOVED; ++j) {
    const Vector3 omega = G.block<3, 1>(OMEGA, j), bias = G.block<3, 1>(BIAS_ALPHA, j);
    const Vector3 middle = omega - F.back * bias;
    G.block<3, 1>(OMEGA, j) = F.A * omega - F.D * bias;
    G.block<3, 1>(LIFT, j) = F.C * Vector3(G.block<3, 1>(LIFT, j)) + F.T * middle;
    G(ANGLE, j) += F.dt * middle.z();
  }
}

// P = F P F^T in place (E-32).
void move_covariance(Covariance& P, const Transition& F) {
  Matrix<STATES, MOVED> G = moved_columns(P, F);
  move_rows(G, F);
  for (int k = 0; k < MOVED; ++k) {  // later ones decide where two meet: symmetric to the bit
    P.col(moved_state(k)) = G.col(k);
    P.row(moved_state(k)) = G.col(k).transpose();
  }
}

}  // namespace

Along along_axis(const Vector3& omega, bool fixed, bool turning) {
  Along along;
  if (!turning) return along;
  along.N.setIdentity();
  if (!fixed) return along;
  along.fixed = true;
  along.N = omega * omega.transpose() / square_of(omega);
  return along;
}

Vector3 free_alpha(const Vector3& alpha_m, const StateVector& x, const Sensor& s) {
  Vector3 alpha = alpha_m - x.segment<3>(BIAS_ALPHA);
  if (s.feedback) alpha -= product(s.SQ_alpha, squares(x.segment<3>(OMEGA)));
  return alpha;
}

Covariance Transition::dense() const {
  Covariance F = Covariance::Identity();
  F.block<3, 3>(OMEGA, OMEGA) = A;
  F.block<3, 3>(OMEGA, BIAS_ALPHA) = -D;
  F.block<3, 3>(LIFT, LIFT) = C;
  F.block<3, 3>(LIFT, OMEGA) = T;
  F.block<3, 3>(LIFT, BIAS_ALPHA) = -back * T;
  F(ANGLE, OMEGA + 2) = dt;
  F(ANGLE, BIAS_ALPHA + 2) = -dt * back;
  return F;
}

Transition move(StateVector& x, const Drive& drive, const Sensor& s) {
  const double dt = drive.dt;
  const Vector3 omega = x.segment<3>(OMEGA), lift = x.segment<3>(LIFT);
  const Matrix3& N = drive.along.N;
  Transition F;
  F.dt = dt;
  if (drive.turning) {
    const Vector3 alpha = free_alpha(drive.alpha_m, x, s);
    F.back = 0.5 * dt;
    F.D = dt * N;
    if (s.feedback) F.A -= dt * product(N, product(s.SQ_alpha, squares_jacobian(omega)));
    if (drive.along.fixed)  // a wrong direction grows with omega
      F.A += dt * dot(alpha, omega) / square_of(omega) * (Matrix3::Identity() - N);
    x.segment<3>(OMEGA) += dt * (N * alpha);
  }
  const Vector3 middle = 0.5 * (omega + x.segment<3>(OMEGA));
  x(ANGLE) += dt * middle.z();
  F.C = turn_matrix(-dt * (middle - drive.earth_b));
  x.segment<3>(LIFT) = F.C * lift;
  // u between the samples: right to second order in the turn of one sample
  F.T = skew(0.5 * dt * (lift + x.segment<3>(LIFT)));
  return F;
}

void predict(StateVector& x, Covariance& P, const Drive& drive, const Sensor& s) {
  move_covariance(P, move(x, drive, s));
}

void add_noise(Covariance& P, const Drive& drive, const Sensor& s, const Tuning& t) {
  const double dt = drive.dt;
  for (int i = 0; i < 3; ++i) P(PIVOT + i, PIVOT + i) += t.pivot_drift * dt;
  if (!drive.turning) return;
  auto omega = P.block<3, 3>(OMEGA, OMEGA);
  if (!drive.along.fixed) {
    omega += dt * dt * s.R_alpha;
    return;
  }
  const Matrix3& N = drive.along.N;  // of rank one: N R N = tr(N R) N
  const double along = dt * dt * trace(Matrix3(N * s.R_alpha)) - t.axis * dt;
  omega += along * N + t.axis * dt * Matrix3::Identity();
}

// Exponential forgetting (E-47): P grows by its own size, up to what is known before any sample.
void forget(Covariance& P, const Sensor& s, const Tuning& t, double amount) {
  constexpr double KNOWN_RATE = 4.0;  // (rad/s)^2
  const double root = elementary::exp(0.5 * amount);
  for (int i = OMEGA; i < LIFT; ++i) {
    const int bias = i - BIAS_ALPHA;
    const double known = bias < 0 ? KNOWN_RATE : t.bias * s.drift(bias, bias);
    if (P(i, i) >= known) continue;
    P.row(i) *= root;
    P.col(i) *= root;
  }
}

}  // namespace gyrofree::rate
