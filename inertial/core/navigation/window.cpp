#include "navigation/window.hpp"

#include <algorithm>

#include "navigation/leg.hpp"

namespace gyrofree::navigation {
namespace {

constexpr double SETTLED = 1e-3;  // change of a weight that ends the reweighting

// R of each group divided by its scale.
RowMatrix scaled(const RowMatrix& R, const Weights& scale) {
  RowMatrix out = R;
  const Blocks blocks = blocks_of(static_cast<int>(R.rows()));
  for (const Block& a : blocks)
    for (const Block& b : blocks)
      out.block(a.first, b.first, a.size, b.size) /= std::sqrt(scale(a.group) * scale(b.group));
  return out;
}

// y - H m
RowVector left_of(const Measurement& z, const StateVector& m) { return z.y - product(z.H, m); }

}  // namespace

void Window::push(const Transition& Phi, const Covariance& Q, const Measurement& z, const Covariance& start) {
  if (count == capacity()) {
    head = (head + 1) % capacity();
    --count;
  }
  ++count;
  Epoch& e = newest();
  e.Phi = Phi;
  e.Q = Q;
  e.z = z;
  e.start = start;
  e.applied = StateVector::Zero(Phi.states());
}

void Window::kalman_beside() {
  const Epoch& e = newest();
  Covariance P = predicted(kalman, e.Phi, e.Q);
  const Innovation innovation = innovate(P, e.z);
  absorb(P, innovation, whiten(innovation.S, e.z.y));
  kalman = P;
  if (seen >= 0) {
    ++seen;
    sum += P;
  }
}

Covariance Window::arrival(int N, Arrival mode, double kappa) const {
  if (mode == Arrival::KALMAN) return of_last(std::min(N, count), 0).start;
  if (mode == Arrival::START || count < N) return P0;
  return (kappa / std::max(seen, 1)) * sum;
}

void Window::forward(int n, const Covariance& P_arr) {
  StateVector mean = StateVector::Zero(P_arr.rows());
  Covariance P = P_arr;
  for (int j = 0; j < n; ++j) {
    Epoch& e = of_last(n, j);
    e.before = moved(e.Phi, mean);
    e.P_before = P = predicted(P, e.Phi, e.Q);
    const Measurement z = [&] {
      Measurement out = e.z;
      out.y = left_of(e.z, e.before);
      out.R = scaled(e.z.R, e.scale);
      return out;
    }();
    const Innovation innovation = innovate(P, z);
    e.after = e.before + absorb(P, innovation, whiten(innovation.S, z.y));
    e.P_after = P;
    mean = e.after - e.applied;
  }
}

void Window::smooth(int n) {
  newest().smoothed = newest().after;
  for (int j = n - 2; j >= 0; --j) {
    const Epoch& later = of_last(n, j + 1);
    Epoch& e = of_last(n, j);
    const StateVector gap = later.smoothed - later.before;
    const StateVector pulled = moved_back(later.Phi, Cholesky<Covariance>(later.P_before).solved(gap));
    e.smoothed = e.after + product(e.P_after, pulled);
  }
}

void Window::robust(int n, const Covariance& P_arr, double huber, int passes) {
  for (int j = 0; j < n; ++j) of_last(n, j).scale.setOnes();
  forward(n, P_arr);
  for (int pass = 0; pass < passes; ++pass) {
    smooth(n);
    double changed = 0.0;
    for (int j = 0; j < n; ++j) {
      Epoch& e = of_last(n, j);
      const Weights weight = huber_weights(e.z.R, left_of(e.z, e.smoothed), huber);
      for (int g = 0; g < GROUPS; ++g) changed = std::max(changed, std::fabs(weight(g) - e.scale(g)));
      e.scale = weight;
    }
    if (changed < SETTLED) break;
    forward(n, P_arr);
  }
}

}  // namespace gyrofree::navigation
