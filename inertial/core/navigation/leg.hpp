// From fix to fix: the nominal state, and Phi and Q of the error since the last measurement.
// E-105 to E-109, E-111, E-114, E-117.
#pragma once

#include <limits>
#include <span>

#include "navigation/state.hpp"

namespace gyrofree::navigation {

constexpr double TICK_S = 0.1;       // after which the sums are folded into those of the interval
constexpr double INTERVAL_S = 0.5;   // after which Phi and Q are brought up to date
constexpr double SLACK_S = 1e-6;     // of times that are sums
constexpr double FOREVER = std::numeric_limits<double>::infinity();

using Samples = std::span<const Sample>;

// Runs samples start..stop-1 to the end of the open tick, or to time `until` (E-105). The sample that
// reaches over `until` acts in part. Returns the first sample not used up. The state is the same to
// the bit however the samples are cut into calls.
std::size_t mechanise(Leg& leg, Samples samples, std::size_t start, std::size_t stop, double until);

// Takes the open tick into the integrals of the interval and into the ring.
void fold(Leg& leg);

// Phi over the open interval (E-108).
Transition transition(const Leg& leg, const Model& model);

// Closes the open interval: Phi and Q reach the time of x (E-108).
void close(Leg& leg, const Model& model);

// Mechanises and closes intervals as far as `until`, sample `stop`, or until `every` s have passed
// since a constraint was looked at. Returns the first sample not used up.
std::size_t run_leg(Leg& leg, const Model& model, Samples samples, std::size_t start, std::size_t stop,
                    double until, double every);

// Phi P Phi^T, symmetric.
Covariance carried(const Transition& Phi, const Covariance& P);
// factor Phi P Phi^T + Q (E-111).
Covariance predicted(const Covariance& P, const Transition& Phi, const Covariance& Q, double factor = 1.0);
// Phi m, and Phi^T m.
StateVector moved(const Transition& Phi, const StateVector& m);
StateVector moved_back(const Transition& Phi, const StateVector& m);
// later := first `later`'s predecessor, then `later`: the product later Phi.
Transition after(const Transition& later, const Transition& Phi);
// P at the time of the leg's state, which stays as it is.
Covariance covariance_now(Leg leg, const Model& model);

// Takes the estimated error out of the nominal state: closed loop (E-114).
void reset(Nominal& x, const StateVector& error, const Model& model);
// Applies an estimate and starts a new leg; the ring's velocities are corrected with it.
void correct(Leg& leg, const Model& model, const StateVector& error);

}  // namespace gyrofree::navigation
