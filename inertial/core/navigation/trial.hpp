// Do this vehicle's wheels tell the truth? A filter with their constraint and one without run side by
// side; what they differ by is judged against what it may be (E-134 to E-136).
//
// Where the constraint holds, the filter that has it is the better of two that agree, and their
// difference has the covariance P_without - P_with (Hausman's test). Where it does not, the difference
// is a multiple of that: in an aircraft that crabs, in a body that rolls, with a unit mounted askew.
// The filter without it never hears of the wheels, so that nothing has to be repaired.
#pragma once

#include "navigation/leg.hpp"

namespace gyrofree::navigation {

// What a filter with wheels believes of them.
enum class Wheels : int { NONE = 0, ON_TRIAL = 1, BELIEVED = 2, CONTRADICTED = 3 };

struct TrialSettings {
  double memory = 10.0;       // s of motion over which the difference is averaged
  double contradicted = 3.0;  // mean squared difference, in its own variances, that ends belief
  double agreed = 1.5;        // mean below which it counts as agreement
  double proof = 15.0;        // s of agreement in motion until the wheels are believed
  double again = 60.0;        // s of it after they were contradicted; doubled each time
  double most_again = 960.0;  // s
  double turn = 0.5236;       // rad, range of headings that the agreement must have gone through: straight
                              // on, wheels and a crab look alike
  double heading = 0.0524;    // rad, sigma above which the filter without wheels cannot tell
  double floor_psi = 0.0035;  // rad, difference that says nothing: no model is better
  double floor_v = 0.05;      // m/s, likewise
  double lost = 4.0;          // NIS per row above which the filter without wheels, if the other foresaw
                              // the fix better, is the one to blame: it drifts away without fixes
  double outage = 5.0;        // s without fixes, after which it must find its way again first
  double recovery = 20.0;     // s that it takes
  double least_speed = 2.0;   // m/s, below which the wheels were not used either
  double strain = 4.0;        // mean NIS per row of the constraint itself that ends belief

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("memory", s.memory), v("contradicted", s.contradicted), v("agreed", s.agreed);
    v("proof", s.proof), v("again", s.again), v("most_again", s.most_again);
    v("turn", s.turn), v("heading", s.heading), v("floor_psi", s.floor_psi), v("floor_v", s.floor_v), v("lost", s.lost);
    v("outage", s.outage), v("recovery", s.recovery), v("least_speed", s.least_speed);
    v("strain", s.strain);
  }
};

// The other one of the two filters, and the verdict so far.
struct Trial {
  bool running = false;
  Leg other;              // with wheels while they are not believed, without while they are
  int refused = 0;        // of the other filter: fixes in a row
  int doubted = 0;
  double difference = 0.0;  // its mean square (E-135)
  double agreement = 0.0;   // s
  double wanted = 0.0;      // s of it
  Vector3 forward = Vector3::Zero();  // of the body in n, level, at its beginning
  double turned = 0.0;      // rad, farthest from there
  double last = 0.0;        // s, time of the fix looked at last
  double settled = 0.0;     // s, until when the filter without wheels finds its way again
  double begun = 0.0;       // s, when the filter with wheels began from the one without
  bool doubted_before = false;  // the wheels were contradicted once

  explicit Trial(int n = CORE) : other(n) {}

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("running", s.running), v("other", s.other), v("refused", s.refused), v("doubted", s.doubted);
    v("difference", s.difference), v("agreement", s.agreement), v("wanted", s.wanted), v("forward", s.forward), v("turned", s.turned);
    v("last", s.last), v("settled", s.settled), v("begun", s.begun), v("doubted_before", s.doubted_before);
  }
};

// Starts the trial of a filter that begins: `leg` goes on without wheels.
void begin_trial(Trial& trial, Leg& leg, const TrialSettings& settings);

// A filter's state and covariance at a fix, and how well it foresaw it.
struct State {
  const Nominal& x;
  const Eigen::Matrix<double, MOVING, MOVING, Eigen::RowMajor>& P;
  double nis_per_row;
};

// The mean over attitude and velocity of the squared difference over its variance (E-134).
double difference_of(const State& with, const State& without, const TrialSettings& settings);

// Looks at both filters at a fix of time t that the one without wheels used; `shown` is what `leg`
// made of it. True: the wheels are believed from now on, or no more, and `leg` and the other have
// changed places.
bool judge_wheels(Trial& trial, Leg& leg, const TrialSettings& settings, double t, const State& shown,
                  const State& other);

// For people and results.
Wheels wheels_of(const Trial& trial, const Leg& leg);

}  // namespace gyrofree::navigation
