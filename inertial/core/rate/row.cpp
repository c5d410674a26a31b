#include "rate/row.hpp"

namespace gyrofree::rate {
namespace {

constexpr double DIRECTION = 5e-4;  // of omega: what scale errors of the axes may turn it by, sigma
constexpr double SIGN_SURE = 9.0;          // of omega^2 over the variance of its sign

// omega and the angle become the mean over both signs by their probability, P the covariance about it
// (E-46).
struct Mixed {
  Vector3 omega;
  Matrix3 P;
  double angle;
};

Mixed mixed(const Frame& frame, const Matrix3& inexact) {
  const Filter& f = frame.filter();
  if (!frame.two_signs()) {
    const double turned = square(DIRECTION) * f.speed_squared();
    return {f.omega(), f.omega_covariance() + turned * Matrix3::Identity() + inexact, f.x(ANGLE)};
  }
  const Filter& g = frame.other();
  const double wrong = 1.0 / (1.0 + elementary::exp(frame.balance()));
  const Vector3 apart = g.omega() - f.omega();
  return {f.omega() + wrong * apart,
          (1.0 - wrong) * f.omega_covariance() + wrong * g.omega_covariance() +
              wrong * (1.0 - wrong) * apart * apart.transpose() + inexact,
          f.x(ANGLE) + wrong * (g.x(ANGLE) - f.x(ANGLE))};
}

Phase phase_of(const Frame& frame) {
  if (!frame.started()) return WAITING;
  if (frame.two_signs()) return TWO_SIGNS;
  return frame.still() ? STILL : TURNING;
}

void write_sight(const Frame& frame, const Constants& c, Row& row) {
  const Sensor& s = frame.sensor(c);
  const Filter& f = frame.filter();
  Doubt doubt = frame.doubt();
  const bool forgets = static_cast<Method>(c.tuning.method) == Method::FORGET;  // its P is no covariance
  if (doubt == Doubt::NONE && forgets && frame.started() && !frame.still()) doubt = Doubt::NO_NOISE_MODEL;
  row.doubt = static_cast<std::uint8_t>(doubt);
  std::fill_n(row.sight, 3, frame.started() ? VALID : BLIND);
  if (doubt != Doubt::NONE) {
    std::fill_n(row.sight, 3, doubt == Doubt::STANDING ? AMBIGUOUS : BLIND);
    return;
  }
  if (!frame.started() || frame.still()) return;
  const Known known{f.omega(), f.omega_covariance().diagonal(), f.sign_variance, frame.two_signs()};
  judge(known, s, frame.dt(), row.sight);
}

}  // namespace

Vector3 information(const Vector3& omega, const Sensor& s) {
  const Matrix<PRODUCTS, 3> D = squares_jacobian(omega), KD = product(s.known, D);
  return {dot(D.col(0), KD.col(0)), dot(D.col(1), KD.col(1)), dot(D.col(2), KD.col(2))};
}

// blind: the products of one second would tell the component no better than BLIND_SIGMA, and what
// integration has gathered since is worse than that too. ambiguous: omega and -omega fit the products,
// and the integral through zero does not tell them apart.
void judge(const Known& known, const Sensor& s, double dt, std::uint8_t (&sight)[3]) {
  const Vector3 seen = information(known.omega_b, s);
  const double limit = dt / (BLIND_SIGMA * BLIND_SIGMA);
  const bool any = seen.x() > limit || seen.y() > limit || seen.z() > limit;
  const bool lost = known.two_signs || (square_of(known.omega_b) < SIGN_SURE * known.sign_variance && any);
  for (int k = 0; k < 3; ++k) {
    sight[k] = VALID;
    if (lost && known.omega_b(k) * known.omega_b(k) > SIGN_SURE * known.variances(k)) {
      sight[k] = AMBIGUOUS;
    } else if (!(seen(k) > limit) && known.variances(k) > BLIND_SIGMA * BLIND_SIGMA) {
      sight[k] = BLIND;
    }
  }
}

void write(const Frame& frame, const Constants& c, Row& row) {
  const Sensor& s = frame.sensor(c);
  const Filter& f = frame.filter();
  const Said& said = frame.said();
  const Measurement y = frame.newest();
  const Matrix3 inexact = frame.inexact().of_rate(c.tuning);
  const Mixed mean = mixed(frame, inexact);
  put(row.omega_b, mean.omega);
  put(row.P[0], mean.P);
  if (!frame.started())
    for (int i = 0; i < 3; ++i) row.P[i][i] = UNKNOWN_RATE * UNKNOWN_RATE;
  if (phase_of(frame) == STILL)  // it may have begun to turn, the more of it unseen the noisier the axes are
    for (int i = 0; i < 3; ++i) row.P[i][i] += c.tuning.unseen_rate * frame.noise().unnoticed();
  put(row.alpha_b, y.segment<3>(ALPHA_M) - f.x.segment<3>(BIAS_ALPHA));
  put(row.f_b, y.segment<3>(FORCE_M) - f.x.segment<3>(BIAS_FORCE));
  put(row.q_nb, f.q_nb);
  row.angle_z = mean.angle;
  put(row.innovation, said.innovation);
  put(row.innovation_sigma, said.sigma);
  row.nis = frame.started() ? said.nis : 0.0;
  row.nis_dof = row.nis != 0.0 ? s.m : 0;
  put(row.p_n, f.p_n);
  put(row.v_n, f.v_n);
  Measurement bias;
  bias << f.x.segment<3>(BIAS_ALPHA), f.x.segment<3>(BIAS_FORCE), f.x.segment<6>(BIAS_PRODUCTS);
  put(row.bias, bias);
  row.sign_variance = f.sign_variance;
  row.still = frame.still();
  row.phase = phase_of(frame);
  write_sight(frame, c, row);
}

}  // namespace gyrofree::rate
