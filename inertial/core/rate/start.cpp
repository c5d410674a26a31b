// A start while turning (E-46).
//
// The products give omega but for its sign, and only as well as their biases are known; gravity, turning
// in the body, gives the rest, the sign as well. A filter is no way to begin there: with so wide a P its
// first few corrections are far from linear. So the most probable state of the first samples is found
// for both signs, by Gauss and Newton with the filter's own model and what is known before any sample.
#include "rate/start.hpp"

#include "common/decompositions.hpp"

namespace gyrofree::rate {
namespace {

constexpr int ROUNDS = 14;        // of Gauss and Newton, at most
constexpr double ENOUGH = 0.2;    // of the misfit, by which a round must be better than the one before
constexpr double ANY_RATE = 5.0;  // rad/s, sigma of omega about what the products say: samples shall tell it
constexpr double ANY_ANGLE = 1e-4;  // rad
constexpr int SEEN = 9;             // of one sample: products, then force
constexpr int SEEN_FORCE = 6;

const Along FREE{Matrix3::Identity(), false};  // all of omega' is integrated

// Normal equations about one state of the first sample, and where the samples lead from there.
struct Normal {
  Covariance N;
  StateVector g;
  double misfit = 0.0;
  StateVector x;                                // at the newest sample
  Covariance moved = Covariance::Identity();    // d x / d first state
};

class Fit {
 public:
  Fit(const Filter& known, const Watch& w, const Sensor& s, const Tuning& t, int n, const Measurement& mean)
      : w_(w), s_(s), t_(t), n_(n), alpha_(mean.segment<3>(ALPHA_M)), prior_(known.x), know_(known.P) {
    const Cholesky<Covariance> factor(known.P);
    usable_ = factor.positive;
    if (usable_) know_ = factor.solved(Covariance(Covariance::Identity()));
  }

  bool usable() const { return usable_; }
  Normal about(const StateVector& start) const;

 private:
  void size_of_gravity(const StateVector& start, Normal& normal) const;
  Matrix<SEEN> weight(const StateVector& start) const;
  void add_sample(Normal& normal, const Measurement& y, const Matrix<SEEN>& weight) const;

  const Watch& w_;
  const Sensor& s_;
  const Tuning& t_;
  const int n_;
  // omega' that the pivot is told by is the mean: noise in it would seem to say that the centre is on
  // the axis
  const Vector3 alpha_;
  const StateVector prior_;
  Covariance know_;
  bool usable_ = false;
};

// The size of u is known, whatever its direction.
void Fit::size_of_gravity(const StateVector& start, Normal& normal) const {
  const Vector3 lift = start.segment<3>(LIFT);
  const double felt = norm_of(lift), off = GRAVITY - felt;
  const Vector3 up = lift / felt;
  normal.misfit += off * off / t_.gravity;
  normal.g.segment<3>(LIFT) += up * (off / t_.gravity);
  normal.N.block<3, 3>(LIFT, LIFT) += up * up.transpose() / t_.gravity;
}

Matrix<SEEN> Fit::weight(const StateVector& start) const {
  const double arm = square_of(start.segment<3>(PIVOT));
  Matrix<SEEN> noise = Matrix<SEEN>::Zero();
  noise.topLeftCorner<6, 6>() = s_.R_c;
  noise.bottomRightCorner<3, 3>() = s_.R_p + (t_.centre + arm * s_.R_alpha(0, 0) / n_) * Matrix3::Identity();
  return Cholesky<Matrix<SEEN>>(noise).solved(Matrix<SEEN>(Matrix<SEEN>::Identity()));
}

void Fit::add_sample(Normal& normal, const Measurement& y, const Matrix<SEEN>& weight) const {
  const StateVector& x = normal.x;
  const Vector3 omega = x.segment<3>(OMEGA);
  const ForceModel h = force_model(x, alpha_ - x.segment<3>(BIAS_ALPHA), s_);
  Matrix<SEEN, STATES> H = Matrix<SEEN, STATES>::Zero();
  H.block<6, 3>(0, OMEGA) = products_model(omega, s_);
  H.block<6, 6>(0, BIAS_PRODUCTS).setIdentity();
  H.block<3, 3>(SEEN_FORCE, OMEGA) = h.by_omega;
  H.block<3, 3>(SEEN_FORCE, PIVOT) = h.by_pivot;
  H.block<3, 3>(SEEN_FORCE, LIFT).setIdentity();
  H.block<3, 3>(SEEN_FORCE, BIAS_FORCE).setIdentity();
  Vector<SEEN> r;
  r.head<6>() = y.segment<6>(PRODUCTS_M) - product(s_.M, squares(omega)) - x.segment<6>(BIAS_PRODUCTS);
  r.tail<3>() = y.segment<3>(FORCE_M) - measured_force(x, h, s_);
  const Matrix<STATES, SEEN> Gt = product(H, normal.moved).transpose();
  const Matrix<STATES, SEEN> GtW = product(Gt, weight);
  normal.N += product_transposed(GtW, Gt);
  normal.g += product(GtW, r);
  normal.misfit += dot(r, product(weight, r));
}

Normal Fit::about(const StateVector& start) const {
  Normal normal;
  const StateVector away = start - prior_;
  normal.N = know_;
  normal.g = -product(know_, away);
  normal.misfit = -dot(away, normal.g);
  normal.x = start;
  size_of_gravity(start, normal);
  const Matrix<SEEN> weight = this->weight(start);
  for (int ago = n_ - 1; ago >= 0; --ago) {
    const long k = w_.newest() - ago;
    if (ago < n_ - 1) {
      const Vector3 alpha = 0.5 * (w_.y(k) + w_.y(k - 1)).segment<3>(ALPHA_M);
      const Transition F = move(normal.x, {alpha, FREE, w_.dt(k), true, Vector3::Zero()}, s_);
      normal.moved = product(F.dense(), normal.moved);
    }
    add_sample(normal, w_.y(k), weight);
  }
  return normal;
}

// The most probable first state from the guess `first`, by damped rounds.
Normal most_probable(const Fit& fit, StateVector& first, const StateVector& prior, const Covariance& unknown) {
  StateVector start = first, best = prior, pull = prior;
  Covariance size = unknown;
  double damp = 1e-3, lowest = std::numeric_limits<double>::infinity();
  for (int round = 1;; ++round) {
    Normal normal = fit.about(start);
    if (normal.misfit < lowest || round == ROUNDS) {
      const double better = lowest - normal.misfit;
      best = start;
      damp *= 0.1;
      lowest = normal.misfit;
      if (better < ENOUGH || round == ROUNDS) {
        first = best;
        return normal;
      }
      size = normal.N;
      pull = normal.g;
    } else {  // too far
      damp *= 10.0;
    }
    Covariance damped = size;
    for (int i = 0; i < STATES; ++i) damped(i, i) += damp * size(i, i);
    start = best;
    if (round < ROUNDS - 1) start += Cholesky<Covariance>(damped).solved(pull);
  }
}

// What is known before any sample: of omega nothing but that the products are right about its size.
void widen(Filter& f, const Tuning& t, double size) {
  f.P.middleRows<3>(OMEGA).setZero();
  f.P.middleCols<3>(OMEGA).setZero();
  f.P.block<3, 3>(OMEGA, OMEGA) = ANY_RATE * ANY_RATE * Matrix3::Identity();
  // centripetal acceleration was taken for gravity
  f.P.block<3, 3>(LIFT, LIFT) += t.pivot * size * size * Matrix3::Identity();
  f.P(ANGLE, ANGLE) = ANY_ANGLE * ANY_ANGLE;
}

// Turns the attitude by a rotation vector in b.
void turn(Filter& f, const Vector3& v) { f.q_nb = f.q_nb * from_rotation_vector(v); }

// The filter becomes that of the newest sample, and its attitude that which began level.
void settle(Filter& f, const Normal& normal, const Covariance& P_first, const StateVector& first, const Watch& w,
            const Sensor& s, int n, const Vector3& alpha_mean) {
  const double dt = w.dt(w.newest());
  f.x = normal.x;
  f.P = product_transposed(product(normal.moved, P_first), normal.moved);
  symmetrise(f.P);
  f.P.block<3, 3>(OMEGA, OMEGA) += n * dt * dt * s.R_alpha;
  f.alpha_m = w.y(w.newest()).segment<3>(ALPHA_M);
  f.alpha_late = alpha_mean;
  f.sign_variance = 0.0;
  const Vector3 lift = first.segment<3>(LIFT);
  f.q_nb = level(lift / norm_of(lift));
  turn(f, (n - 1) * dt * 0.5 * (first.segment<3>(OMEGA) + normal.x.segment<3>(OMEGA)));
}

// Most probable state after the newest n samples: log evidence; the filter holds what is known before.
double fit(Start& begun, const Watch& w, const Sensor& s, const Tuning& t, int n, const Measurement& mean,
           double size) {
  Filter& f = begun.filter;
  widen(f, t, size);
  const Fit model(f, w, s, t, n, mean);
  if (!model.usable()) return std::numeric_limits<double>::quiet_NaN();
  const Normal normal = most_probable(model, begun.first, f.x, f.P);
  const Cholesky<Covariance> factor(normal.N);
  if (!factor.positive) return std::numeric_limits<double>::quiet_NaN();
  const Covariance P_first = factor.solved(Covariance(Covariance::Identity()));
  settle(f, normal, P_first, begun.first, w, s, n, mean.segment<3>(ALPHA_M));
  double log_root = 0.0;
  for (int i = 0; i < STATES; ++i) log_root += elementary::log(factor.L(i, i));
  return -0.5 * normal.misfit - log_root;
}

}  // namespace

bool turns(const Watch& w, const Sensor& s, const Tuning& t) {
  if (w.filled_samples() < FEWEST || !s.plain) return false;
  const int n = std::min(w.filled_samples(), 32);
  if (w.rough(s, n)) return false;  // a damaged sample
  const Products z = w.mean_of(n).segment<6>(PRODUCTS_M);
  const double size = SymmetricEigen<Matrix3>(outer(z)).values(2);
  const double noise = t.bias * s.drift(PRODUCTS_M, PRODUCTS_M) + s.R_c(0, 0) / n;
  return size > 0.0 && size * size > t.start_turning * noise;
}

double begin_turning(Start& likelier, Start& other, const Watch& w, const Sensor& s, const Tuning& t, int n) {
  constexpr double LEAST = 0.1;  // (rad/s)^2
  const Measurement mean = w.mean_of(n);
  const SymmetricEigen<Matrix3> eigen(outer(Products(mean.segment<6>(PRODUCTS_M))));
  const double size = std::max(eigen.values(2), LEAST);
  const Vector3 direction = eigen.vectors.col(2);
  double evidence[2];
  for (const int k : {0, 1}) {
    Start& begun = k == 0 ? likelier : other;
    begin_still(begun.filter, s, t, mean);
    begun.filter.x.segment<3>(OMEGA) = (k == 0 ? 1.0 : -1.0) * std::sqrt(size) * direction;
    if (n == FEWEST) begun.first = begun.filter.x;
    evidence[k] = fit(begun, w, s, t, n, mean, size);
  }
  const double ratio = evidence[0] - evidence[1];
  if (!(ratio >= 0.0)) std::swap(likelier, other);
  return std::isfinite(ratio) ? std::fabs(ratio) : 0.0;
}

void carry(Filter& f, const Measurement& y, double dt, const Sensor& s, const Tuning& t) {
  const Vector3 before = f.omega(), alpha_m = y.segment<3>(ALPHA_M);
  const Drive drive{0.5 * (f.alpha_m + alpha_m), FREE, dt, true, Vector3::Zero()};
  predict(f.x, f.P, drive, s);
  add_noise(f.P, drive, s, t);
  turn(f, 0.5 * dt * (before + f.omega()));
  f.alpha_m = alpha_m;
}

}  // namespace gyrofree::rate
