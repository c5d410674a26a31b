#include "rate/parity.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <limits>

#include "common/elementary.hpp"

namespace gyrofree::parity {
namespace {

using Index = Eigen::Index;

constexpr double RATE_WALK = 2.5e-5;  // (rad/s)^2 a block: what the model of H-2 leaves out
constexpr std::array<int, PRODUCTS> FIRST = {0, 0, 0, 1, 1, 2};
constexpr std::array<int, PRODUCTS> SECOND = {0, 1, 2, 1, 2, 2};

// Rows of the axes that are used, in their order.
struct Chosen {
  std::array<Index, MOST_AXES> axis;
  Index size = 0;

  explicit Chosen(const Mask& used) {
    for (Index i = 0; i < used.size(); ++i)
      if (used(i)) axis[static_cast<std::size_t>(size++)] = i;
  }
  Index operator[](Index a) const { return axis[static_cast<std::size_t>(a)]; }
};

template <int Columns>
OfAxes<Columns> rows_of(const OfAxes<Columns>& all, const Chosen& used) {
  OfAxes<Columns> some(used.size, Columns);
  for (Index a = 0; a < used.size; ++a) some.row(a) = all.row(used[a]);
  return some;
}

Axes rows_of(const Axes& all, const Chosen& used) {
  Axes some(used.size);
  for (Index a = 0; a < used.size; ++a) some(a) = all(used[a]);
  return some;
}

// Transition of H-2 to first order.
Matrix<STATES> transition(const Vector<STATES>& x, double dt) {
  Matrix<STATES> F = Matrix<STATES>::Identity();
  F.block<3, 3>(OMEGA, ALPHA) = dt * Matrix3::Identity();
  F.block<3, 3>(P, P) -= dt * skew(x.segment<3>(OMEGA));
  F.block<3, 3>(P, OMEGA) = dt * skew(x.segment<3>(P));
  return F;
}

// The walks of omega' and p over dt, H-2.
void add_walk(Matrix<STATES>& covariance, double dt, const Tuning& tuning) {
  const double q = tuning.sigma_alpha * tuning.sigma_alpha * dt;
  for (int k = 0; k < 3; ++k) {
    covariance(OMEGA + k, OMEGA + k) += 0.25 * dt * dt * q + RATE_WALK;
    covariance(OMEGA + k, ALPHA + k) += 0.5 * dt * q;
    covariance(ALPHA + k, OMEGA + k) += 0.5 * dt * q;
    covariance(ALPHA + k, ALPHA + k) += q;
    covariance(P + k, P + k) += tuning.sigma_force * tuning.sigma_force * dt;
  }
}

// Mean, Jacobian by omega and covariance of the six products of the rate, second order (H-3).
struct RateProducts {
  Vector<PRODUCTS> mean;
  Eigen::Matrix<double, PRODUCTS, 3> jacobian = Eigen::Matrix<double, PRODUCTS, 3>::Zero();
  Matrix<PRODUCTS> spread;

  explicit RateProducts(const Belief& belief) {
    const Vector3 w = belief.x.segment<3>(OMEGA);
    const Matrix3 C = belief.covariance.block<3, 3>(OMEGA, OMEGA);
    for (std::size_t a = 0; a < PRODUCTS; ++a) {
      const int i = FIRST[a], j = SECOND[a];
      const Index row = static_cast<Index>(a);
      mean(row) = w(i) * w(j) + C(i, j);
      jacobian(row, i) += w(j);
      jacobian(row, j) += w(i);
      for (std::size_t b = 0; b < PRODUCTS; ++b) {
        const int k = FIRST[b], l = SECOND[b];
        spread(row, static_cast<Index>(b)) = C(i, k) * C(j, l) + C(i, l) * C(j, k);
      }
    }
  }
};

// Residual of every used axis against all others: (C^-1 nu)_i / (C^-1)_ii, sigma (C^-1)_ii^-1/2 (H-4).
void residuals_of_used(const Cholesky<AxisMatrix>& factor, const Axes& white, const Chosen& used, Fit& fit) {
  const AxisMatrix M = factor.whitened(AxisMatrix(AxisMatrix::Identity(used.size, used.size)));
  for (Index a = 0; a < used.size; ++a) {
    const double information = square_of(M.col(a));
    fit.residual(used[a]) = dot(M.col(a), white) / information;
    fit.sigma(used[a]) = 1.0 / std::sqrt(information);
  }
}

// Of an axis that is not used: its reading minus the prediction after the correction.
void residuals_of_others(const Belief& belief, const Axes& f, const Axes& R, const Mask& used, const Constants& c,
                         int offset_axis, Fit& fit) {
  const Observation o = observe(belief, c, offset_axis);
  const OfAxes<STATES> HP = product(o.H, belief.covariance);
  for (Index i = 0; i < f.size(); ++i) {
    if (used(i)) continue;
    fit.residual(i) = f(i) - o.reading(i);
    fit.sigma(i) = std::sqrt(std::max(dot(HP.row(i), o.H.row(i)), 0.0) + o.spread(i, i) + R(i));
  }
}

// x = argmin |A x - b| by normal equations with columns of length one, and what a unit of noise of
// each reading makes of every unknown. Unknown is false where A does not see all of them.
template <int Unknowns>
struct LeastSquares {
  Vector<Unknowns> x = Vector<Unknowns>::Zero();
  Vector<Unknowns> noise = Vector<Unknowns>::Zero();

  LeastSquares(OfAxes<Unknowns> A, const Axes& b) {
    Vector<Unknowns> length, along;
    for (int k = 0; k < Unknowns; ++k) {
      length(k) = norm_of(A.col(k));
      A.col(k) /= length(k);
      along(k) = dot(A.col(k), b);
    }
    const OfAxes<Unknowns> columns = A;
    const Cholesky<Matrix<Unknowns>> factor(Matrix<Unknowns>(product(columns.transpose(), columns)));
    if (!factor.positive) return;
    x = factor.solved(along).cwiseQuotient(length);
    const Matrix<Unknowns> M = factor.whitened(Matrix<Unknowns>(Matrix<Unknowns>::Identity()));
    for (int k = 0; k < Unknowns; ++k) noise(k) = norm_of(M.col(k)) / length(k);
  }
};

// Turns the plane of axes i and j so that S(i, j) becomes zero; V collects the turns.
void jacobi_turn(Matrix3& S, Matrix3& V, int i, int j) {
  if (S(i, j) == 0.0) return;
  const double slope = (S(j, j) - S(i, i)) / (2.0 * S(i, j));
  const double t = (slope >= 0.0 ? 1.0 : -1.0) / (std::abs(slope) + std::sqrt(slope * slope + 1.0));
  const double cosine = 1.0 / std::sqrt(t * t + 1.0), sine = t * cosine;
  Matrix3 G = Matrix3::Identity();
  G(i, i) = G(j, j) = cosine;
  G(i, j) = sine;
  G(j, i) = -sine;
  S = product(Matrix3(G.transpose()), product(S, G));
  V = product(V, G);
}

struct Eigenpair {
  double value;
  Vector3 vector;
};

// The largest eigenvalue of a symmetric matrix, by Jacobi's turns.
Eigenpair largest_of(Matrix3 S) {
  constexpr int SWEEPS = 8;
  Matrix3 V = Matrix3::Identity();
  for (int sweep = 0; sweep < SWEEPS; ++sweep)
    for (int i = 0; i < 3; ++i)
      for (int j = i + 1; j < 3; ++j) jacobi_turn(S, V, i, j);
  int most = 0;
  for (int k = 1; k < 3; ++k)
    if (S(k, k) > S(most, most)) most = k;
  return {S(most, most), V.col(most)};
}

// Axes that hypothesis `about` lets the filter use in block k; in block `since`, which may be mixed,
// it does without those in question.
Mask used_in(Index k, const Mask& used, const Hypothesis& about) {
  if (about.kind == Kind::None || k < about.since) return used;
  if (k != about.since && about.kind != Kind::Ignore) return used;
  Mask without = used;
  without(about.i) = false;
  if (about.j >= 0) without(about.j) = false;
  return without;
}

}  // namespace

// Belief after dt, s (H-2): omega' walks, p turns with the body and walks.
void predict(Belief& belief, double dt, const Tuning& tuning) {
  Vector<STATES>& x = belief.x;
  const Vector3 omega = x.segment<3>(OMEGA), p = x.segment<3>(P);
  const Matrix<STATES> F = transition(x, dt);
  const Vector3 turned = p.cross(omega);
  x.segment<3>(OMEGA) += dt * x.segment<3>(ALPHA);
  x.segment<3>(P) += dt * turned + 0.5 * dt * dt * turned.cross(omega);
  belief.covariance = product_transposed(product(F, belief.covariance), F);
  symmetrise(belief.covariance);
  add_walk(belief.covariance, dt, tuning);
}

// Predicted readings, their Jacobian and the spread of the products, second order (H-1, H-3).
Observation observe(const Belief& belief, const Constants& c, int offset_axis) {
  const RateProducts z(belief);
  const Index n = c.J.rows();
  Observation o{Axes(n), OfAxes<STATES>::Zero(n, STATES), AxisMatrix(n, n)};
  o.H.middleCols<3>(OMEGA) = product(c.Q, z.jacobian);
  o.H.middleCols<MOTION>(ALPHA) = c.J;
  o.reading = product(c.J, belief.x.segment<MOTION>(ALPHA)) + product(c.Q, z.mean);
  o.spread = product_transposed(product(c.Q, z.spread), c.Q);
  if (offset_axis >= 0) {
    o.H(offset_axis, OFFSET) = 1.0;
    o.reading(offset_axis) += belief.x(OFFSET);
  }
  return o;
}

// Correction by readings f (N) with variances R (N) of the axes `used` (H-4). NIS is not a number
// where the innovation has no covariance; the belief is then as it was.
Fit correct(Belief& belief, const Axes& f, const Axes& R, const Mask& used, const Constants& c, int offset_axis,
            bool residuals) {
  const Chosen chosen(used);
  const Observation o = observe(belief, c, offset_axis);
  const OfAxes<STATES> H = rows_of(o.H, chosen);
  const OfAxes<STATES> HP = product(H, belief.covariance);
  AxisMatrix C = product_transposed(HP, H);
  for (Index a = 0; a < chosen.size; ++a) {
    for (Index b = 0; b < chosen.size; ++b) C(a, b) += o.spread(chosen[a], chosen[b]);
    C(a, a) += R(chosen[a]);
  }
  const Cholesky<AxisMatrix> factor(C);
  Fit fit{std::numeric_limits<double>::quiet_NaN(), 0.0, Axes::Zero(0), Axes::Zero(0)};
  if (!factor.positive) return fit;
  const Axes white = factor.whitened(rows_of(Axes(f - o.reading), chosen));
  const OfAxes<STATES> G = factor.whitened(HP);  // gain K = G^T L^-1
  fit.nis = square_of(white);
  fit.log_determinant = 2.0 * elementary::log(factor.root_of_determinant());
  for (int k = 0; k < STATES; ++k) belief.x(k) += dot(G.col(k), white);
  belief.covariance -= product(G.transpose(), G);
  if (residuals) {
    fit.residual = fit.sigma = Axes::Zero(f.size());
    residuals_of_used(factor, white, chosen, fit);
    if (chosen.size < f.size()) residuals_of_others(belief, f, R, used, c, offset_axis, fit);
  }
  return fit;
}

// Variance of one block's readings (H-5): noise, offset not known, scale error times what has changed,
// and what of other axes' changes comes in by its direction.
Axes variances(const Axes& f, const Axes& reference, const Constants& c, const Tuning& tuning) {
  Axes R = c.white + c.offset;
  const double others = square(tuning.cross) * square_of(f - reference) / static_cast<double>(f.size());
  for (Index i = 0; i < f.size(); ++i) {
    const double error = tuning.scale * (f(i) - reference(i));
    R(i) += error * error + others;
  }
  return R;
}

// Readings without bias as they were if the hypothesis about axes i and j holds (H-6).
Axes altered(const Axes& f, const Axes& bias, const Axes& reference, const Hypothesis& about) {
  Axes g = f - bias;
  const int i = about.i, j = about.j;
  switch (about.kind) {
    case Kind::MirrorZero:
      g(i) = -f(i) - bias(i);
      break;
    case Kind::MirrorReference:
      g(i) = 2.0 * reference(i) - f(i) - bias(i);
      break;
    case Kind::Swap:
      g(i) = f(j) - bias(i);
      g(j) = f(i) - bias(j);
      break;
    case Kind::SwapChanges:
      g(i) = reference(i) + f(j) - reference(j) - bias(i);
      g(j) = reference(j) + f(i) - reference(i) - bias(j);
      break;
    case Kind::None:
    case Kind::OffsetOf:
    case Kind::Ignore:
      break;
  }
  return g;
}

// One block (N), dt (s) after the last; an axis that is not `learned` has no scale error.
Fit step(Belief& belief, const Axes& block, double dt, const Mask& used, const Mask& learned, const Constants& c,
         const Tuning& tuning) {
  Axes reference = block;
  for (Index i = 0; i < block.size(); ++i)
    if (learned(i)) reference(i) = c.reference(i);
  const Axes R = variances(block, reference, c, tuning);
  predict(belief, dt, tuning);
  return correct(belief, block - c.bias, R, used, c, -1, true);
}

// Runs the filter over blocks (n, N) under a hypothesis (H-8): the belief becomes that after the last.
Score replay(Belief& belief, const Readings& blocks, const Eigen::VectorXd& dt, const Mask& used,
             const Hypothesis& about, const Constants& c, const Tuning& tuning) {
  belief.x(OFFSET) = 0.0;
  belief.covariance.row(OFFSET).setZero();
  belief.covariance.col(OFFSET).setZero();
  if (about.kind == Kind::OffsetOf) belief.covariance(OFFSET, OFFSET) = UNUSED_SIGMA * UNUSED_SIGMA;
  const double unused = 2.0 * elementary::log(UNUSED_SIGMA);
  Score said{0.0, 0.0, 0};
  for (Index k = 0; k < blocks.rows(); ++k) {
    Hypothesis now = about;
    if (k <= about.since) now.kind = Kind::None;
    const Mask in_use = used_in(k, used, about);
    const Axes f = altered(blocks.row(k).transpose(), c.bias, c.reference, now);
    const Axes R = variances(f + c.bias, c.reference, c, tuning);
    predict(belief, dt(k), tuning);
    const int offset_axis = now.kind == Kind::OffsetOf ? now.i : -1;
    const Fit fit = correct(belief, f, R, in_use, c, offset_axis, false);
    if (!(fit.nis >= 0.0)) return {std::numeric_limits<double>::infinity(), fit.nis, 1};
    const int degrees = static_cast<int>(Chosen(in_use).size);
    said.score += fit.nis + fit.log_determinant + static_cast<double>(in_use.size() - degrees) * unused;
    said.nis += fit.nis;
    said.degrees += degrees;
  }
  return said;
}

// First belief from one block f (N) (H-7): omega from the products where they are plain, else about
// zero. `unknown`: m/s^2, sigma of what is not known of a reading.
Belief start(const Constants& c, const Axes& f, const Mask& used, double unknown, bool sees_products) {
  constexpr double SIGMA_ALPHA = 200.0, SIGMA_FORCE = 20.0;  // rad/s^2, m/s^2: nothing is known
  const Chosen chosen(used);
  Belief belief{Vector<STATES>::Zero(), Matrix<STATES>::Zero()};
  belief.x.segment<MOTION>(ALPHA) = LeastSquares<MOTION>(rows_of(c.J, chosen), rows_of(f, chosen)).x;
  double sigma = 1.0;  // rad/s
  if (sees_products && chosen.size == f.size()) {
    OfAxes<MOTION + PRODUCTS> field(f.size(), MOTION + PRODUCTS);
    field << c.J, c.Q;
    const LeastSquares<MOTION + PRODUCTS> found(field, f);
    const double noise = unknown * found.noise.tail<PRODUCTS>().maxCoeff();
    Matrix3 outer;
    for (std::size_t a = 0; a < PRODUCTS; ++a)
      outer(FIRST[a], SECOND[a]) = outer(SECOND[a], FIRST[a]) = found.x(MOTION + static_cast<Index>(a));
    const Eigenpair largest = largest_of(outer);
    if (largest.value > 3.0 * noise) {
      const double rate = std::sqrt(largest.value);
      belief.x.segment<3>(OMEGA) = rate * largest.vector;
      sigma = std::max(0.1, noise / (2.0 * rate));
    }
  }
  for (int k = 0; k < 3; ++k) {
    belief.covariance(OMEGA + k, OMEGA + k) = sigma * sigma;
    belief.covariance(ALPHA + k, ALPHA + k) = SIGMA_ALPHA * SIGMA_ALPHA;
    belief.covariance(P + k, P + k) = SIGMA_FORCE * SIGMA_FORCE;
  }
  return belief;
}

// What mean readings at rest leave once the specific force p that the used axes see is taken out.
Axes offsets_at_rest(const OfAxes<3>& theta, const Axes& mean, const Mask& used) {
  const Chosen chosen(used);
  const LeastSquares<3> force(rows_of(theta, chosen), rows_of(mean, chosen));
  return mean - product(theta, force.x);
}

}  // namespace gyrofree::parity
