// The predictive estimator: the last N fixes solved anew from a state N fixes ago (E-122 to E-127).
//
// Muske and Rawlings' linear moving horizon, in the form "restart a Kalman filter N fixes ago with
// covariance P_arr". With the Kalman filter's own covariance there it is the Kalman filter; with a
// fixed one its gain never sinks, so that it forgets a wrong model of the biases, and pays with noise.
#pragma once

#include <vector>

#include "navigation/update.hpp"

namespace gyrofree::navigation {

enum class Arrival : int { START = 0, MEAN = 1, KALMAN = 2 };

constexpr int CAPACITY = 11;  // fixes kept; N is at most 10

// A fix of the horizon, and what a pass makes of it.
struct Epoch {
  Transition Phi;          // from the fix before
  Covariance Q;
  Measurement z;
  StateVector applied;     // the correction applied after it
  Covariance start;        // covariance after the fix before it
  StateVector before, after;      // state of a pass, before and after it
  Covariance P_before, P_after;   // likewise
  StateVector smoothed;
  Weights scale = Weights::Ones();  // divides R of each group

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("Phi", s.Phi), v("Q", s.Q), v("z", s.z), v("applied", s.applied), v("start", s.start);
    v("before", s.before), v("after", s.after), v("P_before", s.P_before), v("P_after", s.P_after);
    v("smoothed", s.smoothed), v("scale", s.scale);
  }
};

struct Window {
  std::vector<Epoch> epochs;  // a ring
  int head = 0;               // the oldest
  int count = 0;
  int seen = 0;               // fixes since the start; negative: `sum` is a given mean
  Covariance P0;              // at the start of navigation
  Covariance kalman;          // of a Kalman filter beside it, after the last fix
  Covariance sum;             // of `kalman` over all fixes

  explicit Window(int n = CORE, int capacity = 0)
      : epochs(static_cast<std::size_t>(capacity)),
        P0(Covariance::Identity(n, n)),
        kalman(Covariance::Identity(n, n)),
        sum(Covariance::Zero(n, n)) {}

  // The j-th of the last n fixes, the oldest being 0.
  Epoch& of_last(int n, int j) { return epochs[static_cast<std::size_t>((head + count - n + j) % capacity())]; }
  const Epoch& of_last(int n, int j) const {
    return epochs[static_cast<std::size_t>((head + count - n + j) % capacity())];
  }
  Epoch& newest() { return of_last(1, 0); }
  int capacity() const { return static_cast<int>(epochs.size()); }

  // Appends a fix; the oldest goes when the ring is full.
  void push(const Transition& Phi, const Covariance& Q, const Measurement& z, const Covariance& start);
  // Brings the Kalman covariance over the newest fix, and its sum.
  void kalman_beside();
  // Covariance at the start of the last N fixes (E-123); while fewer have come, P0.
  Covariance arrival(int N, Arrival mode, double kappa) const;
  // A Kalman pass over the last n fixes from mean 0 and P_arr (E-124); the newest epoch holds the end.
  void forward(int n, const Covariance& P_arr);
  // State at each of the last n fixes given all of them (E-126), after `forward`.
  void smooth(int n);
  // `forward` with Huber weights found from the smoothed residuals of the horizon (E-127).
  void robust(int n, const Covariance& P_arr, double huber, int passes);

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("epochs", s.epochs), v("head", s.head), v("count", s.count), v("seen", s.seen);
    v("P0", s.P0), v("kalman", s.kalman), v("sum", s.sum);
  }
};

}  // namespace gyrofree::navigation
